//! The constraints on a sample in contact, and their derivatives by its reading, the hub and every parameter.
//!
//! ```text
//!   free: the load is zero · mid: F (sin φ − sin φ_f) = 0 · tip: s − L = 0                   docs/math/whisker_calibrate.md (5)–(7)
//!   with an object: the tangent of a mid contact supports it, the point of a tip contact lies on it                   (9)–(10)
//! ```

use super::model::{Gravity, Meant, meant, rod_of};
use super::outline::{
    Outline, face_near, face_normal, is_near_corner, signed_distance, supporting_point, unit,
};
use super::parameters::{COUNT, Parameter, Values};
use crate::contact::{ByLoad, Method, by_stiffness, contact_in_hub, contact_with_derivatives};
use crate::{HubContact, Rod, Sample, Shape};
use nalgebra::{DVector, RowSVector, RowVector3, SVector, Vector2};
use std::f64::consts::FRAC_PI_2;

/// The reading and the hub's pose as read: `[fx, fy, mz, x, y, angle]`.
pub type Observed = SVector<f64, 6>;

/// The role of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Nothing touched.
    Free,
    /// Contact between clamp and tip, sliding.
    Mid,
    /// Contact at the tip.
    Tip,
    /// Not used: too near a change of role, or not explained by any.
    Unused,
}

/// The constraint of a contact on the object's outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outlined {
    /// Nothing: no object, or a tip too near a corner.
    Not,
    /// Its tangent supports the outline, and the contact is the point of the outline with that normal.
    Supports,
    /// It lies on the line of a face, be it on the face itself or at either of its corners.
    OnFace(usize),
    /// It lies on the outline.
    On,
}

/// The equations of a sample, selected before a fit, so that their number does not change during it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Its role.
    pub role: Role,
    /// Its relation to the outline.
    pub outlined: Outlined,
    /// The unknown that rotates the hub during its stretch; `None` where no equation depends on the hub.
    pub stretch: Option<Stretch>,
}

/// Samples over which the encoder's rounding has something in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// Index of the unknown.
    pub unknown: usize,
    /// Whether the reading of the angle does not change: then that unknown is the whole rounding error.
    pub is_still: bool,
}

/// One scalar equation at one sample.
#[derive(Debug, Clone)]
pub struct Constraint {
    /// Its value, 0 where it is satisfied.
    pub value: f64,
    /// Derivatives with respect to the observations.
    pub by_observed: RowSVector<f64, 6>,
    /// Derivatives with respect to the rig's parameters.
    pub by_parameters: RowSVector<f64, COUNT>,
    /// Derivatives with respect to the object's free parameters.
    pub by_object: Vec<f64>,
}

impl State {
    /// Starts at `values`, with object and encoder as stated.
    pub fn at(values: Values) -> Self {
        State { values, object: DVector::zeros(0), rotations_rad: DVector::zeros(0) }
    }
}

/// The state of a fit.
#[derive(Debug, Clone)]
pub struct State {
    /// The rig's parameters.
    pub values: Values,
    /// The object's, from its start.
    pub object: DVector<f64>,
    /// The rotation of the hub during each stretch by the encoder's rounding, radians.
    pub rotations_rad: DVector<f64>,
}

/// The constants of a fit.
#[derive(Debug, Clone, Copy)]
pub struct Setting<'a> {
    /// The rod as given.
    pub rod: &'a Rod,
    /// Gravity in the plane, where the weight is modelled.
    pub gravity: Option<&'a Gravity>,
    /// The object, where one is used.
    pub outline: Option<&'a Outline>,
    /// The method for computing contacts.
    pub method: Method,
    /// Whether the intrinsic curvature is free; its derivative needs two more contacts.
    pub curvature_is_free: bool,
}

/// A state's rod and object, made once for all samples.
pub struct Posed<'a> {
    setting: Setting<'a>,
    state: &'a State,
    rod: Rod,
    /// The same rod with its curvature changed by ± the step of [`CURVATURE_STEP_RAD`].
    bent: [Rod; 2],
    shape: Option<Shape>,
}

