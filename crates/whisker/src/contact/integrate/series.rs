//! The Taylor series of the elastica about one point: docs/math/whisker_integrate.md eqs. (4)–(7).

use super::piece::Piece;

/// Order of the series. The cost of a step grows as its square, the number of steps falls slowly: measured, 16, 20 and 26 cost the
/// same within a tenth.
pub(super) const ORDER: usize = 20;

/// Coefficients by power.
pub(super) type Coefficients = [f64; ORDER + 1];

/// 1/n.
pub(super) const RECIPROCAL: [f64; ORDER + 2] = reciprocals();

/// Largest last term of a step, radians and units of length. What follows the last term is below a half of it, so a whisker of five
/// steps is good to some 1e-12.
const TOLERANCE: f64 = 1e-12;

const fn reciprocals() -> [f64; ORDER + 2] {
    let mut table = [1.0; ORDER + 2];
    let mut n = 1;
    while n < ORDER + 2 {
        table[n] = 1.0 / n as f64;
        n += 1;
    }
    table
}

/// The whisker at s.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    pub s: f64,
    pub alpha: f64,
    pub moment: f64,
    pub p: f64,
}

/// α, M, p about a state, with the cosine and sine of α.
pub(super) struct Series {
    alpha: Coefficients,
    moment: Coefficients,
    p: Coefficients,
    pub cos: Coefficients,
    pub sin: Coefficients,
}

impl Series {
    #[inline]
    pub fn of(state: &State, piece: &Piece, force: f64) -> Self {
        let zero = [0.0; ORDER + 1];
        let mut series = Series { alpha: zero, moment: zero, p: zero, cos: zero, sin: zero };
        (series.sin[0], series.cos[0]) = state.alpha.sin_cos();
        (series.alpha[0], series.moment[0], series.p[0]) = (state.alpha, state.moment, state.p);
        let mut bent = Bending::new(piece);
        let mut bend = zero;
        for n in 0..ORDER {
            let share = RECIPROCAL[n + 1];
            bend[n] = bent.next(series.moment[n]);
            if n == 0 {
                bend[0] += piece.curvature;
            } else if n == 1 {
                bend[1] += piece.curvature_slope;
            }
            let [by_cos, by_sin] = product(&bend, &series.cos, &series.sin, n);
            series.alpha[n + 1] = bend[n] * share;
            series.moment[n + 1] = force * series.sin[n] * share;
            series.p[n + 1] = series.cos[n] * share;
            series.sin[n + 1] = by_cos * share;
            series.cos[n + 1] = -by_sin * share;
        }
        series
    }

    /// The range in which the series holds.
    #[inline]
    pub fn reach(&self) -> f64 {
        let last = |n: usize| self.alpha[n].abs().max(self.p[n].abs()).max(self.moment[n].abs());
        let step = |n: usize| (TOLERANCE / last(n)).powf(RECIPROCAL[n]);
        step(ORDER).min(step(ORDER - 1))
    }

    /// The state at `start.s + t`.
    #[inline]
    pub fn at(&self, start: &State, t: f64) -> State {
        let (mut alpha, mut moment, mut p) = (0.0, 0.0, 0.0);
        for n in (0..=ORDER).rev() {
            alpha = alpha * t + self.alpha[n];
            moment = moment * t + self.moment[n];
            p = p * t + self.p[n];
        }
        State { s: start.s + t, alpha, moment, p }
    }

