//! A calibration in progress: its start, the equations of every sample, fits, and samples to leave out.

use super::constraints::Stretch;
use super::constraints::{Constraint, Plan, Posed, Role, Setting, State};
use super::fit::{self, Fitted, Noise, Problem};
use super::outline::Outline;
use super::parameters::{Covariance, Parameter, Priors, Values};
use super::stretches::{observed_noise, stretches};
use super::{Calibrated, Calibration, Object, Options, roles, tare, undetermined};
use crate::{Cell, Error, Rod, Sample};
use nalgebra::DVector;
use resight_core::statistics::chi_square::{quantile, tail};

/// Rounds of assigning roles and fitting; roles stay after two or three.
const ROUNDS: usize = 8;
/// How far the friction angle may be from the contacts' median when roles are first assigned, radians: with the whole of its prior,
/// half a radian, every contact at the tip would pass for one that slides.
const FIRST_FRICTION_RAD: f64 = 0.1;
/// Rounds of leaving out samples that the fit with the object does not explain.
const GATINGS: usize = 4;

/// Contacts lighter than this many σ of the force say nothing of the outline: their place along the whisker errs by 5 mm and more, and
/// its correction need not settle (at 8 σ, offsets on a peg came out with twice the scatter they claimed, at 30 σ as claimed).
const OUTLINE_FORCE_SIGMAS: f64 = 30.0;

/// A fit, and the role of every sample in it.
pub struct Outcome {
    /// The fit.
    pub fitted: Fitted,
    /// The roles.
    pub roles: Vec<Role>,
    /// The number of contacts that were left out because they contradict the object.
    pub contradicted: usize,
}

impl Outcome {
    /// Probability that a record which keeps the model fits as badly.
    pub fn p_value(&self) -> f64 {
        tail(self.fitted.degrees_of_freedom, self.fitted.chi2)
    }

    /// Whether the model fits, and the object explains all but a few of the contacts.
    pub fn is_consistent(&self, false_alarm_rate: f64) -> bool {
        let kept = self.roles.iter().filter(|role| matches!(role, Role::Mid | Role::Tip)).count();
        let contacts = (kept + self.contradicted) as f64;
        false_alarm_rate <= self.p_value() && self.contradicted as f64 <= CONTRADICTED * contacts
    }
}

/// An object that contradicts more than this share of the contacts is not the object.
const CONTRADICTED: f64 = 0.05;

/// A calibration under way.
pub struct Job<'a> {
    /// The rod as given.
    pub rod: &'a Rod,
    /// The cell.
    pub cell: &'a Cell,
    /// All samples.
    pub samples: &'a [Sample],
    /// The requested settings.
    pub options: &'a Options,
    /// The requested priors, with a given μ fixed.
    pub priors: Priors,
    /// The centre of the priors, and the start of the fits.
    pub centre: Values,
    /// The noise of the observations.
    pub noise: Noise,
    /// The stretch of the hub's angle to which each sample belongs.
    pub stretches: Vec<Stretch>,
}

impl<'a> Job<'a> {
    /// Starts: zeros where readings crowd, friction at the contacts' median.
    pub fn new(rod: &'a Rod, cell: &'a Cell, samples: &'a [Sample], options: &'a Options) -> Self {
        let friction =
            if options.mu.is_some() { 0.0 } else { options.priors.sigma(Parameter::FrictionAngle) };
        Job {
            rod,
            cell,
            samples,
            options,
            priors: options.priors.with(Parameter::FrictionAngle, friction),
            centre: start(rod, cell, samples, options),
            noise: observed_noise(cell),
            stretches: stretches(cell, samples),
        }
    }

    fn setting<'b>(&'b self, outline: Option<&'b Outline>) -> Setting<'b> {
        Setting {
            rod: self.rod,
            gravity: self.options.gravity.as_ref(),
            outline,
            method: self.options.method,
            curvature_is_free: 0.0 < self.priors.sigma(Parameter::Curvature),
        }
    }

