//! Calibration from sweeps: stiffness, zeros, gains, angles, offsets and friction, each with its uncertainty, from contacts with an
//! object that is known, known in part, or unknown.
//!
//! Samples in free air must read nothing; a sliding mid-whisker contact has its force at the friction angle from the whisker's normal;
//! a contact at the tip is one whisker's length away; and with an object the tangents must support it. One maximum-likelihood fit takes
//! them all. What the record leaves open is named, keeps its prior uncertainty, and goes into the covariance of every contact
//! ([`Calibration::systematic_covariance`]): an uncalibrated rig never gives a confident wrong contact.
//! Derivation: docs/math/whisker_calibrate.md.

mod chi_square;
mod constraints;
mod fit;
mod model;
mod outline;
mod parameters;
mod roles;
mod tare;
mod undetermined;

pub use constraints::Role;
pub use model::{Gravity, unit_weight};
pub use parameters::{COUNT, Covariance, Parameter, Priors, Values};
pub use tare::{Tare, tare};
pub use undetermined::Undetermined;

use crate::contact::Method;
use crate::estimate::Mode;
use crate::{Cell, Error, PlanarPose, Rod, Sample, Shape};
use constraints::{Constraint, Plan, Posed, Setting, State};
use fit::{Fitted, Noise, Problem};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SMatrix, Vector2, Vector3};
use outline::Outline;

/// What is known of the object that was touched.
#[derive(Debug, Clone, PartialEq)]
pub enum Object {
    /// Nothing: only what holds for every object is used.
    Unknown,
    /// Shape, size and place: its clamp-side errors show, too.
    Known(Shape),
    /// Shape and size; the place given is a start.
    KnownSize(Shape),
    /// The kind of shape; size and place given are a start.
    KnownClass(Shape),
}

/// How to calibrate.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How well every parameter is known beforehand.
    pub priors: Priors,
    /// μ, where it is known; none to estimate it.
    pub mu: Option<f64>,
    /// Gravity in the plane, to model the whisker's weight; none where the plane is level or a tare has been taken off.
    pub gravity: Option<Gravity>,
    /// How contacts are found.
    pub method: Method,
    /// Probability with which a record that keeps the model is called inconsistent.
    pub false_alarm_rate: f64,
}

impl Options {
    /// For a rig as it is delivered.
    pub fn of_a_new_rig(cell: &Cell) -> Self {
        Options {
            priors: Priors::of_a_new_rig(cell),
            mu: None,
            gravity: None,
            method: Method::Auto,
            false_alarm_rate: 1e-3,
        }
    }
}

/// The rig as calibrated: turns readings into loads at the clamp, and says how much its own uncertainty moves a contact.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The rod as it was given, before [`Parameter::Stiffness`] and [`Parameter::Curvature`].
    pub nominal_rod: Rod,
    /// The parameters.
    pub values: Values,
    /// Their covariance; parameters that were held have none.
    pub covariance: Covariance,
    /// Gravity, where the weight is modelled.
    pub gravity: Option<Gravity>,
}

/// Why a sample was taken for what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Free.
    pub free: usize,
    /// Between clamp and tip.
    pub mid: usize,
    /// At the tip.
    pub tip: usize,
    /// Not used.
    pub unused: usize,
}

/// A calibration with what its record says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The rig.
    pub calibration: Calibration,
    /// How well it was known beforehand.
    pub priors: Priors,
    /// What the record leaves open.
    pub undetermined: Vec<Undetermined>,
    /// The parameters that were held.
    pub held: Vec<Parameter>,
    /// The object as fitted; as given where it was known, none where unknown.
    pub object: Option<Shape>,
    /// Covariance of its free parameters: shift x, shift y, turn (not of a circle), sizes; m, rad.
    pub object_covariance: DMatrix<f64>,
    /// Squared misfit, priors included.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Probability that a record which keeps the model fits as badly.
    pub p_value: f64,
    /// Whether it does keep the model, at the false-alarm rate asked for.
    pub is_consistent: bool,
    /// What every sample was taken for.
    pub roles: Vec<Role>,
}

/// Rounds of assigning roles and fitting; roles stay after two or three.
const ROUNDS: usize = 8;
/// Rounds of leaving out samples that the fit with the object does not explain.
const GATINGS: usize = 4;

