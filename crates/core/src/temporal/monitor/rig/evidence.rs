//! Which camera moved, and when? The Shiryaev–Roberts statistic of a whole rig: every onset, camera and kind of motion.
//!
//! ```text
//!   g   mean error that unit motions of all cameras since the onset give to the filter's prediction
//!   c = Σ (H g)ᵀ S⁻¹ ν,   D = Σ (H g)ᵀ S⁻¹ H g          all that the frame_sets say of them, correlations included
//!   Λ = |1 + Γ D|^(−½) exp(½ cᵀ(D + Γ⁻¹)⁻¹ c)          over the coordinates I of one camera; Γ how far is looked for
//! ```
//! Λ, weights and R are summed by their logarithms: no change is so gross that they leave the range of numbers.
//! Derivation: docs/math/monitor.md eqs. (22)–(24).

use super::filter::{Innovation, Propagated, STATES};
use crate::temporal::monitor::axis::DAY_S;
use crate::temporal::monitor::onsets::onset_sigma_s;
use crate::temporal::monitor::priors::{COURSES, GROWN, MotionKind, SIZES, WIDER};
use crate::temporal::monitor::{LogSum, Scaled};
use crate::temporal::snapshot::{Numbers, Rest, numbers};
use crate::{Matrix6, Vector6};
use nalgebra::{DMatrix, DVector};

/// Onsets kept.
const ONSETS: usize = 16;
/// Coordinates of one camera that change together: each of six alone, the rotation, all.
const KINDS: usize = 8;

/// A time at which it may have begun.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Onset {
    pub t_s: f64,
    gathered: [Gathered; 2],
    /// ln w of each camera and kind, per course.
    log_weights: [Vec<[f64; KINDS]>; 2],
    /// Variances of an observation of each camera when this onset was added.
    typical: DVector<f64>,
    /// How likely the frame sets before it were under each model of the noise.
    pub then: Then,
}

/// What an onset remembers of the noise before it: logarithms of likelihoods, and the count of frame sets.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Then {
    pub own: f64,
    pub grown: [f64; GROWN.len()],
    pub frame_sets: f64,
}

/// The evidence of the frame sets since an onset for motions of all cameras.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gathered {
    signature: DMatrix<f64>,
    /// c.
    pub score: DVector<f64>,
    /// D.
    pub information: DMatrix<f64>,
    /// Of each camera, the least camera that it is tied to by targets that were seen together: itself while there is none.
    pub groups: Vec<usize>,
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
        let groups = (0..n / 6).collect();
        Gathered { signature, score: DVector::zeros(n), information: DMatrix::zeros(n, n), groups }
    }

    /// What a unit motion of a camera has added by now to its m beyond what the filter has noticed.
    pub fn gained(&self, camera: usize) -> Matrix6 {
        self.signature.fixed_view::<6, 6>(STATES * camera, 6 * camera).into()
    }

    /// Of motions that begin now and stay.
    pub fn of_jumps(cameras: usize) -> Self {
        Gathered::new(unit(cameras))
    }

    pub fn predict(&mut self, carried: &Propagated) {
        for mut column in self.signature.column_iter_mut() {
            column.component_mul_assign(&carried.factors);
        }
    }

    /// c²/d of a camera, the mean over its six coordinates; none where it was not seen.
    pub fn mean_square(&self, camera: usize) -> Option<f64> {
        let square = |i: usize| self.score[i] * self.score[i] / self.information[(i, i)];
        let own = 6 * camera..6 * camera + 6;
        own.clone().all(|i| 0.0 < self.information[(i, i)]).then(|| own.map(square).sum::<f64>() / 6.0)
    }

    pub fn is_sound(&self, cameras: usize) -> bool {
        let n = 6 * cameras;
        self.signature.shape() == (STATES * cameras, n)
            && (self.score.len(), self.information.shape()) == (n, (n, n))
            && self.groups.len() == cameras
            && self.groups.iter().all(|group| *group < cameras)
    }

    pub fn add(&mut self, innovation: &Innovation) {
        self.tie(&innovation.design);
        let seen = &innovation.design * &self.signature;
        let weighted = innovation.spread.solve(&seen);
        self.score += weighted.tr_mul(&innovation.value);
        self.information += weighted.tr_mul(&seen);
        self.signature -= &innovation.gain * seen;
    }

    /// Every six rows of a design are a difference of two cameras.
    fn tie(&mut self, design: &DMatrix<f64>) {
        for row in (0..design.nrows()).step_by(6) {
            let is_in =
                |camera: &usize| design.view((row, STATES * camera), (1, 6)).iter().any(|v| *v != 0.0);
            let tied: Vec<usize> =
                (0..self.groups.len()).filter(is_in).map(|camera| self.groups[camera]).collect();
            let least = tied.iter().copied().min().unwrap_or(0);
            self.groups.iter_mut().filter(|group| tied.contains(*group)).for_each(|group| *group = least);
        }
    }
}

