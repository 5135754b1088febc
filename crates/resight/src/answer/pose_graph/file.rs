//! Our own file of cameras that relative poses placed.

use super::SolvedPoseGraph;
use crate::answer::pose::rows;
use crate::answer::rig::with_status;
use crate::error::Error;
use crate::formats::{JointCovariance, NamedCamera, Placement, WriteError, own_rig_file};
use crate::input::not_among;
use crate::rig::RIG_FRAME;
use serde::Serialize;

impl SolvedPoseGraph {
    /// Writes the file that other commands read (TOML), with the status in its first line. It has lenses where `cameras` hold those of all
    /// cameras, else only poses.
    ///
    /// # Errors
    /// A camera of the pairs that is missing in `cameras`; a lens that the format cannot hold.
    pub fn file(&self, cameras: &[NamedCamera]) -> Result<String, Error> {
        let file = if cameras.is_empty() { self.poses_only()? } else { self.with_lenses(cameras)? };
        Ok(with_status(&file, self.status(), self.contradiction().as_deref()))
    }

    fn placement(&self, i: usize) -> Placement {
        let (b_from_a, covariance) = self.cam_from_rig[i];
        Placement { b: self.cameras[i].clone(), a: RIG_FRAME.to_string(), b_from_a, covariance }
    }

    fn poses_only(&self) -> Result<String, Error> {
        let relation = (0..self.cameras.len()).map(|i| PlaceOnly::of(&self.placement(i))).collect();
        let joint_covariance = self.joint().map(JointOnly::of);
        let file = toml::to_string(&PlacesOnly { relation, joint_covariance });
        Ok(file.map_err(|reason| WriteError(reason.to_string()))?)
    }

    fn with_lenses(&self, cameras: &[NamedCamera]) -> Result<String, Error> {
        let placed = |(i, name): (usize, &String)| match cameras.iter().find(|camera| &camera.name == name) {
            Some(camera) => Ok(NamedCamera { placement: Some(self.placement(i)), ..camera.clone() }),
            None => {
                let names: Vec<String> = cameras.iter().map(|camera| camera.name.clone()).collect();
                Err(Error::request(format!("--camera: {}", not_among(name, "camera", &names))))
            }
        };
        let all: Vec<NamedCamera> = self.cameras.iter().enumerate().map(placed).collect::<Result<_, _>>()?;
        Ok(own_rig_file(&all, self.joint())?)
    }

    /// Returns the covariance of all cameras together, where it is known.
    fn joint(&self) -> Option<JointCovariance> {
        self.known().map(|s| JointCovariance {
            noise_degrees_of_freedom: s.noise_degrees_of_freedom.map(|degrees| degrees as f64),
            ..JointCovariance::of(&self.cameras, &s.joint_covariance)
        })
    }
}

/// `[[relation]]` tables of our own file, which has no lenses. `convert` joins it with files that have them.
#[derive(Serialize)]
struct PlacesOnly {
    relation: Vec<PlaceOnly>,
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_covariance: Option<JointOnly>,
}

/// `[joint_covariance]` of our own file.
#[derive(Serialize)]
struct JointOnly {
    cameras: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise_degrees_of_freedom: Option<f64>,
    /// The lower triangle, row by row.
    lower: Vec<Vec<f64>>,
}

impl JointOnly {
    fn of(joint: JointCovariance) -> Self {
        let lower = joint.rows().into_iter().enumerate().map(|(i, row)| row[..=i].to_vec()).collect();
        let JointCovariance { cameras, noise_degrees_of_freedom, .. } = joint;
        JointOnly { cameras, noise_degrees_of_freedom, lower }
    }
}

/// The keys of `[camera.placement]`.
#[derive(Serialize)]
struct PlaceOnly {
    b: String,
    a: String,
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    covariance: Option<[[f64; 6]; 6]>,
}

impl PlaceOnly {
    fn of(placement: &Placement) -> Self {
        PlaceOnly {
            b: placement.b.clone(),
            a: placement.a.clone(),
            rotation_wxyz: placement.b_from_a.quaternion_wxyz(),
            translation_m: placement.b_from_a.translation.into(),
            covariance: placement.covariance.as_ref().map(rows),
        }
    }
}
