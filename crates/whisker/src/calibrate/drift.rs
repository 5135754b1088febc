//! Tests whether the rig has changed, between two calibrations or along a record.
//!
//! ```text
//!   U  the directions of the parameters (in units of their prior σ, D) that the data determine · d = Uᵀ D⁻¹ (new − old) · V = Cov d
//!   T = dᵀ V⁻¹ d is χ² while nothing changes · one parameter alone: a = Uᵀ D⁻¹ e,  change = aᵀV⁻¹d/(aᵀV⁻¹a) ± (aᵀV⁻¹a)^−½
//! ```
//! docs/math/whisker_calibrate.md eqs. (18)–(21).

use super::constraints::{Outlined, Plan, Posed, Setting, State};
use super::fit::{Noise, projected};
use super::job::median_friction_rad;
use super::parameters::{Covariance, Parameter, Values};
use super::stretches::observed_noise;
use super::{Calibrated, roles};
use crate::contact::Method;
use crate::{Cell, Error, Sample};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use resight_core::statistics::chi_square::tail;

/// The change of one parameter that alone would explain everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// The parameter.
    pub parameter: Parameter,
    /// The change, in its unit.
    pub change: f64,
    /// Standard deviation of that.
    pub sigma: f64,
    /// Probability of the remaining misfit, if this were the only change.
    pub p_value_of_rest: f64,
}

/// A test for change.
#[derive(Debug, Clone, PartialEq)]
pub struct Drift {
    /// χ² of no change at all.
    pub chi2: f64,
    /// Its degrees of freedom: the number of combinations of parameters that the data determine.
    pub degrees_of_freedom: usize,
    /// Probability of as large a χ² without any change.
    pub p_value: f64,
    /// Whether it is below the false-alarm rate.
    pub has_drifted: bool,
    /// Every parameter as the only one that changed, the most likely first.
    pub changes: Vec<Change>,
}

/// The settings of the test.
#[derive(Debug, Clone, PartialEq)]
pub struct DriftOptions {
    /// Probability of an alarm, per test, while nothing changes.
    pub false_alarm_rate: f64,
    /// Parameters that may change without an alarm: friction, where another object is touched.
    pub loose: Vec<Parameter>,
    /// Samples in a window of [`DriftMonitor`].
    pub window: usize,
}

impl Default for DriftOptions {
    fn default() -> Self {
        DriftOptions { false_alarm_rate: 1e-3, loose: vec![Parameter::FrictionAngle], window: 120 }
    }
}

/// A direction is determined where the data leave less than this part of its prior variance: half its standard deviation.
const DETERMINED: f64 = 0.25;

/// Tests whether the rig of `new` is that of `old`; both come from records of their own, with equal priors.
pub fn drift(old: &Calibrated, new: &Calibrated, options: &DriftOptions) -> Drift {
    let free = shared(old, new);
    let scaled = |covariance: &Covariance| scaled(covariance, &free);
    let before = scaled(&old.calibration.covariance);
    let after = scaled(&new.calibration.covariance);
    let worst = SymmetricEigen::new((&before + &after) * 0.5);
    let kept: Vec<usize> = (0..free.len()).filter(|i| worst.eigenvalues[*i] < DETERMINED).collect();
    let basis = DMatrix::from_fn(free.len(), kept.len(), |i, k| worst.eigenvectors[(i, kept[k])]);
    let moved = new.calibration.values - old.calibration.values;
    let d = basis.transpose() * scaled_values(&moved, &free);
    let v = basis.transpose() * (before + after + loosened(&free, options)) * &basis;
    verdict(&free, &basis, &d, &v, options.false_alarm_rate)
}

/// The parameters free in both, with the wider of their prior standard deviations.
fn shared(old: &Calibrated, new: &Calibrated) -> Vec<(Parameter, f64)> {
    let both = old.priors.free().into_iter().filter(|p| 0.0 < new.priors.sigma(*p));
    both.map(|p| (p, old.priors.sigma(p).max(new.priors.sigma(p)))).collect()
}

fn scaled(covariance: &Covariance, free: &[(Parameter, f64)]) -> DMatrix<f64> {
    DMatrix::from_fn(free.len(), free.len(), |i, j| {
        covariance[(free[i].0.index(), free[j].0.index())] / (free[i].1 * free[j].1)
    })
}