/// A contact under a state, with all that residuals need.
#[derive(Debug, Clone)]
pub struct Touched {
    /// The corrected readings of the instruments.
    pub meant: Meant,
    /// The contact in the hub frame.
    pub at: HubContact,
    /// Derivatives with respect to the load.
    pub by_load: ByLoad,
    /// `[x, y, θ, s, φ]` by ln EI.
    pub by_stiffness: SVector<f64, 5>,
    /// Derivatives with respect to the intrinsic curvature.
    pub by_curvature: SVector<f64, 5>,
}

/// Half the bend of the whole whisker between the ends of the central difference by its curvature: truncation 10⁻¹⁰, rounding 10⁻¹¹.
const CURVATURE_STEP_RAD: f64 = 1e-5;

impl<'a> Posed<'a> {
    /// The rod and the object at `state`.
    pub fn new(setting: Setting<'a>, state: &'a State) -> Self {
        let rod = rod_of(&state.values, setting.rod);
        let bent = [1.0, -1.0].map(|sign| {
            let mut values = state.values;
            values[Parameter::Curvature.index()] += sign * CURVATURE_STEP_RAD / setting.rod.length_m;
            rod_of(&values, setting.rod)
        });
        let shape = setting.outline.map(|outline| outline.shape(state.object.as_slice()));
        Posed { setting, state, rod, bent, shape }
    }

    /// The sample with its hub rotated by the encoder's rounding.
    pub fn rotated(&self, sample: &Sample, plan: &Plan) -> Sample {
        let mut rotated = *sample;
        if let Some(turn) = plan.stretch.and_then(|stretch| self.state.rotations_rad.get(stretch.unknown)) {
            rotated.world_from_hub.angle_rad += turn;
        }
        rotated
    }

    /// Returns the corrected readings of `sample`.
    pub fn meant(&self, sample: &Sample) -> Meant {
        meant(&self.state.values, self.setting.gravity, sample)
    }

    /// Returns the contact of `sample`; `None` where its load has none.
    pub fn touched(&self, sample: &Sample) -> Option<Touched> {
        let meant = self.meant(sample);
        let (at, by_load) = contact_with_derivatives(&self.rod, &meant.load, self.setting.method).ok()?;
        let by_curvature = if self.setting.curvature_is_free {
            let ends = [0, 1].map(|i| contact_in_hub(&self.bent[i], &meant.load, self.setting.method));
            let [Ok(plus), Ok(minus)] = ends else { return None };
            (plus.to_vector() - minus.to_vector()) * (0.5 * self.rod.length_m / CURVATURE_STEP_RAD)
        } else {
            SVector::zeros()
        };
        let by_stiffness = by_stiffness(&meant.load, &by_load);
        Some(Touched { meant, at, by_load, by_stiffness, by_curvature })
    }

    /// The three readings of a free sample, which must be zero.
    pub fn free(&self, sample: &Sample) -> Vec<Constraint> {
        let meant = self.meant(sample);
        let load = meant.load.to_vector();
        (0..3)
            .map(|i| {
                let mut by_observed = RowSVector::<f64, 6>::zeros();
                by_observed.fixed_columns_mut::<3>(0).copy_from(&meant.load_by_reading.row(i));
                Constraint {
                    value: load[i],
                    by_observed,
                    by_parameters: meant.load_by_parameters.row(i).into(),
                    by_object: vec![0.0; self.state.object.len()],
                }
            })
            .collect()
    }

    /// Returns the constraints on a contact: that of its role, then, with an object, those of the outline.
    pub fn contact(&self, sample: &Sample, plan: &Plan) -> Option<Vec<Constraint>> {
        let touched = self.touched(sample)?;
        let mut constraints =
            vec![if plan.role == Role::Tip { self.at_tip(&touched) } else { self.sliding(&touched) }];
        if let Some(shape) = &self.shape {
            match plan.outlined {
                Outlined::Not => {}
                Outlined::Supports => {
                    constraints.push(self.supporting(&touched, shape));
                    constraints.push(self.placed(&touched, shape));
                }
                Outlined::OnFace(face) => constraints.push(self.on_face(&touched, shape, face)),
                Outlined::On => constraints.push(self.on_outline(&touched, shape)),
            }
        }
        Some(constraints)
    }

