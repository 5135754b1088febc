//! Tests whether the points of a target contradict each other about a motion. Half of them, hidden, in a shadow or behind a drop of water, are
//! displaced while the others are unchanged: that is a fault of the observation, not a motion of the camera.
//!
//! A single view of a few points cannot show it, because a pose of six numbers absorbs nearly every displacement of four corners. Relative to
//! the expected pose it is visible: hardly any motion leaves half of the points unchanged. During a fault its views are judged together, because
//! the mean of their residuals is more conclusive than each of them.
//!
//! ```text
//!   r = J δ + n          residuals of the points at the expected pose; δ its error, covariance D
//!   nothing  min_δ Σ |r − Jδ|²/σ² + δᵀD⁻¹δ
//!   motion   min_δ Σ |r − Jδ|²/σ² and 6 numbers; or nothing with one axis of δ free, and that number
//!   fault    nothing, without the points that are off, and two numbers for each of them
//! ```
//! docs/watch.md, "States".

use nalgebra::{Matrix2, Matrix6, SMatrix, Vector2, Vector6};
use resight_core::{Camera, Correspondence, Point, Pose};

/// What a number that is fitted must explain, as χ²: 2 ln of how many times smaller its error is than what it might have been. Six for a motion,
/// two for each point that is off.
const PER_NUMBER: f64 = 6.4;
/// What the choice among six axes costs besides, 2 ln 6.
const AMONG_AXES: f64 = 3.6;
/// By how much the fault must be the better story, as χ²: than a motion, and than that nothing happened. Where the view before had one
/// it must only be better: what hides corners does so for a while.
const THAN_MOTION: f64 = 6.0;
const THAN_NOTHING: f64 = 10.0;
/// Of the mean over the views of a fault the newest one is this share at least: what hides the corners may change, and the camera may move.
const NEWEST: f64 = 0.25;
/// Each of so few points is tried as the first that is off.
const FEW: usize = 8;

/// Whether points of the views so far contradicted each other, and their mean displacement.
#[derive(Debug, Default)]
pub(super) struct Disagreement {
    /// Empty where the last view had no fault.
    off: Vec<Off>,
    views: f64,
}

/// A point of a target, and the mean of its residuals since the fault began.
#[derive(Debug)]
struct Off {
    x_in_target: Point,
    mean: Vector2<f64>,
}

/// The comparison for the last view: the expected cam_from_target, and the inverse of its covariance.
pub(super) struct Expected<'a> {
    pub lens: &'a Camera,
    pub pose: Pose,
    pub information: Matrix6<f64>,
    /// Variance of the pixels over the stated one.
    pub noise: f64,
}

impl Disagreement {
    pub fn is_persistent(&self) -> bool {
        !self.off.is_empty()
    }

    pub fn end(&mut self) {
        self.off.clear();
    }

    /// Whether some of the points, half at most, are off while the others are where they are expected, and that is the likelier story than a
    /// motion to `now`: in this view, or in all since the fault began.
    pub fn is_in(&mut self, seen: &[Correspondence], expected: &Expected, now: &Pose) -> bool {
        let is_persistent = self.is_persistent();
        let at_home: Option<Vec<Row>> = seen.iter().map(|point| Row::new(point, expected)).collect();
        let Some(mut rows) = at_home else {
            self.end();
            return false;
        };
        let by_motion: Option<f64> = seen.iter().map(|point| off(point, expected, now)).sum();
        let of_view = weigh(&rows, &expected.information);
        let is_fault = of_view.is_fault(by_motion.unwrap_or(f64::INFINITY), is_persistent);
        self.add(seen, &rows);
        let is_in_all = is_persistent && !of_view.is_of_most && {
            self.mean_of(seen, &mut rows);
            let all = weigh(&rows, &expected.information);
            all.is_fault(all.by_motion, true)
        };
        if !(is_fault || is_in_all) {
            self.end();
        }
        is_fault || is_in_all
    }

    fn add(&mut self, seen: &[Correspondence], rows: &[Row]) {
        self.views = if self.is_persistent() { self.views + 1.0 } else { 1.0 };
        let share = (1.0 / self.views).max(NEWEST);
        for (point, row) in seen.iter().zip(rows) {
            match self.off.iter_mut().find(|off| off.x_in_target == point.x_in_target) {
                Some(off) => off.mean += share * (row.residual - off.mean),
                None => self.off.push(Off { x_in_target: point.x_in_target, mean: row.residual }),
            }
        }
    }

