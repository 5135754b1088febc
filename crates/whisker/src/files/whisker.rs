//! The whisker and its instruments: meta.json.
//!
//! `whisker`: length, stiffness (EI, or Young's modulus and diameters, or a table), intrinsic curvature. `sensor`: noise, rounding, units, force
//! frame and sign. `calibration`: what `calibrate` found.

use super::calibration;
use super::hub::{Conventions, ForceFrame, Sign};
use super::node::Node;
use super::units::Units;
use crate::calibrate::{Calibrated, Calibration};
use crate::rod::{IntrinsicCurvature, Stiffness};
use crate::{Cell, Rod};
use serde_json::Value;

/// A whisker file as it is understood.
#[derive(Debug, Clone, PartialEq)]
pub struct WhiskerFile {
    /// The whisker.
    pub rod: Rod,
    /// Its instruments' noise and steps.
    pub cell: Cell,
    /// How readings are meant unless their header says otherwise.
    pub conventions: Conventions,
    /// What `calibrate` found; none where it has not been asked.
    pub calibration: Option<Calibration>,
    /// What is odd or was assumed.
    pub warnings: Vec<String>,
    /// The whole document: what is written back when a calibration is added.
    pub document: Value,
}

/// Standard deviations assumed where the file states none: the resolution of a small commercial six-axis cell, 1/320 N and 1/64 N·mm.
const ASSUMED_FORCE_SIGMA_N: f64 = 1.0 / 320.0;
const ASSUMED_TORQUE_SIGMA_N_M: f64 = 1e-3 / 64.0;
/// EI stated and EI from modulus and diameter may differ by so much before a word is said.
const EI_AGREES: f64 = 0.01;

/// Reads a whisker file.
///
/// # Errors
/// What JSON says, or the key that is missing or wrong.
pub fn read(text: &str) -> Result<WhiskerFile, String> {
    let text = text.trim_start_matches('\u{feff}');
    let document: Value = serde_json::from_str(text).map_err(|reason| format!("no JSON: {reason}"))?;
    let root = Node::root(&document);
    let mut warnings = Vec::new();
    let rod = rod(&root.need("whisker")?, &mut warnings)?;
    rod.check().map_err(|reason| reason.to_string())?;
    let sensor = root.get("sensor");
    let cell = cell(sensor.as_ref(), &mut warnings)?;
    let conventions = conventions(sensor.as_ref())?;
    let calibration = root.get("calibration").map(|section| calibration::read(&section, &rod)).transpose()?;
    Ok(WhiskerFile { rod, cell, conventions, calibration, warnings, document })
}

/// What `calibrate` wrote, for a comparison with a later calibration: the whisker file and its `calibration` section in full.
///
/// # Errors
/// As [`read`]; a file without that section.
pub fn read_reference(text: &str) -> Result<(WhiskerFile, Calibrated), String> {
    let file = read(text)?;
    let section = Node::root(&file.document).need("calibration")?;
    let calibrated = calibration::read_reference(&section, &file.rod)?;
    Ok((file, calibrated))
}

fn rod(whisker: &Node, warnings: &mut Vec<String>) -> Result<Rod, String> {
    let length_m = whisker.need("length_m")?.positive()?;
    let diameters = diameters(whisker)?;
    let stiffness = stiffness(whisker, length_m, diameters, warnings)?;
    let is_centre_line =
        whisker.get("zero_thickness_contact").is_some_and(|node| node.value() != &Value::Bool(false));
    Ok(Rod {
        length_m,
        stiffness,
        intrinsic_curvature: curvature(whisker)?,
        diameters_m: if is_centre_line { [0.0, 0.0] } else { diameters.unwrap_or([0.0, 0.0]) },
    })
}