/// Calibrates the rig of `rod` and `cell` from `samples`, in the order they were taken.
///
/// Which samples are free, mid or tip is found out. With an [`Object`] the fit is first made without, then with it.
pub fn calibrate(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    object: &Object,
    options: &Options,
) -> Result<Calibrated, Error> {
    rod.check()?;
    options.priors.check()?;
    let centre = start(rod, cell, samples, options);
    let priors = if options.mu.is_some() {
        options.priors.with(Parameter::FrictionAngle, 0.0)
    } else {
        options.priors
    };
    let outline = Outline::of(object);
    let (noise, stretches) = (observed_noise(cell), stretches(cell, samples));
    let job = Job { rod, samples, options, priors, centre, noise, stretches, outline: outline.as_ref() };
    let (fitted, roles) = job.without_object()?;
    let (fitted, roles) = if outline.is_some() { job.with_object(fitted, roles)? } else { (fitted, roles) };
    Ok(job.answer(fitted, roles, object))
}

/// A calibration under way.
struct Job<'a> {
    rod: &'a Rod,
    samples: &'a [Sample],
    options: &'a Options,
    priors: Priors,
    centre: Values,
    noise: Noise,
    /// To which stretch of constant hub angle each sample belongs.
    stretches: Vec<Option<usize>>,
    outline: Option<&'a Outline>,
}