    /// The rows as the mean of the views since the fault began.
    fn mean_of(&self, seen: &[Correspondence], rows: &mut [Row]) {
        // Of a mean that forgets, the variance is this much smaller.
        let readings = self.views.min((2.0 - NEWEST) / NEWEST);
        for (point, row) in seen.iter().zip(rows) {
            if let Some(off) = self.off.iter().find(|off| off.x_in_target == point.x_in_target) {
                (row.residual, row.variance) = (off.mean, row.variance / readings);
            }
        }
    }
}

/// A point at the expected pose.
struct Row {
    residual: Vector2<f64>,
    /// Variance of each coordinate.
    variance: f64,
    by_motion: SMatrix<f64, 2, 6>,
}

impl Row {
    fn new(point: &Correspondence, expected: &Expected) -> Option<Self> {
        let x = expected.pose * point.x_in_target;
        let (pixel, by_x) = expected.lens.project_with_jacobian(&x)?;
        // Left motion: dx = ω × x + ν.
        let mut by_motion = SMatrix::<f64, 3, 6>::zeros();
        by_motion.fixed_view_mut::<3, 3>(0, 0).copy_from(&-x.cross_matrix());
        by_motion.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        let variance = expected.noise * own_variance(point, &by_x);
        Some(Row { residual: point.pixel - pixel, variance, by_motion: by_x * by_motion })
    }
}

/// χ² of the three stories.
struct Weighed {
    nothing: f64,
    fault: f64,
    by_motion: f64,
    /// What a turn about one axis of the camera, or a shift along one, leaves, its number and the choice of the axis counted: after a gap a small
    /// roll and errors that may have grown look like two corners that are off.
    by_axis: f64,
    /// Number of displaced points, and whether they are more than half.
    away: usize,
    is_of_most: bool,
}

impl Weighed {
    /// `by_motion`: what a motion leaves, its six numbers not counted.
    fn is_fault(&self, by_motion: f64, is_persistent: bool) -> bool {
        let [than_motion, than_nothing] = if is_persistent { [0.0; 2] } else { [THAN_MOTION, THAN_NOTHING] };
        0 < self.away
            && !self.is_of_most
            && self.fault + than_nothing <= self.nothing
            && self.fault + than_motion < self.by_axis.min(by_motion + 6.0 * PER_NUMBER)
    }
}

/// Normal equations of δ.
struct Fit {
    information: Matrix6<f64>,
    right: Vector6<f64>,
    squares: f64,
}

impl Fit {
    fn add(&mut self, row: &Row, sign: f64) {
        let weight = sign / row.variance;
        self.information += weight * row.by_motion.transpose() * row.by_motion;
        self.right += weight * row.by_motion.transpose() * row.residual;
        self.squares += weight * row.residual.norm_squared();
    }

    /// χ² at the best δ, and that and its covariance.
    fn solved(&self) -> Option<(f64, Vector6<f64>, Matrix6<f64>)> {
        let factor = self.information.cholesky()?;
        let best = factor.solve(&self.right);
        Some((self.squares - self.right.dot(&best), best, factor.inverse()))
    }
}

/// Compares the three hypotheses about some points, given the expected pose.
fn weigh(rows: &[Row], known: &Matrix6<f64>) -> Weighed {
    let fit = |information: Matrix6<f64>| {
        let mut fit = Fit { information, right: Vector6::zeros(), squares: 0.0 };
        rows.iter().for_each(|row| fit.add(row, 1.0));
        fit
    };
    let chi2 = |fit: &Fit| fit.solved().map_or(0.0, |(chi2, ..)| chi2);
    let nothing = chi2(&fit(*known));
    // Without anything known beforehand; a trace of it keeps the equations regular.
    let by_motion = chi2(&fit(known * 1e-9));
    let with_axis = |axis: usize| chi2(&fit(without_axis(known, axis)));
    let by_axis = (0..6).map(with_axis).fold(f64::INFINITY, f64::min) + PER_NUMBER + AMONG_AXES;
    let firsts: Vec<Option<usize>> = match rows.len() {
        few @ 0..=FEW => (0..few).map(Some).collect(),
        _ => vec![None],
    };
    let least = firsts.into_iter().map(|first| without(rows, fit(*known), first));
    let best = least.min_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let Without { chi2: fault, away, is_of_most } =
        best.unwrap_or(Without { chi2: nothing, away: 0, is_of_most: false });
    Weighed { nothing, fault, by_motion, by_axis, away, is_of_most }
}

