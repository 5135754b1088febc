//! Computes the poses of a file's cameras in one frame, however the file chains them.

use crate::core::temporal::compare::{Correlation, RigPoses};
use crate::core::{Matrix6, Pose};
use crate::formats::{NamedCamera, Placement};
use nalgebra::DMatrix;

/// A camera with its pose in the common frame of a file's cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedCamera {
    /// Its name.
    pub name: String,
    /// x_in_cam = cam_from_rig · x_in_rig.
    pub cam_from_rig: Pose,
    /// 6×6 covariance of its small left motion, camera frame; zero where the camera's frame is the common one; `None` where the file states none
    /// for a pose in the chain.
    pub covariance: Option<Matrix6>,
}

/// The cameras of one calibration in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedRig {
    /// The cameras with their poses.
    pub cameras: Vec<PlacedCamera>,
    /// Joint covariance, 6 rows per camera in their order, where it is known.
    pub joint: Option<DMatrix<f64>>,
    /// Degrees of freedom of the noise, where it was estimated together with the covariances.
    pub noise_degrees_of_freedom: Option<f64>,
}

impl PlacedRig {
    /// Sets the joint covariance; the rows are in the order of `names`.
    ///
    /// # Errors
    /// A sentence, when an uncertain camera is missing in `names`, when the matrix does not have six rows per camera, all finite, or when it
    /// contradicts the covariance of a single camera.
    pub fn with_joint(
        cameras: Vec<PlacedCamera>,
        names: &[String],
        rows: &[Vec<f64>],
    ) -> Result<Self, String> {
        let at = |camera: &PlacedCamera| {
            let found = names.iter().position(|name| *name == camera.name);
            let is_exact = camera.covariance == Some(Matrix6::zeros());
            match found {
                None if !is_exact => Err(format!("the joint covariance lacks camera {}", camera.name)),
                found => Ok(found),
            }
        };
        let order: Vec<Option<usize>> = cameras.iter().map(at).collect::<Result<_, String>>()?;
        let n = 6 * names.len();
        let is_whole =
            rows.len() == n && rows.iter().all(|row| row.len() == n && row.iter().all(|x| x.is_finite()));
        if !is_whole {
            return Err(format!(
                "the joint covariance of {} cameras must be {n} rows of {n} numbers",
                names.len()
            ));
        }
        let index = |i: usize| order[i / 6].map(|camera| 6 * camera + i % 6);
        let joint = DMatrix::from_fn(6 * order.len(), 6 * order.len(), |i, j| {
            index(i).zip(index(j)).map_or(0.0, |(row, column)| rows[row][column])
        });
        for (i, camera) in cameras.iter().enumerate() {
            let own: Matrix6 = joint.fixed_view::<6, 6>(6 * i, 6 * i).into();
            if camera.covariance.is_some_and(|stated| 1e-6 * stated.amax() < (own - stated).amax()) {
                return Err(format!(
                    "the joint covariance contradicts that of camera {} alone; one of them was changed, remove the joint one",
                    camera.name
                ));
            }
        }
        Ok(PlacedRig { cameras, joint: Some(joint), noise_degrees_of_freedom: None })
    }

    /// Returns these cameras in this order, as input of `compare_rigs`. Without a joint covariance the correlations of a file's own covariances
    /// are unknown; cameras of a file that states none get `stated`, independent of each other. `None` where there is neither, or no camera of a
    /// name.
    pub fn places(&self, names: &[String], stated: Option<&Matrix6>) -> Option<RigPoses> {
        let at = |name: &String| self.cameras.iter().position(|camera| camera.name == *name);
        let order: Vec<usize> = names.iter().map(at).collect::<Option<_>>()?;
        let is_exact = order.iter().all(|i| self.cameras[*i].covariance == Some(Matrix6::zeros()));
        let mut covariance = DMatrix::zeros(6 * order.len(), 6 * order.len());
        for (row, &i) in order.iter().enumerate() {
            let own = self.cameras[i].covariance.filter(|_| !is_exact && self.has_covariances());
            covariance.fixed_view_mut::<6, 6>(6 * row, 6 * row).copy_from(&own.or(stated.copied())?);
        }
        if let Some(joint) = &self.joint {
            let index = |i: usize| 6 * order[i / 6] + i % 6;
            covariance =
                DMatrix::from_fn(6 * order.len(), 6 * order.len(), |i, j| joint[(index(i), index(j))]);
        }
        let cam_from_rig = order.iter().map(|i| self.cameras[*i].cam_from_rig).collect();
        let is_known = self.joint.is_some() || is_exact || !self.has_covariances();
        let correlation = if is_known { Correlation::Known } else { Correlation::Unknown };
        let noise_degrees_of_freedom =
            self.noise_degrees_of_freedom.filter(|_| !is_exact && self.has_covariances());
        Some(RigPoses { cam_from_rig, covariance, correlation, noise_degrees_of_freedom })
    }

    /// Returns whether every camera has a covariance: a file may state it for some of them only.
    pub fn has_covariances(&self) -> bool {
        self.cameras.iter().all(|camera| camera.covariance.is_some())
    }
}

/// A frame that was reached, with frame_from_rig and its covariance.
type Reached = (String, Pose, Option<Matrix6>);

