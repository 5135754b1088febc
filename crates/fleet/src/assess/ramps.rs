//! Slow motions: the mean pose changes at a constant rate from one time to another, beside any steps. Its size is rate times duration:
//! docs/math/fleet.md eq. (19).

use super::amid::{Amid, LeastSquares};
use super::evidence::{Course, Record};
use super::motion::Motion;
use super::partition::candidates;
use super::series::{Ramp, Series};
use nalgebra::{DMatrix, DVector};
use resight::core::temporal::monitor::Reading;
use resight::core::{Matrix6, Pose, Vector6};

/// Readings amid a ramp, at least: a period amid which a step falls makes one between two poses, and at the end of a record one more is the new
/// pose.
const SHORTEST: usize = 3;
/// Ends of ramps that are tried at first; those near the best then.
const KNOTS: usize = 32;
/// Steps beside a ramp, at most.
const MOST_BESIDE: usize = 8;
/// Readings that a ramp is fitted to, at most: of more, every second, third ….
const MOST_READINGS: usize = 240;
/// Steps of Gauss and Newton.
const ITERATIONS: usize = 25;
/// A ramp begins or ends with the record where that makes χ² larger by no more than this.
const AT_END: f64 = 12.0;
/// Parts of a period to which the ends of a ramp are looked for.
const FINEST: f64 = 64.0;