impl Onset {
    /// `share`: weight of all cameras and kinds together.
    pub fn new(t_s: f64, share: f64, typical: &DVector<f64>, then: Then) -> Self {
        let cameras = typical.len() / 6;
        let jump = unit(cameras);
        let weight = share / (COURSES.len() * cameras * KINDS) as f64;
        let log_weights = vec![[weight.ln(); KINDS]; cameras];
        Onset {
            t_s,
            gathered: [Gathered::new(jump.clone()), Gathered::new(jump * 0.0)],
            log_weights: [log_weights.clone(), log_weights],
            typical: typical.clone(),
            then,
        }
    }

    fn is_sound(&self, cameras: usize) -> bool {
        self.gathered.iter().all(|gathered| gathered.is_sound(cameras))
            && self.log_weights.iter().all(|weights| weights.len() == cameras)
            && self.typical.len() == 6 * cameras
            && self.typical.iter().all(|variance| 0.0 <= *variance)
    }

    /// Of a jump (0) or a slow drift (1, per day).
    pub fn gathered(&self, course: usize) -> &Gathered {
        &self.gathered[course]
    }

    pub fn predict(&mut self, carried: &Propagated) {
        for (course, gathered) in COURSES.into_iter().zip(&mut self.gathered) {
            gathered.predict(carried);
            if course == MotionKind::Ramp {
                for i in 0..gathered.signature.ncols() {
                    gathered.signature[(STATES * (i / 6) + i % 6, i)] += carried.elapsed_s / DAY_S;
                }
            }
        }
    }

    pub fn add(&mut self, innovation: &Innovation) {
        self.gathered.iter_mut().for_each(|gathered| gathered.add(innovation));
    }

    /// ln Λ of a course, camera and every kind, (23).
    fn log_ratios(&self, course: usize, camera: usize) -> [f64; KINDS] {
        self.log_ratios_of(course, camera, SIZES[course])
    }

    /// The same of motions of another size.
    fn log_ratios_of(&self, course: usize, camera: usize, size: f64) -> [f64; KINDS] {
        let gathered = &self.gathered[course];
        // In units of what is looked for: Γ is one.
        let typical = self.typical.fixed_rows::<6>(6 * camera);
        let sigma = Vector6::from_fn(|i, _| size * typical[i].sqrt());
        let score = gathered.score.fixed_rows::<6>(6 * camera).component_mul(&sigma);
        let mut spread: Matrix6 = gathered.information.fixed_view::<6, 6>(6 * camera, 6 * camera).into();
        spread.component_mul_assign(&(sigma * sigma.transpose()));
        spread += Matrix6::identity();
        log_ratios(&score, &spread)
    }

    /// ln wΛ of a course.
    fn log_masses(&self, course: usize) -> impl Iterator<Item = f64> + '_ {
        let of = move |(camera, weights): (usize, &[f64; KINDS])| {
            let ratios = self.log_ratios(course, camera);
            std::array::from_fn::<f64, KINDS, _>(|kind| weights[kind] + ratios[kind])
        };
        self.log_weights[course].iter().enumerate().flat_map(of)
    }

    /// ln Σ wΛ.
    fn log_mass(&self) -> f64 {
        LogSum::of([0, 1].into_iter().flat_map(|course| self.log_masses(course))).ln()
    }

    /// The same, a motion being of any size: noise that follows a jump explains a gross one better than a small one does.
    fn log_mass_of_any_size(&self) -> f64 {
        let mut sum = LogSum::nothing();
        for (times, weight) in WIDER {
            for course in 0..COURSES.len() {
                for (camera, weights) in self.log_weights[course].iter().enumerate() {
                    let ratios = self.log_ratios_of(course, camera, times * SIZES[course]);
                    ratios.iter().zip(weights).for_each(|(ratio, log_w)| {
                        sum.add(Scaled { exponent: ratio + log_w, factor: weight });
                    });
                }
            }
        }
        sum.ln()
    }

    /// What an onset that goes was worth is added to this one.
    fn inherit(&mut self, gone: &Onset) {
        for course in 0..COURSES.len() {
            for (camera, gone_weights) in gone.log_weights[course].iter().enumerate() {
                let (stays, goes) = (self.log_ratios(course, camera), gone.log_ratios(course, camera));
                for (kind, log_weight) in self.log_weights[course][camera].iter_mut().enumerate() {
                    let inherited = gone_weights[kind] + goes[kind] - stays[kind];
                    *log_weight = LogSum::of([*log_weight, inherited]).ln();
                }
            }
        }
    }
}