impl<'a> Job<'a> {
    fn setting(&self, outline: Option<&'a Outline>) -> Setting<'a> {
        Setting {
            rod: self.rod,
            gravity: self.options.gravity.as_ref(),
            outline,
            method: self.options.method,
            curvature_is_free: 0.0 < self.priors.sigma(Parameter::Curvature),
        }
    }

    /// From `from`, with the equations that `from` makes possible.
    fn fit(&self, outline: Option<&'a Outline>, roles: &[Role], from: &State) -> Result<Fitted, Error> {
        let seen = roles.iter().filter(|role| **role != Role::Unused).count();
        if seen < LEAST_SAMPLES {
            let way_out = "record free air and contacts from touch to tip";
            let what = "samples that are free or in contact";
            return Err(Error::TooFew { what, seen, needed: LEAST_SAMPLES, way_out });
        }
        let plans = self.plans(outline, roles, from);
        let problem = Problem {
            setting: self.setting(outline),
            samples: self.samples,
            plans: &plans,
            noise: self.noise,
            priors: &self.priors,
            centre: self.centre,
        };
        problem.solve(from).ok_or(Error::NoFit {
            what: "the calibration",
            way_out: "check the units and the sign of the load, or start from a stiffness nearer the truth",
        })
    }

    fn plans(&self, outline: Option<&'a Outline>, roles: &[Role], state: &State) -> Vec<Plan> {
        let posed = Posed::new(self.setting(outline), state);
        let rows = self.samples.iter().zip(roles).zip(&self.stretches);
        // Without an object no equation depends on the hub, so no sample tells how it was turned.
        let turns = outline.is_some();
        rows.map(|((sample, role), stretch)| Plan {
            role: *role,
            outlined: posed.outlined(sample, *role),
            stretch: stretch.filter(|_| turns),
        })
        .collect()
    }

    fn roles(&self, state: &State, covariance: &Covariance) -> Vec<Role> {
        roles::assign(&Posed::new(self.setting(None), state), covariance, &self.noise.moving, self.samples)
    }

    fn without_object(&self) -> Result<(Fitted, Vec<Role>), Error> {
        let mut state = State::at(self.centre);
        let mut roles = self.roles(&state, &self.priors.covariance());
        let mut fitted = self.fit(None, &roles, &state)?;
        for _ in 0..ROUNDS {
            state = fitted.state.clone();
            let next = self.roles(&state, &fitted.covariance);
            if next == roles {
                break;
            }
            roles = next;
            fitted = self.fit(None, &roles, &state)?;
        }
        Ok((fitted, roles))
    }

    fn with_object(&self, before: Fitted, mut roles: Vec<Role>) -> Result<(Fitted, Vec<Role>), Error> {
        let object = DVector::zeros(self.outline.map_or(0, Outline::count));
        let turns_rad = DVector::zeros(self.stretches.iter().flatten().max().map_or(0, |last| last + 1));
        let state = State { values: before.state.values, object, turns_rad };
        let mut fitted = self.fit(self.outline, &roles, &state)?;
        for _ in 0..GATINGS {
            let kept = self.gated(&fitted, &roles);
            let is_last = kept == roles;
            roles = kept;
            fitted = self.fit(self.outline, &roles, &fitted.state)?;
            if is_last {
                break;
            }
        }
        Ok((fitted, roles))
    }

    /// Leaves out contacts whose equations miss by more than the gate of roles does.
    fn gated(&self, fitted: &Fitted, roles: &[Role]) -> Vec<Role> {
        let posed = Posed::new(self.setting(self.outline), &fitted.state);
        let plans = self.plans(self.outline, roles, &fitted.state);
        let probability = chi_square::tail(1, roles::GATE);
        let gates = [1, 2, 3].map(|equations| chi_square::quantile(equations, probability));
        let keeps = |sample: &Sample, plan: &Plan| {
            let rows = fit::projected(&posed, sample, plan, &self.noise).filter(|rows| !rows.is_empty());
            let chi2 = |rows: &[Constraint]| rows.iter().map(|row| row.value * row.value).sum::<f64>();
            rows.is_some_and(|rows| chi2(&rows) <= gates[rows.len().min(gates.len()) - 1])
        };
        let kept = self.samples.iter().zip(&plans).map(|(sample, plan)| match plan.role {
            Role::Mid | Role::Tip if !keeps(sample, plan) => Role::Unused,
            role => role,
        });
        kept.collect()
    }

    fn answer(&self, fitted: Fitted, roles: Vec<Role>, object: &Object) -> Calibrated {
        let p_value = chi_square::tail(fitted.degrees_of_freedom.max(1), fitted.chi2);
        Calibrated {
            undetermined: undetermined::undetermined(&fitted.covariance, &self.priors, object),
            held: Parameter::ALL.into_iter().filter(|p| self.priors.sigma(*p) == 0.0).collect(),
            object: self.outline.map(|outline| outline.shape(fitted.state.object.as_slice())),
            object_covariance: fitted.object_covariance,
            chi2: fitted.chi2,
            degrees_of_freedom: fitted.degrees_of_freedom,
            p_value,
            is_consistent: self.options.false_alarm_rate <= p_value,
            roles,
            priors: self.priors,
            calibration: Calibration {
                nominal_rod: self.rod.clone(),
                values: fitted.state.values,
                covariance: fitted.covariance,
                gravity: self.options.gravity,
            },
        }
    }
}

/// Fewer say nothing that was not known.
const LEAST_SAMPLES: usize = 3;

/// Zeros where the readings crowd; friction at the median of the contacts that are surely not at the tip.
fn start(rod: &Rod, cell: &Cell, samples: &[Sample], options: &Options) -> Values {
    let mut values = Values::zeros();
    if let Some(mu) = options.mu {
        values[Parameter::FrictionAngle.index()] = mu.atan();
    }
    if 0.0 < options.priors.sigma(Parameter::ForceXZero) {
        let zeros = tare::most_crowded(cell, samples).unwrap_or_default();
        values[Parameter::ForceXZero.index()] = zeros.x;
        values[Parameter::ForceYZero.index()] = zeros.y;
        values[Parameter::TorqueZero.index()] = zeros.z;
    }
    if options.mu.is_none() && 0.0 < options.priors.sigma(Parameter::FrictionAngle) {
        values[Parameter::FrictionAngle.index()] = median_friction(rod, cell, samples, &values, options);
    }
    values
}

fn median_friction(rod: &Rod, cell: &Cell, samples: &[Sample], values: &Values, options: &Options) -> f64 {
    let state = State::at(*values);
    let setting = Setting {
        rod,
        gravity: options.gravity.as_ref(),
        outline: None,
        method: options.method,
        curvature_is_free: false,
    };
    let posed = Posed::new(setting, &state);
    let least_force = 20.0 * cell.load_covariance()[(0, 0)].sqrt();
    let mut angles: Vec<f64> = samples
        .iter()
        .filter_map(|sample| posed.touched(sample))
        .filter(|t| least_force < t.meant.load.force_n().norm() && t.at.s_m < 0.9 * rod.length_m)
        .map(|t| t.at.friction_angle_rad)
        .collect();
    angles.sort_by(f64::total_cmp);
    angles.get(angles.len() / 2).copied().unwrap_or(0.0)
}

/// Covariance of `[fx, fy, mz, x, y, angle]`.
fn observed_noise(cell: &Cell) -> Noise {
    let covariance = |cell: &Cell| {
        let mut noise = Matrix6::zeros();
        noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&cell.load_covariance());
        noise.fixed_view_mut::<3, 3>(3, 3).copy_from(&cell.hub_covariance());
        noise
    };
    Noise {
        moving: covariance(cell),
        constant: covariance(&Cell { hub_angle_step_rad: 0.0, ..*cell }),
        rounding_rad: cell.hub_angle_step_rad / 12.0_f64.sqrt(),
    }
}

