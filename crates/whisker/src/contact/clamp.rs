//! The part that both closed forms share: the clamped end as a state of the pendulum, and the way back into the hub frame.
//!
//! ```text
//!   F force, M₀ moment at the clamp · λ = √(F/EI) · β₀ angle of the clamped whisker from −F, in (−π, π]
//!   g = sin β₀/2, h = cos β₀/2 · κ₀ intrinsic curvature · z = κ₀/2λ, m = M₀/(2 EI λ), c = z + m
//!   u = λ s · along −F: A = a/λ · across: B = M₀/F · β_c angle of the whisker at the contact from −F
//! ```
//! Mirrored so that M₀ > 0. Derivation: docs/math/whisker_contact.md, sections 2 and 5.

use super::{ByLoad, HubContact, NoZero};
use crate::HubLoad;
use nalgebra::{Matrix3, Matrix4x3, RowVector3, Vector2};

/// The clamped end, mirrored.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clamp {
    /// The sign of the moment before it was mirrored.
    pub side: f64,
    pub force_n: f64,
    pub moment_n_m: f64,
    pub lambda_per_m: f64,
    pub cos_beta: f64,
    pub sin_beta: f64,
    pub g: f64,
    pub h: f64,
    pub m: f64,
    pub z: f64,
    pub c: f64,
}

/// A contact in the pendulum's own terms: `(u, a)` and the angle rotated since the clamp, β_c − β₀, with the friction angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arc {
    pub u: f64,
    pub a: f64,
    pub rotation_rad: f64,
    pub friction_angle_rad: f64,
    pub modulus_squared: f64,
}

impl Clamp {
    /// Eq. (5), (6), with the mirror.
    pub fn of(ei_n_m2: f64, curvature_per_m: f64, load: &HubLoad) -> Result<Self, NoZero> {
        if !load.is_finite() {
            return Err(NoZero::NotFinite);
        }
        let side = load.side();
        let (fx, fy, moment) = (load.fx_n, side * load.fy_n, side * load.mz_n_m);
        let force = length(fx, fy);
        if force == 0.0 {
            return Err(if moment == 0.0 { NoZero::Free } else { NoZero::NeverVanishes });
        }
        let (cos_beta, sin_beta) = (-fx / force, fy / force);
        let (g, h) = half_angle(cos_beta, sin_beta);
        let lambda = (force / ei_n_m2).sqrt();
        let m = moment / (2.0 * ei_n_m2 * lambda);
        let z = side * curvature_per_m / (2.0 * lambda);
        Ok(Clamp {
            side,
            force_n: force,
            moment_n_m: moment,
            lambda_per_m: lambda,
            cos_beta,
            sin_beta,
            g,
            h,
            m,
            z,
            c: z + m,
        })
    }

    /// Back into the hub frame and out of the mirror, eq. (9)–(11).
    pub fn contact(&self, arc: &Arc) -> Result<HubContact, NoZero> {
        let (a, b) = (arc.a / self.lambda_per_m, self.moment_n_m / self.force_n);
        let at = HubContact {
            s_m: arc.u / self.lambda_per_m,
            x_in_hub: Vector2::new(
                a * self.cos_beta + b * self.sin_beta,
                self.side * (b * self.cos_beta - a * self.sin_beta),
            ),
            theta_rad: self.side * arc.rotation_rad,
            friction_angle_rad: arc.friction_angle_rad,
            modulus_squared: arc.modulus_squared,
        };
        if at.is_finite() { Ok(at) } else { Err(NoZero::NotFinite) }
    }

    /// Eq. (24): from the derivatives of `[u, a, β_c, friction angle]` (rows) by `[c, β₀, ρ]` to those of a contact by the load. ρ scales c and
    /// z alike, which is what the force does.
    pub fn by_load(&self, ei_n_m2: f64, arc: &Arc, partials: &Matrix4x3<f64>) -> Result<ByLoad, NoZero> {
        let Clamp { force_n: force, lambda_per_m: lambda, cos_beta, sin_beta, .. } = *self;
        // [c, β₀, ρ] by [F, β₀, M₀].
        let by_moment = 0.5 / (ei_n_m2 * lambda);
        let chain = Matrix3::new(0.0, 0.0, by_moment, 0.0, 1.0, 0.0, -0.5 / force, 0.0, 0.0);
        let by_state = partials * chain;
        let lengthen = RowVector3::new(-0.5 / force, 0.0, 0.0);
        let s = (by_state.row(0) + lengthen * arc.u) / lambda;
        let a = (by_state.row(1) + lengthen * arc.a) / lambda;
        let b = RowVector3::new(-self.moment_n_m / force, 0.0, 1.0) / force;
        let (along, across) = (arc.a / lambda, self.moment_n_m / force);
        let turning = RowVector3::new(0.0, 1.0, 0.0);
        let x = a * cos_beta + b * sin_beta + turning * (across * cos_beta - along * sin_beta);
        let y = b * cos_beta - a * sin_beta - turning * (along * cos_beta + across * sin_beta);
        let polar = ByLoad::from_rows(&[x, y, by_state.row(2) - turning, s, by_state.row(3).into_owned()]);
        // [F, β₀, M₀] by [fx, fy, M₀].
        let to_load =
            Matrix3::new(-cos_beta, sin_beta, 0.0, sin_beta / force, cos_beta / force, 0.0, 0.0, 0.0, 1.0);
        let by_load = self.out_of_the_mirror(polar * to_load);
        if by_load.iter().all(|v| v.is_finite()) { Ok(by_load) } else { Err(NoZero::NotFinite) }
    }

    /// y and θ change their sign with fy and M₀; x, s and the friction angle do not.
    fn out_of_the_mirror(&self, mut by_load: ByLoad) -> ByLoad {
        for row in 0..5 {
            for column in 0..3 {
                if matches!(row, 1 | 2) != (column != 0) {
                    by_load[(row, column)] *= self.side;
                }
            }
        }
        by_load
    }
}

/// √(x² + y²): the plain root where the squares keep all their digits.
fn length(x: f64, y: f64) -> f64 {
    let square = x * x + y * y;
    if (1e-280..1e280).contains(&square) { square.sqrt() } else { x.hypot(y) }
}

/// `(sin β/2, cos β/2)` for β in (−π, π]: the larger by the root, the smaller from it, so that neither cancels.
fn half_angle(cos: f64, sin: f64) -> (f64, f64) {
    if 0.0 <= cos {
        let h = (0.5 * (1.0 + cos)).sqrt();
        (0.5 * sin / h, h)
    } else {
        let g = (0.5 * (1.0 - cos)).sqrt();
        (g.copysign(sin), 0.5 * sin.abs() / g)
    }
}
