//! The contact of a uniform straight whisker by elliptic integrals.
//!
//! ```text
//!   clamp state g, h, c as in clamp.rs · H = M₀²/2EI + fx · k² = c² + g² = (1 + H/F)/2, k′² = 1 − k² = h² − c²
//!   sn u = c/(k h), cn u = k′ g/(k h), dn u = k′/h · G = ∫₀ᵘ sd² v dv, Q = ∫₀ᵘ cd² v dv = u − k′² G · a = u − 2 k² Q
//! ```
//! Derivation: docs/math/whisker_contact.md, sections 3 and 5.

use super::clamp::{Arc, Clamp};
use super::{ByLoad, HubContact, NoZero};
use crate::HubLoad;
use crate::elliptic;
use nalgebra::{Matrix4x3, Vector4};

/// The first zero of the moment, for bending stiffness `ei_n_m2`, N·m².
pub fn straight(ei_n_m2: f64, load: &HubLoad) -> Result<HubContact, NoZero> {
    let bent = Bent::of(ei_n_m2, load)?;
    let (u, g) = bent.integrals();
    bent.clamp.contact(&bent.arc(u, g))
}

/// The first zero of the moment and its derivatives by the load.
pub fn straight_with_derivatives(ei_n_m2: f64, load: &HubLoad) -> Result<(HubContact, ByLoad), NoZero> {
    let bent = Bent::of(ei_n_m2, load)?;
    let (u, g) = bent.integrals();
    let arc = bent.arc(u, g);
    Ok((bent.clamp.contact(&arc)?, bent.clamp.by_load(ei_n_m2, &arc, &bent.partials(u, g))?))
}

/// The clamp with the modulus of its elastica.
struct Bent {
    clamp: Clamp,
    k2: f64,
    complement2: f64,
    k: f64,
    complement: f64,
}

impl Bent {
    fn of(ei_n_m2: f64, load: &HubLoad) -> Result<Self, NoZero> {
        let clamp = Clamp::of(ei_n_m2, 0.0, load)?;
        if clamp.moment_n_m == 0.0 && clamp.sin_beta == 0.0 {
            return Err(NoZero::Axial);
        }
        let Clamp { g, h, c, .. } = clamp;
        let (k2, complement2) = (c * c + g * g, (h - c) * (h + c));
        if !(0.0 < complement2) {
            return Err(NoZero::NeverVanishes);
        }
        Ok(Bent { clamp, k2, complement2, k: k2.sqrt(), complement: complement2.sqrt() })
    }

    /// `(u, G)` by one duplication with signed roots and Carlson's integrals, eq. (15), (16), (20).
    fn integrals(&self) -> (f64, f64) {
        let (Clamp { g, h, c, .. }, k, complement) = (self.clamp, self.k, self.complement);
        // (cs, ds, ns) u, each times c.
        let (cs, ds, ns) = (complement * g, k * complement, k * h);
        // cs + ds = k′ (g + k) and cs + ns: both vanish with c where g < 0.
        let (with_ds, with_ns) = if 0.0 <= g {
            (complement * (g + k), ns + cs)
        } else {
            (complement * c * c / (k - g), c * c / (ns - cs))
        };
        let ds_ns = k * (complement + h);
        let y = with_ds * ds_ns;
        let (f, d) = elliptic::carlson(with_ds * with_ns, with_ns * ds_ns, y);
        (2.0 * c * f, c * c * c * (2.0 / 3.0 * d + 1.0 / (ds * y)))
    }

    /// Eq. (10), (11), (13), (14).
    fn arc(&self, u: f64, big_g: f64) -> Arc {
        let Bent { clamp: Clamp { g, h, c, .. }, k2, complement2, k, complement } = *self;
        // sin θ/2 = k h − g k′, its cancelling form replaced.
        let sin_half = if 0.0 <= g { c * c / (k * h + g * complement) } else { k * h - g * complement };
        let turned = 2.0 * sin_half.atan2(complement * h + k * g);
        // k² − k′² = 2c² − cos β₀ = H/F, without friction exactly the difference of what nearly cancels.
        let pull = 2.0 * c * c - self.clamp.cos_beta;
        Arc {
            u,
            a: u * (complement2 - k2) + 2.0 * k2 * complement2 * big_g,
            rotation_rad: turned,
            friction_angle_rad: pull.atan2(2.0 * k * complement),
            modulus_squared: k2,
        }
    }

    /// Derivatives of `[u, a, β_c, friction angle]` by `[c, β₀, ρ]`, eq. (21)–(23).
    fn partials(&self, u: f64, big_g: f64) -> Matrix4x3<f64> {
        let Bent { clamp: Clamp { g, h, c, .. }, k2, complement2, k, complement } = *self;
        let q = u - complement2 * big_g;
        let u_c = g * h / (complement2 * k2) + c * big_g;
        let u_beta = 0.5 * (g * h * big_g - c * (complement2 - g * g) / (complement2 * k2));
        let w_c = g * h / k2 - c * q;
        let w_beta = -0.5 * (g * h * q + c * h * h / k2);
        let by_k2 = 1.0 / (k * complement);
        let by_c = Vector4::new(u_c, 2.0 * w_c - u_c, 2.0 * c * by_k2, 2.0 * c * by_k2);
        let by_beta = Vector4::new(u_beta, 2.0 * w_beta - u_beta, g * h * by_k2, g * h * by_k2);
        Matrix4x3::from_columns(&[by_c, by_beta, by_c * c])
    }
}
