//! Computes the contact of any whisker by integrating the elastica from the hub until the bending moment vanishes: the method of Scholz and
//! Rahn, by Taylor series of high order.
//!
//! ```text
//!   F force, φ its direction in the hub frame, e along it, n = (e_y, −e_x)
//!   α = θ − φ · p = r·e, q = r·n · M = M₀ − F q: only α, M and p are integrated, q follows
//!   α′ = κ₀(s) + M/EI(s) · M′ = F sin α · p′ = cos α
//!   lengths in ℓ = min(L, √(EI₀/F)), moments in EI₀/ℓ, forces in EI₀/ℓ²
//! ```
//! Between knots of the profiles EI(s) is that of a cone and κ₀(s) linear; steps end on the knots. Past the tip the whisker goes
//! on with the stiffness and the curvature of its tip, up to `REACH` lengths, so that a load whose noise puts the contact just
//! beyond the tip still says where. Derivation: docs/math/whisker_integrate.md.

mod piece;
mod series;
mod variation;

use super::{ByLoad, HubContact, NoZero};
use crate::{HubLoad, Rod};
use nalgebra::{Matrix3, RowVector4, SMatrix, SVector, Vector2};
use piece::{Piece, Units};
use series::{Series, State};
use variation::Variation;

/// Number of whisker lengths searched. A contact farther out belongs to a load without force, and is meaningless.
const REACH: f64 = 32.0;

/// Steps to one zero before giving up, besides those that a profile's knots ask for; a contact within the whisker takes 2 to 5.
const MOST_STEPS: usize = 256;

/// Returns the first zero of the moment.
///
/// The modulus of a non-uniform whisker is no constant of the motion: `modulus_squared` is (1 + sin friction)/2 at the contact.
pub fn contact(rod: &Rod, load: &HubLoad) -> Result<HubContact, NoZero> {
    let mut walk = Walk::start(rod, load)?;
    let zero = walk.next_zero(None)?;
    walk.in_hub(&zero)
}

/// The first zero of the moment with its derivatives by the load, from the variational equations
/// (docs/math/whisker_integrate.md eqs. (9)–(13)). A zero that the moment only grazes has no derivative: `NeverVanishes`.
pub fn contact_with_derivatives(rod: &Rod, load: &HubLoad) -> Result<(HubContact, ByLoad), NoZero> {
    derivatives(rod, load, 0).map(|(at, by_load, _)| (at, by_load))
}

/// A zero of the moment (0: the first, 1: the next, …) with the derivatives of `[x, y, θ, s, friction angle]` by the load and by
/// curvature added everywhere (κ₀, 1/m).
///
/// Those by ln EI and by the clamp's angle follow from them: a common factor on force, moment and EI changes nothing
/// (∂/∂ln EI = −by_load · load), and turning the clamp turns the load.
pub fn derivatives(
    rod: &Rod,
    load: &HubLoad,
    zero: usize,
) -> Result<(HubContact, ByLoad, SVector<f64, 5>), NoZero> {
    if super::MOST_ZEROS < zero {
        return Err(NoZero::NeverVanishes);
    }
    let mut walk = Walk::start(rod, load)?;
    let mut variation = Variation::identity();
    for _ in 0..zero {
        walk.next_zero(Some(&mut variation))?;
    }
    let zero = walk.next_zero(Some(&mut variation))?;
    let by_own = walk.by_own(&zero, &variation);
    if !by_own.iter().all(|v| v.is_finite()) {
        return Err(NoZero::NeverVanishes);
    }
    let by_load = by_own.fixed_columns::<3>(0) * walk.own_by_load();
    Ok((walk.in_hub(&zero)?, by_load, by_own.column(3) * walk.units.length_m))
}

/// The first zeros of the moment on the whisker (s ≤ L), at most `most`, by arc length: more than one in S-shaped states. Empty where
/// there is none. A load that is absurd for its rod coils it up, and there are billions.
pub fn zeros(rod: &Rod, load: &HubLoad, most: usize) -> Vec<HubContact> {
    let mut found = Vec::new();
    let Ok(mut walk) = Walk::start(rod, load) else { return found };
    while found.len() < most {
        match walk.next_zero(None).and_then(|zero| walk.in_hub(&zero)) {
            Ok(at) if at.s_m <= rod.length_m => found.push(at),
            _ => break,
        }
    }
    found
}

/// A walk along the whisker, in units of `Units`.
struct Walk<'a> {
    rod: &'a Rod,
    units: Units,
    /// Unit vector of the force, hub frame.
    along: Vector2<f64>,
    force: f64,
    moment_at_hub: f64,
    state: State,
}

impl<'a> Walk<'a> {
    fn start(rod: &'a Rod, load: &HubLoad) -> Result<Self, NoZero> {
        if !load.is_finite() {
            return Err(NoZero::NotFinite);
        }
        let force_n = load.force_n().norm();
        if force_n == 0.0 {
            return Err(if load.mz_n_m == 0.0 { NoZero::Free } else { NoZero::NeverVanishes });
        }
        // |M′| ≤ F: the moment cannot vanish nearer than |M₀|/F.
        if force_n * REACH * rod.length_m < load.mz_n_m.abs() {
            return Err(NoZero::NeverVanishes);
        }
        let units = Units::of(rod, force_n);
        let along = load.force_n() / force_n;
        let moment_at_hub = load.mz_n_m / units.moment_n_m;
        let state = State { s: 0.0, alpha: (-along.y).atan2(along.x), moment: moment_at_hub, p: 0.0 };
        Ok(Walk { rod, units, along, force: force_n / units.force_n, moment_at_hub, state })
    }

