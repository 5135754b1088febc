//! `whisker calibrate --against`: which part of the rig has moved since an earlier calibration, and when along the record.

use super::input;
use anyhow::{Result, anyhow, bail};
use clap::Args;
use resight_whisker::calibrate::{
    Calibrated, Change, Drift, DriftMonitor, DriftOptions, Gravity, Parameter, Watch, drift,
};
use resight_whisker::files::{WhiskerFile, whisker};
use resight_whisker::{Cell, Sample};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;

/// Comparison with an earlier calibration.
#[derive(Debug, Args)]
pub struct AgainstArgs {
    /// What of the rig has moved since this calibration (what `whisker calibrate -o` wrote, for the same whisker); exit status 3 when
    /// something has. Friction may differ: another object may have been touched.
    #[arg(long, value_name = "OLD.json")]
    against: Option<PathBuf>,
    /// Chance of saying that something moved when nothing did, for each test.
    #[arg(long, value_name = "CHANCE", default_value = "1e-3", requires = "against", value_parser = chance)]
    alpha: f64,
    /// Also test the record against OLD.json window by window, N readings each: when it moved.
    #[arg(long, value_name = "N", requires = "against")]
    watch: Option<usize>,
}

fn chance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if 0.0 < x && x < 1.0 => Ok(x),
        _ => Err("a chance between 0 and 1 is needed, e.g. 1e-3".to_string()),
    }
}

/// The earlier calibration.
pub struct Reference {
    name: String,
    calibrated: Calibrated,
    options: DriftOptions,
    window: Option<usize>,
}

/// What came of the comparison.
pub struct Compared {
    name: String,
    alpha: f64,
    drift: Drift,
    watched: Vec<Watched>,
}

/// A window of the record, by its first and last reading (sweep, sample).
struct Watched {
    from: (u32, u32),
    to: (u32, u32),
    watch: Watch,
}

impl AgainstArgs {
    /// Reads the earlier calibration; it must be of the same whisker as `file`.
    pub fn read(&self, file: &WhiskerFile) -> Result<Option<Reference>> {
        let Some(path) = &self.against else { return Ok(None) };
        let name = path.display().to_string();
        let (old, calibrated) =
            whisker::read_reference(&input::text(path)?).map_err(|reason| anyhow!("{name}: {reason}"))?;
        if old.rod != file.rod {
            bail!(
                "{name} calibrates another whisker (its `whisker` section differs, apart from the calibration); parameters are \
                 relative to it and cannot be compared: calibrate both records with the same --whisker"
            );
        }
        let options = DriftOptions { false_alarm_rate: self.alpha, ..DriftOptions::default() };
        Ok(Some(Reference { name, calibrated, options, window: self.watch }))
    }
}

impl Reference {
    /// Whether both model the weight alike, and nothing is asked of it that cannot be.
    pub fn check(&self, gravity: Option<Gravity>) -> Result<()> {
        if self.calibrated.calibration.gravity != gravity {
            bail!("{}: its gravity differs; give both calibrations the same --gravity-deg", self.name);
        }
        Ok(())
    }

    /// The record's own calibration, and its windows, against this.
    pub fn compare(self, new: &Calibrated, cell: &Cell, samples: &[Sample]) -> Result<Compared> {
        let drift = drift(&self.calibrated, new, &self.options);
        if drift.degrees_of_freedom == 0 {
            bail!(
                "{}: nothing that it leaves known is known in this record; nothing can be compared",
                self.name
            );
        }
        let watched = match self.window {
            None => Vec::new(),
            Some(window) => {
                let options = DriftOptions { window, ..self.options.clone() };
                watched(DriftMonitor::new(&self.calibrated, cell, &options)?, window, samples)
            }
        };
        Ok(Compared { name: self.name, alpha: self.options.false_alarm_rate, drift, watched })
    }
}

/// Whole windows; what is left at the end is too short for a test.
fn watched(mut monitor: DriftMonitor, window: usize, samples: &[Sample]) -> Vec<Watched> {
    let place = |sample: &Sample| (sample.sweep, sample.sample);
    let mut watch = |window: &[Sample]| {
        let last = window.iter().map(|sample| monitor.push(sample)).last()?;
        Some(Watched { from: place(window.first()?), to: place(window.last()?), watch: last })
    };
    samples.chunks_exact(window).filter_map(&mut watch).collect()
}

impl Compared {
    /// Whether anything has moved.
    pub fn has_drifted(&self) -> bool {
        self.drift.has_drifted || self.watched.iter().any(|w| matches!(w.watch, Watch::Drifted(_)))
    }

    /// Lines for a person, each with its label.
    pub fn words(&self) -> Vec<(&'static str, String)> {
        let mut lines = vec![("drift", self.verdict())];
        if self.drift.has_drifted {
            lines.extend(explanations(&self.drift).map(|change| ("", alone(change))));
            if explanations(&self.drift).next().is_none() {
                lines.push(("", "no parameter explains it by itself: several have moved".to_string()));
            }
        }
        lines.extend(self.watched.iter().map(|watched| ("watch", watched.words())));
        lines
    }

    fn verdict(&self) -> String {
        let verdict = if self.drift.has_drifted { "MOVED" } else { "steady" };
        format!(
            "{verdict} since {} (chi2 {:.1} for {} degrees of freedom, p = {:.1e}; moved below {:.0e})",
            self.name, self.drift.chi2, self.drift.degrees_of_freedom, self.drift.p_value, self.alpha
        )
    }
}

/// What has moved since an earlier calibration.
#[derive(Serialize, JsonSchema)]
pub struct ComparedObject {
    #[serde(flatten)]
    drift: CalibrationDrift,
    /// The file of the earlier calibration.
    against: String,
    /// Probability of saying that something moved when nothing did, for each test.
    alpha: f64,
    /// With --watch: the windows of the record, in its order.
    watch: Vec<WatchedObject>,
}

