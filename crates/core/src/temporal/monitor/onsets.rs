//! Did it move, and when? The Shiryaev–Roberts statistic over every onset that is still plausible.
//!
//! ```text
//!   g   mean error that a unit change since the onset gives to the filter's prediction, one coordinate: a jump starts with e₁ and
//!       goes on as g ← F(I − K hᵀ)g; a drift starts with 0 and gains Δ e₁ a step besides
//!   c = Σ (h·g) ν/S,  d = Σ (h·g)²/S          all that the readings say of a change of this coordinate
//!   C = Σ u c,  D = Σ u² d                    the same of a change along u
//!   Λ = (1 + Γ D)^(−½) exp(½ Γ C²/(1 + Γ D))  likelihood ratio, the change's size having variance Γ
//!   R = Σ w Λ over onsets and changes; while nothing happens E R grows by one a step, so E T ≥ A when R = A is the alarm
//! ```
//! Λ, w and R are kept by their exponents: no change is so gross that they leave the range of numbers.
//! Derivation: docs/math/monitor.md eqs. (5)–(12).

use super::axis::{AXES, Innovation, Transition, read};
use super::measured::Measured;
use super::priors::{COURSES, GAP_SHARE, MotionKind, SIZES, WIDER};
use super::{LogSum, Scaled};
use crate::temporal::snapshot::{Numbers, Rest, numbers};
use arrayvec::ArrayVec;
use nalgebra::{Matrix6, Vector4, Vector6};
use std::sync::LazyLock;

/// Onsets kept; older ones lie further apart.
const ONSETS: usize = 24;
/// Estimates of a change expect it below this many of that size: any that can be seen.
const WIDE: f64 = 1000.0;
/// Changes along each of six directions, and of all coordinates at once.
const CHANGES: usize = AXES + 1;
/// Prior weights of the courses: any that add up to one keep the promise, docs/math/monitor.md eq. (9). A step is urgent; a slow drift
/// makes up for a factor of five within minutes of its hours.
const COURSE_WEIGHTS: [f64; COURSES.len()] = [0.9, 0.1];
/// And of the changes: mounts turn (three directions), shift less often (three), or do it all at once.
const CHANGE_WEIGHTS: [f64; CHANGES] = [0.2, 0.2, 0.2, 1.0 / 15.0, 1.0 / 15.0, 1.0 / 15.0, 0.2];
/// ln w of an onset that begins.
static LOG_WEIGHTS: LazyLock<[[f64; CHANGES]; COURSES.len()]> =
    LazyLock::new(|| COURSE_WEIGHTS.map(|course| CHANGE_WEIGHTS.map(|change| (course * change).ln())));

/// What the evidence of a step in one coordinate loses to what else might have been looked for: its prior weight, and a size that is not
/// known (half of ln (1 + Γd) with d of ten readings or so).
pub(super) fn log_cost() -> f64 {
    2.0 - (COURSE_WEIGHTS[0] * CHANGE_WEIGHTS[3]).ln()
}

/// What the readings since an onset say of a change of one coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Gathered {
    /// g.
    pub signature: Vector4<f64>,
    /// c.
    pub score: f64,
    /// d.
    pub information: f64,
}

impl Gathered {
    pub fn add(&mut self, innovation: &Innovation) {
        let seen = read(&self.signature);
        self.score += seen * innovation.value / innovation.variance;
        self.information += seen * seen / innovation.variance;
        self.signature -= innovation.gain * seen;
    }
}

/// A time at which it may have begun.
#[derive(Debug, Clone, PartialEq)]
struct Onset {
    t_s: f64,
    gathered: [[Gathered; AXES]; COURSES.len()],
    /// ln w.
    log_weights: [[f64; CHANGES]; COURSES.len()],
    /// Where noise is measured: how likely the readings before it were under each model of their noise.
    then: Vec<f64>,
}

impl Onset {
    fn new(t_s: f64, log_weight: f64, then: Vec<f64>) -> Self {
        let jump = Gathered { signature: Vector4::x(), ..Gathered::default() };
        let log_weights = LOG_WEIGHTS.map(|of_course| of_course.map(|log_w| log_w + log_weight));
        Onset { t_s, gathered: [[jump; AXES], [Gathered::default(); AXES]], log_weights, then }
    }

