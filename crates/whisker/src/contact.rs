//! Computes the contact of the whisker from one load: the first arc length at which the bending moment vanishes.

pub mod bent;
mod clamp;
pub mod closed_form;
pub mod curved;
pub mod integrate;

use crate::rod::{IntrinsicCurvature, Stiffness};
use crate::{HubLoad, Rod};
use arrayvec::ArrayVec;
use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use std::f64::consts::PI;

/// A contact in the hub frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HubContact {
    /// Arc length from the clamp, metres; beyond the whisker's length if it follows from the load.
    pub s_m: f64,
    /// The point of the centre line, hub frame, metres.
    pub x_in_hub: Vector2<f64>,
    /// Direction of the whisker there, from the clamped direction, counter-clockwise, radians.
    pub theta_rad: f64,
    /// Angle from the whisker's normal to the force, positive where the force pulls towards the tip, radians:
    /// asin(F·t / |F|). Zero without friction, except at the tip.
    pub friction_angle_rad: f64,
    /// (1 + F·t/|F|)/2, which is k², the squared modulus of the elastica, of a straight uniform whisker; ½ without friction.
    pub modulus_squared: f64,
}

impl HubContact {
    /// `[x, y, θ, s, friction angle]`, the rows of [`ByLoad`].
    pub fn to_vector(&self) -> SVector<f64, 5> {
        SVector::from([self.x_in_hub.x, self.x_in_hub.y, self.theta_rad, self.s_m, self.friction_angle_rad])
    }

    /// Returns whether every entry is a number.
    pub fn is_finite(&self) -> bool {
        self.to_vector().iter().all(|v| v.is_finite())
    }
}

/// Derivatives of `[x, y, θ, s, friction angle]` (hub frame; m, m, rad, m, rad) by `[fx, fy, mz]` (N, N, N·m).
pub type ByLoad = SMatrix<f64, 5, 3>;

/// Derivatives of `[x, y, θ, s, friction angle]` with respect to `[ln EI, κ₀, clamp angle]` (1, 1/m, rad).
///
/// ln EI: a common factor on the stiffness of the whole rod (divide by EI for ∂/∂EI). κ₀: curvature added everywhere. Clamp
/// angle: the clamped whisker rotated counter-clockwise within the frame of the load cell, in which load and contact are then given.
pub type ByRod = SMatrix<f64, 5, 3>;

/// Number of later zeros of the moment that are listed.
pub const BRANCHES: usize = 4;

/// The last zero of the moment that is sought, counted from 0; a load that coils its rod up has billions.
pub(crate) const MOST_ZEROS: usize = 64;

/// Later zeros of the moment on the whisker, by arc length.
pub type Branches = ArrayVec<HubContact, BRANCHES>;

/// Why a load has no contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoZero {
    /// No load at all: nothing bends the whisker.
    Free,
    /// The moment never vanishes (k ≥ 1): several contacts, a distributed one, or a wrong EI.
    NeverVanishes,
    /// A force along the straight whisker without a moment: it vanishes everywhere, so the contact may be anywhere.
    Axial,
    /// A load that is not a number, or one so far out of range that its contact is not.
    NotFinite,
}

/// The method of integrating the elastica.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Elliptic integrals where stiffness and intrinsic curvature are constant, otherwise integration.
    #[default]
    Auto,
    /// Always integrate from the hub until the moment vanishes, as Scholz and Rahn do.
    Integrate,
}

/// The solver for a rod.
enum Solver {
    Straight { ei_n_m2: f64 },
    Curved { ei_n_m2: f64, curvature_per_m: f64 },
    Integrate,
}

fn solver(rod: &Rod, method: Method) -> Solver {
    match (method, &rod.stiffness, &rod.intrinsic_curvature) {
        (Method::Auto, Stiffness::Uniform { ei_n_m2 }, IntrinsicCurvature::Constant { per_m }) => {
            if *per_m == 0.0 {
                Solver::Straight { ei_n_m2: *ei_n_m2 }
            } else {
                Solver::Curved { ei_n_m2: *ei_n_m2, curvature_per_m: *per_m }
            }
        }
        _ => Solver::Integrate,
    }
}

/// The contact of `load`.
pub fn contact_in_hub(rod: &Rod, load: &HubLoad, method: Method) -> Result<HubContact, NoZero> {
    match solver(rod, method) {
        Solver::Straight { ei_n_m2 } => closed_form::straight(ei_n_m2, load),
        Solver::Curved { ei_n_m2, curvature_per_m } => curved::contact(ei_n_m2, curvature_per_m, load),
        Solver::Integrate => integrate::contact(rod, load),
    }
}

/// The contact of `load` and its derivatives by the load.
pub fn contact_with_derivatives(
    rod: &Rod,
    load: &HubLoad,
    method: Method,
) -> Result<(HubContact, ByLoad), NoZero> {
    match solver(rod, method) {
        Solver::Straight { ei_n_m2 } => closed_form::straight_with_derivatives(ei_n_m2, load),
        Solver::Curved { ei_n_m2, curvature_per_m } => {
            curved::contact_with_derivatives(ei_n_m2, curvature_per_m, load)
        }
        Solver::Integrate => integrate::contact_with_derivatives(rod, load),
    }
}

