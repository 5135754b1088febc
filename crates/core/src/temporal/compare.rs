//! The motion between two calibrations, of cameras of a rig relative to each other or of one pose, with its uncertainty.
//!
//! Derivation: docs/math/compare.md. Notation: A_i, B_i are cam_from_rig of camera i before and after; S is a set of cameras that
//! did not move relative to each other, b its first; M_i = A_i A_b⁻¹ (B_i B_b⁻¹)⁻¹ is old_from_new of camera i if b stayed;
//! e_i = Log M_i, E the covariance of all e_i.

use crate::covariance::is_covariance;
use crate::statistics::chi_square::tail;
use crate::statistics::variance_ratio::tail_with_estimated_noise;
use crate::{Error, Matrix6, Pose, Vector6};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The cameras of a rig by one calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct RigPoses {
    /// x_in_cam = cam_from_rig · x_in_rig, one entry a camera. The rig's frame may be any: it need not be the same twice.
    pub cam_from_rig: Vec<Pose>,
    /// Covariance of all cameras together, 6 rows a camera, left motions `[rotation_rad; translation_m]`, camera frames. Zero
    /// for the camera whose frame is the rig's.
    pub covariance: DMatrix<f64>,
    /// Whether the blocks between cameras are known.
    pub correlation: Correlation,
    /// Where the noise behind the covariance was estimated along (from loops of pairs, say): from how many redundant numbers. None where it was
    /// stated, or estimated from so many that it counts as known.
    pub noise_degrees_of_freedom: Option<f64>,
}

/// The correlation of the errors of one calibration's cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Correlation {
    /// The covariance of all cameras together holds them.
    Known,
    /// Nothing: the blocks between cameras are zero for want of knowledge. What is tested then holds for any correlation,
    /// docs/math/compare.md eq. (9), and small motions stay hidden.
    Unknown,
}

/// The motion of a camera (or a target).
#[derive(Debug, Clone, PartialEq)]
pub struct Moved {
    /// Which camera.
    pub camera: usize,
    /// x_in_old = old_from_new · x_in_new: the camera's present pose in its own old frame.
    pub old_from_new: Pose,
    /// 6×6 covariance of its small left motion, old camera frame.
    pub covariance: Matrix6,
    /// χ² of "it did not move", 6 degrees of freedom.
    pub chi2: f64,
    /// Chance of such a χ² or a larger one, had it not moved; by an F distribution where the noise was estimated.
    pub probability: f64,
}

/// The motions in a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct RigComparison {
    /// χ² of "no camera moved relative to the others".
    pub chi2: f64,
    /// 6 (cameras − 1).
    pub degrees_of_freedom: usize,
    /// Degrees of freedom of the noise in it where that was estimated, docs/math/compare.md eq. (11).
    pub noise_degrees_of_freedom: Option<f64>,
    /// Chance of such a χ² or a larger one, had nothing moved; by an F distribution where the noise was estimated.
    pub probability: f64,
    /// The largest set of cameras whose relative poses agree; all of them when nothing moved.
    pub unmoved: Vec<usize>,
    /// The others, with their motion relative to that set.
    pub moved: Vec<Moved>,
    /// Other sets as large that explain the poses about as well: when there are any, which cameras moved is not decided.
    pub alternatives: Vec<Vec<usize>>,
}

/// Sets of cameras looked at exhaustively; beyond, the camera that fits worst is left out, one after the other.
const MAX_SETS: usize = 20_000;