    fn predict(&mut self, transitions: &[Transition; AXES]) {
        for (course, gathered) in COURSES.into_iter().zip(&mut self.gathered) {
            for (gathered, transition) in gathered.iter_mut().zip(transitions) {
                gathered.signature = transition.apply(&gathered.signature);
                if course == MotionKind::Ramp {
                    gathered.signature[0] += transition.elapsed_s / super::axis::DAY_S;
                }
            }
        }
    }

    /// Λ of every change of one course.
    fn ratios(&self, course: usize, directions: &Directions) -> [Scaled; CHANGES] {
        self.ratios_of(course, directions, SIZES[course])
    }

    /// The same of changes of another size.
    fn ratios_of(&self, course: usize, directions: &Directions, size: f64) -> [Scaled; CHANGES] {
        let (gathered, variance) = (&self.gathered[course], size.powi(2));
        let (mut score, mut information) = (Vector6::zeros(), Vector6::zeros());
        let (mut along, mut squared) = (Vector6::zeros(), Vector6::zeros());
        for (axis, gathered) in gathered.iter().enumerate() {
            (score[axis], information[axis]) = (gathered.score, gathered.information);
            along += directions.by_axis.column(axis) * gathered.score;
            squared += directions.squares.column(axis) * gathered.information;
        }
        let of_axes = ratios(variance, &score, &information);
        let all = Scaled { exponent: of_axes.0.sum(), factor: of_axes.1.product().sqrt() };
        let (exponents, shrinkages) = ratios(variance, &along, &squared);
        let mut of_changes = [all; CHANGES];
        for direction in 0..AXES {
            of_changes[direction] =
                Scaled { exponent: exponents[direction], factor: shrinkages[direction].sqrt() };
        }
        of_changes
    }

    /// wΛ of every change of one course.
    fn masses(&self, course: usize, directions: &Directions) -> [Scaled; CHANGES] {
        self.masses_of(course, directions, SIZES[course])
    }

    fn masses_of(&self, course: usize, directions: &Directions, size: f64) -> [Scaled; CHANGES] {
        let mut masses = self.ratios_of(course, directions, size);
        masses.iter_mut().zip(&self.log_weights[course]).for_each(|(mass, log_w)| mass.exponent += log_w);
        masses
    }

    /// What an onset that goes is worth is added to this one: (12).
    fn inherit(&mut self, gone: &Onset, directions: &Directions) {
        for course in 0..COURSES.len() {
            let (stays, goes) = (self.ratios(course, directions), gone.masses(course, directions));
            for (change, log_weight) in self.log_weights[course].iter_mut().enumerate() {
                *log_weight = LogSum::of([*log_weight, goes[change].ln() - stays[change].ln()]).ln();
            }
        }
    }
}

/// Exponents of six Λ, and the squares of their factors.
fn ratios(variance: f64, score: &Vector6<f64>, information: &Vector6<f64>) -> (Vector6<f64>, Vector6<f64>) {
    let shrinkages = information.map(|d| 1.0 / (1.0 + variance * d));
    (shrinkages.zip_map(score, |shrinkage, c| 0.5 * variance * c * c * shrinkage), shrinkages)
}

/// The directions looked along: unit changes of the motion's coordinates in whitened coordinates, of length one.
#[derive(Debug, Clone, PartialEq)]
struct Directions {
    /// Columns: the whitened coordinates. Rows: the directions.
    by_axis: Matrix6<f64>,
    /// u².
    squares: Matrix6<f64>,
}

impl Directions {
    fn new(by_axis: Matrix6<f64>) -> Self {
        Directions { by_axis, squares: by_axis.component_mul(&by_axis) }
    }
}

/// What the readings say of a change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    /// The most probable onset.
    pub onset_s: f64,
    /// How uncertain that is, seconds: eq. (80).
    pub onset_sigma_s: f64,
    /// The more probable course.
    pub course: MotionKind,
    /// Its probability.
    pub course_probability: f64,
    /// What it adds by now to the constant part of the filters' states, in whitened coordinates.
    pub shift: Vector6<f64>,
    /// Variances of that.
    pub variance: Vector6<f64>,
}