fn scaled_values(values: &Values, free: &[(Parameter, f64)]) -> DVector<f64> {
    DVector::from_iterator(free.len(), free.iter().map(|(p, scale)| values[p.index()] / scale))
}

/// A loose parameter may have moved by ten times what it was uncertain by beforehand.
fn loosened(free: &[(Parameter, f64)], options: &DriftOptions) -> DMatrix<f64> {
    let loose = free.iter().map(|(p, _)| if options.loose.contains(p) { 100.0 } else { 0.0 });
    DMatrix::from_diagonal(&DVector::from_iterator(free.len(), loose))
}

/// The tests on d = Uᵀ D⁻¹ (change) with covariance V.
fn verdict(
    free: &[(Parameter, f64)],
    basis: &DMatrix<f64>,
    d: &DVector<f64>,
    v: &DMatrix<f64>,
    false_alarm_rate: f64,
) -> Drift {
    let degrees_of_freedom = d.len();
    let Some(factor) = v.clone().cholesky().filter(|_| 0 < degrees_of_freedom) else {
        return Drift {
            chi2: 0.0,
            degrees_of_freedom: 0,
            p_value: 1.0,
            has_drifted: false,
            changes: Vec::new(),
        };
    };
    let weighted = factor.solve(d);
    let chi2 = d.dot(&weighted);
    let p_value = tail(degrees_of_freedom, chi2);
    let mut changes: Vec<(f64, Change)> = Vec::new();
    for (i, (parameter, scale)) in free.iter().enumerate() {
        let a = basis.row(i).transpose() / *scale;
        let information = a.dot(&factor.solve(&a));
        // A parameter whose own change would be invisible cannot be the cause.
        if information * scale * scale * DETERMINED < 1.0 {
            continue;
        }
        let score = a.dot(&weighted);
        let rest = (chi2 - score * score / information).max(0.0);
        let p_value_of_rest = if 1 < degrees_of_freedom { tail(degrees_of_freedom - 1, rest) } else { 1.0 };
        let (change, sigma) = (score / information, information.sqrt().recip());
        changes.push((rest, Change { parameter: *parameter, change, sigma, p_value_of_rest }));
    }
    changes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let changes = changes.into_iter().map(|(_, change)| change).collect();
    Drift { chi2, degrees_of_freedom, p_value, has_drifted: p_value < false_alarm_rate, changes }
}

/// The verdict of a monitor.
#[derive(Debug, Clone, PartialEq)]
pub enum Watch {
    /// The window is not full.
    Filling,
    /// The window holds too few samples, free or in contact.
    Stale {
        /// The number that could be used.
        seen: usize,
        /// The number needed.
        needed: usize,
    },
    /// Nothing has changed beyond the noise and the calibration's own uncertainty.
    Steady(Drift),
    /// The rig has changed, or no longer fits the model.
    Drifted(Drift),
}

/// Tests a record, window by window, for a rig that does not agree with its calibration any more. Without an object, motions of clamp and object
/// together are invisible; [`drift`] between two calibrations with a known object detects these, too.
#[derive(Debug, Clone)]
pub struct DriftMonitor {
    reference: Calibrated,
    cell: Cell,
    noise: Noise,
    options: DriftOptions,
    window: Vec<Sample>,
}

/// By how much friction may differ from window to window without its contacts being taken for tip contacts, σ in radians.
const FRICTION_CHANGE_RAD: f64 = 0.1;

/// The smallest number of usable samples in a window.
const LEAST_SEEN: usize = 20;

impl DriftMonitor {
    /// Watches against `reference`; `cell` is that of the readings. Windows below 20 samples are refused.
    pub fn new(reference: &Calibrated, cell: &Cell, options: &DriftOptions) -> Result<Self, Error> {
        if options.window < LEAST_SEEN {
            let way_out = "watch windows of some hundred samples";
            let what = "samples in a window of the drift monitor";
            return Err(Error::TooFew { what, seen: options.window, needed: LEAST_SEEN, way_out });
        }
        Ok(DriftMonitor {
            reference: reference.clone(),
            cell: *cell,
            noise: observed_noise(cell),
            options: options.clone(),
            window: Vec::with_capacity(options.window),
        })
    }