/// ln Λ of every kind of one camera: c and 1 + D in units of what is looked for. The factor of all six holds that of the rotation.
fn log_ratios(score: &Vector6, spread: &Matrix6) -> [f64; KINDS] {
    let mut ratios = [0.0; KINDS];
    for i in 0..6 {
        ratios[i] = 0.5 * (score[i] * score[i] / spread[(i, i)] - spread[(i, i)].ln());
    }
    let Some(factor) = spread.cholesky() else { return ratios };
    let lower = factor.l_dirty();
    let whitened = lower.solve_lower_triangular(score).unwrap_or_default();
    let first = |n: usize| (0..n).map(|i| 0.5 * whitened[i] * whitened[i] - lower[(i, i)].ln()).sum();
    (ratios[6], ratios[7]) = (first(3), first(6));
    ratios
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
    pub fn course(&self) -> MotionKind {
        COURSES[self.course]
    }
}

/// All onsets and the statistic.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Evidence {
    onsets: Vec<Onset>,
    /// R, or the largest number there is.
    pub statistic: f64,
}

impl Evidence {
    /// Whether it is such as a rig of this many cameras makes: numbers of a file may be any.
    pub fn is_sound(&self, cameras: usize) -> bool {
        self.onsets.len() <= ONSETS && self.onsets.iter().all(|onset| onset.is_sound(cameras))
    }

    pub fn predict(&mut self, carried: &Propagated) {
        self.onsets.iter_mut().for_each(|onset| onset.predict(carried));
    }

    /// Lets a change begin at `t_s` too, with a weight of `share`.
    pub fn begin(&mut self, t_s: f64, share: f64, typical: &DVector<f64>, then: Then) {
        if self.onsets.len() == ONSETS {
            self.merge_two();
        }
        self.onsets.push(Onset::new(t_s, share, typical, then));
    }

    pub fn add(&mut self, innovation: &Innovation) {
        self.onsets.iter_mut().for_each(|onset| onset.add(innovation));
        self.statistic = LogSum::of(self.onsets.iter().map(Onset::log_mass)).ln().exp().min(f64::MAX);
    }

    /// ln R, each onset taken against all noise that is possible.
    pub fn log_statistic_against(&self, log_against: impl Fn(&Then) -> f64) -> f64 {
        let of = |onset: &Onset| onset.log_mass_of_any_size() + log_against(&onset.then);
        LogSum::of(self.onsets.iter().map(of)).ln()
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
        let mut gone = self.onsets.remove(first + 1);
        let kept = &mut self.onsets[first];
        if kept.log_mass() < gone.log_mass() {
            std::mem::swap(kept, &mut gone);
        }
        kept.inherit(&gone);
    }

    /// None before the first frame set.
    pub fn began(&self) -> Option<Began<'_>> {
        let log_mass = |onset: &Onset| [0, 1].map(|course| LogSum::of(onset.log_masses(course)).ln());
        let log_masses: Vec<[f64; 2]> = self.onsets.iter().map(log_mass).collect();
        let total = LogSum::of(log_masses.iter().flatten().copied()).ln();
        let masses: Vec<[f64; 2]> = log_masses.iter().map(|of| of.map(|x| (x - total).exp())).collect();
        let sum = |mass: &[f64; 2]| mass[0] + mass[1];
        let (best, _) = masses.iter().enumerate().max_by(|a, b| sum(a.1).total_cmp(&sum(b.1)))?;
        let by_course = [0, 1].map(|course| masses.iter().map(|m| m[course]).sum::<f64>());
        let course = usize::from(by_course[0] < by_course[1]);
        let onset = &self.onsets[best];
        let times = self.onsets.iter().map(|onset| onset.t_s);
        let sigma_s = onset_sigma_s(times.zip(masses.iter().map(sum)), best);
        Some(Began { onset, sigma_s, course, course_probability: by_course[course].min(1.0) })
    }
}

impl Evidence {
    /// As version 1 of a snapshot has it: without what an onset remembers of the noise before it.
    pub fn put_version_1(&self, numbers: &mut Vec<f64>) {
        self.onsets.len().put(numbers);
        for Onset { t_s, gathered, log_weights, typical, .. } in &self.onsets {
            t_s.put(numbers);
            gathered.put(numbers);
            log_weights.put(numbers);
            typical.put(numbers);
        }
        self.statistic.put(numbers);
    }

