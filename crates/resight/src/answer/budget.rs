//! The parts of a covariance by their sources, as JSON.

use crate::core::Matrix6;
use crate::core::budget::{Budget, BudgetPart, ErrorSource};
use crate::report::words::sigmas;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use std::borrow::Cow;

/// A part of a covariance.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BudgetPartObject {
    /// The source of the errors.
    part: PartName,
    /// One standard deviation of the rotation about each axis if only these errors were there.
    sigma_rad: [f64; 3],
    /// One standard deviation of the position along each axis, likewise.
    sigma_m: [f64; 3],
    /// Fraction of the variance of the position, which is the sum over its axes.
    share: f64,
    /// The parts add up to the covariance.
    covariance: [[f64; 6]; 6],
}

/// A source by its name.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(transparent)]
struct PartName(&'static str);

impl JsonSchema for PartName {
    fn schema_name() -> Cow<'static, str> {
        "BudgetPartName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schemars::json_schema!({ "type": "string", "enum": ErrorSource::ALL.map(ErrorSource::name) })
    }
}

/// Returns the parts in the order of the budget.
pub(super) fn parts(budget: &Budget) -> Vec<BudgetPartObject> {
    let part = |one: &BudgetPart| {
        let (sigma_rad, sigma_m) = sigmas(&one.covariance);
        BudgetPartObject {
            part: PartName(one.source.name()),
            sigma_rad,
            sigma_m,
            share: budget.position_share(one),
            covariance: rows(&one.covariance),
        }
    };
    budget.parts().iter().map(part).collect()
}

/// Returns a 6×6 matrix row by row.
pub fn rows(m: &Matrix6) -> [[f64; 6]; 6] {
    std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
}
