//! One pose of the hub, one kind of contact: the force, the place along the whisker and the place on the outline.

use super::TruthContact;
use super::elastica::shoot;
use crate::{PlanarPose, Rod, Shape};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Which part of the outline is touched, and by which part of the whisker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Touching {
    /// Mid-whisker on a smooth outline.
    Tangent,
    /// Mid-whisker on a face, which leads from the corner of this number to the next.
    Face(usize),
    /// Mid-whisker on a corner.
    Corner(usize),
    /// The tip on a smooth outline.
    Tip,
    /// The tip on a face.
    TipOnFace(usize),
}

impl Touching {
    /// Whether it is the tip that touches.
    pub fn is_tip(self) -> bool {
        matches!(self, Touching::Tip | Touching::TipOnFace(_))
    }
}

/// `tan`, `face3`, `corner0`, `tip`, `tip0`: the names of the published truth files.
impl std::fmt::Display for Touching {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Touching::Tangent => write!(f, "tan"),
            Touching::Face(i) => write!(f, "face{i}"),
            Touching::Corner(i) => write!(f, "corner{i}"),
            Touching::Tip => write!(f, "tip"),
            Touching::TipOnFace(i) => write!(f, "tip{i}"),
        }
    }
}

/// The object as the solver walks along it.
pub(super) struct Outline<'a> {
    pub shape: &'a Shape,
    pub corners: Vec<Vector2<f64>>,
    /// Normal of each face, and by how much the next one turns from it, radians.
    pub normals_rad: Vec<f64>,
    pub lengths_m: Vec<f64>,
}

/// A point of the outline, the direction of its normal, and how both move with the parameter.
struct Place {
    x: Vector2<f64>,
    normal_rad: f64,
    x_by: Vector2<f64>,
    normal_by: f64,
}

impl<'a> Outline<'a> {
    pub fn new(shape: &'a Shape) -> Self {
        let corners = shape.corners_m();
        let lengths_m =
            (0..corners.len()).map(|i| (corners[(i + 1) % corners.len()] - corners[i]).norm()).collect();
        Outline { shape, normals_rad: shape.face_normals_rad(), corners, lengths_m }
    }

    pub fn count(&self) -> usize {
        self.corners.len()
    }

    pub fn before(&self, i: usize) -> usize {
        (i + self.count() - 1) % self.count()
    }

    pub fn after(&self, i: usize) -> usize {
        (i + 1) % self.count()
    }

    /// By how much the normal turns at a corner, radians.
    pub fn rotation_rad(&self, corner: usize) -> f64 {
        (self.normals_rad[corner] - self.normals_rad[self.before(corner)]).rem_euclid(TAU)
    }

    /// The parameter is the normal's direction on a smooth outline (rad), the way from its first corner on a face (m), the
    /// normal's turn from the face before at a corner (rad).
    fn place(&self, touching: Touching, parameter: f64) -> Place {
        match touching {
            Touching::Tangent | Touching::Tip => {
                let (x, radius) = self.shape.smooth_point_m(parameter).unwrap_or_default();
                let (sin, cos) = parameter.sin_cos();
                Place { x, normal_rad: parameter, x_by: Vector2::new(-sin, cos) * radius, normal_by: 1.0 }
            }
            Touching::Face(i) | Touching::TipOnFace(i) => {
                let (sin, cos) = self.normals_rad[i].sin_cos();
                let along = Vector2::new(-sin, cos);
                let x = self.corners[i] + along * parameter;
                Place { x, normal_rad: self.normals_rad[i], x_by: along, normal_by: 0.0 }
            }
            Touching::Corner(i) => {
                let normal_rad = self.normals_rad[self.before(i)] + parameter;
                Place { x: self.corners[i], normal_rad, x_by: Vector2::zeros(), normal_by: 1.0 }
            }
        }
    }
}

/// Abscissae and weights of Gauss and Legendre's rule of five points over 0 … 1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

impl Outline<'_> {
    /// Length of the outline, counter-clockwise, over a small change of the parameter.
    fn arc_m(&self, touching: Touching, parameter: f64, by: f64) -> f64 {
        match touching {
            Touching::Face(_) | Touching::TipOnFace(_) => by,
            Touching::Corner(_) => 0.0,
            Touching::Tangent | Touching::Tip => {
                let radius =
                    |share: f64| self.shape.smooth_point_m(parameter + share * by).map_or(0.0, |(_, r)| r);
                by * GAUSS.iter().map(|(share, weight)| weight * radius(*share)).sum::<f64>()
            }
        }
    }
}

/// A whisker bent by an object.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    pub touching: Touching,
    /// +1 with the object on the right of the whisker, −1 on the left.
    pub side: f64,
    /// Angle of friction on the whisker, signed: positive where it pulls towards the tip. At its limit while the whisker slides,
    /// unknown while it sticks.
    pub friction_rad: f64,
    /// Whether the touching point of the whisker stays on the touched point of the outline, or rolls.
    pub sticks: bool,
    /// Force, newtons; arc length, metres, or for the tip the whisker's direction there, radians; parameter on the outline.
    pub unknowns: Vector3<f64>,
}

