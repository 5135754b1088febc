//! The outline under the last contacts: a circle arc by its support lines, and what it is called.
//!
//! ```text
//!   x = c + ρ n(α)    x contact, n its unit normal away from the object, c centre, ρ radius of curvature: 0 at a corner
//! ```
//!
//! docs/math/whisker_events.md eqs. (4)–(7).

use crate::estimate::Mode;
use crate::friction::Projection;
use crate::{HubLoad, PlanarPose, Sample};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, SMatrix, Vector2, Vector3};
use resight_core::frames::chi_square;

/// A contact as the outline sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlinePoint {
    /// The contact, world, metres.
    pub x_in_world: Vector2<f64>,
    /// Direction of the outline's normal, away from the object, world, radians.
    pub normal_rad: f64,
    /// Covariance of `[x, y, normal]`, m², m·rad, rad².
    pub covariance: Matrix3<f64>,
    /// Where on the whisker.
    pub mode: Mode,
}

/// The outline's normal turned from the force: φ_f towards the whisker's tip, by the side that is touched, eq. (4).
pub(crate) fn turn_of_force(load: &HubLoad, friction_rad: f64) -> f64 {
    friction_rad * 1.0_f64.copysign(load.mz_n_m)
}

impl OutlinePoint {
    /// Of a projected load; `friction_rad` is φ_f.
    pub fn new(sample: &Sample, projection: &Projection, friction_rad: f64) -> Self {
        let hub = &sample.world_from_hub;
        let by_load = by_load(hub, projection);
        let force = hub.turn(projection.load.force_n());
        OutlinePoint {
            x_in_world: hub.apply(projection.at.x_in_hub),
            normal_rad: force.y.atan2(force.x) + turn_of_force(&projection.load, friction_rad),
            covariance: by_load * projection.covariance * by_load.transpose(),
            mode: projection.constraint.mode(),
        }
    }

    fn normal(&self) -> Vector2<f64> {
        Vector2::new(self.normal_rad.cos(), self.normal_rad.sin())
    }
}

/// Derivatives of `[x, y, normal]`, world, by `[fx, fy, mz]`.
pub(crate) fn by_load(hub: &PlanarPose, projection: &Projection) -> Matrix3<f64> {
    by_load_of(hub, &projection.load, &projection.by_load)
}

pub(crate) fn by_load_of(hub: &PlanarPose, load: &HubLoad, by_load: &crate::contact::ByLoad) -> Matrix3<f64> {
    let force = load.force_n();
    let mut rows = Matrix3::zeros();
    for column in 0..3 {
        let turned = hub.turn(Vector2::new(by_load[(0, column)], by_load[(1, column)]));
        (rows[(0, column)], rows[(1, column)]) = (turned.x, turned.y);
    }
    rows[(2, 0)] = -force.y / force.norm_squared();
    rows[(2, 1)] = force.x / force.norm_squared();
    rows
}

/// What is touched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Label {
    /// A corner: the whisker turns about a fixed point.
    Corner,
    /// A smooth part of the outline: the contact moves as the whisker turns.
    Tangent,
    /// The whisker's tip traces the outline.
    Tip,
    /// The contacts do not tell.
    Undecided,
}

/// The circle arc under a run of contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalOutline {
    /// c, world, metres.
    pub centre_m: Vector2<f64>,
    /// ρ, metres; 0 at a corner.
    pub radius_m: f64,
    /// Covariance of `[cx, cy, ρ]`, m².
    pub covariance: Matrix3<f64>,
    /// χ² of the contacts about the arc.
    pub chi2: f64,
    /// Its degrees of freedom: two per contact less three.
    pub degrees_of_freedom: usize,
    /// How far the normal turns along the contacts, radians.
    pub turn_rad: f64,
}

/// Standard deviation of ρ before any contact, metres: flat as well as sharp, next to a whisker of some decimetres.
const PRIOR_RADIUS_M: f64 = 1.0;
/// An outline sharper than this on a whisker of a quarter metre is called a corner even where ρ is told from 0.
const CORNER_M: f64 = 1e-3;
/// A radius is told from zero beyond this many standard deviations.
const TOLD: f64 = 3.0;
/// A radius this uncertain, metres, says nothing yet.
const VAGUE_M: f64 = 0.01;