/// At the clamp and at the tip.
fn diameters(whisker: &Node) -> Result<Option<[f64; 2]>, String> {
    let Some(base) = whisker.any(&["diameter_base_m", "diameter_m"]) else { return Ok(None) };
    let base = base.positive()?;
    let tip = whisker.get("diameter_tip_m").map_or(Ok(base), |tip| tip.positive())?;
    let length_m = whisker.need("length_m")?.positive()?;
    // Also of a whisker whose contacts are stated on its centre line: EI follows from this.
    let (thickest, most) = (base.max(tip), crate::rod::THICKEST_SHARE * length_m);
    if most < thickest {
        return Err(format!(
            "the whisker's diameter is {thickest} m of a length of {length_m} m; at most {most:.4} m is a rod that \
             bends as the elastica says, check units and decimals"
        ));
    }
    Ok(Some([base, tip]))
}

fn stiffness(
    whisker: &Node,
    length_m: f64,
    diameters: Option<[f64; 2]>,
    warnings: &mut Vec<String>,
) -> Result<Stiffness, String> {
    if let Some(profile) = whisker.get("EI_profile") {
        let s_m = profile.need("s_m")?.numbers()?;
        let ei_n_m2 = profile.need("EI_Nm2")?.numbers()?;
        check_profile(&s_m, &ei_n_m2, length_m).map_err(|what| profile.complaint(&what))?;
        return Ok(Stiffness::Profile { s_m, ei_n_m2 });
    }
    let ei = ei_base(whisker, diameters, warnings)?;
    let taper = match (whisker.get("taper"), diameters) {
        (Some(taper), _) => taper.number()?,
        (None, Some([base, tip])) => 1.0 - tip / base,
        (None, None) => 0.0,
    };
    Ok(match taper {
        0.0 => Stiffness::Uniform { ei_n_m2: ei },
        taper => Stiffness::Taper { ei_base_n_m2: ei, taper },
    })
}

/// Stated, or E π d⁴ / 64 of the clamp's diameter; the stated one holds where both are there.
fn ei_base(whisker: &Node, diameters: Option<[f64; 2]>, warnings: &mut Vec<String>) -> Result<f64, String> {
    let stated = whisker.any(&["EI_base_Nm2", "EI_Nm2"]).map(|node| node.positive()).transpose()?;
    let modulus = whisker.get("youngs_modulus_Pa").map(|node| node.positive()).transpose()?;
    let computed =
        modulus.zip(diameters).map(|(e, [base, _])| e * std::f64::consts::PI * base.powi(4) / 64.0);
    match (stated, computed) {
        (Some(stated), Some(computed)) if EI_AGREES < (computed / stated - 1.0).abs() => {
            warnings.push(format!(
                "EI_base_Nm2 is {stated:.6}, Young's modulus and diameter give {computed:.6}; the stated EI is used"
            ));
            Ok(stated)
        }
        (Some(ei), _) | (None, Some(ei)) => Ok(ei),
        (None, None) => {
            Err("the stiffness is missing: give `whisker.EI_base_Nm2`, or `whisker.youngs_modulus_Pa` with \
            `whisker.diameter_base_m`, or `whisker.EI_profile` {s_m, EI_Nm2}"
                .to_string())
        }
    }
}

fn curvature(whisker: &Node) -> Result<IntrinsicCurvature, String> {
    if let Some(profile) = whisker.get("intrinsic_curvature_profile") {
        let (s_m, per_m) = (profile.need("s_m")?.numbers()?, profile.need("curvature_1_per_m")?.numbers()?);
        let length_m = whisker.need("length_m")?.positive()?;
        check_profile(&s_m, &per_m, length_m).map_err(|what| profile.complaint(&what))?;
        return Ok(IntrinsicCurvature::Profile { s_m, per_m });
    }
    Ok(IntrinsicCurvature::Constant {
        per_m: whisker.optional(&["intrinsic_curvature_1_per_m"])?.unwrap_or(0.0),
    })
}

/// Arc lengths that increase from 0 to the length, with as many values.
fn check_profile(s_m: &[f64], values: &[f64], length_m: f64) -> Result<(), String> {
    let (n, m) = (s_m.len(), values.len());
    let ends =
        s_m.first() == Some(&0.0) && s_m.last().is_some_and(|l| (l - length_m).abs() <= 1e-9 * length_m);
    match () {
        _ if n != m => Err(format!("as many values as arc lengths ({n} and {m} are there)")),
        _ if n < 2 || !ends => Err(format!("arc lengths from 0 to the whisker's length, {length_m} m,")),
        _ if s_m.windows(2).any(|pair| pair[1] <= pair[0]) => {
            Err("a list of increasing arc lengths".to_string())
        }
        _ => Ok(()),
    }
}