/// The contact that a state means, world axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observed {
    pub x: Vector2<f64>,
    pub theta_rad: f64,
    pub s_m: f64,
    pub force_n: f64,
    /// From the whisker's normal.
    pub friction_angle_rad: f64,
    /// Direction of the outline's normal.
    pub normal_rad: f64,
}

/// The hub that a state needs, and its derivatives by the unknowns.
struct Needs {
    hub: Vector3<f64>,
    by: Matrix3<f64>,
}

/// Converged: the state and how it answers to the hub.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solved {
    pub state: State,
    /// Derivatives of the unknowns by the hub's `[x, y, angle]`.
    pub by_hub: Matrix3<f64>,
    /// Sign of the determinant: a change says that a fold was stepped over.
    pub orientation: f64,
}

impl State {
    pub fn seen(&self, rod: &Rod, outline: &Outline) -> Observed {
        let place = outline.place(self.touching, self.unknowns.z);
        let tip = self.touching.is_tip();
        let theta_rad = if tip { self.unknowns.y } else { place.normal_rad - self.side * FRAC_PI_2 };
        Observed {
            x: place.x,
            theta_rad,
            s_m: if tip { rod.length_m } else { self.unknowns.y },
            force_n: self.unknowns.x,
            friction_angle_rad: self.tilt_rad(theta_rad, place.normal_rad),
            normal_rad: place.normal_rad,
        }
    }

    /// The contact as the outside sees it.
    pub fn truth(&self, rod: &Rod, outline: &Outline) -> TruthContact {
        let seen = self.seen(rod, outline);
        let (sin, cos) = seen.theta_rad.sin_cos();
        let (tangent, normal) = (Vector2::new(cos, sin), Vector2::new(-sin, cos) * self.side);
        let (pull, push) = seen.friction_angle_rad.sin_cos();
        TruthContact {
            x_in_world: seen.x,
            s_m: seen.s_m,
            theta_rad: seen.theta_rad,
            force_in_world_n: (tangent * pull + normal * push) * seen.force_n,
            friction_angle_rad: seen.friction_angle_rad,
            touching: self.touching,
            sticks: self.sticks,
        }
    }

    /// Angle of the force from the whisker's normal; eq. (2).
    fn tilt_rad(&self, theta_rad: f64, normal_rad: f64) -> f64 {
        self.friction_rad + wrapped(FRAC_PI_2 - self.side * (normal_rad - theta_rad))
    }

    /// eq. (3)–(4).
    fn needs(&self, rod: &Rod, outline: &Outline) -> Option<Needs> {
        let seen = self.seen(rod, outline);
        if !(seen.friction_angle_rad.abs() < FRAC_PI_2) {
            return None;
        }
        let place = outline.place(self.touching, self.unknowns.z);
        let shot = shoot(rod, self.side, seen.force_n, seen.s_m, seen.friction_angle_rad);
        let (sin, cos) = seen.theta_rad.sin_cos();
        let turn = Matrix3::new(cos, -self.side * sin, 0.0, sin, self.side * cos, 0.0, 0.0, 0.0, self.side);
        let hub = turn * shot.hub_in_contact;
        let by_theta = Vector3::new(-hub.y, hub.x, 1.0);
        let by = turn * shot.by;
        let (by_force, by_s, by_tilt) = (by.column(0), by.column(1), by.column(2));
        let by_place = Vector3::new(place.x_by.x, place.x_by.y, 0.0);
        let by_roll = by_s * (-self.side * place.x_by.norm());
        let columns = match (self.touching.is_tip(), self.sticks) {
            // The tilt turns with the whisker, and against the outline.
            (true, false) => [
                by_force.into(),
                by_theta + by_tilt * self.side,
                by_place - by_tilt * (self.side * place.normal_by),
            ],
            (true, true) => [by_force.into(), by_theta + by_tilt * self.side, by_tilt.into()],
            (false, false) => [by_force.into(), by_s.into(), by_place + by_theta * place.normal_by],
            (false, true) => {
                [by_force.into(), by_place + by_theta * place.normal_by + by_roll, by_tilt.into()]
            }
        };
        let hub = hub + Vector3::new(seen.x.x, seen.x.y, seen.theta_rad);
        Some(Needs { hub, by: Matrix3::from_columns(&columns) })
    }

    /// The state after a small change: of the unknowns while it slides; while it sticks of the force, of the parameter (of the
    /// direction, for the tip) and of the friction.
    pub fn moved(mut self, outline: &Outline, by: &Vector3<f64>) -> Self {
        if !self.sticks {
            self.unknowns += by;
            return self;
        }
        self.unknowns.x += by.x;
        self.friction_rad += by.z;
        if self.touching.is_tip() {
            self.unknowns.y += by.y;
        } else {
            // Rolling: as much of the whisker as of the outline, eq. (11).
            self.unknowns.y -= self.side * outline.arc_m(self.touching, self.unknowns.z, by.y);
            self.unknowns.z += by.y;
        }
        self
    }