    /// Fits from `from`, with the equations that are possible there.
    fn fit(
        &self,
        outline: Option<&Outline>,
        roles: &[Role],
        from: &State,
        roles_are_doubtful: bool,
    ) -> Result<Fitted, Error> {
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
            roles_are_doubtful,
        };
        problem.solve(from).ok_or(Error::NoFit {
            what: "the calibration",
            way_out: "check the units and the sign of the load, or start from a stiffness nearer the truth",
        })
    }

    fn plans(&self, outline: Option<&Outline>, roles: &[Role], state: &State) -> Vec<Plan> {
        let posed = Posed::new(self.setting(outline), state);
        let rows = self.samples.iter().zip(roles).zip(&self.stretches);
        // Without an object no equation depends on the hub, so that no sample determines its rotation.
        let turns = outline.is_some();
        let least_force_n = OUTLINE_FORCE_SIGMAS * self.noise.moving[(0, 0)].sqrt();
        rows.map(|((sample, role), stretch)| Plan {
            role: *role,
            outlined: posed.outlined(sample, *role, least_force_n),
            stretch: turns.then_some(*stretch),
        })
        .collect()
    }

    fn roles(&self, state: &State, covariance: &Covariance) -> Vec<Role> {
        roles::assign(&Posed::new(self.setting(None), state), covariance, &self.noise.moving, self.samples)
    }

    /// Roles and parameters from what holds for every object.
    pub fn without_object(&self) -> Result<Outcome, Error> {
        let mut state = State::at(self.centre);
        let first = self.priors.with(
            Parameter::FrictionAngle,
            FIRST_FRICTION_RAD.min(self.priors.sigma(Parameter::FrictionAngle)),
        );
        let mut roles = self.roles(&state, &first.covariance());
        for _ in 0..ROUNDS {
            let fitted = self.fit(None, &roles, &state, true)?;
            // Wrong roles spoil a fit by more than it claims to know: as much more as it fits worse than it should.
            let excess = fitted.chi2 / fitted.degrees_of_freedom.max(1) as f64;
            let next = self.roles(&fitted.state, &(fitted.covariance * excess.max(1.0)));
            state = fitted.state;
            if next == roles {
                break;
            }
            roles = next;
        }
        let fitted = self.fit(None, &roles, &state, false)?;
        let roles = self.roles(&fitted.state, &fitted.covariance);
        let fitted = self.fit(None, &roles, &fitted.state, false)?;
        Ok(Outcome { fitted, roles, contradicted: 0 })
    }

    /// Fits with an object, starting from the fit `before`.
    pub fn with_object(
        &self,
        outline: &Outline,
        before: &Fitted,
        before_roles: &[Role],
    ) -> Result<Outcome, Error> {
        let mut roles = before_roles.to_vec();
        let object = DVector::zeros(outline.count());
        let rotations_rad =
            DVector::zeros(self.stretches.iter().map(|stretch| stretch.unknown + 1).max().unwrap_or(0));
        let state = State { values: before.state.values, object, rotations_rad };
        let mut fitted = self.fit(Some(outline), &roles, &state, false)?;
        for _ in 0..GATINGS {
            let kept = self.gated(outline, &fitted, &roles);
            let is_last = kept == roles;
            roles = kept;
            fitted = self.fit(Some(outline), &roles, &fitted.state, false)?;
            if is_last {
                break;
            }
        }
        let contradicted = roles.iter().zip(before_roles).filter(|(now, before)| now != before).count();
        Ok(Outcome { fitted, roles, contradicted })
    }

    /// Leaves out contacts whose equations miss by more than the limit of the roles.
    fn gated(&self, outline: &Outline, fitted: &Fitted, roles: &[Role]) -> Vec<Role> {
        let posed = Posed::new(self.setting(Some(outline)), &fitted.state);
        let plans = self.plans(Some(outline), roles, &fitted.state);
        let probability = tail(1, roles::GATE);
        let gates = [1, 2, 3].map(|equations| quantile(equations, probability));
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

    /// The result of the fit.
    pub fn answer(&self, outcome: Outcome, object: &Object, outline: Option<&Outline>) -> Calibrated {
        let is_consistent = outcome.is_consistent(self.options.false_alarm_rate);
        let p_value = outcome.p_value();
        let Outcome { fitted, roles, contradicted } = outcome;
        Calibrated {
            undetermined: undetermined::undetermined(&fitted.covariance, &self.priors, object),
            held: Parameter::ALL.into_iter().filter(|p| self.priors.sigma(*p) == 0.0).collect(),
            object: outline.map(|outline| outline.shape(fitted.state.object.as_slice())),
            object_covariance: fitted.object_covariance.clone(),
            unknown_reason: None,
            chi2: fitted.chi2,
            degrees_of_freedom: fitted.degrees_of_freedom,
            p_value,
            contradicted,
            is_consistent,
            roles,
            priors: self.priors,
            calibration: self.calibration(&fitted),
        }
    }

    /// The rig as fitted.
    pub fn calibration(&self, fitted: &Fitted) -> Calibration {
        Calibration {
            nominal_rod: self.rod.clone(),
            values: fitted.state.values,
            covariance: fitted.covariance,
            gravity: self.options.gravity,
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

/// Without contacts that are surely not at the tip: none.
fn median_friction(rod: &Rod, cell: &Cell, samples: &[Sample], values: &Values, options: &Options) -> f64 {
    let state = State::at(*values);
    let setting = Setting {
        rod,
        gravity: options.gravity.as_ref(),
        outline: None,
        method: options.method,
        curvature_is_free: false,
    };
    median_friction_rad(&Posed::new(setting, &state), rod.length_m, cell, samples).unwrap_or(0.0)
}

/// The median friction angle of the contacts of 20 σ and more within 0.9 of the whisker's length, radians.
pub fn median_friction_rad(posed: &Posed, length_m: f64, cell: &Cell, samples: &[Sample]) -> Option<f64> {
    let least_force = 20.0 * cell.load_covariance()[(0, 0)].sqrt();
    let mut angles: Vec<f64> = samples
        .iter()
        .filter_map(|sample| posed.touched(sample))
        .filter(|t| least_force < t.meant.load.force_n().norm() && t.at.s_m < 0.9 * length_m)
        .map(|t| t.at.friction_angle_rad)
        .collect();
    angles.sort_by(f64::total_cmp);
    angles.get(angles.len() / 2).copied()
}
