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
//! Derivation: docs/math/monitor.md eqs. (5)–(12).

use super::axis::{Innovation, Transition, read};
use crate::snapshot::{Numbers, Rest, numbers};
use arrayvec::ArrayVec;
use nalgebra::{Matrix6, Vector4, Vector6};

/// Coordinates of a small motion.
pub(super) const AXES: usize = 6;
/// Onsets kept; older ones lie further apart.
const ONSETS: usize = 24;
/// Size looked for of each course, in standard deviations of a reading, of a drift per day. A change five times larger or smaller costs
/// about ln 5 of evidence.
const SIZES: [f64; COURSES.len()] = [2.0, 30.0];
/// Estimates of a change expect it below this many of that size: any that can be seen.
const WIDE: f64 = 1000.0;
/// Changes along each of six directions, and of all coordinates at once.
const CHANGES: usize = AXES + 1;
/// Prior weights of the courses: any that add up to one keep the promise, docs/math/monitor.md eq. (9). A step is urgent; a slow drift
/// makes up for a factor of five within minutes of its hours.
const COURSE_WEIGHTS: [f64; COURSES.len()] = [0.9, 0.1];
/// And of the changes: mounts turn (three directions), shift less often (three), or do it all at once.
const CHANGE_WEIGHTS: [f64; CHANGES] = [0.2, 0.2, 0.2, 1.0 / 15.0, 1.0 / 15.0, 1.0 / 15.0, 0.2];

/// How a change goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// A jump that stays.
    Step,
    /// A drift that goes on; its size is per day.
    Slow,
}

/// In this order everywhere below.
const COURSES: [Course; 2] = [Course::Step, Course::Slow];

/// What the readings since an onset say of a change of one coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Gathered {
    /// g.
    signature: Vector4<f64>,
    /// c.
    score: f64,
    /// d.
    information: f64,
}

impl Gathered {
    fn add(&mut self, innovation: &Innovation) {
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
    weights: [[f64; CHANGES]; COURSES.len()],
}

impl Onset {
    fn new(t_s: f64) -> Self {
        let jump = Gathered { signature: Vector4::x(), ..Gathered::default() };
        Onset {
            t_s,
            gathered: [[jump; AXES], [Gathered::default(); AXES]],
            weights: COURSE_WEIGHTS.map(|course| CHANGE_WEIGHTS.map(|change| course * change)),
        }
    }

    fn predict(&mut self, transitions: &[Transition; AXES]) {
        for (course, gathered) in COURSES.into_iter().zip(&mut self.gathered) {
            for (gathered, transition) in gathered.iter_mut().zip(transitions) {
                gathered.signature = transition.apply(&gathered.signature);
                if course == Course::Slow {
                    gathered.signature[0] += transition.elapsed_s / super::axis::DAY_S;
                }
            }
        }
    }

    /// ln Λ of every change of one course.
    fn log_ratios(&self, course: usize, directions: &Matrix6<f64>) -> [f64; CHANGES] {
        let (gathered, variance) = (&self.gathered[course], SIZES[course].powi(2));
        let all: f64 = gathered.iter().map(|g| log_ratio(variance, g.score, g.information)).sum();
        let mut ratios = [all; CHANGES];
        for direction in 0..AXES {
            let (mut score, mut information) = (0.0, 0.0);
            for axis in 0..AXES {
                let u = directions[(axis, direction)];
                score += u * gathered[axis].score;
                information += u * u * gathered[axis].information;
            }
            ratios[direction] = log_ratio(variance, score, information);
        }
        ratios
    }
}

/// ln Λ.
fn log_ratio(variance: f64, score: f64, information: f64) -> f64 {
    let spread = 1.0 + variance * information;
    0.5 * (variance * score * score / spread - spread.ln())
}

/// Beyond e^600 the alarm is certain; an infinite ratio would make the weights NaN.
const LARGEST: f64 = 600.0;

/// What the readings say of a change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    /// The most probable onset.
    pub onset_s: f64,
    /// Standard deviation of the onset over those kept, seconds.
    pub onset_sigma_s: f64,
    /// The more probable course.
    pub course: Course,
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
    onsets: ArrayVec<Onset, { ONSETS + 1 }>,
    /// Columns: unit changes of the motion's coordinates in whitened coordinates, of length one.
    directions: Matrix6<f64>,
    /// R.
    pub statistic: f64,
}