/// What moved between two calibrations of a rig, one camera after the other in the same order. `false_alarm` is the chance of saying
/// that something moved when nothing did, docs/math/compare.md eq. (7).
///
/// # Errors
/// `CountMismatch` for lists of different lengths; `InvalidSetting` for fewer than two cameras, a chance outside (0, 1), numbers that
/// are none, or a covariance that is not positive definite once the rig's frame is divided out.
pub fn compare_rigs(before: &RigPoses, after: &RigPoses, false_alarm: f64) -> Result<RigComparison, Error> {
    check(before, after, false_alarm)?;
    let differences = Differences { before, after };
    let n = before.cam_from_rig.len();
    let all: Vec<usize> = (0..n).collect();
    let (whole, degrees_of_freedom) = (differences.statistic(&all)?, 6 * (n - 1));
    let (unmoved, alternatives) = differences.largest_agreeing(all, false_alarm)?;
    let moved = (0..n)
        .filter(|camera| !unmoved.contains(camera))
        .map(|camera| differences.motion(camera, &unmoved))
        .collect::<Result<Vec<Moved>, Error>>()?;
    let Statistic { chi2, noise_degrees, .. } = whole;
    let noise_degrees_of_freedom = noise_degrees.is_finite().then_some(noise_degrees);
    let probability = whole.probability();
    if !(chi2.is_finite() && moved.iter().all(|m| is_covariance(&m.covariance))) {
        return Err(not_positive());
    }
    Ok(RigComparison {
        chi2,
        degrees_of_freedom,
        noise_degrees_of_freedom,
        probability,
        unmoved,
        moved,
        alternatives,
    })
}

/// How far two estimates of one pose b_from_a are apart: `old_from_new` of frame b, `camera` 0.
///
/// # Errors
/// `InvalidSetting` for numbers that are none, or a covariance that is not positive definite.
pub fn compare_poses(before: (&Pose, &Matrix6), after: (&Pose, &Matrix6)) -> Result<Moved, Error> {
    let old_from_new = *before.0 * after.0.inverse();
    let covariance = old_from_new.product_covariance(before.1, after.1);
    let e = old_from_new.log();
    if !e.iter().chain(covariance.iter()).all(|x| x.is_finite()) {
        return Err(not_a_number());
    }
    for given in [before.1, after.1] {
        if !is_covariance(given) {
            return Err(no_covariance(given.symmetric_eigenvalues().min()));
        }
    }
    let chi2 = e.dot(&covariance.cholesky().ok_or_else(not_positive)?.solve(&e));
    if !chi2.is_finite() {
        return Err(not_a_number());
    }
    Ok(Moved { camera: 0, old_from_new, covariance, chi2, probability: tail(6, chi2) })
}

fn check(before: &RigPoses, after: &RigPoses, false_alarm: f64) -> Result<(), Error> {
    let n = before.cam_from_rig.len();
    if after.cam_from_rig.len() != n {
        return Err(Error::CountMismatch { what: "cameras", seen: after.cam_from_rig.len(), needed: n });
    }
    let invalid = |setting, seen, needed| Err(Error::InvalidSetting { setting, seen, needed });
    if n < 2 {
        return invalid(
            "number of cameras",
            n as f64,
            "one camera alone cannot move relative to others; give two or more",
        );
    }
    if !(0.0 < false_alarm && false_alarm < 1.0) {
        return invalid("false_alarm", false_alarm, "it is a chance, between 0 and 1");
    }
    for places in [before, after] {
        if let Some(seen) = places.noise_degrees_of_freedom.filter(|degrees| !(0.0 < *degrees)) {
            let needed =
                "without a redundant number the noise was not estimated; state how well the poses are known";
            return invalid("noise_degrees_of_freedom", seen, needed);
        }
        if places.covariance.shape() != (6 * n, 6 * n) {
            return invalid(
                "rows of the covariance",
                places.covariance.nrows() as f64,
                "there must be 6 a camera",
            );
        }
        let poses = places.cam_from_rig.iter().flat_map(|p| p.rotation.iter().chain(p.translation.iter()));
        if !poses.chain(places.covariance.iter()).all(|x| x.is_finite()) {
            return Err(not_a_number());
        }
        if !is_covariance(&places.covariance) {
            return Err(no_covariance(places.covariance.symmetric_eigenvalues().min()));
        }
    }
    Ok(())
}

fn no_covariance(least_eigenvalue: f64) -> Error {
    let needed = "it must be symmetric, and its least eigenvalue not negative";
    Error::InvalidSetting { setting: "covariance of the poses", seen: least_eigenvalue, needed }
}

fn not_a_number() -> Error {
    Error::InvalidSetting {
        setting: "a pose or covariance",
        seen: f64::NAN,
        needed: "every number must be finite",
    }
}

