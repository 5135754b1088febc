//! The rotation of maximum likelihood over the landmarks that agree, and how uncertain it is: docs/math/turn.md sections 2 and 3.

use super::{Landmark, RelativeRotation};
use crate::{Bearing, Camera, Error, Pixel};
use nalgebra::{Matrix2, Matrix2x4, Matrix3, Matrix4, Matrix4x2, Matrix4x3, Vector2, Vector4};

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
    bent_px: Vector2<f64>,
    unobserved_px: Matrix2<f64>,
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
            bent_px: landmark.bent_px,
            unobserved_px: landmark.unobserved_px,
            information: factor.inverse(),
        })
    }
}

/// What is estimated: the rotation, and the tone curve's bend in its own standard deviations.
#[derive(Clone, Copy)]
struct Estimate {
    r: Matrix3<f64>,
    bend: f64,
}

impl Estimate {
    /// Turned on the left by a small rotation vector, orthonormal to rounding; the bend is linear.
    fn moved(&self, step: &Vector4<f64>) -> Self {
        let relative_rotation = nalgebra::Rotation3::new(step.xyz());
        let r = crate::pose::orthonormalized(&(relative_rotation.matrix() * self.r));
        Estimate { r, bend: self.bend + step.w }
    }
}

/// Residual and derivative of one landmark.
struct Row {
    index: usize,
    e: Vector2<f64>,
    /// By turn and bend.
    j: Matrix2x4<f64>,
    unobserved_px: Matrix2<f64>,
    information: Matrix2<f64>,
}

impl Row {
    /// None where the rotation puts it out of the lens' field.
    fn new(landmark: &Prepared, camera: &Camera, at: &Estimate) -> Option<Self> {
        let y = at.r * landmark.in_reference.into_inner();
        let (pixel, slope) = camera.project_with_jacobian(&y)?;
        let mut j = Matrix2x4::zeros();
        j.fixed_columns_mut::<3>(0).copy_from(&-(slope * y.cross_matrix()));
        j.set_column(3, &landmark.bent_px);
        let (index, information) = (landmark.index, landmark.information);
        let e = landmark.pixel - pixel - landmark.bent_px * at.bend;
        Some(Row { index, e, j, unobserved_px: landmark.unobserved_px, information })
    }

    /// eᵀ C⁻¹ e.
    fn chi2(&self) -> f64 {
        self.e.dot(&(self.information * self.e))
    }

    fn normal(&self) -> Matrix4<f64> {
        self.j.tr_mul(&self.information) * self.j
    }

