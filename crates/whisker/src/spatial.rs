//! Contacts in space from six hub signals: a straight round whisker bends in one plane, in which the planar contact applies.
//!
//! A single force at a point of the centre line, whatever its direction and friction included, bends a straight round whisker in the
//! plane of clamp axis and force, without torsion. Six signals then have four degrees of freedom (axial force, transverse force,
//! moment, roll of the plane); the other two are the test whether that is so. Derivation: docs/math/whisker_spatial.md.

use crate::contact::{ByLoad, HubContact, Method, NoZero, contact_with_derivatives};
use crate::rod::IntrinsicCurvature;
use crate::{Cell, Error, HubLoad, Rod};
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Matrix6, Matrix6x4, Vector2, Vector3, Vector4, Vector6};

/// Share of sound readings that are called out of plane.
pub const FALSE_ALARM: f64 = 1e-3;

/// The roll must be known this well for the plane to be more than a guess, radians: beyond, a circle is no longer its tangent, and
/// neither χ² nor the covariance means what it says.
pub const MOST_ROLL_SIGMA_RAD: f64 = 0.15;

/// Degrees of freedom of the test: six signals less four parameters.
pub const DEGREES_OF_FREEDOM: usize = 2;

/// What the whisker exerts on the hub: hub axes, x along the clamped whisker; moment about the clamp point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpatialLoad {
    /// Force, newtons.
    pub force_n: Vector3<f64>,
    /// Moment, newton metres.
    pub moment_n_m: Vector3<f64>,
}

impl SpatialLoad {
    /// `[fx, fy, fz, mx, my, mz]`, N, N·m.
    pub fn to_vector(self) -> Vector6<f64> {
        let (f, m) = (self.force_n, self.moment_n_m);
        Vector6::new(f.x, f.y, f.z, m.x, m.y, m.z)
    }
}

/// Covariance of the six signals of a cell whose three forces are alike and whose three moments are alike, N², N²·m².
pub fn load_covariance(cell: &Cell) -> Matrix6<f64> {
    let planar = cell.load_covariance();
    let (force, moment) = (planar[(0, 0)], planar[(2, 2)]);
    Matrix6::from_diagonal(&Vector6::new(force, force, force, moment, moment, moment))
}

/// The plane of bending that fits the six signals best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reduction {
    /// The load in that plane; its moment is not negative.
    pub load: HubLoad,
    /// Turn about the clamp axis from the hub's xy plane to the plane of bending, radians.
    pub roll_rad: f64,
    /// Covariance of `[fx, fy, mz, roll]` in the plane, N, N, N·m, rad.
    pub covariance: Matrix4<f64>,
    /// Weighted sum of squared residuals: χ² of `DEGREES_OF_FREEDOM` where one force bends a straight round whisker.
    pub chi2: f64,
    /// How probable a χ² at least as large is: exp(−χ²/2).
    pub p_value: f64,
}

/// Whether the planar contact may be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The signals are those of one force in one plane.
    Planar,
    /// They are not: several contacts, torsion by friction at the surface, a curved whisker, a load cell out of line.
    OutOfPlane,
    /// The whisker's own curvature has a plane, which rolls with it: no reduction whatever the signals.
    CurvedWhisker,
    /// The roll is not known well enough to speak of a plane.
    TooWeak,
    /// The load in the plane has no contact, for this reason.
    NoContact(NoZero),
}

/// A contact in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpatialContact {
    /// The point of the centre line, hub frame, metres.
    pub x_in_hub: Vector3<f64>,
    /// Its covariance, m².
    pub covariance: Matrix3<f64>,
    /// Unit vector along the whisker there, towards the tip, hub frame.
    pub tangent_in_hub: Vector3<f64>,
    /// The same contact in the plane of bending.
    pub in_plane: HubContact,
}

/// The estimate of six signals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpatialEstimate {
    /// Whether the contact below holds.
    pub verdict: Verdict,
    /// The plane and its test; none where the signals have no plane at all.
    pub reduction: Option<Reduction>,
    /// The contact that the reduction gives; to be believed only where the verdict is planar.
    pub contact: Option<SpatialContact>,
}

/// The contact in space from six signals and their covariance (`[fx, fy, fz, mx, my, mz]`). Fails on signals that are no numbers and
/// on a covariance that is none.
pub fn estimate(rod: &Rod, load: &SpatialLoad, covariance: &Matrix6<f64>) -> Result<SpatialEstimate, Error> {
    let Some(reduction) = reduce(load, covariance)? else {
        return Ok(SpatialEstimate { verdict: Verdict::TooWeak, reduction: None, contact: None });
    };
    let contact = contact_with_derivatives(rod, &reduction.load, Method::Auto);
    let weak = !(reduction.covariance[(3, 3)] <= MOST_ROLL_SIGMA_RAD.powi(2));
    let verdict = match &contact {
        _ if !is_straight(rod) => Verdict::CurvedWhisker,
        _ if weak => Verdict::TooWeak,
        _ if reduction.p_value < FALSE_ALARM => Verdict::OutOfPlane,
        Err(why) => Verdict::NoContact(*why),
        Ok(_) => Verdict::Planar,
    };
    let contact = contact.ok().map(|(at, by_load)| in_space(&reduction, at, &by_load));
    Ok(SpatialEstimate { verdict, reduction: Some(reduction), contact })
}

