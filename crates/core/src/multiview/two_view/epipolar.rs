//! The residual of a pair of bearings against a relative pose, and its derivatives: docs/math/two_view.md section 3.
//!
//! ```text
//!   a, b  bearings in the first and second view, σ₁, σ₂   ·   y = R a   ·   e = b · (t × y)
//!   V = σ₂² (|t × y|² − e²) + σ₁² (|t × b|² − e²)   ·   r = e/√V   ·   parallax  the angle between y and b along the epipolar line
//! ```

use super::BearingPair;
use nalgebra::{Matrix3, Matrix3x2, Vector3, Vector5};

/// A relative pose up to the length of its translation.
#[derive(Debug, Clone, Copy)]
pub(super) struct RelativePose {
    pub r: Matrix3<f64>,
    /// Unit length.
    pub t: Vector3<f64>,
}

/// Two axes across a unit vector, so that (first, second, vector) is right-handed.
pub(crate) fn axes_across(v: &Vector3<f64>) -> Matrix3x2<f64> {
    let least = v.iamin();
    let first = v.cross(&Vector3::ith(least, 1.0)).normalize();
    Matrix3x2::from_columns(&[first, v.cross(&first)])
}

impl RelativePose {
    pub fn essential(&self) -> Matrix3<f64> {
        self.t.cross_matrix() * self.r
    }

    /// R ← Exp(ω) R, t ← t + B δ at unit length.
    pub fn moved(&self, step: &Vector5<f64>) -> Option<Self> {
        let rotation = nalgebra::Rotation3::new(Vector3::new(step[0], step[1], step[2]));
        let t = self.t + axes_across(&self.t) * step.fixed_rows::<2>(3);
        let moved = RelativePose {
            r: crate::pose::orthonormalized(&(rotation.matrix() * self.r)),
            t: t.try_normalize(f64::MIN_POSITIVE)?,
        };
        (moved.r.sum() + moved.t.sum()).is_finite().then_some(moved)
    }

    /// Both depths of the point of a pair in units of the baseline, each times the squared sine of the angle between the rays: eq. (3).
    pub fn scaled_depths(&self, pair: &BearingPair) -> [f64; 2] {
        let (y, b) = (self.r * pair.first.into_inner(), pair.second.into_inner());
        let c = y.cross(&b);
        [-self.t.cross(&b).dot(&c), -self.t.cross(&y).dot(&c)]
    }
}

/// r²: squared residual in standard deviations against an essential matrix.
pub(super) fn squared_residual(e: &Matrix3<f64>, pair: &BearingPair) -> f64 {
    let (a, b) = (pair.first.into_inner(), pair.second.into_inner());
    let (line_in_second, line_in_first) = (e * a, e.tr_mul(&b));
    let off = b.dot(&line_in_second);
    let square = off * off;
    let variance = pair.sigma_second_rad.powi(2) * (line_in_second.norm_squared() - square)
        + pair.sigma_first_rad.powi(2) * (line_in_first.norm_squared() - square);
    if 0.0 < variance { square / variance } else { 0.0 }
}

/// One residual with its derivatives by (ω, δ).
pub(super) struct EpipolarRow {
    pub residual: f64,
    pub by_step: Vector5<f64>,
    /// Square of the parallax along the epipolar line, over its stated variance.
    pub parallax: f64,
    /// Part of J Jᵀ that is the noise of the bearings along the epipolar line, δ alone: eq. (11).
    pub noise: nalgebra::Matrix2<f64>,
}

impl EpipolarRow {
    /// `None` for a bearing along the translation.
    pub fn new(at: &RelativePose, pair: &BearingPair) -> Option<Self> {
        let (y, b, t) = (at.r * pair.first.into_inner(), pair.second.into_inner(), at.t);
        let basis = axes_across(&t);
        let [s1, s2] = [pair.sigma_first_rad, pair.sigma_second_rad].map(|s| s * s);
        let e = b.dot(&t.cross(&y));
        let (ty, tb) = (t.dot(&y), t.dot(&b));
        let variance = s2 * (1.0 - ty * ty - e * e) + s1 * (1.0 - tb * tb - e * e);
        if !(0.0 < variance) {
            return None;
        }
        let e_by_turn = y.cross(&b.cross(&t));
        let e_by_t = basis.tr_mul(&y.cross(&b));
        let common = -2.0 * e * (s1 + s2);
        let v_by_turn = -2.0 * s2 * ty * y.cross(&t) + common * e_by_turn;
        let v_by_t = basis.tr_mul(&(-2.0 * (s2 * ty * y + s1 * tb * b))) + common * e_by_t;
        let root = variance.sqrt();
        let by_turn = (e_by_turn - v_by_turn * (e / (2.0 * variance))) / root;
        let by_t = (e_by_t - v_by_t * (e / (2.0 * variance))) / root;
        let across = t.cross(&b).normalize();
        let w = basis.tr_mul(&across);
        Some(EpipolarRow {
            residual: e / root,
            by_step: Vector5::new(by_turn.x, by_turn.y, by_turn.z, by_t.x, by_t.y),
            parallax: y.cross(&b).dot(&across).powi(2) / (s1 + s2),
            noise: w * w.transpose() * ((s1 + s2) / variance),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bearing;

    /// Central differences err by h² and ε/h.
    const STEP: f64 = 6e-6;

    #[test]
    fn derivatives_match_central_differences() {
        let r = nalgebra::Rotation3::new(Vector3::new(0.1, -0.2, 0.05)).into_inner();
        let at = RelativePose { r, t: Vector3::new(0.1, -0.05, -1.0).normalize() };
        let pair = BearingPair {
            first: Bearing::new_normalize(Vector3::new(0.3, 0.2, 1.0)),
            second: Bearing::new_normalize(Vector3::new(0.1, 0.33, 1.0)),
            sigma_first_rad: 1e-3,
            sigma_second_rad: 2e-3,
        };
        let row = EpipolarRow::new(&at, &pair).expect("a row");
        let e = at.essential();
        assert!((row.residual.powi(2) - squared_residual(&e, &pair)).abs() < 1e-9 * row.residual.powi(2));
        for i in 0..5 {
            let residual = |h: f64| {
                let mut step = Vector5::zeros();
                step[i] = h;
                EpipolarRow::new(&at.moved(&step).expect("a pose"), &pair).expect("a row").residual
            };
            let numeric = (residual(STEP) - residual(-STEP)) / (2.0 * STEP);
            assert!((numeric - row.by_step[i]).abs() < 1e-6 * row.by_step.norm(), "{i}: {numeric}");
        }
    }
}
