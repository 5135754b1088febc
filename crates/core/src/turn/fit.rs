//! The turn of maximum likelihood over the landmarks that agree, and how sure it is: docs/math/turn.md sections 2 and 3.

use super::{Landmark, Turn};
use crate::{Bearing, Camera, Error, Pixel};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// A landmark as the search and the fit need it.
pub(super) struct Prepared {
    /// In the input.
    index: usize,
    pub in_reference: Bearing,
    /// Direction of the pixel now.
    pub now: Bearing,
    /// Pixels a radian there.
    pub px_per_rad: f64,
    pixel: Pixel,
    information: Matrix2<f64>,
}

impl Prepared {
    /// Those within the lens' field: what is found elsewhere, in a fisheye's dark corners for one, has no direction.
    ///
    /// # Errors
    /// `CovarianceNotPositive`.
    pub fn all(landmarks: &[Landmark], camera: &Camera) -> Result<Vec<Self>, Error> {
        let prepared = |(index, landmark): (usize, &Landmark)| {
            let now = camera.bearing(&landmark.pixel).ok()?;
            Some(Prepared::new(index, landmark, now, camera))
        };
        landmarks.iter().enumerate().filter_map(prepared).collect()
    }

    fn new(index: usize, landmark: &Landmark, now: Bearing, camera: &Camera) -> Result<Self, Error> {
        let slope = camera.project_with_jacobian(&now).map_or(0.0, |(_, slope)| slope.norm());
        let covariance = &landmark.covariance_px2;
        let factor = covariance.cholesky().ok_or_else(|| Error::CovarianceNotPositive {
            index,
            seen: covariance.symmetric_eigenvalues().min(),
        })?;
        Ok(Prepared {
            index,
            in_reference: landmark.in_reference,
            now,
            px_per_rad: slope * core::f64::consts::FRAC_1_SQRT_2,
            pixel: landmark.pixel,
            information: factor.inverse(),
        })
    }
}

/// Residual and derivative of one landmark.
struct Row {
    index: usize,
    e: Vector2<f64>,
    j: Matrix2x3<f64>,
    information: Matrix2<f64>,
}

impl Row {
    /// None where the turn puts it out of the lens' field.
    fn new(landmark: &Prepared, camera: &Camera, r: &Matrix3<f64>) -> Option<Self> {
        let y = r * landmark.in_reference.into_inner();
        let (at, slope) = camera.project_with_jacobian(&y)?;
        let j = -(slope * y.cross_matrix());
        let (index, information) = (landmark.index, landmark.information);
        Some(Row { index, e: landmark.pixel - at, j, information })
    }

    /// eᵀ C⁻¹ e.
    fn chi2(&self) -> f64 {
        self.e.dot(&(self.information * self.e))
    }

    fn normal(&self) -> Matrix3<f64> {
        self.j.tr_mul(&self.information) * self.j
    }

    fn gradient(&self) -> Vector3<f64> {
        self.j.tr_mul(&self.information) * self.e
    }
}

/// Steps of selection and Gauss–Newton; the selection settles within three, the step squares its error.
const STEPS: usize = 6;
/// Whitened distance, in units of the robust scatter, that one good landmark in a thousand exceeds: √(2 ln 1000).
const GATE: f64 = 3.7169;
/// Share of χ² that the gate leaves, docs/math/turn.md eq. (4).
const KEPT: f64 = 0.993_085;
/// Median of χ² with two degrees of freedom: 2 ln 2.
const MEDIAN_OF_TWO: f64 = 2.0 * core::f64::consts::LN_2;
/// The residuals of the reference itself are zero, its errors are not: no picture is twice as good as stated.
const LEAST_NOISE_FACTOR: f64 = 0.25;
/// Inverse condition of H below which the landmarks lie too close together to tell a turn about them.
const MIN_CONDITION: f64 = 1e-10;

/// The minimum.
pub(super) struct Fit {
    r: Matrix3<f64>,
    rows: Vec<Row>,
    /// By number in the input.
    pub used: Vec<usize>,
}

impl Fit {
    pub fn of(
        all: &[Prepared],
        camera: &Camera,
        start: &Matrix3<f64>,
        threshold_px: f64,
    ) -> Result<Self, Error> {
        let mut r = *start;
        let mut rows = agreeing(all, camera, &r, threshold_px);
        for _ in 0..STEPS {
            let gradient = rows.iter().map(Row::gradient).sum::<Vector3<f64>>();
            r = turned(&r, &(inverse(&information(&rows))? * gradient));
            rows = agreeing(all, camera, &r, threshold_px);
        }
        let used = rows.iter().map(|row| row.index).collect();
        Ok(Fit { r, rows, used })
    }