impl LocalOutline {
    /// The arc of maximum likelihood, eqs. (5), (6). None for fewer than three contacts or contacts at one place and angle.
    pub fn fit(points: &[OutlinePoint]) -> Option<Self> {
        if points.len() < 3 {
            return None;
        }
        let (mut arc, mut fitted) = (Vector3::zeros(), None);
        // ρ enters the weights: three rounds settle them to a part in a thousand.
        for _ in 0..3 {
            let (information, gradient, _) = equations(points, &arc)?;
            let covariance = information.try_inverse()?;
            arc += covariance * gradient;
            fitted = Some(covariance);
        }
        let (_, _, chi2) = equations(points, &arc)?;
        let origin = points[0].x_in_world;
        let outline = LocalOutline {
            centre_m: origin + arc.fixed_rows::<2>(0),
            radius_m: arc.z,
            covariance: fitted?,
            chi2,
            degrees_of_freedom: 2 * points.len() - 3,
            turn_rad: turn(points),
        };
        outline.covariance.iter().chain(arc.iter()).all(|v| v.is_finite()).then_some(outline)
    }

    /// The arc under the last contacts: of at most `most`, as many as one arc explains (one right window in a hundred is shortened).
    pub fn of_last(points: &[OutlinePoint], most: usize) -> Option<Self> {
        let mut count = points.len().min(most);
        loop {
            let outline = LocalOutline::fit(&points[points.len() - count..])?;
            if count <= 6 || 0.01 < chi_square::tail(outline.degrees_of_freedom, outline.chi2) {
                return Some(outline);
            }
            count = (count * 3 / 4).max(6);
        }
    }

    /// Standard deviation of ρ, metres.
    pub fn radius_sigma_m(&self) -> f64 {
        self.covariance[(2, 2)].sqrt()
    }

    /// What mid-whisker contacts on this arc are called, eq. (7).
    pub fn label(&self) -> Label {
        let (radius, sigma) = (self.radius_m.abs(), self.radius_sigma_m());
        match () {
            _ if radius < CORNER_M.max(TOLD * sigma) && sigma < VAGUE_M => Label::Corner,
            _ if TOLD * sigma < self.radius_m => Label::Tangent,
            _ => Label::Undecided,
        }
    }
}

type Equations = (Matrix3<f64>, Vector3<f64>, f64);

/// Normal equations of `[c − x₀, ρ]` at `arc`, and χ² there.
fn equations(points: &[OutlinePoint], arc: &Vector3<f64>) -> Option<Equations> {
    let mut information = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, PRIOR_RADIUS_M.powi(-2)));
    let mut gradient = Vector3::new(0.0, 0.0, -arc.z * PRIOR_RADIUS_M.powi(-2));
    let mut chi2 = 0.0;
    for point in points {
        let n = point.normal();
        let by_arc: SMatrix<f64, 2, 3> = SMatrix::from_columns(&[Vector2::x(), Vector2::y(), n]);
        let residual = point.x_in_world - points[0].x_in_world - by_arc * arc;
        let weight = weight(point, arc.z)?;
        let weighted: Matrix3x2<f64> = by_arc.transpose() * weight;
        information += weighted * by_arc;
        gradient += weighted * residual;
        chi2 += residual.dot(&(weight * residual));
    }
    Some((information, gradient, chi2))
}

/// Inverse covariance of x − c − ρ n(α).
fn weight(point: &OutlinePoint, radius_m: f64) -> Option<Matrix2<f64>> {
    let n = point.normal();
    let by: SMatrix<f64, 2, 3> =
        SMatrix::from_columns(&[Vector2::x(), Vector2::y(), Vector2::new(n.y, -n.x) * radius_m]);
    (by * point.covariance * by.transpose()).try_inverse()
}

fn turn(points: &[OutlinePoint]) -> f64 {
    let first = points[0].normal();
    let angles = points.iter().map(|point| {
        let n = point.normal();
        (first.x * n.y - first.y * n.x).atan2(first.dot(&n))
    });
    let (least, most) =
        angles.fold((0.0_f64, 0.0_f64), |(least, most), angle| (least.min(angle), most.max(angle)));
    most - least
}