    /// Returns the relation of a contact in `role` to the outline; none where its force is below `least_force_n`.
    pub fn outlined(&self, sample: &Sample, role: Role, least_force_n: f64) -> Outlined {
        let (Some(shape), Some(touched)) = (&self.shape, self.touched(sample)) else { return Outlined::Not };
        match role {
            _ if touched.meant.load.force_n().norm() < least_force_n => Outlined::Not,
            Role::Mid => match face_near(shape, touched.normal_rad()) {
                Some(face) => Outlined::OnFace(face),
                None => Outlined::Supports,
            },
            Role::Tip if !is_near_corner(shape, touched.x_in_world()) => Outlined::On,
            _ => Outlined::Not,
        }
    }

    /// F (sin φ − sin φ_f), newtons.
    pub fn sliding(&self, touched: &Touched) -> Constraint {
        let friction = self.state.values[Parameter::FrictionAngle.index()];
        let force = touched.meant.load.force_n();
        let size = force.norm();
        let excess = touched.at.friction_angle_rad.sin() - friction.sin();
        let mut by_contact = RowSVector::<f64, 5>::zeros();
        by_contact[4] = size * touched.at.friction_angle_rad.cos();
        let by_load = RowVector3::new(force.x, force.y, 0.0) * (excess / size);
        let mut constraint = self.chained(touched, size * excess, &by_contact, by_load, RowVector3::zeros());
        constraint.by_parameters[Parameter::FrictionAngle.index()] -= size * friction.cos();
        constraint
    }

    /// s − L, metres.
    pub fn at_tip(&self, touched: &Touched) -> Constraint {
        let mut by_contact = RowSVector::<f64, 5>::zeros();
        by_contact[3] = 1.0;
        let value = touched.at.s_m - self.rod.length_m;
        self.chained(touched, value, &by_contact, RowVector3::zeros(), RowVector3::zeros())
    }

    /// n·x − h(n), metres, n across the whisker: the tangent of a mid contact supports the object.
    fn supporting(&self, touched: &Touched, shape: &Shape) -> Constraint {
        let (x, angle) = (touched.x_in_world(), touched.normal_rad());
        // n·x − h = n·(x − p), and turning n about p, where h is supported, leaves t·(x − p).
        let off = x - supporting_point(shape, angle).0;
        let by_angle = unit(angle + FRAC_PI_2).dot(&off);
        self.along(
            touched,
            angle,
            unit(angle).dot(&off) - self.radius_m(touched),
            by_angle,
            |outline, moved| outline.support_by_parameters(moved, angle),
        )
    }

    /// t·x − h′(n), metres: a mid contact is where the outline has its normal.
    fn placed(&self, touched: &Touched, shape: &Shape) -> Constraint {
        let (x, angle) = (touched.x_in_world(), touched.normal_rad());
        let (point, radius) = supporting_point(shape, angle);
        let value = unit(angle + FRAC_PI_2).dot(&(x - point));
        // h″ = ρ − h: −n·x − h″ = −n·(x − p) − ρ.
        let by_angle = -unit(angle).dot(&(x - point)) - radius;
        self.along(touched, angle + FRAC_PI_2, value, by_angle, |outline, moved| {
            outline.slope_by_parameters(moved, angle)
        })
    }

    /// n·x − h(n), metres, n across a face.
    fn on_face(&self, touched: &Touched, shape: &Shape, face: usize) -> Constraint {
        let (x, angle) = (touched.x_in_world(), face_normal(shape, face));
        let value = unit(angle).dot(&x) - shape.support_m(unit(angle)) - self.radius_m(touched);
        self.along(touched, angle, value, 0.0, |outline, moved| {
            outline.face_by_parameters(moved, face, x).into_iter().map(|d| -d).collect()
        })
    }

    /// The signed distance of a contact at the tip from the outline, metres.
    fn on_outline(&self, touched: &Touched, shape: &Shape) -> Constraint {
        let (distance, angle) = signed_distance(shape, touched.x_in_world());
        self.along(touched, angle, distance - self.radius_m(touched), 0.0, |outline, moved| {
            outline.support_by_parameters(moved, angle)
        })
    }

