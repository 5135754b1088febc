//! `whisker calibrate`: stiffness, zeros, gains, angles and offsets from sweeps.

use super::answer;
use super::drift::{self, AgainstArgs, Compared, ComparedObject};
use super::input::{self, WhiskerArgs};
use super::solving::{MethodArg, parse_mu};
use crate::output::{Outcome, print};
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use resight::formats::write_atomically;
use resight::report::verdict::Status;
use resight_whisker::Sample;
use resight_whisker::calibrate::{Calibrated, Gravity, Object, Options, Parameter, calibrate};
use resight_whisker::files::WhiskerFile;
use resight_whisker::files::calibration::CalibrationObject;
use resight_whisker::files::object::OutlineObject;
use resight_whisker::friction::Mu;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;

/// Stiffness, load-cell zeros and gains, hub angle and offset, friction: from sweeps over an object that may be known.
///
/// Samples in free air must read nothing, sliding contacts have their force at the friction angle, tip contacts are one length away,
/// and a known object must be touched where it is. What the record leaves open is named and carried as uncertainty. The file written
/// is the whisker file with a `calibration` section, which every --whisker honours.
#[derive(Debug, Args)]
pub struct Calibrate {
    #[command(flatten)]
    whisker: WhiskerArgs,
    /// Hub readings of sweeps that begin in free air, CSV or JSON Lines.
    #[arg(value_name = "HUB.csv")]
    hub: PathBuf,
    /// Whisker file with the calibration added.
    #[arg(short, long, value_name = "CALIBRATED.json")]
    output: Option<PathBuf>,
    /// The object that was touched: an object file, or what `identify` wrote.
    #[arg(long, value_name = "OBJECT.json")]
    known: Option<PathBuf>,
    /// What of the object is known: where it is, its size only, or its kind only.
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = KnownArg::Place, requires = "known")]
    known_is: KnownArg,
    /// Coulomb's coefficient of friction: `auto` estimates it.
    #[arg(long, value_name = "auto|MU", default_value = "auto", allow_negative_numbers = true, value_parser = parse_mu)]
    mu: Mu,
    /// Direction in which things fall in the plane, degrees from the world's x axis: models the whisker's weight.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    gravity_deg: Option<f64>,
    /// Parameters to determine besides those of a new rig.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', value_enum)]
    free: Vec<FreeArg>,
    /// How contacts are found from loads.
    #[arg(long, value_name = "METHOD", value_enum, default_value_t = MethodArg::Auto)]
    method: MethodArg,
    #[command(flatten)]
    against: AgainstArgs,
    /// One JSON object on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KnownArg {
    /// Shape, size and place.
    Place,
    /// Shape and size.
    Size,
    /// The kind of shape.
    Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FreeArg {
    /// The cell's origin from the clamp, within 5 mm.
    CellOrigin,
    /// The whisker's intrinsic curvature, within 0.5 / m.
    Curvature,
}

/// See `Calibrate`.
pub fn run(args: &Calibrate) -> Result<Outcome> {
    if let Some(path) = &args.output {
        crate::files::must_be_writable(path)?;
    }
    let file = args.whisker.read()?;
    let reference = args.against.read(&file)?;
    let readings = input::readings(&args.hub, file.conventions)?;
    let samples: Vec<Sample> = readings.iter().filter_map(|row| row.reading.clone().ok()).collect();
    if let Some(reference) = &reference {
        reference.check(args.gravity(&file)?)?;
    }
    let n_missing = readings.len() - samples.len();
    let calibrated = calibrate(&file.rod, &file.cell, &samples, &known(args)?, &options(args, &file)?)?;
    if let Some(path) = &args.output {
        let text = serde_json::to_string_pretty(&document(&file, &calibrated))? + "\n";
        write_atomically(path, text.as_bytes())?;
    }
    let compared =
        reference.map(|reference| reference.compare(&calibrated, &file.cell, &samples)).transpose()?;
    match args.json {
        true => print(&answer::line(CalibrateObject::new(&calibrated, compared.as_ref()))?)?,
        false => print(&words(args, &file, &calibrated, n_missing, compared.as_ref()))?,
    }
    if compared.is_some_and(|compared| compared.has_drifted()) {
        return Ok(Outcome::Moved);
    }
    let fit = if calibrated.is_consistent { Status::Ok } else { Status::Inconsistent };
    let readings = if n_missing == 0 { Status::Ok } else { Status::Error };
    Ok(Outcome::of([fit, readings]))
}

/// The calibration and, with --against, what has moved since an earlier one.
#[derive(Serialize, JsonSchema)]
pub struct CalibrateObject {
    #[serde(flatten)]
    calibration: CalibrationObject,
    /// With --against.
    #[serde(skip_serializing_if = "Option::is_none")]
    drift: Option<ComparedObject>,
}

impl CalibrateObject {
    fn new(calibrated: &Calibrated, compared: Option<&Compared>) -> Self {
        CalibrateObject { calibration: calibrated.into(), drift: compared.map(ComparedObject::from) }
    }
}

