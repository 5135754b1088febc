//! One coordinate of a camera's readings: how likely they are with steps at given readings, amid an error that lasts.
//!
//! ```text
//!   v_i = m_i + b_i + d_i + e_i    m the mean, which steps; b a correlated error exp(−Δ/τ); d the stated diurnal variation; e white
//! ```
//! Derivation: docs/math/fleet.md eqs. (9)–(12).

/// A correlated error, exp(−Δ/τ).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correlated {
    /// Standard deviation.
    pub sigma: f64,
    /// The time in which it is forgotten, seconds.
    pub time_s: f64,
}

/// A step of the mean before a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jump {
    /// The first reading after it.
    pub at: usize,
    /// Its variance, of which the mean is zero.
    pub variance: f64,
}

/// A slow motion, of size one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ramp {
    /// When it begins and ends, seconds.
    pub from_s: f64,
    pub to_s: f64,
    /// A reading is a mean over so long.
    pub period_s: f64,
}

impl Ramp {
    /// How much of it is done in the mean of a reading: zero before it, one after it.
    pub fn at(&self, t_s: f64) -> f64 {
        let length_s = (self.to_s - self.from_s).max(f64::MIN_POSITIVE);
        let until = |t_s: f64| match t_s - self.from_s {
            elapsed_s if elapsed_s < length_s => elapsed_s.max(0.0).powi(2) / (2.0 * length_s),
            elapsed_s => elapsed_s - 0.5 * length_s,
        };
        (until(t_s + 0.5 * self.period_s) - until(t_s - 0.5 * self.period_s)) / self.period_s
    }

    /// By how much that changes with its begin and its end.
    pub fn slopes(&self, t_s: f64) -> [f64; 2] {
        let length_s = (self.to_s - self.from_s).max(f64::MIN_POSITIVE);
        let within = |t_s: f64| t_s.clamp(self.from_s, self.to_s);
        let (p, q) = (within(t_s - 0.5 * self.period_s), within(t_s + 0.5 * self.period_s));
        let about =
            |end: f64| ((q - end).powi(2) - (p - end).powi(2)) / (2.0 * length_s.powi(2) * self.period_s);
        [about(self.to_s), -about(self.from_s)]
    }
}

/// Values along one direction, in order of time.
#[derive(Debug, Clone)]
pub(super) struct Series<'a> {
    /// When, seconds.
    pub t_s: &'a [f64],
    pub values: Vec<f64>,
    /// Variances of the readings' own noise.
    pub variances: Vec<f64>,
    /// Of what is stated beforehand.
    pub stated: Correlated,
    pub diurnal_sigma: f64,
}

/// Errors that steps are looked for amid, besides none and the stated one: standard deviation in units of a reading's, time in units of the
/// span.
const AMID: [(f64, f64); 3] = [(1.0, 0.125), (2.0, 0.5), (6.0, 1.0)];
/// First and last step of the search for the likeliest error, in ln σ and ln τ.
const FIRST_STEP: f64 = 0.8;
const LAST_STEP: f64 = 0.1;
/// Evaluations of that search, at most.
const EVALUATIONS: usize = 120;
pub(super) const DAY_S: f64 = 86_400.0;