    /// The first t in (0, step] at which the moment vanishes. A step is too short for the moment's slope, F sin α, to change
    /// its sign twice: where it does once and away from zero at first, the extremum is looked at too.
    pub fn first_zero(&self, step: f64, force: f64) -> Option<f64> {
        let (start, slope_at_start) = (self.moment[0], force * self.sin[0]);
        let (end, slope_at_end) = self.moment_at(step);
        if start * end < 0.0 || (end == 0.0 && start != 0.0) {
            return Some(self.zero_between([0.0, step], [start, end], [slope_at_start, slope_at_end]));
        }
        let (falls, rises) = (slope_at_start * end < 0.0, 0.0 < slope_at_end * end);
        if !(falls && rises) {
            return None;
        }
        let lowest = self.extremum(step);
        let (value, slope) = self.moment_at(lowest);
        if 0.0 <= value * end {
            return None;
        }
        // From a zero at the start the first one is behind, and the next lies after the extremum.
        let (ends, values, slopes) = if start == 0.0 {
            ([lowest, step], [value, end], [slope, slope_at_end])
        } else {
            ([0.0, lowest], [start, value], [slope_at_start, slope])
        };
        Some(self.zero_between(ends, values, slopes))
    }

    /// M and M′ at t.
    #[inline]
    fn moment_at(&self, t: f64) -> (f64, f64) {
        let (mut value, mut slope) = (self.moment[ORDER], 0.0);
        for n in (0..ORDER).rev() {
            slope = slope * t + value;
            value = value * t + self.moment[n];
        }
        (value, slope)
    }

    /// Newton from the inverse cubic through both ends, with bisection as the way back.
    fn zero_between(&self, ends: [f64; 2], values: [f64; 2], slopes: [f64; 2]) -> f64 {
        let ([mut low, mut high], sign) = (ends, values[0].signum());
        let mut t = inverse_cubic(ends, values, slopes);
        for _ in 0..100 {
            if !(low <= t && t <= high) {
                t = 0.5 * (low + high);
            }
            let (value, slope) = self.moment_at(t);
            if 0.0 < value * sign {
                low = t
            } else {
                high = t
            }
            let newton = value / slope;
            t -= newton;
            // Newton converges quadratically: after a step of 1e-9 the next is below rounding.
            if newton.abs() <= 1e-9 * high || high - low <= f64::EPSILON * high {
                break;
            }
        }
        t.clamp(ends[0], ends[1])
    }

    /// Where M′ vanishes between 0 and `step`, by bisection: rare.
    fn extremum(&self, step: f64) -> f64 {
        let (mut low, mut high) = (0.0, step);
        let sign = self.sin[0];
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if 0.0 < self.moment_at(middle).1 * sign { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

/// The zero of the cubic t(M) through both ends with their slopes.
fn inverse_cubic(ends: [f64; 2], values: [f64; 2], slopes: [f64; 2]) -> f64 {
    let width = values[1] - values[0];
    let (u, rise) = (-values[0] / width, ends[1] - ends[0]);
    let [d0, d1] = slopes.map(|slope| width / slope);
    let v = 1.0 - u;
    ends[0] + u * u * (3.0 - 2.0 * u) * rise + u * v * (v * d0 - u * d1)
}

/// The quotient M/EI of a cone: four divisions by 1 − ρt, one after the other, each a recurrence of first order.
pub(super) struct Bending {
    compliance: f64,
    narrowing: f64,
    quotients: [f64; 4],
}

impl Bending {
    pub fn new(piece: &Piece) -> Self {
        Bending { compliance: piece.compliance, narrowing: piece.narrowing, quotients: [0.0; 4] }
    }

    /// The next coefficient of M/EI, for the next one of M.
    #[inline]
    pub fn next(&mut self, moment: f64) -> f64 {
        let mut carried = moment;
        for quotient in &mut self.quotients {
            carried += self.narrowing * *quotient;
            *quotient = carried;
        }
        self.compliance * carried
    }
}

/// The coefficients n of `left × a` and `left × b`.
#[inline]
pub(super) fn product(left: &Coefficients, a: &Coefficients, b: &Coefficients, n: usize) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (left, (a, b)) in left[..=n].iter().rev().zip(a[..=n].iter().zip(&b[..=n])) {
        sums[0] += left * a;
        sums[1] += left * b;
    }
    sums
}