/// The information about δ beside a motion along one axis of any size: that of the others, the axis eliminated. A trace of it keeps the equations
/// regular.
fn without_axis(known: &Matrix6<f64>, axis: usize) -> Matrix6<f64> {
    let column = known.column(axis).into_owned();
    known - column * column.transpose() * ((1.0 - 1e-9) / known[(axis, axis)])
}

/// What is left without the points that are off, two numbers counted for each of them.
struct Without {
    chi2: f64,
    away: usize,
    is_of_most: bool,
}

/// Leaves out one point after the other, the one that is worth most each time, as long as it is worth its two numbers.
fn without(rows: &[Row], mut fit: Fit, first: Option<usize>) -> Without {
    let mut stays = vec![true; rows.len()];
    let mut away = 0;
    let nothing = Without { chi2: 0.0, away: 0, is_of_most: false };
    loop {
        let Some((chi2, best, covariance)) = fit.solved() else { return nothing };
        let now = Without { chi2: chi2 + away as f64 * 2.0 * PER_NUMBER, away, is_of_most: false };
        let worth = |i: usize| {
            let row = &rows[i];
            let left = row.residual - row.by_motion * best;
            let spread =
                Matrix2::identity() * row.variance - row.by_motion * covariance * row.by_motion.transpose();
            spread.cholesky().map_or(0.0, |factor| left.dot(&factor.solve(&left)))
        };
        let next =
            (0..rows.len()).filter(|i| stays[*i]).map(|i| (i, worth(i))).max_by(|a, b| a.1.total_cmp(&b.1));
        let forced = first.filter(|_| away == 0).map(|i| (i, f64::INFINITY));
        match forced.or(next) {
            Some((i, worth)) if 2.0 * PER_NUMBER < worth => {
                if rows.len() < 2 * (away + 1) {
                    return Without { is_of_most: true, ..now };
                }
                fit.add(&rows[i], -1.0);
                (stays[i], away) = (false, away + 1);
            }
            _ => return now,
        }
    }
}

/// Variance of each coordinate of a pixel, with what the target's own points err by.
fn own_variance(point: &Correspondence, by_x: &SMatrix<f64, 2, 3>) -> f64 {
    point.sigma_px * point.sigma_px + (by_x * point.sigma_m).norm_squared() / 2.0
}