impl Onsets {
    pub fn new(directions: Matrix6<f64>) -> Self {
        Onsets { onsets: ArrayVec::new(), directions, statistic: 0.0 }
    }

    pub fn predict(&mut self, transitions: &[Transition; AXES]) {
        self.onsets.iter_mut().for_each(|onset| onset.predict(transitions));
    }

    /// Takes in the readings at `t_s`, at which a change may have begun too.
    pub fn add(&mut self, t_s: f64, innovations: &[Innovation; AXES]) {
        if self.onsets.len() == ONSETS {
            self.merge_two();
        }
        self.onsets.push(Onset::new(t_s));
        for onset in &mut self.onsets {
            for gathered in &mut onset.gathered {
                gathered.iter_mut().zip(innovations).for_each(|(g, innovation)| g.add(innovation));
            }
        }
        self.statistic = self.masses(0.0).iter().flatten().sum();
    }

    /// Σ wΛe^−peak of each onset and course.
    fn masses(&self, peak: f64) -> ArrayVec<[f64; COURSES.len()], { ONSETS + 1 }> {
        self.onsets.iter().map(|onset| [0, 1].map(|course| self.mass(onset, course, peak))).collect()
    }

    fn mass(&self, onset: &Onset, course: usize, peak: f64) -> f64 {
        let ratios = onset.log_ratios(course, &self.directions);
        let masses = ratios.iter().zip(&onset.weights[course]);
        masses.map(|(ratio, weight)| (ratio - peak).min(LARGEST).exp() * weight).sum()
    }

    /// The largest ln Λ of all.
    fn peak(&self) -> f64 {
        let of = |onset: &Onset| [0, 1].map(|course| onset.log_ratios(course, &self.directions));
        self.onsets.iter().flat_map(of).flatten().fold(0.0, f64::max)
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
        let (mut kept, mut gone) = (self.onsets[first].clone(), self.onsets[first + 1].clone());
        let total = |onset: &Onset| self.mass(onset, 0, 0.0) + self.mass(onset, 1, 0.0);
        if total(&kept) < total(&gone) {
            std::mem::swap(&mut kept, &mut gone);
        }
        for course in 0..COURSES.len() {
            let stays = kept.log_ratios(course, &self.directions);
            let goes = gone.log_ratios(course, &self.directions);
            for change in 0..CHANGES {
                let ratio = (goes[change] - stays[change]).min(LARGEST).exp();
                kept.weights[course][change] += gone.weights[course][change] * ratio;
            }
        }
        self.onsets[first] = kept;
        self.onsets.remove(first + 1);
    }

    /// The change that explains the readings; none before the first reading.
    pub fn change(&self) -> Option<Change> {
        // Gross changes have ratios beyond any number: seen from the largest, their order is kept.
        let masses = self.masses(self.peak());
        let (best, _) = masses.iter().enumerate().max_by(|a, b| sum(a.1).total_cmp(&sum(b.1)))?;
        let by_course = [0, 1].map(|course| masses.iter().map(|m| m[course]).sum::<f64>());
        let course = usize::from(by_course[0] < by_course[1]);
        let at = self.onsets.get(best)?;
        let spread: f64 =
            masses.iter().zip(&self.onsets).map(|(m, o)| sum(m) * (o.t_s - at.t_s).powi(2)).sum();
        let (shift, variance) = shift(&at.gathered[course], WIDE * SIZES[course]);
        Some(Change {
            onset_s: at.t_s,
            onset_sigma_s: (spread / masses.iter().map(sum).sum::<f64>()).sqrt(),
            course: COURSES[course],
            course_probability: by_course[course] / (by_course[0] + by_course[1]),
            shift,
            variance,
        })
    }

    /// What a jump at the onset nearest to `onset_s` adds by now, mean and variance.
    pub fn jump_since(&self, onset_s: f64) -> Option<(Vector6<f64>, Vector6<f64>)> {
        let distance = |onset: &&Onset| (onset.t_s - onset_s).abs();
        let nearest = self.onsets.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some(shift(&nearest.gathered[0], WIDE * SIZES[0]))
    }
}

fn sum(masses: &[f64; COURSES.len()]) -> f64 {
    masses.iter().sum()
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
numbers!(Onset { t_s, gathered, weights });
numbers!(Onsets { onsets, directions, statistic });

impl Numbers for Course {
    fn put(&self, numbers: &mut Vec<f64>) {
        (*self == Course::Slow).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        Some(COURSES[usize::from(bool::take(rest)?)])
    }
}