/// Shorter stretches of constant hub angle are taken for chance.
const LEAST_STRETCH: usize = 4;

/// Stretches of samples at one reading of the hub's angle. Rounding an angle that stands still errs by the same amount every time:
/// it is an unknown of the stretch, not noise of the sample.
fn stretches(cell: &Cell, samples: &[Sample]) -> Vec<Option<usize>> {
    let mut stretches = Vec::with_capacity(samples.len());
    let mut count = 0;
    let same = |a: &Sample, b: &Sample| {
        let apart = (a.world_from_hub.angle_rad - b.world_from_hub.angle_rad).abs();
        a.sweep == b.sweep && apart < 0.5 * cell.hub_angle_step_rad
    };
    for stretch in samples.chunk_by(same) {
        let is_constant = LEAST_STRETCH <= stretch.len();
        stretches.extend(stretch.iter().map(|_| is_constant.then_some(count)));
        count += usize::from(is_constant);
    }
    stretches
}

impl Calibrated {
    /// How many samples were taken for what.
    pub fn counts(&self) -> Counts {
        let of = |role: Role| self.roles.iter().filter(|r| **r == role).count();
        Counts { free: of(Role::Free), mid: of(Role::Mid), tip: of(Role::Tip), unused: of(Role::Unused) }
    }
}

impl Calibration {
    /// An ideal rig: nothing to correct, nothing uncertain.
    pub fn ideal(rod: &Rod) -> Self {
        Calibration {
            nominal_rod: rod.clone(),
            values: Values::zeros(),
            covariance: Covariance::zeros(),
            gravity: None,
        }
    }

    /// One parameter, in its unit.
    pub fn value(&self, parameter: Parameter) -> f64 {
        self.values[parameter.index()]
    }

    /// Its standard deviation; 0 where it was held.
    pub fn sigma(&self, parameter: Parameter) -> f64 {
        self.covariance[(parameter.index(), parameter.index())].sqrt()
    }

    /// The rod: the one given with its EI scaled and its curvature shifted.
    pub fn rod(&self) -> Rod {
        model::rod_of(&self.values, &self.nominal_rod)
    }

    /// What the cell reads with nothing touched, without weight: N, N, N·m.
    pub fn zeros(&self) -> Vector3<f64> {
        let [x, y, m] = [Parameter::ForceXZero, Parameter::ForceYZero, Parameter::TorqueZero];
        Vector3::new(self.value(x), self.value(y), self.value(m))
    }

    /// Force over reading.
    pub fn force_gain(&self) -> f64 {
        self.value(Parameter::ForceGain).exp()
    }

    /// Torque over reading.
    pub fn torque_gain(&self) -> f64 {
        self.value(Parameter::TorqueGain).exp()
    }

    /// The clamp from the hub position read, world axes, metres.
    pub fn hub_offset_m(&self) -> Vector2<f64> {
        Vector2::new(self.value(Parameter::HubX), self.value(Parameter::HubY))
    }

    /// The cell's origin from the clamp, hub axes, metres.
    pub fn cell_origin_m(&self) -> Vector2<f64> {
        Vector2::new(self.value(Parameter::CellOriginX), self.value(Parameter::CellOriginY))
    }

    /// Coefficient of friction.
    pub fn mu(&self) -> f64 {
        self.value(Parameter::FrictionAngle).tan()
    }