impl Calibrate {
    /// Gravity where the whisker's weight is modelled.
    fn gravity(&self, file: &WhiskerFile) -> Result<Option<Gravity>> {
        let Some(degrees) = self.gravity_deg else { return Ok(None) };
        if !degrees.is_finite() {
            bail!("--gravity-deg {degrees}: a finite angle is needed");
        }
        Ok(Some(Gravity { direction_rad: degrees.to_radians(), lever_m: 0.5 * file.rod.length_m }))
    }
}

fn known(args: &Calibrate) -> Result<Object> {
    let Some(path) = &args.known else { return Ok(Object::Unknown) };
    let shape = input::object(path)?.shape;
    Ok(match args.known_is {
        KnownArg::Place => Object::Known(shape),
        KnownArg::Size => Object::KnownSize(shape),
        KnownArg::Kind => Object::KnownClass(shape),
    })
}

fn options(args: &Calibrate, file: &WhiskerFile) -> Result<Options> {
    let mut options = Options::of_a_new_rig(&file.cell);
    options.method = args.method.into();
    if let Mu::Known(mu) = args.mu {
        options.mu = Some(mu);
    }
    for free in &args.free {
        let sigmas: &[(Parameter, f64)] = match free {
            FreeArg::CellOrigin => &[(Parameter::CellOriginX, 5e-3), (Parameter::CellOriginY, 5e-3)],
            FreeArg::Curvature => &[(Parameter::Curvature, 0.5)],
        };
        for (parameter, sigma) in sigmas {
            options.priors = options.priors.with(*parameter, *sigma);
        }
    }
    options.gravity = args.gravity(file)?;
    if options.gravity.is_some() {
        options.priors = options.priors.with(Parameter::Weight, WEIGHT_SIGMA_N);
    }
    Ok(options)
}

/// A steel whisker of 1.5 mm and 0.4 m weighs 0.05 N.
const WEIGHT_SIGMA_N: f64 = 0.05;

/// The whisker file as it came, with this calibration in place of an older one.
fn document(file: &WhiskerFile, calibrated: &Calibrated) -> serde_json::Value {
    let mut document = file.document.clone();
    document["calibration"] = serde_json::json!(CalibrationObject::from(calibrated));
    document
}

fn words(
    args: &Calibrate,
    file: &WhiskerFile,
    calibrated: &Calibrated,
    n_missing: usize,
    compared: Option<&Compared>,
) -> String {
    let verdict =
        if calibrated.is_consistent { "OK" } else { "INCONSISTENT: the record does not keep the model" };
    let mut out = format!("{}   {verdict}\n", args.hub.display());
    let mut line = |label: &str, text: &str| crate::text::line(&mut out, label, text);
    let counts = calibrated.counts();
    line(
        "readings",
        &format!(
            "{} in free air, {} mid-whisker, {} at the tip, {} not used, {n_missing} with empty cells",
            counts.free, counts.mid, counts.tip, counts.unused
        ),
    );
    line(
        "fit",
        &format!(
            "chi2 {:.1} for {} degrees of freedom, p = {:.2}",
            calibrated.chi2, calibrated.degrees_of_freedom, calibrated.p_value
        ),
    );
    for parameter in Parameter::ALL.into_iter().filter(|p| !calibrated.held.contains(p)) {
        line("", &figure(calibrated, file, parameter));
    }
    for open in &calibrated.undetermined {
        let names: Vec<&str> = open.combination.iter().map(|(p, _)| p.name()).collect();
        line(
            "open",
            &format!(
                "{} ({:.0} % of the prior uncertainty left): {}",
                names.join(" with "),
                100.0 * open.left,
                open.reason
            ),
        );
    }
    if let Some(shape) = &calibrated.object {
        line("object", &serde_json::json!(OutlineObject::from(shape)).to_string());
    }
    for (label, text) in compared.map(Compared::words).unwrap_or_default() {
        line(label, &text);
    }
    if let Some(path) = &args.output {
        line("written", &path.display().to_string());
    }
    out
}

/// A parameter in the units a person reads.
fn figure(calibrated: &Calibrated, file: &WhiskerFile, parameter: Parameter) -> String {
    let (value, sigma) = (calibrated.calibration.value(parameter), calibrated.calibration.sigma(parameter));
    let said = || {
        let (name, factor, unit) = drift::as_read(parameter);
        format!("{name:24} {:>10.4} ± {:.4} {unit}", factor * value, factor * sigma)
    };
    match parameter {
        Parameter::Stiffness => {
            let ei = calibrated.calibration.rod().ei_base_n_m2();
            let change = 100.0 * (ei / file.rod.ei_base_n_m2() - 1.0);
            format!(
                "{:24} {:>10.4} ± {:.4} N mm² ({change:+.2} % of the file's)",
                "EI at the clamp",
                1e6 * ei,
                1e6 * ei * sigma
            )
        }
        Parameter::FrictionAngle => {
            let (mu, mu_sigma) = (calibrated.calibration.mu(), calibrated.calibration.mu_sigma());
            format!("{:24} {mu:>10.4} ± {mu_sigma:.4}", "friction mu")
        }
        _ => said(),
    }
}