    fn gradient(&self) -> Vector4<f64> {
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
/// The residuals of the reference itself are zero, its errors are not: no image is twice as good as stated.
const LEAST_NOISE_FACTOR: f64 = 0.25;
/// Inverse condition of H below which the landmarks lie too close together to tell a rotation about them.
const MIN_CONDITION: f64 = 1e-10;

/// The minimum.
pub(super) struct Fit {
    at: Estimate,
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
        let mut at = Estimate { r: *start, bend: 0.0 };
        let mut rows = agreeing(all, camera, &at, threshold_px);
        for _ in 0..STEPS {
            // The bend is expected to be zero, give or take one: an observation more.
            let gradient = rows.iter().map(Row::gradient).sum::<Vector4<f64>>() - Vector4::w() * at.bend;
            at = at.moved(&(inverse(&information(&rows))? * gradient));
            rows = agreeing(all, camera, &at, threshold_px);
        }
        let used = rows.iter().map(|row| row.index).collect();
        Ok(Fit { at, rows, used })
    }

    /// With covariance, eqs. (3)–(6).
    pub fn relative_rotation(
        &self,
        all: &[Prepared],
        landmarks: &[Landmark],
    ) -> Result<RelativeRotation, Error> {
        let h_inverse = inverse(&information(&self.rows))?;
        let freedom = (2 * self.rows.len()) as f64 - 3.0;
        let chi2 = self.rows.iter().map(Row::chi2).sum::<f64>() + self.at.bend.powi(2);
        let noise_factor = (chi2 / (KEPT * freedom)).max(LEAST_NOISE_FACTOR);
        let coherence = self.coherence(&h_inverse, noise_factor, landmarks);
        let widened = noise_factor * freedom / (freedom - 2.0) * coherence;
        let square = self.rows.iter().map(|row| row.e.norm_squared()).sum::<f64>();
        let found = RelativeRotation {
            now_from_reference: self.at.r,
            covariance: of_turn(&h_inverse) * widened + self.unseen(&h_inverse),
            used: self.used.clone(),
            given: all.len(),
            bend: self.at.bend,
            noise_factor,
            coherence,
            rms_px: (square / (2 * self.rows.len()) as f64).sqrt(),
        };
        match (found.covariance.sum() + found.now_from_reference.sum()).is_finite() {
            true => Ok(found),
            false => Err(too_close(0.0)),
        }
    }

    /// What errors that no residual shows do to the rotation, eq. (6).
    fn unseen(&self, h_inverse: &Matrix4<f64>) -> Matrix3<f64> {
        let by_row = |row: &Row| row.j.tr_mul(&row.information) * row.unobserved_px;
        let by_turn = h_inverse * self.rows.iter().map(by_row).sum::<Matrix4x2<f64>>();
        of_turn(&(by_turn * by_turn.transpose()))
    }

    /// κ², eq. (5).
    fn coherence(&self, h_inverse: &Matrix4<f64>, noise_factor: f64, landmarks: &[Landmark]) -> f64 {
        let mut sums = std::collections::BTreeMap::<u32, (Vector4<f64>, Matrix4<f64>)>::new();
        for row in &self.rows {
            let sum = sums.entry(landmarks[row.index].neighbourhood).or_default();
            sum.0 += row.gradient();
            sum.1 += row.normal();
        }
        let Some(weight) = of_turn(h_inverse).try_inverse() else { return 1.0 };
        let to_turn: Matrix4x3<f64> = h_inverse.fixed_columns::<3>(0).into_owned();
        let (mut seen, mut expected) = (0.0, 0.0);
        for (gradient, normal) in sums.values() {
            let step = to_turn.tr_mul(gradient);
            seen += step.dot(&(weight * step));
            let own = normal - normal * h_inverse * normal;
            expected += (weight * to_turn.tr_mul(&(own * to_turn))).trace();
        }
        // One neighbourhood alone cannot tell.
        let ratio = if LEAST_EXPECTED < expected { seen / (noise_factor * expected) } else { 1.0 };
        if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
    }
}

/// The part of the rotation.
fn of_turn(covariance: &Matrix4<f64>) -> Matrix3<f64> {
    covariance.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Of the three that many small neighbourhoods give: below it too few neighbourhoods compare.
const LEAST_EXPECTED: f64 = 1.0;

/// Those within the threshold and within the gate of the robust scatter.
fn agreeing(all: &[Prepared], camera: &Camera, at: &Estimate, threshold_px: f64) -> Vec<Row> {
    let mut rows: Vec<Row> = all.iter().filter_map(|landmark| Row::new(landmark, camera, at)).collect();
    rows.retain(|row| row.e.norm() <= threshold_px);
    let mut chi2: Vec<f64> = rows.iter().map(Row::chi2).collect();
    chi2.sort_unstable_by(f64::total_cmp);
    let Some(median) = chi2.get(chi2.len() / 2) else { return rows };
    let limit = GATE * GATE * (median / MEDIAN_OF_TWO).max(LEAST_NOISE_FACTOR);
    rows.retain(|row| row.chi2() <= limit);
    rows
}

/// Of turn and bend; one is what the expectation of the bend adds.
fn information(rows: &[Row]) -> Matrix4<f64> {
    let prior = Matrix4::from_diagonal(&Vector4::w());
    rows.iter().map(Row::normal).sum::<Matrix4<f64>>() + prior
}

/// H⁻¹, where the rotation is reported.
fn inverse(h: &Matrix4<f64>) -> Result<Matrix4<f64>, Error> {
    let inverse = h.cholesky().map(|factor| factor.inverse()).ok_or_else(|| too_close(0.0))?;
    let metric = 1.0 / (of_turn(h).trace() * of_turn(&inverse).trace());
    if MIN_CONDITION < metric { Ok(inverse) } else { Err(too_close(metric)) }
}

fn too_close(metric: f64) -> Error {
    let reason = "the landmarks that agree lie too close together to tell a rotation about them; use an image with more of them";
    Error::DegenerateView { reason, metric, needed: MIN_CONDITION }
}