fn not_positive() -> Error {
    let needed =
        "the covariance of the poses' differences must be positive definite; state how well they are known";
    Error::InvalidSetting { setting: "covariance", seen: 0.0, needed }
}

/// Two calibrations of the same cameras.
struct Differences<'a> {
    before: &'a RigPoses,
    after: &'a RigPoses,
}

/// e and E of some cameras, as seen from a camera that is taken to have stayed: eqs. (2)–(4).
struct SeenFrom {
    e: DVector<f64>,
    /// What each calibration adds to E.
    parts: [DMatrix<f64>; 2],
}

impl SeenFrom {
    fn covariance(&self) -> DMatrix<f64> {
        &self.parts[0] + &self.parts[1]
    }
}

/// χ² of some cameras, and its distribution.
#[derive(Clone, Copy)]
struct Statistic {
    chi2: f64,
    degrees_of_freedom: usize,
    /// Infinite where the noise is known.
    noise_degrees: f64,
}

impl Statistic {
    fn probability(&self) -> f64 {
        tail_with_estimated_noise(self.degrees_of_freedom, self.noise_degrees, self.chi2)
    }

    /// −2 log of the likelihood: χ² itself where the noise is known, eq. (12).
    fn cost(&self) -> f64 {
        match self.noise_degrees.is_finite() {
            true => {
                (self.noise_degrees + self.degrees_of_freedom as f64)
                    * (self.chi2 / self.noise_degrees).ln_1p()
            }
            false => self.chi2,
        }
    }
}

