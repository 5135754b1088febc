//! The outline under the last contacts: an arc whose radius of curvature changes steadily as its normal turns, and its name.
//!
//! ```text
//!   x(α) = p + ∫ (ρ₀ + ρ₁ a) t(α₀ + a) da, a = 0 … α − α₀     n(α) outward normal, t = dn/dα, ρ = 0: a corner
//! ```
//!
//! docs/math/whisker_events.md eqs. (4)–(8).

use crate::estimate::Mode;
use crate::friction::Projection;
use crate::{Cell, HubLoad, PlanarPose, Sample};
use nalgebra::{Matrix2, Matrix3, Matrix4, RowVector4, SMatrix, Vector2, Vector4};
use resight_core::statistics::chi_square;

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
pub(crate) fn rotation_of_force(load: &HubLoad, friction_rad: f64) -> f64 {
    friction_rad * 1.0_f64.copysign(load.mz_n_m)
}

impl OutlinePoint {
    /// Of a projected load; `friction_rad` is φ_f. The hub's own uncertainty is part of the covariance.
    pub fn new(cell: &Cell, sample: &Sample, projection: &Projection, friction_rad: f64) -> Self {
        let hub = &sample.world_from_hub;
        let by_load = by_load(hub, projection);
        let force = hub.rotate(projection.load.force_n());
        let arm = hub.rotate(projection.at.x_in_hub);
        let by_hub = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
        OutlinePoint {
            x_in_world: hub.apply(projection.at.x_in_hub),
            normal_rad: force.y.atan2(force.x) + rotation_of_force(&projection.load, friction_rad),
            covariance: by_load * projection.covariance * by_load.transpose()
                + by_hub * cell.hub_covariance() * by_hub.transpose(),
            mode: projection.constraint.mode(),
        }
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
        let turned = hub.rotate(Vector2::new(by_load[(0, column)], by_load[(1, column)]));
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

/// A stretch of outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// α₀, world, radians.
    pub normal_rad: f64,
    /// p, the point with that normal, world, metres.
    pub point_m: Vector2<f64>,
    /// ρ₀, the radius of curvature there, metres.
    pub radius_m: f64,
    /// ρ₁ = dρ/dα, metres per radian.
    pub radius_slope_m_per_rad: f64,
}

impl Arc {
    /// A circle's, or with no radius a corner's.
    pub fn circle(centre_m: Vector2<f64>, radius_m: f64) -> Self {
        let point_m = centre_m + Vector2::x() * radius_m;
        Arc { normal_rad: 0.0, point_m, radius_m, radius_slope_m_per_rad: 0.0 }
    }

    /// The point whose normal is α, and ρ there: a convex outline's, so that where ρ would fall below zero a corner begins.
    pub fn at(&self, normal_rad: f64) -> (Vector2<f64>, f64) {
        let mut along = turned(normal_rad - self.normal_rad);
        let radius = self.radius_m + self.radius_slope_m_per_rad * along;
        if radius < 0.0 {
            along = if self.radius_m <= 0.0 { 0.0 } else { -self.radius_m / self.radius_slope_m_per_rad };
        }
        let moved = design(self.normal_rad, along) * self.unknowns();
        (self.point_m + moved, radius.max(0.0))
    }

    /// `[0, 0, ρ₀, ρ₁]`: what shapes the arc beside its point.
    fn unknowns(&self) -> Vector4<f64> {
        Vector4::new(0.0, 0.0, self.radius_m.max(0.0), self.radius_slope_m_per_rad)
    }

