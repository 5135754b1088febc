//! The parts of a covariance by their sources, as JSON.

use crate::core::Matrix6;
use crate::core::budget::{Budget, BudgetPart, ErrorSource};
use crate::report::words::sigmas;
use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, OMatrix};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Serialize, Serializer};
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

/// A part of the variance of one number, or of the covariance of several.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct NumbersPartObject {
    /// The source of the errors.
    part: PartName,
    /// One standard deviation of each number if only these errors were there, in its unit.
    sigma: Vec<f64>,
    /// Fraction of the variance: of a measurement its own, of several coordinates their sum, of intrinsics that of the projection over the image.
    share: f64,
}

/// A source by its name.
#[derive(Debug, Clone, Copy)]
struct PartName(ErrorSource);

impl Serialize for PartName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0.name())
    }
}

impl NumbersPartObject {
    /// Returns the source of the errors with its fraction.
    pub fn share(&self) -> (ErrorSource, f64) {
        (self.part.0, self.share)
    }
}

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
            part: PartName(one.source),
            sigma_rad,
            sigma_m,
            share: budget.position_share(one),
            covariance: rows(&one.covariance),
        }
    };
    budget.parts().iter().map(part).collect()
}

/// Returns the parts of several numbers with their shares.
pub(crate) fn parts_of_numbers<D: Dim>(
    budget: &Budget<OMatrix<f64, D, D>>,
    share: impl Fn(&BudgetPart<OMatrix<f64, D, D>>) -> f64,
) -> Vec<NumbersPartObject>
where
    DefaultAllocator: Allocator<D, D>,
{
    let part = |one: &BudgetPart<OMatrix<f64, D, D>>| NumbersPartObject {
        part: PartName(one.source),
        sigma: (0..one.covariance.nrows()).map(|i| one.covariance[(i, i)].max(0.0).sqrt()).collect(),
        share: share(one),
    };
    budget.parts().iter().map(part).collect()
}

/// Returns a 6×6 matrix row by row.
pub fn rows(m: &Matrix6) -> [[f64; 6]; 6] {
    std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
}