    /// Reads what that wrote.
    pub fn take_version_1(rest: &mut Rest) -> Option<Self> {
        let n = usize::take(rest)?;
        let mut onsets = Vec::new();
        for _ in 0..n {
            onsets.push(Onset {
                t_s: f64::take(rest)?,
                gathered: Numbers::take(rest)?,
                log_weights: Numbers::take(rest)?,
                typical: Numbers::take(rest)?,
                then: Then::default(),
            });
        }
        Some(Evidence { onsets, statistic: f64::take(rest)? })
    }
}

numbers!(Then { own, grown, frame_sets });
numbers!(Gathered { signature, score, information, groups });
numbers!(Onset { t_s, gathered, log_weights, typical, then });
numbers!(Evidence { onsets, statistic });

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub const SIGMA: f64 = 1e-3;

    /// What two cameras of a rig see beside each other: a rotation about x, every coordinate known to `SIGMA`.
    pub fn difference(cameras: usize, of: [usize; 2], rotation_rad: f64) -> Innovation {
        let mut design = DMatrix::zeros(6, STATES * cameras);
        for (camera, sign) in of.into_iter().zip([1.0, -1.0]) {
            (0..6).for_each(|i| design[(i, STATES * camera + i)] = sign);
        }
        let spread = (DMatrix::identity(6, 6) * SIGMA * SIGMA).cholesky().expect("a covariance");
        let value = DVector::from_fn(6, |i, _| if i == 0 { rotation_rad } else { 0.0 });
        Innovation { design, value, spread, gain: DMatrix::zeros(STATES * cameras, 6) }
    }

    /// A frame set a second, and what two cameras see of a rotation after the quiet ones.
    fn turned(quiet: usize, after: usize, rotation_rad: f64) -> Evidence {
        let (mut evidence, typical) = (Evidence::default(), DVector::from_element(12, SIGMA * SIGMA));
        for i in 0..quiet + after {
            evidence.begin(i as f64, 1.0, &typical, Then::default());
            evidence.add(&difference(2, [0, 1], if i < quiet { 0.0 } else { rotation_rad }));
        }
        evidence
    }

    /// An alarm that stays open, with ratios beyond any number.
    #[test]
    fn gross_changes_leave_every_number_finite() {
        let evidence = turned(50, 200, 60.0 * SIGMA);
        assert!(evidence.statistic.is_finite() && 1e300 < evidence.statistic);
        let began = evidence.began().expect("moments");
        // Onsets are joined as they age: between the one that is kept and the one before it all are possible, eq. (80).
        let off_s = (began.onset.t_s - 50.0).abs();
        assert!(off_s <= 20.0 && off_s <= began.sigma_s, "{off_s} {}", began.sigma_s);
        assert!(began.sigma_s < 65.0 && began.course() == MotionKind::Step, "{}", began.sigma_s);
        assert!((0.5..=1.0).contains(&began.course_probability), "{}", began.course_probability);
        assert!(evidence.onsets.iter().all(|onset| onset.log_mass().is_finite()));
    }

    #[test]
    fn joining_onsets_keeps_the_sum() {
        for rotation_rad in [0.0, 2.0 * SIGMA, 60.0 * SIGMA] {
            let mut evidence = turned(6, ONSETS - 6, rotation_rad);
            let log_r = |evidence: &Evidence| LogSum::of(evidence.onsets.iter().map(Onset::log_mass)).ln();
            let before = log_r(&evidence);
            evidence.merge_two();
            assert_eq!(evidence.onsets.len(), ONSETS - 1);
            let after = log_r(&evidence);
            assert!((after - before).abs() < 1e-9 * before.abs().max(1.0), "{before} {after}");
        }
    }

    /// The factor of all six coordinates beside determinants and inverses of each block.
    #[test]
    fn ratios_are_those_of_23() {
        let root = Matrix6::from_fn(|i, j| ((3 * i + 5 * j) % 7) as f64 - 2.5);
        let spread = root * root.transpose() + Matrix6::identity();
        let score = Vector6::new(1.0, -2.0, 3.0, 0.5, -4.0, 2.0);
        let ratios = log_ratios(&score, &spread);
        let all: [usize; 6] = std::array::from_fn(|i| i);
        let kinds = (0..6).map(|i| &all[i..=i]).chain([&all[..3], &all[..]]);
        for (kind, ratio) in kinds.zip(ratios) {
            let block = DMatrix::from_fn(kind.len(), kind.len(), |i, j| spread[(kind[i], kind[j])]);
            let part = DVector::from_fn(kind.len(), |i, _| score[kind[i]]);
            let explained = part.dot(&(block.clone().try_inverse().expect("regular") * &part));
            let wanted = 0.5 * (explained - block.determinant().ln());
            assert!((ratio - wanted).abs() < 1e-9, "{kind:?}: {ratio} {wanted}");
        }
    }
}
