//! The `calibration` section of a whisker file: values, standard deviations and covariance by name.

use super::node::Node;
use super::object::OutlineObject;
use crate::Rod;
use crate::calibrate::{
    Calibrated, Calibration, Covariance, Gravity, Parameter, Priors, Undetermined, Values,
};
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// Numbers by the names of the parameters, which end in their units.
type ByName = BTreeMap<&'static str, f64>;

/// What is read back.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CalibrationSection {
    /// Every parameter, in the unit that its name ends in; `ln_…` are logarithms of factors. Axes and signs: docs/math/whisker_calibrate.md.
    values: ByName,
    /// Standard deviations of the parameters that were not held, in the same units.
    sigma: ByName,
    /// The parameters that were not held: rows and columns of `covariance`.
    parameters: Vec<&'static str>,
    /// Row by row, in the products of their units.
    covariance: Vec<Vec<f64>>,
    /// The parameters that were held at their values.
    held: Vec<&'static str>,
    /// Null where the whisker's weight is not modelled.
    gravity: Option<GravityObject>,
}

/// Gravity in the plane of bending.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
struct GravityObject {
    /// Direction in which things fall, counter-clockwise from the world's x axis, radians.
    direction_rad: f64,
    /// The whisker's centre of mass from the clamp, metres.
    lever_m: f64,
}

/// What a record says of the rig: the calibration that is read back, and how well the record determines it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CalibrationObject {
    #[serde(flatten)]
    section: CalibrationSection,
    /// Standard deviations of the same parameters before the record.
    prior_sigma: ByName,
    /// Coulomb's coefficient of friction.
    mu: f64,
    /// Its standard deviation.
    mu_sigma: f64,
    /// Bending stiffness at the clamp, N m².
    #[serde(rename = "EI_base_Nm2")]
    ei_base_n_m2: f64,
    /// `inconsistent` where the record does not keep the model.
    #[schemars(extend("enum" = ["ok", "inconsistent"]))]
    status: &'static str,
    /// Squared misfit of the record, in the noise stated.
    chi2: f64,
    /// Its degrees of freedom.
    degrees_of_freedom: usize,
    /// Probability that a record which keeps the model fits as badly.
    p_value: f64,
    /// Readings in free air.
    n_free: usize,
    /// Readings in contact between clamp and tip.
    n_mid: usize,
    /// Readings in contact at the tip.
    n_tip: usize,
    /// Readings not used.
    n_unused: usize,
    /// What the record leaves open, the most open first.
    undetermined: Vec<OpenObject>,
    /// The object as fitted, or as given where it is known; null where nothing is known of it.
    object: Option<OutlineObject>,
}

/// A combination of parameters that the record does not determine.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
struct OpenObject {
    /// The share of each parameter, in units of its prior standard deviation.
    combination: ByName,
    /// Standard deviation after the record over that before, 0.5 to 1.
    left: f64,
    /// Why, and what would determine it.
    reason: &'static str,
}

impl From<&Calibrated> for CalibrationObject {
    fn from(calibrated: &Calibrated) -> Self {
        let (calibration, counts) = (&calibrated.calibration, calibrated.counts());
        CalibrationObject {
            section: section(calibration, &calibrated.held),
            prior_sigma: by_name(&calibrated.priors.free(), |p| calibrated.priors.sigma(p)),
            mu: calibration.mu(),
            mu_sigma: calibration.mu_sigma(),
            ei_base_n_m2: calibration.rod().ei_base_n_m2(),
            status: if calibrated.is_consistent { "ok" } else { "inconsistent" },
            chi2: calibrated.chi2,
            degrees_of_freedom: calibrated.degrees_of_freedom,
            p_value: calibrated.p_value,
            n_free: counts.free,
            n_mid: counts.mid,
            n_tip: counts.tip,
            n_unused: counts.unused,
            undetermined: calibrated.undetermined.iter().map(open).collect(),
            object: calibrated.object.as_ref().map(OutlineObject::from),
        }
    }
}

fn by_name(which: &[Parameter], of: impl Fn(Parameter) -> f64) -> ByName {
    which.iter().map(|p| (p.name(), of(*p))).collect()
}