impl Differences<'_> {
    /// M_i, eq. (2).
    fn old_from_new(&self, camera: usize, base: usize) -> Pose {
        let cam_from_base = |rig: &RigPoses| rig.cam_from_rig[camera] * rig.cam_from_rig[base].inverse();
        cam_from_base(self.before) * cam_from_base(self.after).inverse()
    }

    /// The factor by which each calibration's own blocks bound the covariance of these cameras together, whatever their correlations: how
    /// many of them are uncertain, eq. (9). 1 where the correlations are known.
    fn bounds(&self, cameras: &[usize]) -> [f64; 2] {
        [self.before, self.after].map(|rig| match rig.correlation {
            Correlation::Known => 1.0,
            Correlation::Unknown => {
                let is_uncertain = |i: &&usize| rig.covariance.view((6 * **i, 6 * **i), (6, 6)).amax() != 0.0;
                cameras.iter().filter(is_uncertain).count().max(1) as f64
            }
        })
    }

    fn seen_from(&self, base: usize, cameras: &[usize], bounds: [f64; 2]) -> SeenFrom {
        let n = self.before.cam_from_rig.len();
        let mut e = DVector::zeros(6 * cameras.len());
        let mut by_before = DMatrix::zeros(6 * cameras.len(), 6 * n);
        let mut by_after = by_before.clone();
        for (row, &camera) in cameras.iter().enumerate() {
            let moved = self.old_from_new(camera, base);
            e.fixed_rows_mut::<6>(6 * row).copy_from(&moved.log());
            let from_base =
                (self.before.cam_from_rig[camera] * self.before.cam_from_rig[base].inverse()).adjoint();
            let put = |matrix: &mut DMatrix<f64>, camera: usize, block: Matrix6| {
                matrix.fixed_view_mut::<6, 6>(6 * row, 6 * camera).copy_from(&block);
            };
            put(&mut by_before, camera, Matrix6::identity());
            put(&mut by_before, base, -from_base);
            put(&mut by_after, camera, -moved.adjoint());
            put(&mut by_after, base, from_base);
        }
        let part = |by: &DMatrix<f64>, rig: &RigPoses, bound: f64| {
            let part = by * &rig.covariance * by.transpose() * bound;
            (&part + part.transpose()) * 0.5
        };
        SeenFrom {
            e,
            parts: [part(&by_before, self.before, bounds[0]), part(&by_after, self.after, bounds[1])],
        }
    }

    /// χ² of "these did not move relative to each other", eq. (5).
    fn statistic(&self, cameras: &[usize]) -> Result<Statistic, Error> {
        self.statistic_bounded(cameras, self.bounds(cameras))
    }

    fn statistic_bounded(&self, cameras: &[usize], bounds: [f64; 2]) -> Result<Statistic, Error> {
        let none = Statistic { chi2: 0.0, degrees_of_freedom: 0, noise_degrees: f64::INFINITY };
        let [base, others @ ..] = cameras else { return Ok(none) };
        if others.is_empty() {
            return Ok(none);
        }
        let seen = self.seen_from(*base, others, bounds);
        let solver = factor(seen.covariance())?;
        let noise_degrees = self.noise_degrees(&seen.parts, &solver);
        let chi2 = seen.e.dot(&solver.solve(&seen.e));
        Ok(Statistic { chi2, degrees_of_freedom: 6 * others.len(), noise_degrees })
    }

    /// Degrees of freedom of the noise in a covariance that is the sum of each calibration's part, eq. (11).
    fn noise_degrees(&self, parts: &[DMatrix<f64>; 2], sum: &Cholesky<f64, Dyn>) -> f64 {
        let share = |(rig, part): (&RigPoses, &DMatrix<f64>)| {
            rig.noise_degrees_of_freedom.map_or(0.0, |degrees| {
                let x = sum.solve(part);
                x.component_mul(&x.transpose()).sum() / degrees
            })
        };
        let uncertainty: f64 = [self.before, self.after].into_iter().zip(parts).map(share).sum();
        if 0.0 < uncertainty { sum.l_dirty().nrows() as f64 / uncertainty } else { f64::INFINITY }
    }

    /// Motion of a camera relative to a set that stayed: what the set's own differences say about its first camera is taken
    /// out, eq. (6).
    fn motion(&self, camera: usize, unmoved: &[usize]) -> Result<Moved, Error> {
        let together = [unmoved, &[camera]].concat();
        let (old_from_new, parts) = self.beside(camera, unmoved, self.bounds(&together))?;
        let solver = factor(&parts[0] + &parts[1])?;
        let covariance: Matrix6 = (&parts[0] + &parts[1]).fixed_view::<6, 6>(0, 0).into();
        let delta = old_from_new.log();
        let chi2 = delta.dot(&covariance.cholesky().ok_or_else(not_positive)?.solve(&delta));
        let noise_degrees = self.noise_degrees(&parts, &solver);
        let probability = Statistic { chi2, degrees_of_freedom: 6, noise_degrees }.probability();
        Ok(Moved { camera, old_from_new, covariance, chi2, probability })
    }

    /// A camera beside a set: M_m|S and what each calibration adds to E_m|S, eq. (6).
    fn beside(
        &self,
        camera: usize,
        unmoved: &[usize],
        bounds: [f64; 2],
    ) -> Result<(Pose, [DMatrix<f64>; 2]), Error> {
        // None agree where χ² overflows.
        let [base, others @ ..] = unmoved else { return Err(not_a_number()) };
        let base = *base;
        let cameras: Vec<usize> = others.iter().copied().chain([camera]).collect();
        let seen = self.seen_from(base, &cameras, bounds);
        let covariance = seen.covariance();
        let k = 6 * others.len();
        // (−K, 1)
        let mut by = DMatrix::zeros(6, k + 6);
        by.view_mut((0, k), (6, 6)).fill_with_identity();
        if 0 < k {
            let solver = factor(covariance.view((0, 0), (k, k)).into_owned())?;
            let gain = solver.solve(&covariance.view((0, k), (k, 6)).into_owned());
            by.view_mut((0, 0), (6, k)).copy_from(&-gain.transpose());
        }
        let expected = Vector6::from_column_slice((-by.columns(0, k) * seen.e.rows(0, k)).as_slice());
        let old_from_new = Pose::exp(&-expected) * self.old_from_new(camera, base);
        let part = |part: &DMatrix<f64>| {
            let part = &by * part * by.transpose();
            (&part + part.transpose()) * 0.5
        };
        Ok((old_from_new, [part(&seen.parts[0]), part(&seen.parts[1])]))
    }

    /// Whether these cameras stayed as they were: eq. (7).
    fn agree(&self, cameras: &[usize], all: &Statistic, false_alarm: f64) -> Result<bool, Error> {
        let n = cameras.len();
        let whole = all.probability();
        if n < 3 {
            return Ok(false_alarm <= whole);
        }
        if whole < 0.5 * false_alarm {
            return Ok(false);
        }
        let (limit, bounds) = (0.5 * false_alarm / n as f64, self.bounds(cameras));
        for i in 0..n {
            let rest = without(cameras, i);
            let chi2 = all.chi2 - self.statistic_bounded(&rest, bounds)?.chi2;
            let noise_degrees = match all.noise_degrees.is_finite() {
                true => {
                    let (_, parts) = self.beside(cameras[i], &rest, bounds)?;
                    self.noise_degrees(&parts, &factor(&parts[0] + &parts[1])?)
                }
                false => f64::INFINITY,
            };
            if (Statistic { chi2, degrees_of_freedom: 6, noise_degrees }).probability() < limit {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The largest set that agrees, the likeliest of its size, and its alternatives.
    fn largest_agreeing(
        &self,
        all: Vec<usize>,
        false_alarm: f64,
    ) -> Result<(Vec<usize>, Vec<Vec<usize>>), Error> {
        let n = all.len();
        let mut sets = vec![all];
        loop {
            let mut agreeing = Vec::new();
            for set in &sets {
                let statistic = self.statistic(set)?;
                if self.agree(set, &statistic, false_alarm)? {
                    agreeing.push((statistic.cost(), set.clone()));
                }
            }
            agreeing.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
            if let Some((least, _)) = agreeing.first() {
                let limit = least - 2.0 * false_alarm.ln();
                let mut found = agreeing.into_iter().filter(|(cost, _)| *cost < limit).map(|(_, set)| set);
                let best = found.next().unwrap_or_default();
                return Ok((best, found.collect()));
            }
            sets = self.smaller(&sets, n)?;
        }
    }

    /// All sets of one camera less; where they are too many, those that the best of the present ones leaves.
    fn smaller(&self, sets: &[Vec<usize>], n: usize) -> Result<Vec<Vec<usize>>, Error> {
        let size = sets[0].len() - 1;
        if binomial(n, size) <= MAX_SETS {
            return Ok(subsets(n, size));
        }
        let mut best: Option<(f64, &Vec<usize>)> = None;
        for set in sets {
            let chi2 = self.statistic(set)?.chi2;
            if best.is_none_or(|(least, _)| chi2 < least) {
                best = Some((chi2, set));
            }
        }
        let set = best.map_or(&sets[0], |(_, set)| set);
        Ok((0..set.len()).map(|i| without(set, i)).collect())
    }
}

fn factor(covariance: DMatrix<f64>) -> Result<Cholesky<f64, Dyn>, Error> {
    covariance.cholesky().ok_or_else(not_positive)
}

fn without(cameras: &[usize], i: usize) -> Vec<usize> {
    [&cameras[..i], &cameras[i + 1..]].concat()
}

/// Saturates far above `MAX_SETS`.
fn binomial(n: usize, k: usize) -> usize {
    (0..k.min(n - k)).fold(1usize, |c, i| c.saturating_mul(n - i) / (i + 1))
}

/// All sets of `k` of the numbers 0…n−1, in lexicographic order.
fn subsets(n: usize, k: usize) -> Vec<Vec<usize>> {
    let mut found = vec![Vec::new()];
    for place in 0..k {
        let longer = |set: Vec<usize>| {
            let first = set.last().map_or(0, |last| last + 1);
            (first..=n - (k - place)).map(move |next| [&set[..], &[next]].concat())
        };
        found = found.into_iter().flat_map(longer).collect();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subsets_are_all_and_counted() {
        for n in 1..8 {
            for k in 0..=n {
                let sets = subsets(n, k);
                assert_eq!(sets.len(), binomial(n, k), "{n} over {k}");
                assert!(sets.windows(2).all(|pair| pair[0] < pair[1]));
                assert!(sets.iter().all(|set| set.len() == k && set.windows(2).all(|p| p[0] < p[1])));
            }
        }
        assert!(MAX_SETS < binomial(200, 100));
    }
}