/// χ² of a point against where a pose puts it.
fn off(point: &Correspondence, expected: &Expected, pose: &Pose) -> Option<f64> {
    let (pixel, by_x) = expected.lens.project_with_jacobian(&(*pose * point.x_in_target))?;
    Some((point.pixel - pixel).norm_squared() / (expected.noise * own_variance(point, &by_x)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight::render::Pcg;
    use resight_core::Lens;
    use resight_core::camera::{CameraMatrix, Pinhole};

    const SIGMA_PX: f64 = 0.2;

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 320.0, cy_px: 240.0 };
        Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a lens")), size: None }
    }

    fn home() -> Pose {
        Pose::exp(&Vector6::new(0.25, -0.45, 0.1, 0.12, -0.08, 1.2))
    }

    /// Returns the corners of a tag of 120 mm from a pose, each displaced by `fault`.
    fn corners(pose: &Pose, seed: u64, fault: impl Fn(usize) -> Vector2<f64>) -> Vec<Correspondence> {
        let mut chance = Pcg::new(seed);
        let corner = |(i, (x, y)): (usize, (f64, f64))| {
            let point = Point::new(0.06 * x, 0.06 * y, 0.0);
            let noise = Vector2::from_fn(|_, _| SIGMA_PX * chance.normal());
            let pixel = camera().project(&(*pose * point)).expect("in front") + noise + fault(i);
            Correspondence::new(&camera(), point, pixel, SIGMA_PX).expect("a point")
        };
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].into_iter().enumerate().map(corner).collect()
    }

    fn says(seen: &[Correspondence]) -> bool {
        let estimate = resight_core::locate::locate(seen, &camera(), &Default::default()).expect("a pose");
        let known = Vector6::new(1e-8, 1e-8, 1e-8, 1e-9, 1e-9, 1e-9).map(|variance| 1.0 / variance);
        let information = Matrix6::from_diagonal(&known);
        let expected = Expected { lens: &camera(), pose: home(), information, noise: 1.0 };
        Disagreement::default().is_in(seen, &expected, &estimate.cam_from_target)
    }

    /// After a gap errors may have grown to 0.04° and 0.5 mm: a roll of 0.15° to 0.4° with that is a motion, one or two corners that are off
    /// are still a fault.
    #[test]
    fn a_small_roll_after_a_gap_is_no_disagreement() {
        let sigma = Vector6::new(7e-4, 7e-4, 7e-4, 5e-4, 5e-4, 5e-4);
        let information = Matrix6::from_diagonal(&sigma.map(|s| 1.0 / (s * s)));
        let says = |seen: &[Correspondence]| {
            let estimate =
                resight_core::locate::locate(seen, &camera(), &Default::default()).expect("a pose");
            let expected = Expected { lens: &camera(), pose: home(), information, noise: 1.0 };
            Disagreement::default().is_in(seen, &expected, &estimate.cam_from_target)
        };
        let (mut false_ones, mut found, mut all) = (0, 0, 0);
        for seed in 0..100 {
            let mut chance = Pcg::new(500 + seed);
            let error = sigma.map(|s| s * chance.normal());
            let roll = f64::to_radians(0.15 + 0.25 * (seed as f64 / 100.0));
            let now = Pose::exp(&(error + Vector6::ith(2, roll))) * home();
            false_ones += u32::from(says(&corners(&now, seed, |_| Vector2::zeros())));
            let here = Pose::exp(&error) * home();
            for pair in [[0, 1], [1, 2], [0, 2], [1, 1]] {
                let angle = 0.7 * f64::from(all);
                let off = 1.5 * Vector2::new(angle.cos(), angle.sin());
                let fault = |i: usize| if pair.contains(&i) { off } else { Vector2::zeros() };
                found += u32::from(says(&corners(&here, 3000 + seed, fault)));
                all += 1;
            }
        }
        println!("{false_ones} of 100 rolls are faults, {found} of {all} faults are found");
        assert!(false_ones <= 2 && 80 * all < 100 * found, "{false_ones}, {found} of {all}");
    }

    /// One or two corners off by a pixel and a third, in any direction and any pair: found in nearly all views, and in none where nothing is.
    #[test]
    fn corners_that_are_off_alone_are_found() {
        let (mut found, mut all, mut false_ones) = (0, 0, 0);
        for seed in 0..40 {
            false_ones += u32::from(says(&corners(&home(), seed, |_| Vector2::zeros())));
            for pair in [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 1]] {
                let angle = 0.7 * f64::from(all);
                let off = 1.3 * Vector2::new(angle.cos(), angle.sin());
                let fault = |i: usize| if pair.contains(&i) { off } else { Vector2::zeros() };
                found += u32::from(says(&corners(&home(), 1000 + seed, fault)));
                all += 1;
            }
        }
        println!("{found} of {all} found, {false_ones} of 40 falsely");
        assert!(90 * all < 100 * found && false_ones == 0, "{found} of {all}, {false_ones} falsely");
    }

    /// Turns about and shifts along each axis: a motion that one view shows never counts as a fault; one that is just visible may, in one of
    /// its views, seldom enough not to be late by more than a view.
    #[test]
    fn a_motion_is_no_disagreement() {
        let (mut false_ones, mut all) = (0, 0);
        for seed in 0..20 {
            for (axis, least) in [(0, 5e-4), (1, 5e-4), (2, 5e-3), (3, 5e-4), (4, 5e-4), (5, 3e-3)] {
                for size in [1.0, 2.0, 5.0, 20.0, -1.5, -6.0] {
                    let now = Pose::exp(&Vector6::ith(axis, size * least)).inverse() * home();
                    let seen = corners(&now, 7000 + seed, |_| Vector2::zeros());
                    let is_large = 5.0 < f64::abs(size);
                    assert!(!(is_large && says(&seen)), "{seed}: {size} × {least} of {axis}");
                    false_ones += u32::from(says(&seen));
                    all += 1;
                }
            }
        }
        assert!(20 * false_ones < all, "{false_ones} of {all}");
    }
}
