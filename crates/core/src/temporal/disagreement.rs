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

use crate::{Camera, Correspondence, Matrix6, Point, Pose, Vector6};
use nalgebra::{Matrix2, SMatrix, Vector2};

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
pub struct Disagreement {
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

/// What a view is compared with.
pub struct Expected<'a> {
    /// The lens, at the size of the image.
    pub lens: &'a Camera,
    /// The expected `cam_from_target`.
    pub cam_from_target: Pose,
    /// The inverse of the covariance of its small left motion `[rotation_rad; translation_m]`.
    pub information: Matrix6,
    /// Variance of the pixels over the stated one.
    pub noise: f64,
}

impl Disagreement {
    /// Returns whether the last view had a fault.
    pub fn is_persistent(&self) -> bool {
        !self.off.is_empty()
    }

    /// Forgets the views so far.
    pub fn end(&mut self) {
        self.off.clear();
    }

    /// Returns whether some of the points, half at most, are off while the others are where they are expected, and that is the likelier story than a
    /// motion to `now`: in this view, or in all since the fault began.
    pub fn is_in(&mut self, seen: &[Correspondence], expected: &Expected, now: &Pose) -> bool {
        let is_persistent = self.is_persistent();
        let at_home: Option<Vec<Row>> = seen.iter().map(|point| Row::new(point, expected)).collect();
        let Some(mut rows) = at_home else {
            self.end();
            return false;
        };
        let by_motion: Option<f64> = seen.iter().map(|point| off(point, expected, now)).sum();
        let of_view = weigh(&rows, &expected.information, is_persistent);
        let is_fault = of_view.is_fault(by_motion.unwrap_or(f64::INFINITY), is_persistent);
        self.add(seen, &rows);
        let is_in_all = is_persistent && !of_view.is_of_most && {
            self.mean_of(seen, &mut rows);
            let all = weigh(&rows, &expected.information, true);
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
        let x = expected.cam_from_target * point.x_in_target;
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
        let than_motion = if is_persistent { 0.0 } else { THAN_MOTION };
        0 < self.away
            && !self.is_of_most
            && self.fault + than_nothing(is_persistent) <= self.nothing
            && self.fault + than_motion < self.by_axis.min(by_motion + 6.0 * PER_NUMBER)
    }
}

fn than_nothing(is_persistent: bool) -> f64 {
    if is_persistent { 0.0 } else { THAN_NOTHING }
}

/// Normal equations of δ.
#[derive(Clone, Copy)]
struct Fit {
    information: Matrix6,
    right: Vector6,
    squares: f64,
}

impl Fit {
    /// Those of the rows alone.
    fn new(rows: &[Row]) -> Self {
        let mut fit = Fit { information: Matrix6::zeros(), right: Vector6::zeros(), squares: 0.0 };
        rows.iter().for_each(|row| fit.add(row, 1.0));
        fit
    }

    /// Those with what is known of δ besides.
    fn with(mut self, known: &Matrix6) -> Self {
        self.information += known;
        self
    }

    fn add(&mut self, row: &Row, sign: f64) {
        let weight = sign / row.variance;
        self.information += weight * row.by_motion.transpose() * row.by_motion;
        self.right += weight * row.by_motion.transpose() * row.residual;
        self.squares += weight * row.residual.norm_squared();
    }

    /// χ² at the best δ; 0 where there is none.
    fn chi2(&self) -> f64 {
        let factor = self.information.cholesky();
        factor.map_or(0.0, |factor| self.squares - self.right.dot(&factor.solve(&self.right)))
    }

    /// χ² at the best δ, and that and its covariance.
    fn solved(&self) -> Option<(f64, Vector6, Matrix6)> {
        let factor = self.information.cholesky()?;
        let best = factor.solve(&self.right);
        Some((self.squares - self.right.dot(&best), best, factor.inverse()))
    }
}

/// Compares the three hypotheses about some points, given the expected pose. What a fault explains is at most what there is: where that is less than a
/// fault must explain, there is none, and nothing else is compared.
fn weigh(rows: &[Row], known: &Matrix6, is_persistent: bool) -> Weighed {
    let seen = Fit::new(rows);
    let nothing = seen.with(known).chi2();
    if nothing < 2.0 * PER_NUMBER + than_nothing(is_persistent) {
        return Weighed {
            nothing,
            fault: nothing,
            by_motion: nothing,
            by_axis: nothing,
            away: 0,
            is_of_most: false,
        };
    }
    // Without anything known beforehand; a trace of it keeps the equations regular.
    let by_motion = seen.with(&(known * 1e-9)).chi2();
    let with_axis = |axis: usize| seen.with(&without_axis(known, axis)).chi2();
    let by_axis = (0..6).map(with_axis).fold(f64::INFINITY, f64::min) + PER_NUMBER + AMONG_AXES;
    let firsts = match rows.len() {
        few @ 0..=FEW => few,
        _ => 1,
    };
    let first = |i: usize| (rows.len() <= FEW).then_some(i);
    let least = (0..firsts).map(|i| without(rows, seen.with(known), first(i)));
    let best = least.min_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let Without { chi2: fault, away, is_of_most } =
        best.unwrap_or(Without { chi2: nothing, away: 0, is_of_most: false });
    Weighed { nothing, fault, by_motion, by_axis, away, is_of_most }
}

/// The information about δ beside a motion along one axis of any size: that of the others, the axis eliminated. A trace of it keeps the equations
/// regular.
fn without_axis(known: &Matrix6, axis: usize) -> Matrix6 {
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