/// The plane of bending of largest likelihood, docs/math/whisker_spatial.md eqs. (3)–(6); none where no plane is better than
/// another.
pub fn reduce(load: &SpatialLoad, covariance: &Matrix6<f64>) -> Result<Option<Reduction>, Error> {
    let seen = load.to_vector();
    if !seen.iter().all(|v| v.is_finite()) {
        return Err(Error::NotFinite { what: "a hub signal" });
    }
    let Some(weight) = covariance.cholesky().map(|factor| factor.inverse()) else {
        let seen = covariance.symmetric_eigenvalues().min();
        return Err(Error::NotPositive { what: "the least eigenvalue of the hub signals' covariance", seen });
    };
    let Some(mut at) = start(load, covariance) else { return Ok(None) };
    for _ in 0..MOST_STEPS {
        let by_parameters = derivatives(&at);
        let normal = by_parameters.transpose() * weight * by_parameters;
        let pull = by_parameters.transpose() * weight * (seen - signals(&at));
        let Some(factor) = normal.cholesky() else { return Ok(None) };
        let step = factor.solve(&pull);
        at += step;
        if step.dot(&pull) < CONVERGED_CHI2 {
            return Ok(Some(reduction(&at, &weight, &seen, factor.inverse())));
        }
    }
    Ok(None)
}

/// Gauss–Newton from the equally weighted plane takes 2 to 4 steps.
const MOST_STEPS: usize = 30;

/// A step that promises less is no step, in units of χ².
const CONVERGED_CHI2: f64 = 1e-16;

fn reduction(
    at: &Vector4<f64>,
    weight: &Matrix6<f64>,
    seen: &Vector6<f64>,
    covariance: Matrix4<f64>,
) -> Reduction {
    let left = seen - signals(at);
    let chi2 = left.dot(&(weight * left));
    // Half a turn of the plane mirrors the load: of the two the one whose moment is positive.
    let side = if at[2] < 0.0 { -1.0 } else { 1.0 };
    let mirror = Matrix4::from_diagonal(&Vector4::new(1.0, side, side, 1.0));
    let half_rotation = if side < 0.0 { std::f64::consts::PI } else { 0.0 };
    Reduction {
        load: HubLoad { fx_n: at[0], fy_n: side * at[1], mz_n_m: side * at[2] },
        roll_rad: (at[3] + half_rotation).sin().atan2((at[3] + half_rotation).cos()),
        covariance: mirror * covariance * mirror,
        chi2,
        p_value: (-0.5 * chi2).exp(),
    }
}

/// Eq. (3): `[fx, fy, fz, mx, my, mz]` of `[fx, f, m, roll]`.
fn signals(at: &Vector4<f64>) -> Vector6<f64> {
    let (sin, cos) = at[3].sin_cos();
    Vector6::new(at[0], at[1] * cos, at[1] * sin, 0.0, -at[2] * sin, at[2] * cos)
}

fn derivatives(at: &Vector4<f64>) -> Matrix6x4<f64> {
    let (sin, cos) = at[3].sin_cos();
    Matrix6x4::from_columns(&[
        Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        Vector6::new(0.0, cos, sin, 0.0, 0.0, 0.0),
        Vector6::new(0.0, 0.0, 0.0, 0.0, -sin, cos),
        Vector6::new(0.0, -at[1] * sin, at[1] * cos, 0.0, -at[2] * cos, -at[2] * sin),
    ])
}

/// Eq. (5): the direction along which transverse force and turned moment are largest, each in units of its noise.
fn start(load: &SpatialLoad, covariance: &Matrix6<f64>) -> Option<Vector4<f64>> {
    let force = Vector2::new(load.force_n.y, load.force_n.z);
    let moment = Vector2::new(load.moment_n_m.z, -load.moment_n_m.y);
    let [of_force, of_moment] =
        [(1, 2), (4, 5)].map(|(i, j)| 2.0 / (covariance[(i, i)] + covariance[(j, j)]));
    let sum = force * force.transpose() * of_force + moment * moment.transpose() * of_moment;
    if !(0.0 < sum.trace() && sum.trace().is_finite()) {
        return None;
    }
    let roll = 0.5 * (2.0 * sum[(0, 1)]).atan2(sum[(0, 0)] - sum[(1, 1)]);
    let across = Vector2::new(roll.cos(), roll.sin());
    Some(Vector4::new(load.force_n.x, across.dot(&force), across.dot(&moment), roll))
}

fn is_straight(rod: &Rod) -> bool {
    match &rod.intrinsic_curvature {
        IntrinsicCurvature::Constant { per_m } => *per_m == 0.0,
        IntrinsicCurvature::Profile { per_m, .. } => per_m.iter().all(|v| *v == 0.0),
    }
}

/// The contact of the plane turned into space, eqs. (7), (8).
fn in_space(plane: &Reduction, at: HubContact, by_load: &ByLoad) -> SpatialContact {
    let (sin, cos) = plane.roll_rad.sin_cos();
    let space_from_plane = |x: f64, y: f64| Vector3::new(x, y * cos, y * sin);
    let mut by_parameters = Matrix3x4::zeros();
    for column in 0..3 {
        by_parameters.set_column(column, &space_from_plane(by_load[(0, column)], by_load[(1, column)]));
    }
    by_parameters.set_column(3, &Vector3::new(0.0, -at.x_in_hub.y * sin, at.x_in_hub.y * cos));
    SpatialContact {
        x_in_hub: space_from_plane(at.x_in_hub.x, at.x_in_hub.y),
        covariance: by_parameters * plane.covariance * by_parameters.transpose(),
        tangent_in_hub: space_from_plane(at.theta_rad.cos(), at.theta_rad.sin()),
        in_plane: at,
    }
}