impl Series<'_> {
    pub fn span_s(&self) -> f64 {
        self.t_s[self.t_s.len() - 1] - self.t_s[0]
    }

    /// Of a typical reading.
    pub fn typical_variance(&self) -> f64 {
        self.variances.iter().sum::<f64>() / self.variances.len() as f64
    }

    /// Mean square about the mean.
    fn scatter(&self) -> f64 {
        let n = self.values.len() as f64;
        let mean = self.values.iter().sum::<f64>() / n;
        self.values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n
    }

    /// The errors that steps are looked for amid, chosen before any reading is seen.
    pub fn errors(&self) -> Vec<Correlated> {
        let (sigma, span_s) = (self.typical_variance().sqrt(), self.span_s());
        let mut errors = vec![Correlated { sigma: 0.0, time_s: span_s }];
        errors.extend(AMID.map(|(size, time)| Correlated { sigma: size * sigma, time_s: time * span_s }));
        errors.extend((0.0 < self.stated.sigma).then_some(self.stated));
        errors
    }

    /// ln p(v) of all but the first reading, which says where the mean is; by a Kalman filter of mean, error and diurnal variation.
    pub fn log_likelihood(&self, error: &Correlated, jumps: &[Jump]) -> f64 {
        self.walk(error, jumps, None).0
    }

    /// The same amid a ramp whose size has this variance.
    pub fn log_likelihood_of_ramp(
        &self,
        error: &Correlated,
        jumps: &[Jump],
        ramp: &Ramp,
        variance: f64,
    ) -> f64 {
        let (log_p, score, information) = self.walk(error, jumps, Some(ramp));
        let shrinkage = 1.0 / (1.0 + variance * information);
        log_p + 0.5 * (variance * score.powi(2) * shrinkage + shrinkage.ln())
    }

    /// ln p(v), and the score and information of a ramp of size one.
    fn walk(&self, error: &Correlated, jumps: &[Jump], ramp: Option<&Ramp>) -> (f64, f64, f64) {
        let mut filter = Filter::new(self, error);
        let (mut sum, mut score, mut information) = (0.0, 0.0, 0.0);
        let mut jumps = jumps.iter().peekable();
        for i in 0..self.values.len() {
            if 0 < i {
                filter.predict(self.t_s[i] - self.t_s[i - 1]);
            }
            while let Some(jump) = jumps.next_if(|jump| jump.at == i) {
                filter.p[0][0] += jump.variance;
            }
            let x = ramp.map_or(0.0, |ramp| ramp.at(self.t_s[i]));
            let (nu, nu_x, variance) = filter.update(self.values[i], x, self.variances[i]);
            if 0 < i {
                sum -= 0.5 * (nu * nu / variance + variance.ln());
                score += nu * nu_x / variance;
                information += nu_x * nu_x / variance;
            }
        }
        (sum, score, information)
    }

    /// The error that explains the readings best given the steps, sought from a grid on, and ln p(v) with it. `is_enough` ends the search
    /// once the likelihood reaches it.
    pub fn likeliest(&self, jumps: &[Jump], is_enough: f64) -> (f64, Correlated) {
        let floor = 1e-3 * self.typical_variance().sqrt();
        let scatter = self.scatter().sqrt().max(floor);
        let ceiling = floor + 1e3 * scatter;
        let (shortest_s, longest_s) = (1e-3 * self.span_s(), 100.0 * self.span_s());
        let mut best = (f64::NEG_INFINITY, Correlated { sigma: 0.0, time_s: self.span_s() });
        let offer = |best: &mut (f64, Correlated), error: Correlated| {
            let log_p = self.log_likelihood(&error, jumps);
            if best.0 < log_p {
                *best = (log_p, error);
            }
        };
        self.errors().into_iter().for_each(|error| offer(&mut best, error));
        let at = |sigma: f64, time_s: f64| Correlated {
            sigma: sigma.clamp(floor, ceiling),
            time_s: time_s.clamp(shortest_s, longest_s),
        };
        for size in [1.5, 0.5, 0.15] {
            for time in [0.004, 0.1, 1.0, 8.0] {
                offer(&mut best, at(size * scatter, time * self.span_s()));
            }
        }
        let (mut step, mut evaluations) = (FIRST_STEP, 0);
        while LAST_STEP < step && evaluations < EVALUATIONS && best.0 < is_enough {
            let (before, error) = best;
            // The last two go along the ridge on which σ²/τ, what a random walk gains, stays.
            for (s, t) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 2.0), (-1.0, -2.0)] {
                let sigma = error.sigma.max(floor) * f64::exp(s * step);
                offer(&mut best, at(sigma, error.time_s * f64::exp(t * step)));
                evaluations += 1;
            }
            if best.0 == before {
                step *= 0.5;
            }
        }
        best
    }
}

/// Mean, correlated error, and the two phases of the diurnal variation.
struct Filter {
    /// How many of the four there are.
    n: usize,
    x: [f64; 4],
    /// The same filter over a ramp of size one.
    ramp: [f64; 4],
    p: [[f64; 4]; 4],
    error: Correlated,
}

impl Filter {
    fn new(series: &Series, error: &Correlated) -> Self {
        let mut p = [[0.0; 4]; 4];
        // Of the mean nothing is known: its first reading says all.
        p[0][0] = 1e6 * (series.scatter() + series.typical_variance());
        p[1][1] = error.sigma.powi(2);
        (p[2][2], p[3][3]) = (series.diurnal_sigma.powi(2), series.diurnal_sigma.powi(2));
        let n = if series.diurnal_sigma == 0.0 { 2 } else { 4 };
        Filter { n, x: [0.0; 4], ramp: [0.0; 4], p, error: *error }
    }

    fn predict(&mut self, elapsed_s: f64) {
        let kept = (-elapsed_s / self.error.time_s).exp();
        self.x[1] *= kept;
        self.ramp[1] *= kept;
        for i in 0..self.n {
            self.p[1][i] *= kept;
            self.p[i][1] *= kept;
        }
        self.p[1][1] += self.error.sigma.powi(2) * (1.0 - kept * kept);
        if self.n == 4 {
            self.rotate(std::f64::consts::TAU * elapsed_s / DAY_S);
        }
    }

    fn rotate(&mut self, angle: f64) {
        let (sin, cos) = angle.sin_cos();
        let turn = |a: f64, b: f64| (cos * a - sin * b, sin * a + cos * b);
        (self.x[2], self.x[3]) = turn(self.x[2], self.x[3]);
        (self.ramp[2], self.ramp[3]) = turn(self.ramp[2], self.ramp[3]);
        for row in &mut self.p {
            (row[2], row[3]) = turn(row[2], row[3]);
        }
        let (low, high) = self.p.split_at_mut(3);
        for (a, b) in low[2].iter_mut().zip(&mut high[0]) {
            (*a, *b) = turn(*a, *b);
        }
    }

    /// The innovations of the value and of the ramp, and their variance.
    fn update(&mut self, value: f64, ramp: f64, noise: f64) -> (f64, f64, f64) {
        let n = self.n;
        // All but the second phase are seen.
        let seen = n.min(3);
        let mut ph = [0.0; 4];
        for (i, sum) in ph.iter_mut().enumerate().take(n) {
            *sum = self.p[i][..seen].iter().sum();
        }
        let variance = ph[..seen].iter().sum::<f64>() + noise;
        let nu = value - self.x[..seen].iter().sum::<f64>();
        let nu_ramp = ramp - self.ramp[..seen].iter().sum::<f64>();
        for i in 0..n {
            self.x[i] += ph[i] * nu / variance;
            self.ramp[i] += ph[i] * nu_ramp / variance;
            for j in 0..n {
                self.p[i][j] -= ph[i] * ph[j] / variance;
            }
        }
        (nu, nu_ramp, variance)
    }
}