    /// Moves to the next zero of the moment, a zero at the hub included; `variation` is carried along.
    fn next_zero(&mut self, mut variation: Option<&mut Variation>) -> Result<State, NoZero> {
        let end = REACH * self.rod.length_m / self.units.length_m;
        if self.state.moment == 0.0 && self.state.s == 0.0 {
            let zero = self.state;
            self.state.s = f64::MIN_POSITIVE; // Passed: the next search starts behind it.
            return Ok(zero);
        }
        for _ in 0..MOST_STEPS + 2 * self.rod.knots() {
            let piece = Piece::at(self.rod, &self.units, self.state.s);
            if end <= self.state.s || self.never(&piece) {
                return Err(NoZero::NeverVanishes);
            }
            let series = Series::of(&self.state, &piece, self.force);
            let step = series.reach().min(piece.end - self.state.s).min(end);
            let zero = series.first_zero(step, self.force);
            let step = zero.unwrap_or(step);
            if let Some(variation) = &mut variation {
                variation.advance(&series, &piece, self.force, step);
            }
            let last = zero.is_none() && piece.end - self.state.s <= step;
            self.state = series.at(&self.state, step);
            if last {
                self.state.s = piece.end; // Exactly, or rounding would leave a sliver.
            }
            if !self.state.alpha.is_finite() || !self.state.moment.is_finite() {
                return Err(NoZero::NotFinite);
            }
            if zero.is_some() {
                self.state.moment = 0.0;
                return Ok(self.state);
            }
        }
        Err(NoZero::NeverVanishes)
    }

    /// Whether the moment cannot vanish on a piece that continues for ever: there EI and κ₀ are constant, and so is
    /// C = M²/2EI + M κ₀ + F cos α, which is F cos α at a zero; a rod that keeps turning keeps the sign of its curvature.
    fn never(&self, piece: &Piece) -> bool {
        if piece.end.is_finite() {
            return false;
        }
        let curvature = piece.curvature + self.state.moment * piece.compliance;
        let turned = self.force * self.state.alpha.cos();
        let c = 0.5 * self.state.moment * (curvature + piece.curvature) + turned;
        let keeps_turning = self.force < 0.5 * curvature * curvature / piece.compliance + turned;
        self.force < c.abs() || (keeps_turning && curvature * piece.curvature < 0.0)
    }

    fn in_hub(&self, zero: &State) -> Result<HubContact, NoZero> {
        let (e, n) = (self.along, Vector2::new(self.along.y, -self.along.x));
        let sin_friction = zero.alpha.cos();
        let at = HubContact {
            s_m: zero.s * self.units.length_m,
            x_in_hub: (e * zero.p + n * (self.moment_at_hub / self.force)) * self.units.length_m,
            theta_rad: zero.alpha + e.y.atan2(e.x),
            friction_angle_rad: sin_friction.asin(),
            modulus_squared: 0.5 * (1.0 + sin_friction),
        };
        let numbers = [at.s_m, at.x_in_hub.x, at.x_in_hub.y, at.theta_rad];
        if numbers.iter().all(|v| v.is_finite()) { Ok(at) } else { Err(NoZero::NotFinite) }
    }

    /// docs/math/whisker_integrate.md eqs. (11)–(13).
    fn by_own(&self, zero: &State, variation: &Variation) -> SMatrix<f64, 5, 4> {
        let (e, n) = (self.along, Vector2::new(self.along.y, -self.along.x));
        let (sin, cos) = zero.alpha.sin_cos();
        let piece = Piece::at(self.rod, &self.units, zero.s);
        let by_s = -variation.moment / (self.force * sin);
        let by_alpha = variation.alpha + by_s * piece.curvature;
        let by_p = variation.p + by_s * cos;
        let across = self.moment_at_hub / self.force;
        // Columns: the clamp's α, the moment at the hub, the force, curvature.
        let by_q = RowVector4::new(0.0, 1.0 / self.force, -across / self.force, 0.0);
        let turned = RowVector4::new(1.0, 0.0, 0.0, 0.0);
        let by_x = e * by_p + n * by_q + (n * zero.p - e * across) * turned;
        let mut by_own = SMatrix::<f64, 5, 4>::zeros();
        by_own.fixed_rows_mut::<2>(0).copy_from(&(by_x * self.units.length_m));
        by_own.set_row(2, &(by_alpha - turned));
        by_own.set_row(3, &(by_s * self.units.length_m));
        by_own.set_row(4, &(-by_alpha * sin.signum()));
        by_own
    }

    /// Derivatives of α at the clamp, the moment there and the force (own units) by `[fx, fy, mz]`.
    fn own_by_load(&self) -> Matrix3<f64> {
        let (e, force_n) = (self.along, self.force * self.units.force_n);
        Matrix3::new(
            e.y / force_n,
            -e.x / force_n,
            0.0,
            0.0,
            0.0,
            1.0 / self.units.moment_n_m,
            e.x / self.units.force_n,
            e.y / self.units.force_n,
            0.0,
        )
    }
}