    /// Takes the next sample as read; answers at the end of every window, each test with samples of its own.
    pub fn push(&mut self, sample: &Sample) -> Watch {
        self.window.push(*sample);
        if self.window.len() < self.options.window {
            return Watch::Filling;
        }
        let window = std::mem::take(&mut self.window);
        self.watch(&window)
    }

    fn watch(&self, window: &[Sample]) -> Watch {
        let calibration = &self.reference.calibration;
        let free: Vec<(Parameter, f64)> =
            self.reference.priors.free().into_iter().map(|p| (p, self.reference.priors.sigma(p))).collect();
        let setting = Setting {
            rod: &calibration.nominal_rod,
            gravity: calibration.gravity.as_ref(),
            outline: None,
            method: Method::Auto,
            curvature_is_free: free.iter().any(|(p, _)| *p == Parameter::Curvature),
        };
        let state = State::at(self.with_friction_of(window, setting));
        let posed = Posed::new(setting, &state);
        let assigned = roles::assign(&posed, &self.roles_covariance(), &self.noise.moving, window);
        let mut information = DMatrix::zeros(free.len(), free.len());
        let mut gradient = DVector::zeros(free.len());
        let mut seen = 0;
        for (sample, role) in window.iter().zip(assigned) {
            let plan = Plan { role, outlined: Outlined::Not, stretch: None };
            let Some(rows) =
                roles::is_used(role).then(|| projected(&posed, sample, &plan, &self.noise)).flatten()
            else {
                continue;
            };
            seen += 1;
            for row in rows {
                let a = DVector::from_iterator(
                    free.len(),
                    free.iter().map(|(p, s)| row.by_parameters[p.index()] * s),
                );
                gradient -= &a * row.value;
                information += &a * a.transpose();
            }
        }
        if seen < LEAST_SEEN {
            return Watch::Stale { seen, needed: LEAST_SEEN };
        }
        let drift = self.tested(&free, information, &gradient);
        if drift.has_drifted { Watch::Drifted(drift) } else { Watch::Steady(drift) }
    }

    /// The reference; where friction may change, with the friction of this window, so that what is linearised is small.
    fn with_friction_of(&self, window: &[Sample], setting: Setting) -> Values {
        let mut values = self.reference.calibration.values;
        if self.options.loose.contains(&Parameter::FrictionAngle) {
            let state = State::at(values);
            let posed = Posed::new(setting, &state);
            if let Some(angle) = median_friction_rad(&posed, setting.rod.length_m, &self.cell, window) {
                values[Parameter::FrictionAngle.index()] = angle;
            }
        }
        values
    }

    /// A change must not be taken for a change of role, nor for an outlier: roles are assigned as for a rig that may be off by a tenth
    /// of what it could be when new, and its friction by a tenth of a radian.
    fn roles_covariance(&self) -> Covariance {
        let friction = Parameter::FrictionAngle.index();
        let mut covariance =
            self.reference.calibration.covariance + self.reference.priors.covariance() * 0.01;
        covariance[(friction, friction)] += FRICTION_CHANGE_RAD * FRICTION_CHANGE_RAD;
        covariance
    }

    /// The window's own estimate of the change against that of the reference.
    fn tested(&self, free: &[(Parameter, f64)], information: DMatrix<f64>, gradient: &DVector<f64>) -> Drift {
        let eigen = SymmetricEigen::new(information);
        let kept: Vec<usize> = (0..free.len()).filter(|i| 1.0 < eigen.eigenvalues[*i] * DETERMINED).collect();
        let basis = DMatrix::from_fn(free.len(), kept.len(), |i, k| eigen.eigenvectors[(i, kept[k])]);
        let own = DVector::from_iterator(kept.len(), kept.iter().map(|k| eigen.eigenvalues[*k].recip()));
        let d = (basis.transpose() * gradient).component_mul(&own);
        let reference = scaled(&self.reference.calibration.covariance, free) + loosened(free, &self.options);
        let v = DMatrix::from_diagonal(&own) + basis.transpose() * reference * &basis;
        verdict(free, &basis, &d, &v, self.options.false_alarm_rate)
    }
}
