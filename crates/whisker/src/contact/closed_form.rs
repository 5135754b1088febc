//! The contact of a uniform straight whisker by elliptic integrals.
//!
//! ```text
//!   F force, M₀ moment at the clamp · λ = √(F/EI) · β₀ angle of the clamped whisker from −F · H = M₀²/2EI + fx
//!   c = M₀/(2√(EI F)), g = sin β₀/2 · k² = c² + g² = (1 + H/F)/2 · φ₀ = atan2(g, c)
//!   u = K − F(φ₀), w = E − E(φ₀) · s = u/λ, along the force A = (2w − u)/λ, across it B = M₀/F
//! ```
//! Derivation: docs/math/whisker_contact.md.

use super::{HubContact, NoZero};
use crate::HubLoad;
use crate::elliptic;
use nalgebra::Vector2;

/// The first zero of the moment, for bending stiffness `ei_n_m2`.
pub fn straight(ei_n_m2: f64, load: &HubLoad) -> Result<HubContact, NoZero> {
    if !load.is_finite() {
        return Err(NoZero::NotFinite);
    }
    // Mirrored so that the moment is positive.
    let side = if load.mz_n_m < 0.0 { -1.0 } else { 1.0 };
    let (fx, fy, moment) = (load.fx_n, side * load.fy_n, side * load.mz_n_m);
    let force = fx.hypot(fy);
    if force == 0.0 {
        return Err(if moment == 0.0 { NoZero::Free } else { NoZero::NeverVanishes });
    }
    let lambda = (force / ei_n_m2).sqrt();
    let beta0 = fy.atan2(-fx);
    let c = moment / (2.0 * (ei_n_m2 * force).sqrt());
    let (g, g_complement) = (0.5 * beta0).sin_cos();
    let k2 = c * c + g * g;
    // k′² = cos²(β₀/2) − c²
    let complement2 = (g_complement - c) * (g_complement + c);
    if !(0.0 < complement2) {
        return Err(NoZero::NeverVanishes);
    }
    let (k, k_complement) = (k2.sqrt(), complement2.sqrt());
    let (sin_phi0, _) = (g / k, c / k);
    // K − F(φ₀) = F(ψ) and E − E(φ₀) = E(ψ) − k² sin φ₀ sin ψ, tan ψ = c/(k′ g): no cancellation near the zero.
    let psi = c.atan2(k_complement * g);
    let (u, e) = elliptic::incomplete(psi, k2, k_complement);
    let w = e - k2 * sin_phi0 * psi.sin();
    let along = Vector2::new(fx, fy) / force;
    let (a, b) = ((2.0 * w - u) / lambda, moment / force);
    let x = Vector2::new(-a * along.x + b * along.y, -a * along.y - b * along.x);
    Ok(HubContact {
        s_m: u / lambda,
        x_in_hub: Vector2::new(x.x, side * x.y),
        theta_rad: side * (2.0 * k.asin() - beta0),
        friction_angle_rad: (2.0 * k2 - 1.0).clamp(-1.0, 1.0).asin(),
        modulus_squared: k2,
    })
}