    /// With covariance, eqs. (3)–(6).
    pub fn turn(&self, all: &[Prepared], landmarks: &[Landmark]) -> Result<Turn, Error> {
        let h = information(&self.rows);
        let h_inverse = inverse(&h)?;
        let freedom = (2 * self.rows.len()) as f64 - 3.0;
        let chi2 = self.rows.iter().map(Row::chi2).sum::<f64>();
        let noise_factor = (chi2 / (KEPT * freedom)).max(LEAST_NOISE_FACTOR);
        let coherence = self.coherence(&h_inverse, noise_factor, landmarks);
        let widened = noise_factor * freedom / (freedom - 2.0) * coherence;
        let square = self.rows.iter().map(|row| row.e.norm_squared()).sum::<f64>();
        let found = Turn {
            now_from_reference: self.r,
            covariance: h_inverse * widened,
            used: self.used.clone(),
            given: all.len(),
            noise_factor,
            coherence,
            rms_px: (square / (2 * self.rows.len()) as f64).sqrt(),
        };
        match (found.covariance.sum() + found.now_from_reference.sum()).is_finite() {
            true => Ok(found),
            false => Err(too_close(0.0)),
        }
    }

    /// κ², eq. (5).
    fn coherence(&self, h_inverse: &Matrix3<f64>, noise_factor: f64, landmarks: &[Landmark]) -> f64 {
        let mut sums = std::collections::BTreeMap::<u32, (Vector3<f64>, Matrix3<f64>)>::new();
        for row in &self.rows {
            let sum = sums.entry(landmarks[row.index].neighbourhood).or_default();
            sum.0 += row.gradient();
            sum.1 += row.normal();
        }
        let seen: f64 = sums.values().map(|(g, _)| g.dot(&(h_inverse * g))).sum();
        let share = |h: &Matrix3<f64>| {
            let part = h_inverse * h;
            (part * part).trace()
        };
        let expected = 3.0 - sums.values().map(|(_, h)| share(h)).sum::<f64>();
        // One neighbourhood alone cannot tell.
        let ratio = if LEAST_EXPECTED < expected { seen / (noise_factor * expected) } else { 1.0 };
        if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
    }
}

/// Of the three that many small neighbourhoods give: below it too few neighbourhoods compare.
const LEAST_EXPECTED: f64 = 1.0;

/// Those within the threshold and within the gate of the robust scatter.
fn agreeing(all: &[Prepared], camera: &Camera, r: &Matrix3<f64>, threshold_px: f64) -> Vec<Row> {
    let mut rows: Vec<Row> = all.iter().filter_map(|landmark| Row::new(landmark, camera, r)).collect();
    rows.retain(|row| row.e.norm() <= threshold_px);
    let mut chi2: Vec<f64> = rows.iter().map(Row::chi2).collect();
    chi2.sort_unstable_by(f64::total_cmp);
    let Some(median) = chi2.get(chi2.len() / 2) else { return rows };
    let limit = GATE * GATE * (median / MEDIAN_OF_TWO).max(LEAST_NOISE_FACTOR);
    rows.retain(|row| row.chi2() <= limit);
    rows
}

fn information(rows: &[Row]) -> Matrix3<f64> {
    rows.iter().map(Row::normal).sum()
}

fn inverse(h: &Matrix3<f64>) -> Result<Matrix3<f64>, Error> {
    let inverse = h.cholesky().map(|factor| factor.inverse()).ok_or_else(|| too_close(0.0))?;
    let metric = 1.0 / (h.trace() * inverse.trace());
    if MIN_CONDITION < metric { Ok(inverse) } else { Err(too_close(metric)) }
}

fn too_close(metric: f64) -> Error {
    let reason = "the landmarks that agree lie too close together to tell a turn about them; use a picture with more of them";
    Error::DegenerateView { reason, metric, needed: MIN_CONDITION }
}

/// Turned on the left by a small rotation vector, orthonormal to rounding.
fn turned(r: &Matrix3<f64>, turn: &Vector3<f64>) -> Matrix3<f64> {
    crate::pose::orthonormalized(&(nalgebra::Rotation3::new(*turn).matrix() * r))
}
