//! Poses of cameras with their covariances, where known, as JSON.

use super::budget::{BudgetPartObject, parts};
use super::{TransformObject, rows};
use crate::core::budget::Budget;
use crate::core::{Matrix6, Pose};
use crate::report::words::{sigmas, translation_sigma_m};
use crate::rig::relative::UncertainPose;
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;

/// `cam_from_rig` and its inverse; covariance and sigmas null where nothing is known.
#[derive(Serialize, JsonSchema)]
pub(super) struct PlacedObject {
    cam_from_rig: TransformObject,
    rig_from_cam: TransformObject,
    covariance: Option<[[f64; 6]; 6]>,
    sigma_rad: Option<[f64; 3]>,
    sigma_m: Option<[f64; 3]>,
    /// Of the translation of `cam_from_rig` itself, which a rotation changes too.
    sigma_translation_m: Option<[f64; 3]>,
}

impl PlacedObject {
    /// Builds the object from a pose and the covariance of its small left motion.
    pub(super) fn of(cam_from_rig: &Pose, covariance: Option<&Matrix6>) -> Self {
        let sigma = covariance.map(sigmas);
        PlacedObject {
            cam_from_rig: (*cam_from_rig).into(),
            rig_from_cam: cam_from_rig.inverse().into(),
            covariance: covariance.map(rows),
            sigma_rad: sigma.map(|s| s.0),
            sigma_m: sigma.map(|s| s.1),
            sigma_translation_m: covariance.map(|covariance| translation_sigma_m(cam_from_rig, covariance)),
        }
    }
}

/// A pose under a name of its own, with its covariance.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct UncertainObject {
    #[serde(flatten)]
    pose: TransformObject,
    covariance: [[f64; 6]; 6],
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
    /// Of the translation itself, which a rotation changes too.
    sigma_translation_m: [f64; 3],
    /// The parts of `covariance` by the sources of the errors, where they are known.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    budget: Vec<BudgetPartObject>,
}

impl UncertainObject {
    pub(super) fn of(pose: &UncertainPose) -> Self {
        let (sigma_rad, sigma_m) = sigmas(&pose.covariance);
        UncertainObject {
            pose: pose.b_from_a.into(),
            covariance: rows(&pose.covariance),
            sigma_rad,
            sigma_m,
            sigma_translation_m: translation_sigma_m(&pose.b_from_a, &pose.covariance),
            budget: Vec::new(),
        }
    }

    /// The object with the parts of its covariance.
    pub(super) fn with_budget(self, budget: &Budget) -> Self {
        UncertainObject { budget: parts(budget), ..self }
    }
}

/// The covariance of all cameras of a rig together.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct JointObject {
    /// Six rows each.
    cameras: Vec<String>,
    matrix: Vec<Vec<f64>>,
}

impl JointObject {
    /// Builds the object for these cameras; the matrix has six rows for each.
    pub(super) fn of(cameras: Vec<String>, matrix: &DMatrix<f64>) -> Self {
        JointObject { cameras, matrix: matrix.row_iter().map(|row| row.iter().copied().collect()).collect() }
    }
}
