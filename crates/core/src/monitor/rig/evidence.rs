//! Which camera moved, and when? The Shiryaev–Roberts statistic of a whole rig: every onset, camera and kind of motion.
//!
//! ```text
//!   g   mean error that unit motions of all cameras since the onset give to the filter's prediction
//!   c = Σ (H g)ᵀ S⁻¹ ν,   D = Σ (H g)ᵀ S⁻¹ H g          all that the moments say of them, correlations included
//!   Λ = |1 + Γ D|^(−½) exp(½ cᵀ(D + Γ⁻¹)⁻¹ c)          over the coordinates I of one camera; Γ how far is looked for
//! ```
//! Derivation: docs/math/monitor.md eqs. (22)–(24).

use super::filter::{Carried, Innovation, STATES};
use crate::Matrix6;
use crate::monitor::axis::DAY_S;
use crate::monitor::onsets::Course;
use nalgebra::{DMatrix, DVector};

/// Onsets kept.
const ONSETS: usize = 16;
/// Sizes looked for of each course, in standard deviations of a sight, of a drift per day.
const SIZES: [f64; 2] = [2.0, 30.0];
const COURSES: [Course; 2] = [Course::Step, Course::Slow];
/// Beyond e^600 the alarm is certain.
const LARGEST: f64 = 600.0;
/// Coordinates of one camera that change together: each alone, the rotation, all.
const KINDS: [&[usize]; 8] = [&[0], &[1], &[2], &[3], &[4], &[5], &[0, 1, 2], &[0, 1, 2, 3, 4, 5]];

/// A time at which it may have begun.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Onset {
    pub t_s: f64,
    gathered: [Gathered; 2],
    /// Of each camera and kind, per course.
    weights: [Vec<f64>; 2],
    /// Variances of a sight of each camera when this onset came up.
    typical: DVector<f64>,
}

/// What the moments since an onset say of motions of all cameras.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gathered {
    signature: DMatrix<f64>,
    /// c.
    pub score: DVector<f64>,
    /// D.
    pub information: DMatrix<f64>,
}

/// Unit motions of m.
fn unit(cameras: usize) -> DMatrix<f64> {
    DMatrix::from_fn(STATES * cameras, 6 * cameras, |i, j| {
        if i / STATES == j / 6 && i % STATES == j % 6 { 1.0 } else { 0.0 }
    })
}

impl Gathered {
    fn new(signature: DMatrix<f64>) -> Self {
        let n = signature.ncols();
        Gathered { signature, score: DVector::zeros(n), information: DMatrix::zeros(n, n) }
    }

    /// What a unit motion of a camera has added by now to its m beyond what the filter has noticed.
    pub fn gained(&self, camera: usize) -> Matrix6 {
        self.signature.fixed_view::<6, 6>(STATES * camera, 6 * camera).into()
    }

    fn add(&mut self, innovation: &Innovation) {
        let seen = &innovation.design * &self.signature;
        let weighted = innovation.spread.solve(&seen);
        self.score += weighted.tr_mul(&innovation.value);
        self.information += weighted.tr_mul(&seen);
        self.signature -= &innovation.gain * seen;
    }
}

impl Onset {
    /// `share`: weight of all cameras and kinds together.
    pub fn new(t_s: f64, share: f64, typical: &DVector<f64>) -> Self {
        let cameras = typical.len() / 6;
        let jump = unit(cameras);
        let weight = share / (COURSES.len() * cameras * KINDS.len()) as f64;
        let weights = vec![weight; cameras * KINDS.len()];
        Onset {
            t_s,
            gathered: [Gathered::new(jump.clone()), Gathered::new(jump * 0.0)],
            weights: [weights.clone(), weights],
            typical: typical.clone(),
        }
    }

    /// Of a jump (0) or a slow drift (1, per day).
    pub fn gathered(&self, course: usize) -> &Gathered {
        &self.gathered[course]
    }

    pub fn predict(&mut self, carried: &Carried) {
        for (course, gathered) in COURSES.into_iter().zip(&mut self.gathered) {
            for mut column in gathered.signature.column_iter_mut() {
                column.component_mul_assign(&carried.factors);
            }
            if course == Course::Slow {
                for i in 0..gathered.signature.ncols() {
                    gathered.signature[(STATES * (i / 6) + i % 6, i)] += carried.elapsed_s / DAY_S;
                }
            }
        }
    }

    pub fn add(&mut self, innovation: &Innovation) {
        self.gathered.iter_mut().for_each(|gathered| gathered.add(innovation));
    }

    /// ln Λ of every camera and kind of a course.
    fn log_ratios(&self, course: usize) -> Vec<f64> {
        let cameras = self.typical.len() / 6;
        let of = |camera: usize| KINDS.iter().map(move |kind| self.log_ratio(course, camera, kind));
        (0..cameras).flat_map(of).collect()
    }

