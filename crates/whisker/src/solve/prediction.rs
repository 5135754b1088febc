//! The prediction of a contact: the beginning of its phase, and its slip-off in words.

use super::rig::Rig;
use crate::contact::Method;
use crate::estimate::Status;
use crate::events::slip::HORIZON;
use crate::events::{self, End, Prediction};
use crate::friction::FrictionAngle;
use crate::{ContactEstimate, Sample};
use schemars::JsonSchema;
use serde::Serialize;

/// Samples and estimates that a forecast looks back on, at most; see [`events::slip::WINDOW`].
pub const WINDOW_READINGS: usize = events::slip::WINDOW;

/// A forecast and the sample it was made at.
#[derive(Debug, Clone)]
pub struct Forecast {
    /// Which sweep.
    pub sweep: u32,
    /// Which sample of it.
    pub sample: u32,
    /// Its place among the complete readings.
    pub index: usize,
    /// What lies ahead.
    pub prediction: Prediction,
}

/// Which contacts a forecast is made at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum At {
    /// The last reading of every sweep that still touches then.
    Last,
    /// Every contact.
    Every,
}

/// Forecasts of a record under constraints, in its order.
pub fn forecasts(
    rig: &Rig,
    samples: &[Sample],
    estimates: &[ContactEstimate],
    friction: FrictionAngle,
    method: Method,
    at: At,
) -> Vec<Forecast> {
    let is_asked = |i: usize| match at {
        At::Every => true,
        At::Last => samples.get(i + 1).is_none_or(|next| next.sweep != samples[i].sweep),
    };
    let asked = (0..samples.len()).filter(|i| estimates[*i].status == Status::Ok && is_asked(*i));
    let forecast = |i: usize| {
        let phase = phase(samples, estimates, i);
        let prediction = ahead(rig, &samples[phase.clone()], &estimates[phase], friction, method)?;
        let Sample { sweep, sample, .. } = samples[i];
        Some(Forecast { sweep, sample, index: i, prediction })
    };
    asked.filter_map(forecast).collect()
}

/// What lies ahead of the last of the samples of one contact phase.
pub fn ahead(
    rig: &Rig,
    samples: &[Sample],
    estimates: &[ContactEstimate],
    friction: FrictionAngle,
    method: Method,
) -> Option<Prediction> {
    events::predict(&rig.rod, &rig.cell, samples, estimates, friction, method)
}

/// The readings of the same uninterrupted contact up to `i`, as many as are looked back on.
fn phase(samples: &[Sample], estimates: &[ContactEstimate], i: usize) -> std::ops::Range<usize> {
    let is_same =
        |j: &usize| samples[*j].sweep == samples[i].sweep && estimates[*j].status != Status::NoContact;
    let count = (0..=i).rev().take_while(is_same).take(WINDOW_READINGS).count();
    i + 1 - count..i + 1
}

/// Steps and their standard deviation, where it is a slip-off and known at all.
pub fn steps_to_slip_off(prediction: &Prediction) -> Option<[f64; 2]> {
    let ending = prediction.ending.filter(|ending| ending.end == End::Fold)?;
    (ending.steps_sigma < HORIZON).then_some([ending.steps, ending.steps_sigma])
}

/// `sweep 0 still touches: 12.34 ± 0.10 mm of whisker left, slips off in 7.2 ± 0.9 readings`.
pub fn words(forecast: &Forecast) -> String {
    let Forecast { sweep, prediction, .. } = forecast;
    let left = format!("{:.2} ± {:.2} mm", 1e3 * prediction.margin_m, 1e3 * prediction.margin_sigma_m);
    let ahead = match (prediction.ending, steps_to_slip_off(prediction)) {
        (_, Some([steps, sigma])) => format!("predicted in {steps:.1} ± {sigma:.1} readings"),
        (Some(ending), None) if ending.end == End::Release => {
            format!("not predicted: the hub lets go in {:.0} readings", ending.steps)
        }
        (Some(_), None) => "possible, its time is not known".to_string(),
        (None, None) => format!("not predicted within {HORIZON:.0} readings"),
    };
    format!("{ahead} (sweep {sweep} ends in contact; {left} of whisker beyond it)")
}

/// What lies ahead of a contact if the hub continues as it does.
#[derive(Serialize, JsonSchema)]
pub struct ForecastObject {
    /// Sweep of the reading from which it is predicted.
    sweep: u32,
    /// Its sample.
    sample: u32,
    /// Length of the whisker beyond the contact, metres.
    margin_m: f64,
    /// Its standard deviation, metres.
    margin_sigma_m: f64,
    /// Least singular value of the equilibrium's Jacobian, in units of the whisker; 0 where it slips off.
    stability: f64,
    /// Readings until the contact reaches the tip; null where it does not within the horizon.
    steps_to_tip: Option<f64>,
    /// How the contact ends; null where it does not within the horizon.
    #[schemars(extend("enum" = ["slip_off", "release", null]))]
    ending: Option<&'static str>,
    /// Readings until then.
    steps: Option<f64>,
    /// Standard deviation of `steps`; null where it is not known.
    steps_sigma: Option<f64>,
}

impl From<&Forecast> for ForecastObject {
    fn from(forecast: &Forecast) -> Self {
        let prediction = &forecast.prediction;
        ForecastObject {
            sweep: forecast.sweep,
            sample: forecast.sample,
            margin_m: prediction.margin_m,
            margin_sigma_m: prediction.margin_sigma_m,
            stability: prediction.stability,
            steps_to_tip: prediction.steps_to_tip,
            ending: prediction.ending.map(|ending| match ending.end {
                End::Fold => "slip_off",
                End::Release => "release",
            }),
            steps: prediction.ending.map(|ending| ending.steps),
            steps_sigma: prediction.ending.map(|ending| ending.steps_sigma).filter(|sigma| *sigma < HORIZON),
        }
    }
}