/// The likeliest course with a ramp: beside none of the steps, beside each set of them, or beside those that are left without the ramp.
pub(super) fn best(record: &Record, sets: &[Vec<usize>], period_s: f64) -> Option<(Course, f64)> {
    let mut courses: Vec<Course> = Vec::new();
    let beside = |steps: Vec<usize>, courses: &mut Vec<Course>| {
        let ramp = likeliest(record, &steps, period_s)?;
        let course = Course { steps, ramp: Some(ramp) };
        if !courses.contains(&course) {
            courses.push(course);
        }
        Some(ramp)
    };
    for steps in [Vec::new()].into_iter().chain(sets.iter().filter(|set| set.len() <= MOST_BESIDE).cloned()) {
        if let Some(ramp) = beside(steps.clone(), &mut courses) {
            let left = candidates(&without(record, &steps, &ramp), record.weights());
            if let Some(left) = left.into_iter().find(|set| set.len() <= MOST_BESIDE) {
                beside(left, &mut courses);
            }
        }
    }
    let scored = courses.into_iter().map(|course| {
        let score = record.log_posterior(&course);
        (course, score)
    });
    scored.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whitened readings and weights, centred within each stretch between steps.
struct Centred {
    values: Vec<Vector6>,
    weights: Vec<f64>,
    /// The stretch of each reading.
    stretch: Vec<usize>,
    stretches: usize,
}

impl Centred {
    fn of(record: &Record, steps: &[usize]) -> Self {
        let weights = record.weights().to_vec();
        let stretch: Vec<usize> =
            (0..record.len()).map(|i| steps.iter().filter(|step| **step <= i).count()).collect();
        let stretches = steps.len() + 1;
        let mut sums = vec![(Vector6::zeros(), 0.0); stretches];
        for (i, y) in record.whitened().iter().enumerate() {
            let (sum, weight) = &mut sums[stretch[i]];
            *sum += y * weights[i];
            *weight += weights[i];
        }
        let values =
            record.whitened().iter().zip(&stretch).map(|(y, k)| y - sums[*k].0 / sums[*k].1).collect();
        Centred { values, weights, stretch, stretches }
    }

    /// The size of a ramp and by how much it reduces the weighted squares.
    fn fit(&self, ramp: &[f64]) -> (Vector6, f64) {
        let mut sums = vec![(0.0, 0.0, 0.0); self.stretches];
        let mut product = Vector6::zeros();
        for (i, x) in ramp.iter().enumerate() {
            let w = self.weights[i];
            let (weight, sum, square) = &mut sums[self.stretch[i]];
            (*weight, *sum, *square) = (*weight + w, *sum + w * x, *square + w * x * x);
            product += self.values[i] * (w * x);
        }
        let norm: f64 =
            sums.iter().map(|(weight, sum, square)| square - sum * sum / weight.max(1e-300)).sum();
        // A ramp within which nothing is left to explain says nothing.
        if norm < 1e-6 {
            return (Vector6::zeros(), 0.0);
        }
        (product / norm, product.norm_squared() / norm)
    }
}

fn between(record: &Record, from: usize, to: usize, period_s: f64) -> Ramp {
    let (t_s, last) = (record.t_s(), record.len() - 1);
    Ramp {
        from_s: if from == 0 { record.span_s.0 } else { t_s[from] },
        to_s: if to == last { record.span_s.1 } else { t_s[to] },
        period_s,
    }
}

/// The ramp that explains most beside steps, amid white noise.
pub(super) fn likeliest(record: &Record, steps: &[usize], period_s: f64) -> Option<Ramp> {
    let n = record.len();
    let centred = Centred::of(record, steps);
    let gain = |from: usize, to: usize| {
        let ramp = between(record, from, to, period_s);
        let x: Vec<f64> = record.t_s().iter().map(|t_s| ramp.at(*t_s)).collect();
        centred.fit(&x).1
    };
    let mut stride = n.div_ceil(KNOTS);
    let knots: Vec<usize> = (0..n).step_by(stride).chain([n - 1]).collect();
    let mut best = (0.0, 0, 0);
    let offer = |best: &mut (f64, usize, usize), from: usize, to: usize| {
        if to < n && from + SHORTEST < to {
            let gain = gain(from, to);
            if best.0 < gain {
                *best = (gain, from, to);
            }
        }
    };
    for from in &knots {
        for to in &knots {
            offer(&mut best, *from, *to);
        }
    }
    while 0 < stride {
        let (before, from, to) = best;
        for a in [from.saturating_sub(stride), from, from + stride] {
            for b in [to.saturating_sub(stride), to, to + stride] {
                offer(&mut best, a, b);
            }
        }
        if best.0 == before {
            stride /= 2;
        }
    }
    (0.0 < best.0).then(|| finer(record, &centred, between(record, best.1, best.2, period_s), period_s))
}

/// The best ramp near one whose ends are readings.
fn finer(record: &Record, centred: &Centred, ramp: Ramp, period_s: f64) -> Ramp {
    let whole = between(record, 0, record.len() - 1, period_s);
    let gain = |ramp: &Ramp| {
        let x: Vec<f64> = record.t_s().iter().map(|t_s| ramp.at(*t_s)).collect();
        centred.fit(&x).1
    };
    let (mut best, mut step_s) = ((gain(&ramp), ramp), 0.5 * period_s);
    while period_s / FINEST < step_s {
        let (before, ramp) = best;
        for (a, b) in [
            (1.0, 0.0),
            (-1.0, 0.0),
            (0.0, 1.0),
            (0.0, -1.0),
            (1.0, 1.0),
            (-1.0, -1.0),
            (1.0, -1.0),
            (-1.0, 1.0),
        ] {
            let moved = Ramp {
                from_s: (ramp.from_s + a * step_s).max(whole.from_s),
                to_s: (ramp.to_s + b * step_s).min(whole.to_s),
                period_s,
            };
            let gain = if is_long(record, &moved) { gain(&moved) } else { 0.0 };
            if best.0 < gain {
                best = (gain, moved);
            }
        }
        if best.0 == before {
            step_s *= 0.5;
        }
    }
    best.1
}

fn is_long(record: &Record, ramp: &Ramp) -> bool {
    let is_between = |t_s: &&f64| (0.1..0.9).contains(&ramp.at(**t_s));
    SHORTEST <= record.t_s().iter().filter(is_between).count()
}

/// Whitened readings without a ramp beside steps.
fn without(record: &Record, steps: &[usize], ramp: &Ramp) -> Vec<Vector6> {
    let x: Vec<f64> = record.t_s().iter().map(|t_s| ramp.at(*t_s)).collect();
    let (size, _) = Centred::of(record, steps).fit(&x);
    record.whitened().iter().zip(&x).map(|(y, x)| y - size * *x).collect()
}

/// A slow motion in numbers.
pub(super) struct Slow {
    pub ramp: Ramp,
    /// Rate times duration, and its covariance.
    pub motion: Vector6,
    pub covariance: Matrix6,
    /// Of its first and its last time, seconds; none of an end at the end of the record: it may continue.
    from_sigma_s: f64,
    to_sigma_s: Option<f64>,
    /// Variances of its size in whitened coordinates.
    variances: [f64; 6],
}

impl Slow {
    pub fn event(&self) -> Motion {
        let from = (self.ramp.from_s, self.from_sigma_s);
        let until = self.to_sigma_s.map(|sigma_s| [self.ramp.to_s, sigma_s]);
        Motion { until_s: until, ..Motion::new("ramp", from, self.motion, self.covariance) }
    }

    /// Readings without it, at these times.
    pub fn removed(&self, readings: &[Reading], t_s: &[f64]) -> Vec<Reading> {
        let back = |r: &Reading, t_s: f64| Pose::exp(&(self.motion * self.ramp.at(t_s))) * r.a_from_b;
        readings.iter().zip(t_s).map(|(r, t_s)| Reading { a_from_b: back(r, *t_s), ..*r }).collect()
    }

    /// The ramp, and the variances of its size, for the errors of what is left.
    pub fn uncertain(&self) -> (Ramp, [f64; 6]) {
        (self.ramp, self.variances)
    }
}

/// Whether the ends of a ramp are those of the record, or free.
type IsFree = [bool; 2];

/// The ramp near `start` with the least squares, beside steps, amid the correlated errors that are left; its ends are fitted, too.
pub(super) fn fit(record: &Record, steps: &[usize], start: &Ramp, period_s: f64) -> Option<Slow> {
    let (whole, n) = (between(record, 0, record.len() - 1, period_s), record.len());
    let x: Vec<f64> = record.t_s().iter().map(|t_s| start.at(*t_s)).collect();
    let (size, _) = Centred::of(record, steps).fit(&x);
    let left: Vec<Series> = (0..6)
        .map(|axis| {
            let series = &record.series[axis];
            let values = series.values.iter().zip(&x).map(|(v, x)| v - size[axis] * x).collect();
            Series { values, ..series.clone() }
        })
        .collect();
    let amid = Amid::of(&left, steps, None);
    let used: Vec<usize> = (0..n).step_by(n.div_ceil(MOST_READINGS)).collect();
    let values = DMatrix::from_fn(used.len(), 6, |i, axis| record.whitened()[used[i]][axis]);
    let data = Data { record, steps, used, values, period_s, whole };
    let mut is_free = [whole.from_s < start.from_s, start.to_s < whole.to_s];
    let mut fitted = data.fit(&amid, *start, is_free)?;
    // Ends that may be those of the record are.
    for end in 0..2 {
        let off_s = [fitted.ramp.from_s - whole.from_s, whole.to_s - fitted.ramp.to_s][end];
        if is_free[end] && 0.0 <= off_s {
            let mut fixed = is_free;
            fixed[end] = false;
            let snapped = match end {
                0 => Ramp { from_s: whole.from_s, ..fitted.ramp },
                _ => Ramp { to_s: whole.to_s, ..fitted.ramp },
            };
            let snapped = data.fit(&amid, snapped, fixed);
            if let Some(snapped) = snapped.filter(|snapped| snapped.chi2 < fitted.chi2 + AT_END) {
                (fitted, is_free) = (snapped, fixed);
            }
        }
    }
    let root = record.motion_from_whitened;
    let variances = std::array::from_fn(|axis| fitted.covariance[(axis, axis)]);
    Some(Slow {
        ramp: fitted.ramp,
        motion: root * fitted.size,
        covariance: root * fitted.covariance * root.transpose(),
        // When the first reading says that it moves already, it began before.
        from_sigma_s: fitted.sigma_s[0].max(0.1 * period_s),
        to_sigma_s: is_free[1].then_some(fitted.sigma_s[1].max(0.1 * period_s)),
        variances,
    })
}

struct Data<'r, 'a> {
    record: &'r Record<'a>,
    steps: &'r [usize],
    used: Vec<usize>,
    values: DMatrix<f64>,
    period_s: f64,
    /// From the begin of the record to its end.
    whole: Ramp,
}

/// In whitened coordinates.
struct Fitted {
    ramp: Ramp,
    size: Vector6,
    covariance: Matrix6,
    sigma_s: [f64; 2],
    chi2: f64,
}

impl Data<'_, '_> {
    fn t_s(&self, i: usize) -> f64 {
        self.record.t_s()[self.used[i]]
    }

    /// The stretches between steps, then the ramp.
    fn columns(&self, ramp: &Ramp) -> DMatrix<f64> {
        let stretch: Vec<usize> =
            self.used.iter().map(|i| self.steps.iter().filter(|step| *step <= i).count()).collect();
        let mut kept: Vec<usize> = stretch.clone();
        kept.dedup();
        DMatrix::from_fn(self.used.len(), kept.len() + 1, |i, k| match kept.get(k) {
            Some(k) => f64::from(u8::from(stretch[i] == *k)),
            None => ramp.at(self.t_s(i)),
        })
    }

    /// By how much the ramp at each reading changes with its ends.
    fn slopes(&self, ramp: &Ramp, is_free: IsFree) -> DMatrix<f64> {
        let ends: Vec<usize> = (0..2).filter(|end| is_free[*end]).collect();
        DMatrix::from_fn(self.used.len(), ends.len(), |i, k| ramp.slopes(self.t_s(i))[ends[k]])
    }

    fn fit(&self, amid: &Amid, start: Ramp, is_free: IsFree) -> Option<Fitted> {
        let mut ramp = start;
        let mut squares = amid.fit(&self.used, &self.columns(&ramp))?;
        for _ in 0..ITERATIONS {
            let (information, score, _) = self.information(&squares, &ramp, is_free)?;
            let Some(step) = information.try_inverse().map(|inverse| inverse * score) else { break };
            let mut steps = step.iter().copied();
            let limit_s = 0.25 * (ramp.to_s - ramp.from_s);
            let mut moved = ramp;
            if is_free[0] {
                moved.from_s += steps.next().unwrap_or(0.0).clamp(-limit_s, limit_s);
            }
            if is_free[1] {
                moved.to_s += steps.next().unwrap_or(0.0).clamp(-limit_s, limit_s);
            }
            moved.from_s = moved.from_s.max(self.whole.from_s);
            moved.to_s = moved.to_s.min(self.whole.to_s);
            if !is_long(self.record, &moved) {
                break;
            }
            let change_s = (moved.from_s - ramp.from_s).abs() + (moved.to_s - ramp.to_s).abs();
            ramp = moved;
            squares = squares.with(&self.columns(&ramp))?;
            if change_s < 1e-3 * self.period_s {
                break;
            }
        }
        self.fitted(&squares, ramp, is_free)
    }

    fn values(&self, axis: usize) -> DMatrix<f64> {
        DMatrix::from_fn(self.used.len(), 1, |i, _| self.values[(i, axis)])
    }

    fn size(&self, squares: &LeastSquares, axis: usize) -> Option<f64> {
        squares.coefficients(axis, &self.values(axis)).map(|found| found[found.len() - 1])
    }

    /// The information of the ends beside the columns, what the residuals say of them, and χ².
    fn information(
        &self,
        squares: &LeastSquares,
        ramp: &Ramp,
        is_free: IsFree,
    ) -> Option<(DMatrix<f64>, DMatrix<f64>, f64)> {
        let all = self.slopes(ramp, is_free);
        let ends = all.ncols();
        let (mut information, mut score) = (DMatrix::zeros(ends, ends), DMatrix::zeros(ends, 1));
        let mut chi2 = 0.0;
        for axis in 0..6 {
            let size = self.size(squares, axis)?;
            let weighed = squares.weighed(axis, &squares.residuals(axis, &all)?)?.transpose() * size;
            information += &weighed * squares.residuals(axis, &all)? * size;
            let left = squares.residuals(axis, &self.values(axis))?;
            score += weighed * &left;
            chi2 += left.dot(&squares.weighed(axis, &left)?);
        }
        Some((information, score, chi2))
    }

    fn fitted(&self, squares: &LeastSquares, ramp: Ramp, is_free: IsFree) -> Option<Fitted> {
        let (information, _, chi2) = self.information(squares, &ramp, is_free)?;
        let ends = information.try_inverse()?;
        let slopes = self.slopes(&ramp, is_free);
        let n = self.columns(&ramp).ncols();
        let combination = DVector::from_fn(n, |k, _| f64::from(u8::from(k + 1 == n)));
        let (mut size, mut own) = (Vector6::zeros(), Vector6::zeros());
        // An end that is off changes the size in every coordinate along with it.
        let mut by_ends = DMatrix::zeros(6, ends.ncols());
        for axis in 0..6 {
            size[axis] = self.size(squares, axis)?;
            own[axis] = squares.variance(axis, &combination)?;
            let found = squares.coefficients(axis, &slopes)?;
            by_ends.set_row(axis, &(found.row(n - 1) * size[axis]));
        }
        let together = &by_ends * &ends * by_ends.transpose();
        let mut sigmas = ends.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect::<Vec<_>>().into_iter();
        let sigma_s = is_free.map(|is_free| {
            let fixed = self.period_s / 12_f64.sqrt();
            if is_free { sigmas.next().unwrap_or(fixed) } else { fixed }
        });
        let covariance = Matrix6::from_diagonal(&own) + Matrix6::from_fn(|i, j| together[(i, j)]);
        Some(Fitted { ramp, size, covariance, sigma_s, chi2 })
    }
}