    fn log_ratio(&self, course: usize, camera: usize, kind: &[usize]) -> f64 {
        let gathered = &self.gathered[course];
        let at = |i: usize| 6 * camera + kind[i];
        let sigma = |i: usize| SIZES[course] * self.typical[at(i)].sqrt();
        // In units of what is looked for: Γ is one.
        let spread = DMatrix::from_fn(kind.len(), kind.len(), |i, j| {
            gathered.information[(at(i), at(j))] * sigma(i) * sigma(j) + f64::from(u8::from(i == j))
        });
        let score = DVector::from_fn(kind.len(), |i, _| gathered.score[at(i)] * sigma(i));
        let Some(factor) = spread.cholesky() else { return 0.0 };
        let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
        0.5 * (score.dot(&factor.solve(&score)) - log_determinant)
    }

    fn masses(&self, peak: f64) -> [f64; 2] {
        [0, 1].map(|course| {
            let ratios = self.log_ratios(course);
            let masses = ratios.iter().zip(&self.weights[course]);
            masses.map(|(ratio, weight)| weight * (ratio - peak).min(LARGEST).exp()).sum()
        })
    }

    fn peak(&self) -> f64 {
        [0, 1].iter().flat_map(|course| self.log_ratios(*course)).fold(0.0, f64::max)
    }

    /// What an onset that goes was worth is added to this one.
    fn inherit(&mut self, gone: &Onset) {
        for course in 0..COURSES.len() {
            let (stays, goes) = (self.log_ratios(course), gone.log_ratios(course));
            for (i, weight) in self.weights[course].iter_mut().enumerate() {
                *weight += gone.weights[course][i] * (goes[i] - stays[i]).min(LARGEST).exp();
            }
        }
    }
}

/// When and how it most probably began.
pub(super) struct Began<'a> {
    pub onset: &'a Onset,
    pub sigma_s: f64,
    /// 0 at once, 1 slowly.
    pub course: usize,
    pub course_probability: f64,
}

impl Began<'_> {
    pub fn course(&self) -> Course {
        COURSES[self.course]
    }
}

/// All onsets and the statistic.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Evidence {
    onsets: Vec<Onset>,
    /// R.
    pub statistic: f64,
}

impl Evidence {
    pub fn predict(&mut self, carried: &Carried) {
        self.onsets.iter_mut().for_each(|onset| onset.predict(carried));
    }

    /// Lets a change begin at `t_s` too, with a weight of `share`.
    pub fn begin(&mut self, t_s: f64, share: f64, typical: &DVector<f64>) {
        if self.onsets.len() == ONSETS {
            self.merge_two();
        }
        self.onsets.push(Onset::new(t_s, share, typical));
    }

    pub fn add(&mut self, innovation: &Innovation) {
        self.onsets.iter_mut().for_each(|onset| onset.add(innovation));
        self.statistic = self.onsets.iter().flat_map(|onset| onset.masses(0.0)).sum();
    }

    /// Joins the neighbours that lie closest for their age; the heavier stands for both.
    fn merge_two(&mut self) {
        let now = self.onsets[self.onsets.len() - 1].t_s;
        let closeness = |i: &usize| {
            let (older, newer) = (self.onsets[*i].t_s, self.onsets[i + 1].t_s);
            (newer - older) / (now - older).max(f64::MIN_POSITIVE)
        };
        let Some(first) = (0..ONSETS - 2).min_by(|a, b| closeness(a).total_cmp(&closeness(b))) else {
            return;
        };
        let total = |onset: &Onset| onset.masses(0.0).iter().sum::<f64>();
        let gone = self.onsets.remove(first + 1);
        let kept = &mut self.onsets[first];
        if total(kept) < total(&gone) {
            let older = std::mem::replace(kept, gone);
            kept.inherit(&older);
        } else {
            kept.inherit(&gone);
        }
    }

    /// None before the first moment.
    pub fn began(&self) -> Option<Began<'_>> {
        let peak = self.onsets.iter().map(Onset::peak).fold(0.0, f64::max);
        let masses: Vec<[f64; 2]> = self.onsets.iter().map(|onset| onset.masses(peak)).collect();
        let sum = |mass: &[f64; 2]| mass[0] + mass[1];
        let (best, _) = masses.iter().enumerate().max_by(|a, b| sum(a.1).total_cmp(&sum(b.1)))?;
        let by_course = [0, 1].map(|course| masses.iter().map(|m| m[course]).sum::<f64>());
        let course = usize::from(by_course[0] < by_course[1]);
        let onset = &self.onsets[best];
        let away = |(mass, other): (&[f64; 2], &Onset)| sum(mass) * (other.t_s - onset.t_s).powi(2);
        let spread: f64 = masses.iter().zip(&self.onsets).map(away).sum();
        let all = by_course[0] + by_course[1];
        Some(Began {
            onset,
            sigma_s: (spread / all).sqrt(),
            course,
            course_probability: by_course[course] / all,
        })
    }
}