/// All onsets and the statistic.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Onsets {
    onsets: Box<ArrayVec<Onset, { ONSETS + 1 }>>,
    directions: Directions,
}

impl Onsets {
    /// Columns of `directions`: unit changes of the motion's coordinates in whitened coordinates, of length one.
    pub fn new(directions: Matrix6<f64>) -> Self {
        Onsets { onsets: Box::default(), directions: Directions::new(directions.transpose()) }
    }

    pub fn predict(&mut self, transitions: &[Transition; AXES]) {
        self.onsets.iter_mut().for_each(|onset| onset.predict(transitions));
    }

    /// When the last one began.
    pub fn last_s(&self) -> Option<f64> {
        self.onsets.last().map(|onset| onset.t_s)
    }

    /// Takes in the readings at `t_s`, at which a change may have begun too, with a weight: ln R.
    pub fn add(
        &mut self,
        t_s: f64,
        innovations: &[Innovation; AXES],
        log_weight: f64,
        then: Vec<f64>,
    ) -> f64 {
        if self.onsets.len() == ONSETS {
            self.merge_two();
        }
        self.onsets.push(Onset::new(t_s, log_weight, then));
        for onset in self.onsets.iter_mut() {
            for gathered in &mut onset.gathered {
                gathered.iter_mut().zip(innovations).for_each(|(g, innovation)| g.add(innovation));
            }
        }
        self.log_mass(&self.onsets)
    }

    /// ln R, the ratios of each onset taken against all noise that is possible; where that is below `threshold`, something between it and
    /// that.
    pub(crate) fn log_statistic_against(&self, measured: &Measured, threshold: f64) -> f64 {
        let masses: ArrayVec<f64, { ONSETS + 1 }> = self
            .onsets
            .iter()
            .map(|onset| LogSum::of([0, 1].map(|course| self.log_mass_of_any_size(onset, course))).ln())
            .collect();
        let mut order: ArrayVec<usize, { ONSETS + 1 }> = (0..masses.len()).collect();
        order.sort_by(|a, b| masses[*b].total_cmp(&masses[*a]));
        let mut sum = LogSum::nothing();
        for (i, onset) in order.iter().enumerate() {
            sum.add((masses[*onset] + measured.log_against(&self.onsets[*onset].then)).into());
            // The others are worth no more than they are against the noise in use.
            let mut most = sum;
            order[i + 1..].iter().for_each(|other| most.add(masses[*other].into()));
            if most.ln() < threshold {
                return most.ln();
            }
        }
        sum.ln()
    }

    /// ln wΛ of an onset and a course, a change being of any size. Beside the noise in use a size that is expected too small costs little of what a gross
    /// change is worth; noise that follows a jump explains one of a hundred standard deviations better than a change of two does.
    fn log_mass_of_any_size(&self, onset: &Onset, course: usize) -> f64 {
        let mut sum = LogSum::nothing();
        for (times, weight) in WIDER {
            let masses = onset.masses_of(course, &self.directions, times * SIZES[course]);
            masses.into_iter().for_each(|mass| {
                sum.add(Scaled { exponent: mass.exponent, factor: weight * mass.factor });
            });
        }
        sum.ln()
    }

    /// What the models of noise were worth before the onset nearest to `onset_s`.
    pub fn then(&self, onset_s: f64) -> Option<&[f64]> {
        let distance = |onset: &&Onset| (onset.t_s - onset_s).abs();
        let nearest = self.onsets.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some(&nearest.then)
    }

    /// ln Σ wΛ of these onsets.
    fn log_mass(&self, onsets: &[Onset]) -> f64 {
        let mut sum = LogSum::nothing();
        for onset in onsets {
            for course in 0..COURSES.len() {
                onset.masses(course, &self.directions).into_iter().for_each(|mass| sum.add(mass));
            }
        }
        sum.ln()
    }