    /// Moved by `[px, py, ρ₀, ρ₁]`.
    pub fn moved(&self, by: &Vector4<f64>) -> Self {
        Arc {
            point_m: self.point_m + by.fixed_rows::<2>(0),
            radius_m: self.radius_m + by[2],
            radius_slope_m_per_rad: self.radius_slope_m_per_rad + by[3],
            ..*self
        }
    }
}

/// ∂x(α₀ + a)/∂[px, py, ρ₀, ρ₁], eq. (5): `[I, n − n₀, a n + t − t₀]`.
fn design(normal_rad: f64, along: f64) -> SMatrix<f64, 2, 4> {
    let [start, end] = [normal_rad, normal_rad + along].map(|angle| Vector2::new(angle.cos(), angle.sin()));
    let [start_t, end_t] = [start, end].map(|n| Vector2::new(-n.y, n.x));
    SMatrix::from_columns(&[Vector2::x(), Vector2::y(), end - start, end * along + end_t - start_t])
}

/// The same angle within half a turn of zero.
pub(crate) fn turned(angle_rad: f64) -> f64 {
    angle_rad - (angle_rad / std::f64::consts::TAU).round() * std::f64::consts::TAU
}

/// The arc under a run of contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalOutline {
    /// The arc, from the last contact on.
    pub arc: Arc,
    /// Covariance of `[px, py, ρ₀, ρ₁]`, m, m/rad.
    pub covariance: Matrix4<f64>,
    /// χ² of the contacts about the arc.
    pub chi2: f64,
    /// Its degrees of freedom: two per contact less three, less one where ρ₁ is free.
    pub degrees_of_freedom: usize,
    /// How many contacts it rests on.
    pub contacts: usize,
    /// How far the normal turns along the contacts, radians.
    pub rotation_rad: f64,
}

/// Standard deviation of ρ₀ before any contact, metres: flat as well as sharp, next to a whisker of some decimetres.
const PRIOR_RADIUS_M: f64 = 1.0;
/// Standard deviation of ρ₁ before any contact, metres per radian: an ellipse of axes 5 : 2 cm changes its ρ by about that much.
pub const PRIOR_SLOPE_M_PER_RAD: f64 = 0.05;
/// No change of ρ: a circle.
pub const CIRCLE: f64 = 1e-9;
/// An outline sharper than this on a whisker of a quarter metre is called a corner even where ρ is distinguished from 0.
const CORNER_M: f64 = 1e-3;
/// A radius is distinguished from zero beyond this many standard deviations.
const REPORTED: f64 = 3.0;
/// A radius this uncertain, metres, says nothing yet.
const VAGUE_M: f64 = 2e-3;
/// Rounds of the fit; the normals' own errors settle like a Gauss–Newton iteration's.
const ROUNDS: usize = 12;

impl LocalOutline {
    /// The arc of maximum likelihood, the contacts' normals uncertain as their points are, eqs. (5), (6); `slope_sigma` is what is known
    /// of ρ₁ beforehand, m/rad. None for fewer than three contacts or contacts without a covariance.
    pub fn fit(points: &[OutlinePoint], slope_sigma: f64) -> Option<Self> {
        let last = points.last().filter(|_| 3 <= points.len())?;
        let prior = Vector4::new(0.0, 0.0, PRIOR_RADIUS_M.powi(-2), slope_sigma.powi(-2));
        let mut fit = Fit::new(points, last);
        let mut covariance = Matrix4::zeros();
        for _ in 0..ROUNDS {
            covariance = fit.round(points, &prior)?;
        }
        let free = if slope_sigma <= CIRCLE { 3 } else { 4 };
        let outline = LocalOutline {
            arc: fit.arc,
            covariance,
            chi2: fit.chi2,
            degrees_of_freedom: (2 * points.len()).saturating_sub(free),
            contacts: points.len(),
            rotation_rad: turn(points),
        };
        outline.is_finite().then_some(outline)
    }

    /// The arc under the last contacts: of at most `most`, as many as one arc explains (one right window in a hundred is shortened).
    pub fn of_last(points: &[OutlinePoint], most: usize, slope_sigma: f64) -> Option<Self> {
        let mut count = points.len().min(most);
        loop {
            let outline = LocalOutline::fit(&points[points.len() - count..], slope_sigma)?;
            if count <= 6 || 0.01 < chi_square::tail(outline.degrees_of_freedom, outline.chi2) {
                return Some(outline);
            }
            count = (count * 3 / 4).max(6);
        }
    }