/// Computes the cameras' poses in the frame from which the first placement maps. Poses in a chain are assumed to be independent.
///
/// # Errors
/// A sentence, when no pose is stated or a camera is not connected to the others.
pub fn placed(cameras: &[NamedCamera]) -> Result<Vec<PlacedCamera>, String> {
    let placements: Vec<&Placement> = cameras.iter().filter_map(|camera| camera.placement.as_ref()).collect();
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    placed_among(&names, &placements)
}

/// Computes the poses of frames that a file states without lenses, as `pose-graph` writes them, in the frame from which the first one maps.
///
/// # Errors
/// A sentence, when no pose is stated or a frame is not connected to the others.
pub fn placed_frames(relations: &[Placement]) -> Result<Vec<PlacedCamera>, String> {
    let mut names: Vec<&str> = Vec::new();
    for name in relations.iter().map(|relation| relation.b.as_str()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    placed_among(&names, &relations.iter().collect::<Vec<_>>())
}

fn placed_among(names: &[&str], placements: &[&Placement]) -> Result<Vec<PlacedCamera>, String> {
    let Some(first) = placements.first() else {
        return Err("states no poses, only intrinsics; give a file that says where its cameras are".into());
    };
    let reached = reach(&first.a, placements);
    let place = |name: &&str| {
        let found = reached.iter().find(|(frame, ..)| frame == name);
        let (_, cam_from_rig, covariance) = found
            .ok_or_else(|| format!("does not state the pose of camera {name} relative to the others"))?;
        Ok(PlacedCamera { name: name.to_string(), cam_from_rig: *cam_from_rig, covariance: *covariance })
    };
    names.iter().map(place).collect()
}

/// Returns every frame that placements connect to the root, nearest first.
fn reach(root: &str, placements: &[&Placement]) -> Vec<Reached> {
    let mut reached = vec![(root.to_owned(), Pose::identity(), Some(Matrix6::zeros()))];
    let mut next = 0;
    while let Some((frame, frame_from_rig, covariance)) = reached.get(next).cloned() {
        for p in placements {
            let (to, to_from_frame, step) = match (p.a == frame, p.b == frame) {
                (true, _) => (&p.b, p.b_from_a, p.covariance),
                (_, true) => {
                    let inverse = p.covariance.map(|covariance| p.b_from_a.inverse_covariance(&covariance));
                    (&p.a, p.b_from_a.inverse(), inverse)
                }
                _ => continue,
            };
            if reached.iter().all(|(seen, ..)| seen != to) {
                let both = step.zip(covariance);
                let sum = both.map(|(step, before)| to_from_frame.product_covariance(&step, &before));
                reached.push((to.clone(), to_from_frame * frame_from_rig, sum));
            }
        }
        next += 1;
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::{Camera, Vector6};

    fn camera(name: &str, placement: Option<(&str, &str, f64, bool)>) -> NamedCamera {
        let placement = placement.map(|(b, a, x, has_covariances)| Placement {
            b: b.into(),
            a: a.into(),
            b_from_a: Pose::exp(&Vector6::new(0.1, x, 0.2, x, 0.0, 1.0)),
            covariance: has_covariances.then(|| Matrix6::from_diagonal_element(1e-6)),
        });
        NamedCamera {
            name: name.into(),
            camera: Camera::normalized(),
            placement,
            intrinsics_covariance: None,
        }
    }

    /// A chain (Kalibr), a first camera without a pose (OpenCV), and a pose stated the other way round (EuRoC).
    #[test]
    fn chains_first_cameras_and_inverses() {
        let chain = [
            camera("c0", None),
            camera("c1", Some(("c1", "c0", 0.1, true))),
            camera("c2", Some(("c1", "c2", 0.3, true))),
        ];
        let found = placed(&chain).unwrap();
        let p = |i: usize| chain[i].placement.as_ref().unwrap().b_from_a;
        assert_eq!((found[0].cam_from_rig, found[0].covariance), (Pose::identity(), Some(Matrix6::zeros())));
        assert_eq!(found[1].cam_from_rig, p(1));
        let expected = p(2).inverse() * p(1);
        assert!((found[2].cam_from_rig.translation - expected.translation).norm() < 1e-14);
        let covariance = p(2).inverse_covariance(&Matrix6::from_diagonal_element(1e-6));
        let covariance =
            p(2).inverse().product_covariance(&covariance, &Matrix6::from_diagonal_element(1e-6));
        assert!((found[2].covariance.unwrap() - covariance).norm() < 1e-18);
    }

    #[test]
    fn what_is_not_said_is_none_or_named() {
        let cameras =
            [camera("a", Some(("a", "rig", 0.1, false))), camera("b", Some(("b", "rig", 0.2, true)))];
        let found = placed(&cameras).unwrap();
        assert!(found[0].covariance.is_none() && found[1].covariance.is_some());
        let lost = [camera("a", Some(("a", "rig", 0.1, true))), camera("b", Some(("b", "other", 0.1, true)))];
        assert!(placed(&lost).unwrap_err().contains("camera b"));
        assert!(placed(&[camera("a", None)]).unwrap_err().contains("no poses"));
    }
}