    /// Probability of each onset and course, were one of them what happened.
    fn probabilities(&self, measured: Option<&Measured>) -> ArrayVec<[f64; COURSES.len()], { ONSETS + 1 }> {
        // As the test weighs them: a gross change of the expected size only would seem to have begun later than it did.
        let log_mass = |onset: &Onset, course| match measured {
            Some(measured) => self.log_mass_of_any_size(onset, course) + measured.log_against(&onset.then),
            None => LogSum::of(onset.masses(course, &self.directions)).ln(),
        };
        let of = |onset: &Onset| [0, 1].map(|course| log_mass(onset, course));
        let log_masses: ArrayVec<_, { ONSETS + 1 }> = self.onsets.iter().map(of).collect();
        let all = LogSum::of(log_masses.iter().flatten().copied()).ln();
        log_masses.into_iter().map(|of| of.map(|log_mass| (log_mass - all).exp())).collect()
    }

    /// Joins the neighbours that lie closest for their age; the heavier stands for both, so that R does not change.
    fn merge_two(&mut self) {
        let now = self.onsets[self.onsets.len() - 1].t_s;
        let closeness = |i: usize| {
            let (older, newer) = (self.onsets[i].t_s, self.onsets[i + 1].t_s);
            (newer - older) / (now - older).max(f64::MIN_POSITIVE)
        };
        let Some(first) = (0..self.onsets.len() - 2).min_by(|a, b| closeness(*a).total_cmp(&closeness(*b)))
        else {
            return;
        };
        let mut gone = self.onsets.remove(first + 1);
        if self.log_mass(&self.onsets[first..=first]) < self.log_mass(std::slice::from_ref(&gone)) {
            std::mem::swap(&mut self.onsets[first], &mut gone);
        }
        self.onsets[first].inherit(&gone, &self.directions);
    }

    /// The change that explains the readings; none before the first reading.
    pub fn change(&self, measured: Option<&Measured>) -> Option<Change> {
        let mut probabilities = self.probabilities(measured);
        // The weights of the courses say how soon each must be found, not how often there is one: they take no part in its name.
        let odds = COURSE_WEIGHTS.map(|weight| COURSE_WEIGHTS[0] / weight);
        probabilities.iter_mut().for_each(|p| p.iter_mut().zip(odds).for_each(|(p, odds)| *p *= odds));
        let all: f64 = probabilities.iter().flatten().sum();
        probabilities.iter_mut().flatten().for_each(|p| *p /= all);
        let (best, _) = probabilities.iter().enumerate().max_by(|a, b| sum(a.1).total_cmp(&sum(b.1)))?;
        let mut by_course = [0, 1].map(|course| probabilities.iter().map(|p| p[course]).sum::<f64>());
        let is_ramp = by_course[0] < by_course[1];
        let after_gap = if is_ramp { self.after_gap(best) } else { None };
        if after_gap.is_some() {
            by_course = [1.0, 0.0];
        }
        let (best, course) = (after_gap.unwrap_or(best), usize::from(by_course[0] < by_course[1]));
        let at = self.onsets.get(best)?;
        let times = self.onsets.iter().map(|onset| onset.t_s);
        let onset_sigma_s = onset_sigma_s(times.zip(probabilities.iter().map(sum)), best);
        let (shift, variance) = shift(&at.gathered[course], WIDE * SIZES[course]);
        Some(Change {
            onset_s: at.t_s,
            onset_sigma_s,
            course: COURSES[course],
            course_probability: by_course[course].min(1.0),
            shift,
            variance,
        })
    }

    /// The onset after a gap, longer by far than the time before this one, that is most of the time since. What happened in it looks the same whether it went on for all of it or
    /// not, and until more is read it is a step.
    fn after_gap(&self, best: usize) -> Option<usize> {
        let now_s = self.last_s()?;
        // Before the oldest onset nothing is known: it is as if there were one at the same time.
        let before_s = self.onsets[best.saturating_sub(1)].t_s;
        let since_s = now_s - self.onsets[best].t_s;
        let gap_s = |i: &usize| self.onsets[*i].t_s - self.onsets[i - 1].t_s;
        let last = best + 1..self.onsets.len();
        let longest = last.max_by(|a, b| gap_s(a).total_cmp(&gap_s(b)))?;
        let is_gap = self.onsets[best].t_s - before_s < (1.0 - GAP_SHARE) * gap_s(&longest);
        (is_gap && GAP_SHARE * since_s < gap_s(&longest)).then_some(longest)
    }