    /// A straight face under the last contacts: normals and offsets all the same while the contacts move along it, eq. (8). None where
    /// fewer than four contacts agree to one, or where they stay in one place.
    pub fn flat_of_last(points: &[OutlinePoint], most: usize) -> Option<Self> {
        let mut count = points.len().min(most);
        while 4 <= count {
            let last = &points[points.len() - count..];
            let face = flat(last)?;
            if 0.01 < chi_square::tail(face.degrees_of_freedom, face.chi2) {
                return is_traced(last).then_some(face);
            }
            count = count * 3 / 4;
        }
        None
    }

    fn is_finite(&self) -> bool {
        self.chi2.is_finite() && self.covariance.iter().all(|v| v.is_finite())
    }

    /// Standard deviation of ρ₀, metres.
    pub fn radius_sigma_m(&self) -> f64 {
        self.covariance[(2, 2)].sqrt()
    }

    /// Derivative of the support n·x at a normal by `[px, py, ρ₀, ρ₁]`.
    pub(crate) fn support_by_arc(&self, normal_rad: f64) -> RowVector4<f64> {
        let n = Vector2::new(normal_rad.cos(), normal_rad.sin());
        n.transpose() * design(self.arc.normal_rad, turned(normal_rad - self.arc.normal_rad))
    }

    /// What mid-whisker contacts on this arc are called, eq. (7).
    pub fn label(&self) -> Label {
        let (radius, sigma) = (self.arc.radius_m.abs(), self.radius_sigma_m());
        match () {
            _ if radius < CORNER_M.max(REPORTED * sigma) && sigma < VAGUE_M => Label::Corner,
            _ if REPORTED * sigma < self.arc.radius_m => Label::Tangent,
            _ => Label::Undecided,
        }
    }
}

/// The fit under way: the arc, and along it where each contact's normal is thought to be.
struct Fit {
    arc: Arc,
    along_rad: Vec<f64>,
    chi2: f64,
}

impl Fit {
    fn new(points: &[OutlinePoint], last: &OutlinePoint) -> Self {
        let arc = Arc {
            normal_rad: last.normal_rad,
            point_m: last.x_in_world,
            radius_m: 0.0,
            radius_slope_m_per_rad: 0.0,
        };
        let along_rad = points.iter().map(|point| turned(point.normal_rad - last.normal_rad)).collect();
        Fit { arc, along_rad, chi2: f64::INFINITY }
    }

    /// One Gauss–Newton step of arc and normals together; the covariance of `[px, py, ρ₀, ρ₁]`.
    fn round(&mut self, points: &[OutlinePoint], prior: &Vector4<f64>) -> Option<Matrix4<f64>> {
        let unknowns = Vector4::new(0.0, 0.0, self.arc.radius_m, self.arc.radius_slope_m_per_rad);
        let mut information = Matrix4::from_diagonal(prior);
        let mut gradient = -prior.component_mul(&unknowns);
        self.chi2 = 0.0;
        let mut rows = Vec::with_capacity(points.len());
        for (point, along) in points.iter().zip(&self.along_rad) {
            let row = Row::new(point, &self.arc, *along)?;
            let weighted = row.by_arc.transpose() * row.weight;
            information += weighted * row.by_arc;
            gradient += weighted * row.residual;
            self.chi2 += row.residual.dot(&(row.weight * row.residual));
            rows.push(row);
        }
        let covariance = information.try_inverse()?;
        let step = covariance * gradient;
        for ((along, row), point) in self.along_rad.iter_mut().zip(&rows).zip(points) {
            *along = turned(point.normal_rad - self.arc.normal_rad)
                - row.normal_gain.dot(&(row.residual - row.by_arc * step));
        }
        self.arc = self.arc.moved(&step);
        Some(covariance)
    }
}

/// One contact's residual, linearised where its normal is thought to be.
struct Row {
    residual: Vector2<f64>,
    by_arc: SMatrix<f64, 2, 4>,
    weight: Matrix2<f64>,
    /// How much of the residual is the normal's own error.
    normal_gain: Vector2<f64>,
}

