//! The `calibration` section of a whisker file: values, standard deviations and covariance by name.

use super::node::Node;
use crate::Rod;
use crate::calibrate::{
    Calibrated, Calibration, Covariance, Gravity, Parameter, Priors, Undetermined, Values,
};
use nalgebra::DMatrix;
use serde_json::{Map, Value, json};

/// Everything that `calibrate` says: what is read back, and what a person wants to know.
pub fn to_json(calibrated: &Calibrated) -> Value {
    let mut all = section(&calibrated.calibration, &calibrated.held);
    let counts = calibrated.counts();
    let verdict = json!({
        "prior_sigma": prior_sigma(&calibrated.priors),
        "mu": calibrated.calibration.mu(),
        "mu_sigma": calibrated.calibration.mu_sigma(),
        "EI_base_Nm2": calibrated.calibration.rod().ei_base_n_m2(),
        "status": if calibrated.is_consistent { "ok" } else { "inconsistent" },
        "chi2": calibrated.chi2,
        "degrees_of_freedom": calibrated.degrees_of_freedom,
        "p_value": calibrated.p_value,
        "n_free": counts.free, "n_mid": counts.mid, "n_tip": counts.tip, "n_unused": counts.unused,
        "undetermined": calibrated.undetermined.iter().map(open).collect::<Vec<_>>(),
        "object": calibrated.object.as_ref().map(super::object::to_json),
    });
    if let (Some(all), Value::Object(verdict)) = (all.as_object_mut(), verdict) {
        all.extend(verdict);
    }
    all
}

fn prior_sigma(priors: &Priors) -> Value {
    let free = priors.free().into_iter().map(|p| (p.name().to_string(), json!(priors.sigma(p))));
    Value::Object(free.collect())
}

fn open(open: &Undetermined) -> Value {
    let shares = open.combination.iter().map(|(p, share)| (p.name().to_string(), json!(share)));
    json!({"combination": Value::Object(shares.collect()), "left": open.left, "reason": open.reason})
}

/// What is read back.
pub fn section(calibration: &Calibration, held: &[Parameter]) -> Value {
    let free: Vec<Parameter> = Parameter::ALL.into_iter().filter(|p| !held.contains(p)).collect();
    let by_name = |of: &dyn Fn(Parameter) -> f64, which: &[Parameter]| {
        Value::Object(which.iter().map(|p| (p.name().to_string(), json!(of(*p)))).collect::<Map<_, _>>())
    };
    let row = |a: &Parameter| -> Vec<f64> {
        free.iter().map(|b| calibration.covariance[(a.index(), b.index())]).collect()
    };
    json!({
        "values": by_name(&|p| calibration.value(p), &Parameter::ALL),
        "sigma": by_name(&|p| calibration.sigma(p), &free),
        "parameters": free.iter().map(|p| p.name()).collect::<Vec<_>>(),
        "covariance": free.iter().map(row).collect::<Vec<_>>(),
        "held": held.iter().map(|p| p.name()).collect::<Vec<_>>(),
        "gravity": calibration.gravity.map(|g| json!({"direction_rad": g.direction_rad, "lever_m": g.lever_m})),
    })
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