fn cell(sensor: Option<&Node>, warnings: &mut Vec<String>) -> Result<Cell, String> {
    let noise = sensor.and_then(|sensor| sensor.get("noise"));
    let steps = noise.as_ref().and_then(|noise| noise.get("quantised_to_LSB"));
    let sigma = |keys: &[&str]| match noise.as_ref().and_then(|noise| noise.any(keys)) {
        Some(node) => node.not_negative().map(Some),
        None => Ok(None),
    };
    let step = |keys: &[&str]| match steps.as_ref().and_then(|steps| steps.any(keys)) {
        Some(node) => node.not_negative(),
        None => Ok(0.0),
    };
    let (force, torque) = (sigma(&["force_sigma_N"])?, sigma(&["torque_sigma_Nm"])?);
    let mut cell = Cell {
        force_sigma_n: force.unwrap_or(ASSUMED_FORCE_SIGMA_N),
        torque_sigma_n_m: torque.unwrap_or(ASSUMED_TORQUE_SIGMA_N_M),
        hub_angle_sigma_rad: sigma(&["hub_angle_sigma_rad"])?.unwrap_or(0.0),
        hub_xy_sigma_m: sigma(&["hub_xy_sigma_m"])?.unwrap_or(0.0),
        force_step_n: step(&["force_N"])?,
        torque_step_n_m: step(&["torque_Nm"])?,
        hub_angle_step_rad: step(&["hub_angle_rad"])?,
    };
    assume_noise(&mut cell, [force, torque], warnings);
    Ok(cell)
}

/// Exact forces do not exist: a covariance of zero would make every test of consistency fail.
fn assume_noise(cell: &mut Cell, stated: [Option<f64>; 2], warnings: &mut Vec<String>) {
    let zero = cell.load_covariance().diagonal().iter().any(|variance| *variance == 0.0);
    if stated.contains(&None) || zero {
        if zero {
            (cell.force_sigma_n, cell.torque_sigma_n_m) = (ASSUMED_FORCE_SIGMA_N, ASSUMED_TORQUE_SIGMA_N_M);
        }
        warnings.push(format!(
            "`sensor.noise` does not say how noisy forces and torque are: {:.3} mN and {:.4} N mm assumed",
            1e3 * cell.force_sigma_n,
            1e3 * cell.torque_sigma_n_m
        ));
    }
}

/// Units as an object, or as words that begin with SI; frame and sign by the words the file begins them with.
fn conventions(sensor: Option<&Node>) -> Result<Conventions, String> {
    let mut conventions = Conventions::default();
    let Some(sensor) = sensor else { return Ok(conventions) };
    if let Some(units) = sensor.get("units") {
        conventions.units = self::units(&units)?;
    }
    if let Some(frame) = sensor.get("force_frame") {
        conventions.force_frame = match first_word(frame.word()?).as_str() {
            "hub" => ForceFrame::Hub,
            "world" => ForceFrame::World,
            _ => return Err(frame.complaint("`hub` or `world`")),
        };
    }
    if let Some(sign) = sensor.get("sign")
        && first_word(sign.word()?) == "on_whisker"
    {
        conventions.sign = Sign::OnWhisker;
    }
    Ok(conventions)
}

fn units(node: &Node) -> Result<Units, String> {
    if let Some(object) = node.value().as_object() {
        let mut units = Units::default();
        for (quantity, unit) in object {
            let unit = unit.as_str().ok_or_else(|| node.complaint("a word for each unit"))?;
            units.set(quantity, unit).map_err(|what| format!("`sensor.units`: {what}"))?;
        }
        return Ok(units);
    }
    match first_word(node.word()?).as_str() {
        "si" => Ok(Units::default()),
        _ => Err(node.complaint("`SI` or {\"length\": \"mm\", …}")),
    }
}

fn first_word(text: &str) -> String {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default().to_lowercase()
}