fn open(open: &Undetermined) -> OpenObject {
    let combination = open.combination.iter().map(|(p, share)| (p.name(), *share)).collect();
    OpenObject { combination, left: open.left, reason: open.reason }
}

/// What is read back.
pub fn section(calibration: &Calibration, held: &[Parameter]) -> CalibrationSection {
    let free: Vec<Parameter> = Parameter::ALL.into_iter().filter(|p| !held.contains(p)).collect();
    let names = |which: &[Parameter]| which.iter().map(|p| p.name()).collect();
    let row = |a: &Parameter| -> Vec<f64> {
        free.iter().map(|b| calibration.covariance[(a.index(), b.index())]).collect()
    };
    CalibrationSection {
        values: by_name(&Parameter::ALL, |p| calibration.value(p)),
        sigma: by_name(&free, |p| calibration.sigma(p)),
        parameters: names(&free),
        covariance: free.iter().map(row).collect(),
        held: names(held),
        gravity: calibration
            .gravity
            .map(|g| GravityObject { direction_rad: g.direction_rad, lever_m: g.lever_m }),
    }
}

/// Reads the section of the whisker file of `rod`.
///
/// # Errors
/// The key that is missing or wrong.
pub fn read(section: &Node, rod: &Rod) -> Result<Calibration, String> {
    let mut values = Values::zeros();
    let given = section.need("values")?;
    for parameter in Parameter::ALL {
        if let Some(node) = given.get(parameter.name()) {
            values[parameter.index()] = node.number()?;
        }
    }
    let names = section.need("parameters")?;
    let mut places = Vec::new();
    for node in names.list()? {
        let word = node.word()?;
        let known = Parameter::ALL.into_iter().find(|p| p.name() == word);
        places.push(known.ok_or_else(|| node.complaint(&format!("one of {}", all_names())))?.index());
    }
    let gravity = section.get("gravity").map(|node| gravity(&node)).transpose()?;
    let covariance = covariance(&section.need("covariance")?, &places)?;
    Ok(Calibration { nominal_rod: rod.clone(), values, covariance, gravity })
}

/// Reads what a comparison with a later calibration needs: the rig, and how well it was known beforehand. What was said of the record
/// besides (roles, object, what is open) is not read.
///
/// # Errors
/// The key that is missing or wrong.
pub fn read_reference(section: &Node, rod: &Rod) -> Result<Calibrated, String> {
    let calibration = read(section, rod)?;
    let given = section.need("prior_sigma")?;
    let mut priors = Priors::all_held();
    for parameter in Parameter::ALL {
        if let Some(node) = given.get(parameter.name()) {
            priors = priors.with(parameter, node.positive()?);
        }
    }
    let held = Parameter::ALL.into_iter().filter(|p| priors.sigma(*p) == 0.0).collect();
    let status = section.need("status")?.word()?;
    Ok(Calibrated {
        calibration,
        priors,
        undetermined: Vec::new(),
        held,
        object: None,
        object_covariance: DMatrix::zeros(0, 0),
        unknown_reason: None,
        chi2: section.need("chi2")?.not_negative()?,
        degrees_of_freedom: section.need("degrees_of_freedom")?.not_negative()? as usize,
        p_value: section.need("p_value")?.not_negative()?,
        contradicted: 0,
        is_consistent: status == "ok",
        roles: Vec::new(),
    })
}

fn all_names() -> String {
    Parameter::ALL.map(Parameter::name).join(", ")
}

fn gravity(node: &Node) -> Result<Gravity, String> {
    Ok(Gravity {
        direction_rad: node.need("direction_rad")?.number()?,
        lever_m: node.need("lever_m")?.number()?,
    })
}

fn covariance(node: &Node, places: &[usize]) -> Result<Covariance, String> {
    let rows = node.list()?;
    let mut covariance = Covariance::zeros();
    let square = format!("a square list of {0} by {0} numbers", places.len());
    if rows.len() != places.len() {
        return Err(node.complaint(&square));
    }
    for (row, i) in rows.iter().zip(places) {
        let numbers = row.numbers()?;
        if numbers.len() != places.len() {
            return Err(row.complaint(&square));
        }
        for (value, j) in numbers.iter().zip(places) {
            covariance[(*i, *j)] = *value;
        }
    }
    Ok(covariance)
}