    /// The whisker's radius: its centre line runs that far outside the outline. How it changes along the whisker is left out of the
    /// derivatives: a part in 10³ of the place along it.
    fn radius_m(&self, touched: &Touched) -> f64 {
        0.5 * self.rod.diameter_m_at(touched.at.s_m)
    }

    /// A distance along a direction of the world, which also depends on the direction of the whisker.
    fn along(
        &self,
        touched: &Touched,
        direction_rad: f64,
        value: f64,
        by_angle: f64,
        by_object: impl Fn(&Outline, &[f64]) -> Vec<f64>,
    ) -> Constraint {
        let hub = &touched.meant.world_from_hub;
        let direction = unit(direction_rad);
        let in_hub = hub.rotate_back(direction);
        let by_contact = RowSVector::<f64, 5>::new(in_hub.x, in_hub.y, by_angle, 0.0, 0.0);
        let arm = touched.x_in_world() - Vector2::new(hub.x_m, hub.y_m);
        let turn = direction.y * arm.x - direction.x * arm.y + by_angle;
        let by_hub = RowVector3::new(direction.x, direction.y, turn);
        let mut constraint = self.chained(touched, value, &by_contact, RowVector3::zeros(), by_hub);
        if let Some(outline) = self.setting.outline {
            let by = by_object(outline, self.state.object.as_slice());
            constraint.by_object = by.into_iter().map(|d| -d).collect();
        }
        constraint
    }

    /// The chain rule: a value that depends on the contact `[x, y, θ, s, φ]` (hub frame), the load besides, and the hub.
    fn chained(
        &self,
        touched: &Touched,
        value: f64,
        by_contact: &RowSVector<f64, 5>,
        by_load_besides: RowVector3<f64>,
        by_hub: RowVector3<f64>,
    ) -> Constraint {
        let by_load = by_contact * touched.by_load + by_load_besides;
        let mut by_observed = RowSVector::<f64, 6>::zeros();
        by_observed.fixed_columns_mut::<3>(0).copy_from(&(by_load * touched.meant.load_by_reading));
        by_observed.fixed_columns_mut::<3>(3).copy_from(&by_hub);
        let mut by_parameters = by_load * touched.meant.load_by_parameters;
        by_parameters[Parameter::Stiffness.index()] += (by_contact * touched.by_stiffness)[0];
        by_parameters[Parameter::Curvature.index()] += (by_contact * touched.by_curvature)[0];
        by_parameters[Parameter::HubX.index()] += by_hub.x;
        by_parameters[Parameter::HubY.index()] += by_hub.y;
        by_parameters[Parameter::HubAngle.index()] += by_hub.z;
        Constraint { value, by_observed, by_parameters, by_object: vec![0.0; self.state.object.len()] }
    }
}

impl Touched {
    /// The contact in the world.
    fn x_in_world(&self) -> Vector2<f64> {
        self.meant.world_from_hub.apply(self.at.x_in_hub)
    }

    /// Direction of the normal from the object to the whisker, n = ±(−sin θ, cos θ), world.
    fn normal_rad(&self) -> f64 {
        let side = if self.meant.load.mz_n_m < 0.0 { -1.0 } else { 1.0 };
        self.meant.world_from_hub.angle_rad + self.at.theta_rad + side * FRAC_PI_2
    }
}