/// The zeros of the moment after the first one, `first`, up to the whisker's length: S-shaped states have them.
pub fn later_zeros(rod: &Rod, load: &HubLoad, first: &HubContact, method: Method) -> Branches {
    let (ei_n_m2, curvature_per_m) = match solver(rod, method) {
        Solver::Straight { ei_n_m2 } => (ei_n_m2, 0.0),
        Solver::Curved { ei_n_m2, curvature_per_m } => (ei_n_m2, curvature_per_m),
        Solver::Integrate => {
            return integrate::zeros(rod, load, 1 + BRANCHES).into_iter().skip(1).collect();
        }
    };
    // Of a straight whisker zeros lie 2K/λ ≥ π/λ apart.
    let room = (rod.length_m - first.s_m).max(0.0);
    let force = load.force_n().norm();
    if curvature_per_m == 0.0 && room * room * force < PI * PI * ei_n_m2 {
        return Branches::new();
    }
    let zeros = (1..=BRANCHES).map_while(|n| curved::zero(ei_n_m2, curvature_per_m, load, n).ok());
    zeros.take_while(|at| at.s_m <= rod.length_m).collect()
}

/// A later zero of the moment (0: the first) with its derivatives by the load.
pub fn branch_with_derivatives(
    rod: &Rod,
    load: &HubLoad,
    method: Method,
    branch: usize,
) -> Result<(HubContact, ByLoad), NoZero> {
    match solver(rod, method) {
        Solver::Straight { ei_n_m2 } => curved::zero_with_derivatives(ei_n_m2, 0.0, load, branch),
        Solver::Curved { ei_n_m2, curvature_per_m } => {
            curved::zero_with_derivatives(ei_n_m2, curvature_per_m, load, branch)
        }
        Solver::Integrate if branch == 0 => integrate::contact_with_derivatives(rod, load),
        Solver::Integrate => integrated_branch(rod, load, branch),
    }
}

/// By central differences, which err by some 1e-10 of their size: the integration carries derivatives only to the first zero.
fn integrated_branch(rod: &Rod, load: &HubLoad, branch: usize) -> Result<(HubContact, ByLoad), NoZero> {
    if MOST_ZEROS < branch {
        return Err(NoZero::NeverVanishes);
    }
    let zero = |load: &HubLoad| {
        integrate::zeros(rod, load, branch + 1).get(branch).copied().ok_or(NoZero::NeverVanishes)
    };
    let (at, force) = (zero(load)?, load.force_n().norm());
    let mut by_load = ByLoad::zeros();
    for (column, scale) in [force, force, force * rod.length_m].into_iter().enumerate() {
        let step = 6e-6 * scale;
        let moved = |by: f64| {
            let mut vector = load.to_vector();
            vector[column] += by;
            zero(&HubLoad::from_vector(&vector)).map(|at| at.to_vector())
        };
        by_load.set_column(column, &((moved(step)? - moved(-step)?) / (2.0 * step)));
    }
    Ok((at, by_load))
}

/// Derivatives of a contact by the whisker itself, from those by the load; whisker_contact.md eq. (36)–(38).
///
/// None unless EI is uniform: of another profile only [`by_stiffness`] and [`by_clamp_angle`] follow from the load.
pub fn by_rod(rod: &Rod, load: &HubLoad, at: &HubContact, by_load: &ByLoad) -> Option<ByRod> {
    let Stiffness::Uniform { ei_n_m2 } = rod.stiffness else { return None };
    let mut by_rod = ByRod::zeros();
    by_rod.set_column(0, &by_stiffness(load, by_load));
    by_rod.set_column(1, &by_curvature(ei_n_m2, rod.curvature_per_m_at(at.s_m), load, at, by_load));
    by_rod.set_column(2, &by_clamp_angle(load, at, by_load));
    Some(by_rod)
}

/// By the logarithm of a factor on the stiffness of the whole rod, of whatever profile: the load divided by that factor bends as far.
pub fn by_stiffness(load: &HubLoad, by_load: &ByLoad) -> SVector<f64, 5> {
    -(by_load * load.to_vector())
}

/// By the angle of the clamped whisker in the frame of the load cell, in which load and contact are given, of whatever rod.
pub fn by_clamp_angle(load: &HubLoad, at: &HubContact, by_load: &ByLoad) -> SVector<f64, 5> {
    let carried = SVector::from([-at.x_in_hub.y, at.x_in_hub.x, 1.0, 0.0, 0.0]);
    carried + by_load * Vector3::new(load.fy_n, -load.fx_n, 0.0)
}

/// By a curvature added everywhere to a uniform rod: a moment EI δκ₀ bends it alike, but vanishes later.
fn by_curvature(
    ei_n_m2: f64,
    curvature_per_m: f64,
    load: &HubLoad,
    at: &HubContact,
    by_load: &ByLoad,
) -> SVector<f64, 5> {
    let (sin, cos) = at.theta_rad.sin_cos();
    // dM/ds = −F·n.
    let slope = load.fx_n * sin - load.fy_n * cos;
    let side = if slope < 0.0 { 1.0 } else { -1.0 };
    let along = SVector::from([cos, sin, curvature_per_m, 1.0, side * curvature_per_m]);
    (by_load.column(2) + along / slope) * ei_n_m2
}