    /// What a jump at the onset nearest to `onset_s` adds by now, mean and variance.
    pub fn jump_since(&self, onset_s: f64) -> Option<(Vector6<f64>, Vector6<f64>)> {
        let distance = |onset: &&Onset| (onset.t_s - onset_s).abs();
        let nearest = self.onsets.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some(shift(&nearest.gathered[0], WIDE * SIZES[0]))
    }
}

/// Standard deviation of an onset that is reported as the time of the first reading after it, seconds: how far the other `onsets` (time and
/// probability, in order of time) are from number `best`, and the interval before that one, in which nothing was read. The first of all has
/// the interval after it instead: eq. (80).
pub(super) fn onset_sigma_s(onsets: impl Iterator<Item = (f64, f64)> + Clone, best: usize) -> f64 {
    let Some((best_s, _)) = onsets.clone().nth(best) else { return 0.0 };
    let neighbour = if best == 0 { 1 } else { best - 1 };
    let interval_s = onsets.clone().nth(neighbour).map_or(0.0, |(t_s, _)| t_s - best_s);
    let spread: f64 = onsets.map(|(t_s, probability)| probability * (t_s - best_s).powi(2)).sum();
    spread.sqrt().hypot(interval_s)
}

fn sum(of_courses: &[f64; COURSES.len()]) -> f64 {
    of_courses.iter().sum()
}

/// Mean and variance of what a change adds to the filters' constant part: its posterior size, expected below `sigma`, times g.
fn shift(gathered: &[Gathered; AXES], sigma: f64) -> (Vector6<f64>, Vector6<f64>) {
    let variance = |g: &Gathered| 1.0 / (g.information + 1.0 / (sigma * sigma));
    (
        Vector6::from_fn(|axis, _| {
            variance(&gathered[axis]) * gathered[axis].score * gathered[axis].signature[0]
        }),
        Vector6::from_fn(|axis, _| variance(&gathered[axis]) * gathered[axis].signature[0].powi(2)),
    )
}

numbers!(Gathered { signature, score, information });
numbers!(Onset { t_s, gathered, log_weights, then });
numbers!(Onsets { onsets, directions });

impl Numbers for Directions {
    fn put(&self, numbers: &mut Vec<f64>) {
        self.by_axis.put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        Some(Directions::new(Matrix6::take(rest)?))
    }
}

impl Numbers for MotionKind {
    fn put(&self, numbers: &mut Vec<f64>) {
        (*self == MotionKind::Ramp).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        Some(COURSES[usize::from(bool::take(rest)?)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Λ by eq. (8), from the logarithm of each, along the columns that were given.
    #[test]
    fn each_direction_is_looked_along() {
        let mut directions = Matrix6::from_fn(|i, j| ((1 + 2 * i + 5 * j) as f64).sin());
        directions.column_iter_mut().for_each(|mut column| {
            column.normalize_mut();
        });
        let onsets = Onsets::new(directions);
        let mut onset = Onset::new(0.0, 0.0, Vec::new());
        for (axis, gathered) in onset.gathered[0].iter_mut().enumerate() {
            (gathered.score, gathered.information) = ((axis as f64 + 0.3).cos(), 0.5 + axis as f64);
        }
        let variance = SIZES[0] * SIZES[0];
        let log_ratio =
            |c: f64, d: f64| 0.5 * (variance * c * c / (1.0 + variance * d) - (1.0 + variance * d).ln());
        let ratios = onset.ratios(0, &onsets.directions).map(|ratio| ratio.ln());
        for (direction, u) in directions.column_iter().enumerate() {
            let c: f64 = u.iter().zip(&onset.gathered[0]).map(|(u, g)| u * g.score).sum();
            let d: f64 = u.iter().zip(&onset.gathered[0]).map(|(u, g)| u * u * g.information).sum();
            assert!((ratios[direction] - log_ratio(c, d)).abs() < 1e-12, "{direction}");
        }
        let all: f64 = onset.gathered[0].iter().map(|g| log_ratio(g.score, g.information)).sum();
        assert!((ratios[AXES] - all).abs() < 1e-12);
    }
}