    /// How this state, taken as solved, answers to the hub.
    pub fn derivatives(&self, rod: &Rod, outline: &Outline) -> Option<Solved> {
        let needs = self.needs(rod, outline)?;
        let orientation = needs.by.determinant().signum();
        Some(Solved { state: *self, by_hub: needs.by.try_inverse()?, orientation })
    }

    /// The same where the whisker only just touches: with the weakest force that the formulas take.
    pub fn at_touch(mut self, rod: &Rod, outline: &Outline) -> Option<Solved> {
        self.unknowns.x = least_force_n(rod);
        self.derivatives(rod, outline)
    }

    /// Newton's method from this state to the one that `hub` needs; None where it does not arrive.
    pub fn solve(mut self, rod: &Rod, outline: &Outline, hub: &PlanarPose) -> Option<Solved> {
        let weakest = least_force_n(rod);
        for _ in 0..MAX_STEPS {
            // A trial may not leave the range where the formulas hold; the solution itself may be beyond the tip or pull.
            self.unknowns.x = self.unknowns.x.max(weakest);
            let needs = self.needs(rod, outline)?;
            let missing = Vector3::new(
                hub.x_m - needs.hub.x,
                hub.y_m - needs.hub.y,
                wrapped(hub.angle_rad - needs.hub.z),
            );
            let determinant = needs.by.determinant();
            let by_hub = needs.by.try_inverse()?;
            let step = by_hub * missing;
            self = self.moved(outline, &step);
            let far = missing.x.hypot(missing.y) / rod.length_m + missing.z.abs();
            if !far.is_finite() || !self.is_plausible(rod, outline) {
                return None;
            }
            // The step just taken squares what was missing: below rounding.
            if far < CONVERGED && self.is_settled(rod, &step) {
                return Some(Solved { state: self, by_hub, orientation: determinant.signum() });
            }
        }
        None
    }

    /// Near a fold what is missing squares slowly: the step must be small too.
    fn is_settled(&self, rod: &Rod, step: &Vector3<f64>) -> bool {
        let scale = rod.length_m;
        let angle = self.touching.is_tip() || self.sticks && !matches!(self.touching, Touching::Face(_));
        let arc = if angle { step.y.abs() } else { step.y.abs() / scale };
        step.x.abs() * scale * scale / rod.ei_base_n_m2() + arc < SETTLED
    }

    fn is_plausible(&self, rod: &Rod, outline: &Outline) -> bool {
        let z = &self.unknowns;
        let along =
            if self.touching.is_tip() { true } else { 0.0 < z.y && z.y < MAX_OVERSHOOT * rod.length_m };
        let on_face = match self.touching {
            Touching::Face(i) | Touching::TipOnFace(i) => {
                z.z.abs() < 3.0 * outline.lengths_m[i] + rod.length_m
            }
            Touching::Corner(_) => z.z.abs() < TAU,
            _ => true,
        };
        z.x.is_finite() && along && on_face
    }
}

impl Solved {
    /// The state predicted after a motion of the hub.
    pub fn moved(&self, outline: &Outline, by: &Vector3<f64>) -> State {
        self.state.moved(outline, &(self.by_hub * by))
    }

    /// How fast the whisker slides along the outline towards its tip, per share of a motion `by` of the hub, metres; eq. (11).
    pub fn slip_m(&self, outline: &Outline, by: &Vector3<f64>) -> f64 {
        if self.state.sticks {
            return 0.0;
        }
        let rate = self.by_hub * by;
        let place = outline.place(self.state.touching, self.state.unknowns.z);
        let along = -self.state.side * place.x_by.norm() * rate.z;
        if self.state.touching.is_tip() { along } else { along - rate.y }
    }
}

/// Newton's steps before a path is halved.
const MAX_STEPS: usize = 12;
/// Part of the length that may be missing before the last step, which squares it.
const CONVERGED: f64 = 1e-9;
/// Largest last step, parts of L, rad and EI/L².
const SETTLED: f64 = 1e-7;
/// How far beyond the tip a trial may look, where a taper still has some stiffness.
const MAX_OVERSHOOT: f64 = 1.1;

/// Below this force there is no contact, newtons: u = 1e-4 at the tip, a deflection of 3e-9 of the length.
pub(super) fn least_force_n(rod: &Rod) -> f64 {
    1e-8 * rod.ei_base_n_m2() / (rod.length_m * rod.length_m)
}

/// Into (−π, π].
pub(super) fn wrapped(angle_rad: f64) -> f64 {
    let turned = angle_rad - TAU * (angle_rad / TAU).round();
    if turned <= -PI { turned + TAU } else { turned }
}