impl Row {
    fn new(point: &OutlinePoint, arc: &Arc, along: f64) -> Option<Self> {
        let by_arc = design(arc.normal_rad, along);
        let angle = arc.normal_rad + along;
        let unknowns = Vector4::new(0.0, 0.0, arc.radius_m, arc.radius_slope_m_per_rad);
        let by_normal =
            Vector2::new(-angle.sin(), angle.cos()) * (arc.radius_m + arc.radius_slope_m_per_rad * along);
        let error = turned(point.normal_rad - arc.normal_rad) - along;
        let by: SMatrix<f64, 2, 3> = SMatrix::from_columns(&[Vector2::x(), Vector2::y(), -by_normal]);
        let spread = by * point.covariance;
        let weight = (spread * by.transpose()).try_inverse()?;
        Some(Row {
            residual: point.x_in_world - arc.point_m - by_arc * unknowns - by_normal * error,
            by_arc,
            weight,
            normal_gain: weight * spread.column(2),
        })
    }
}

/// A face's radius of curvature, metres: its sagitta over a centimetre is a micrometre.
const FLAT_M: f64 = 10.0;
/// Contacts closer together than this have not traced a face, metres.
const TRACED_M: f64 = 5e-3;

/// The weighted mean of the normals and offsets, taken from the last contact.
fn flat(points: &[OutlinePoint]) -> Option<LocalOutline> {
    let last = points.last()?;
    let n = Vector2::new(last.normal_rad.cos(), last.normal_rad.sin());
    let by = SMatrix::<f64, 2, 3>::new(n.x, n.y, 0.0, 0.0, 0.0, 1.0);
    let seen = |point: &OutlinePoint| {
        let off = n.dot(&(point.x_in_world - last.x_in_world));
        Vector2::new(off, turned(point.normal_rad - last.normal_rad))
    };
    let t = Vector2::new(-n.y, n.x);
    // A normal other than the last one's tilts the offsets: along the face they grow by its difference.
    let rows =
        |point: &OutlinePoint| Matrix2::new(1.0, t.dot(&(point.x_in_world - last.x_in_world)), 0.0, 1.0);
    let (mut information, mut gradient) = (Matrix2::zeros(), Vector2::zeros());
    for point in points {
        let weight = (by * point.covariance * by.transpose()).try_inverse()?;
        information += rows(point).transpose() * weight * rows(point);
        gradient += rows(point).transpose() * weight * seen(point);
    }
    let covariance = information.try_inverse()?;
    let mean = covariance * gradient;
    let chi2 = points.iter().try_fold(0.0, |sum, point| {
        let weight = (by * point.covariance * by.transpose()).try_inverse()?;
        let off = seen(point) - rows(point) * mean;
        Some(sum + off.dot(&(weight * off)))
    })?;
    let mut of_arc = Matrix4::zeros();
    of_arc.fixed_view_mut::<2, 2>(0, 0).copy_from(&(n * n.transpose() * covariance[(0, 0)]));
    let arc = Arc {
        normal_rad: last.normal_rad + mean.y,
        point_m: last.x_in_world + n * mean.x,
        radius_m: FLAT_M,
        radius_slope_m_per_rad: 0.0,
    };
    let degrees_of_freedom = 2 * points.len() - 2;
    let contacts = points.len();
    Some(LocalOutline {
        arc,
        covariance: of_arc,
        chi2,
        degrees_of_freedom,
        contacts,
        rotation_rad: turn(points),
    })
}

/// Whether the contacts have moved along the face.
fn is_traced(points: &[OutlinePoint]) -> bool {
    let [first, .., last] = points else { return false };
    let way = last.x_in_world - first.x_in_world;
    let spread = (first.covariance + last.covariance).fixed_view::<2, 2>(0, 0).trace();
    TRACED_M.max(REPORTED * spread.sqrt()) < way.norm()
}

fn turn(points: &[OutlinePoint]) -> f64 {
    let angles = points.iter().map(|point| turned(point.normal_rad - points[0].normal_rad));
    let (least, most) =
        angles.fold((0.0_f64, 0.0_f64), |(least, most), angle| (least.min(angle), most.max(angle)));
    most - least
}