/// A test for change.
#[derive(Serialize, JsonSchema)]
struct CalibrationDrift {
    /// Whether `p_value` is below `alpha`.
    has_drifted: bool,
    /// χ² of no change at all.
    chi2: f64,
    /// Its degrees of freedom: how many combinations of parameters the data determine.
    degrees_of_freedom: usize,
    /// Probability of as large a χ² without any change.
    p_value: f64,
    /// Every parameter as the only one that changed, the most likely first.
    changes: Vec<ParameterChange>,
}

/// A parameter as the only one that changed.
#[derive(Serialize, JsonSchema)]
struct ParameterChange {
    /// Its name, which ends in its unit; `ln_…` are logarithms of factors.
    parameter: &'static str,
    /// Later less earlier value, in that unit.
    change: f64,
    /// Standard deviation of `change`.
    sigma: f64,
    /// Probability of what it leaves unexplained.
    p_value_of_rest: f64,
}

/// A window of the record against the earlier calibration.
#[derive(Serialize, JsonSchema)]
struct WatchedObject {
    /// Sweep and sample of its first reading.
    from: [u32; 2],
    /// Sweep and sample of its last reading.
    to: [u32; 2],
    /// `stale`: too few of its readings are of use.
    #[schemars(extend("enum" = ["stale", "steady", "drifted"]))]
    verdict: &'static str,
    /// Null where stale.
    drift: Option<CalibrationDrift>,
}

impl From<&Compared> for ComparedObject {
    fn from(compared: &Compared) -> Self {
        ComparedObject {
            drift: (&compared.drift).into(),
            against: compared.name.clone(),
            alpha: compared.alpha,
            watch: compared.watched.iter().map(WatchedObject::from).collect(),
        }
    }
}

impl From<&Drift> for CalibrationDrift {
    fn from(drift: &Drift) -> Self {
        let change = |change: &Change| ParameterChange {
            parameter: change.parameter.name(),
            change: change.change,
            sigma: change.sigma,
            p_value_of_rest: change.p_value_of_rest,
        };
        CalibrationDrift {
            has_drifted: drift.has_drifted,
            chi2: drift.chi2,
            degrees_of_freedom: drift.degrees_of_freedom,
            p_value: drift.p_value,
            changes: drift.changes.iter().map(change).collect(),
        }
    }
}

impl From<&Watched> for WatchedObject {
    fn from(watched: &Watched) -> Self {
        let (verdict, drift) = match &watched.watch {
            Watch::Filling | Watch::Stale { .. } => ("stale", None),
            Watch::Steady(drift) => ("steady", Some(drift.into())),
            Watch::Drifted(drift) => ("drifted", Some(drift.into())),
        };
        WatchedObject { from: watched.from.into(), to: watched.to.into(), verdict, drift }
    }
}

/// A parameter explains the change by itself where what it leaves would not be a change.
const EXPLAINED: f64 = 1e-3;

fn explanations(drift: &Drift) -> impl Iterator<Item = &Change> {
    drift.changes.iter().filter(|change| EXPLAINED < change.p_value_of_rest)
}

fn alone(change: &Change) -> String {
    let (name, factor, unit) = as_read(change.parameter);
    let (by, sigma) = (factor * change.change, factor * change.sigma);
    format!(
        "{name} alone, by {by:+.4} ± {sigma:.4} {unit}, would explain it (p = {:.2})",
        change.p_value_of_rest
    )
}

impl Watched {
    fn words(&self) -> String {
        let span = format!(
            "sweep {} sample {} to sweep {} sample {}",
            self.from.0, self.from.1, self.to.0, self.to.1
        );
        let said = match &self.watch {
            Watch::Filling => "too short".to_string(),
            Watch::Stale { seen, needed } => format!("unseen: {seen} readings of use, {needed} are needed"),
            Watch::Steady(drift) => format!("steady (p = {:.1e})", drift.p_value),
            Watch::Drifted(drift) => {
                let most_likely = drift.changes.first().map(alone).unwrap_or_default();
                format!("MOVED (p = {:.1e}); most likely {most_likely}", drift.p_value)
            }
        };
        format!("{span}: {said}")
    }
}

/// A parameter as a person reads it: its name, the factor from its own unit, the unit.
pub fn as_read(parameter: Parameter) -> (&'static str, f64, &'static str) {
    let degree = 1.0_f64.to_degrees();
    match parameter {
        Parameter::Stiffness => ("EI", 100.0, "%"),
        Parameter::ForceXZero => ("zero of fx", 1e3, "mN"),
        Parameter::ForceYZero => ("zero of fy", 1e3, "mN"),
        Parameter::TorqueZero => ("zero of mz", 1e3, "N mm"),
        Parameter::ForceGain => ("force gain less 1", 100.0, "%"),
        Parameter::TorqueGain => ("torque gain less 1", 100.0, "%"),
        Parameter::CellAngle => ("cell angle offset", degree, "°"),
        Parameter::HubAngle => ("hub angle offset", degree, "°"),
        Parameter::HubX => ("hub offset x", 1e3, "mm"),
        Parameter::HubY => ("hub offset y", 1e3, "mm"),
        Parameter::CellOriginX => ("cell origin x", 1e3, "mm"),
        Parameter::CellOriginY => ("cell origin y", 1e3, "mm"),
        Parameter::Curvature => ("curvature offset", 1.0, "1/m"),
        Parameter::FrictionAngle => ("friction angle", degree, "°"),
        Parameter::Weight => ("weight", 1e3, "mN"),
    }
}