    /// Its standard deviation.
    pub fn mu_sigma(&self) -> f64 {
        self.sigma(Parameter::FrictionAngle) / self.value(Parameter::FrictionAngle).cos().powi(2)
    }

    /// The sample as it is meant: the load of the object at the clamp, clamp axes; the clamp's place in the world.
    pub fn apply(&self, sample: &Sample) -> Sample {
        let meant = model::meant(&self.values, self.gravity.as_ref(), sample);
        Sample { load: meant.load, world_from_hub: meant.world_from_hub, ..*sample }
    }

    /// The cell with the noise of loads as [`Calibration::apply`] gives them: gains scale it. Turning it by the cell's angle and
    /// moving it by the cell's origin are left out, a part in 10⁴ of it.
    pub fn apply_to_cell(&self, cell: &Cell) -> Cell {
        let (force, torque) = (self.force_gain(), self.torque_gain());
        Cell {
            force_sigma_n: cell.force_sigma_n * force,
            force_step_n: cell.force_step_n * force,
            torque_sigma_n_m: cell.torque_sigma_n_m * torque,
            torque_step_n_m: cell.torque_step_n_m * torque,
            ..*cell
        }
    }

    /// What the calibration's own uncertainty adds to the covariance of a contact `[x, y, θ]` of `sample` (as read, not applied),
    /// world: the same error in all samples, so it does not average out. For `Mode::Mid` and `Mode::Tip` of a contact estimated
    /// under that constraint, `Mode::Free` of one estimated from its load alone. None where the sample has no contact.
    /// docs/math/whisker_calibrate.md eqs. (16)–(17).
    pub fn systematic_covariance(&self, cell: &Cell, sample: &Sample, mode: Mode) -> Option<Matrix3<f64>> {
        let by_parameters = self.contact_by_parameters(cell, sample, mode)?;
        Some(by_parameters * self.covariance * by_parameters.transpose())
    }

    /// ∂[x, y, θ]/∂parameters of the contact of `sample`, world.
    fn contact_by_parameters(
        &self,
        cell: &Cell,
        sample: &Sample,
        mode: Mode,
    ) -> Option<SMatrix<f64, 3, COUNT>> {
        let state = State::at(self.values);
        let setting = Setting {
            rod: &self.nominal_rod,
            gravity: self.gravity.as_ref(),
            outline: None,
            method: Method::Auto,
            curvature_is_free: 0.0 < self.sigma(Parameter::Curvature),
        };
        let posed = Posed::new(setting, &state);
        let touched = posed.touched(sample)?;
        let hub = &touched.meant.world_from_hub;
        let turn = world_axes(hub);
        let by_load = turn * touched.by_load.fixed_rows::<3>(0);
        let mut by = by_load * touched.meant.load_by_parameters;
        let mut add = |parameter: Parameter, column: Vector3<f64>| {
            let sum = by.column(parameter.index()) + column;
            by.set_column(parameter.index(), &sum);
        };
        let arm = hub.turn(touched.at.x_in_hub);
        add(Parameter::Stiffness, turn * touched.by_stiffness.fixed_rows::<3>(0));
        add(Parameter::Curvature, turn * touched.by_curvature.fixed_rows::<3>(0));
        add(Parameter::HubAngle, Vector3::new(-arm.y, arm.x, 1.0));
        add(Parameter::HubX, Vector3::x());
        add(Parameter::HubY, Vector3::y());
        let constraint = match mode {
            Mode::Free => return Some(by),
            Mode::Mid => posed.sliding(&touched),
            Mode::Tip => posed.at_tip(&touched),
        };
        // Projected onto the constraint, the contact follows the constraint's own shift: K = J Σ gᵀ/(g Σ gᵀ).
        let by_reading = by_load * touched.meant.load_by_reading;
        let gradient = constraint.by_observed.fixed_columns::<3>(0).transpose();
        let spread = cell.load_covariance() * gradient;
        let gain = by_reading * spread / gradient.dot(&spread);
        Some(by - gain * constraint.by_parameters)
    }
}

/// Turns `[x, y, θ]` of the hub frame into world axes.
fn world_axes(hub: &PlanarPose) -> Matrix3<f64> {
    let (sin, cos) = hub.angle_rad.sin_cos();
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}