/// The sample moved by a correction of what was observed.
pub fn corrected(sample: &Sample, correction: &Observed) -> Sample {
    let mut moved = *sample;
    moved.load.fx_n += correction[0];
    moved.load.fy_n += correction[1];
    moved.load.mz_n_m += correction[2];
    moved.world_from_hub.x_m += correction[3];
    moved.world_from_hub.y_m += correction[4];
    moved.world_from_hub.angle_rad += correction[5];
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HubLoad;
    use crate::calibrate::Object;

    /// A load without friction at 0.4 N, beside objects of every kind.
    fn sample() -> Sample {
        let load = HubLoad { fx_n: -0.2496, fy_n: 0.35, mz_n_m: 0.07 };
        let world_from_hub = crate::PlanarPose { x_m: 0.02, y_m: -0.01, angle_rad: 1.4 };
        Sample { load, world_from_hub, ..Sample::default() }
    }

    fn shapes() -> [Shape; 4] {
        let centre_m = Vector2::new(0.05, 0.15);
        [
            Shape::Circle { centre_m, radius_m: 0.025 },
            Shape::Ellipse { centre_m, semi_axes_m: [0.05, 0.02], angle_rad: 0.3 },
            Shape::Rectangle { centre_m, sides_m: [0.06, 0.05], angle_rad: 0.4 },
            Shape::Polygon {
                corners_m: vec![Vector2::new(0.1, 0.1), Vector2::new(0.12, 0.2), Vector2::new(0.03, 0.17)],
            },
        ]
    }

    fn state(objects: usize) -> State {
        let mut values = Values::zeros();
        for (i, value) in values.iter_mut().enumerate() {
            *value = 1e-3 * (i as f64 + 1.0);
        }
        State {
            values,
            object: DVector::from_fn(objects, |i, _| 1e-3 * (i as f64 + 1.0)),
            rotations_rad: DVector::zeros(0),
        }
    }

    /// Central differences of step 1e-6 err by 1e-10 of the values, which are of order 0.1 over units of 0.01.
    fn close(seen: f64, expected: f64) -> bool {
        (seen - expected).abs() < 1e-6 * (1.0 + expected.abs())
    }

    fn slope(value: impl Fn(f64) -> Vec<f64>) -> Vec<f64> {
        const STEP: f64 = 1e-6;
        value(STEP).iter().zip(value(-STEP)).map(|(plus, minus)| (plus - minus) / (2.0 * STEP)).collect()
    }

    #[test]
    fn gradients_match_central_differences() {
        let rod = Rod { diameters_m: [1e-3, 1e-3], ..Rod::uniform(0.25, 9.8e-3).expect("a rod") };
        let gravity = Gravity { direction_rad: -1.2, lever_m: 0.12 };
        for shape in shapes() {
            let outline = Outline::of(&Object::KnownClass(shape)).expect("an outline");
            let setting = Setting {
                rod: &rod,
                gravity: Some(&gravity),
                outline: Some(&outline),
                method: Method::Auto,
                curvature_is_free: true,
            };
            let state = state(outline.count());
            for (role, outlined) in
                [(Role::Mid, Outlined::Supports), (Role::Mid, Outlined::OnFace(1)), (Role::Tip, Outlined::On)]
            {
                if outlined == Outlined::OnFace(1) && outline.is_smooth() {
                    continue;
                }
                check(setting, &state, &Plan { role, outlined, stretch: None });
            }
        }
    }

    fn check(setting: Setting, state: &State, plan: &Plan) {
        let values = |state: &State, sample: &Sample| -> Vec<f64> {
            let rows = Posed::new(setting, state).contact(sample, plan).expect("a contact");
            rows.iter().map(|row| row.value).collect()
        };
        let rows = Posed::new(setting, state).contact(&sample(), plan).expect("a contact");
        let compare = |what: &str, i: usize, slopes: Vec<f64>, pick: &dyn Fn(&Constraint) -> f64| {
            for (k, (row, slope)) in rows.iter().zip(slopes).enumerate() {
                assert!(close(pick(row), slope), "{what} {i} of row {k} {plan:?}: {} {slope}", pick(row));
            }
        };
        // The weight's direction follows the angle read; of the hub's angle that share is left out, a weight's milliradians.
        for i in 0..5 {
            let moved = |by: f64| {
                let mut correction = Observed::zeros();
                correction[i] = by;
                values(state, &corrected(&sample(), &correction))
            };
            compare("observed", i, slope(moved), &|row| row.by_observed[i]);
        }
        for i in 0..COUNT {
            let moved = |by: f64| {
                let mut state = state.clone();
                state.values[i] += by;
                values(&state, &sample())
            };
            compare("parameter", i, slope(moved), &|row| row.by_parameters[i]);
        }
        for i in 0..state.object.len() {
            let moved = |by: f64| {
                let mut state = state.clone();
                state.object[i] += by;
                values(&state, &sample())
            };
            compare("object", i, slope(moved), &|row| row.by_object[i]);
        }
    }
}
