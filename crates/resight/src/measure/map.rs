//! The photographs and points of a scene on the Earth, as features of a map.

use super::answers::Answers;
use super::scene::NamedScene;
use crate::answer::georeference::GeoreferencedPose;
use crate::core::multiview::network::Adjusted;
use crate::georeference::features::NamedPosition;
use crate::georeference::{Features, georeferenced_pose};

/// Returns photographs and points as features; `None` where the control points are not given on the Earth.
pub fn features(scene: &NamedScene, answers: &Answers) -> Option<Features> {
    let frame = scene.frame.as_ref()?;
    let mut features = Features::default();
    for (i, photo) in scene.photos.iter().enumerate() {
        if let Some(pose) = photo_on_earth(scene, &answers.adjusted, i) {
            features.add_camera(&photo.name, &pose);
        }
    }
    let point = |(i, name): (usize, &String)| {
        let sigma_m =
            answers.adjusted.point_covariance_m2(i).map(|c| [0, 1, 2].map(|k| c[(k, k)].max(0.0).sqrt()));
        Some(NamedPosition { name: name.clone(), x_in_local: answers.adjusted.point(i)?, sigma_m })
    };
    features.add_points(frame, scene.points.iter().enumerate().filter_map(point)).ok()?;
    Some(features)
}

/// Returns where a photograph was taken; `None` where it has no pose or covariance, or the scene is not on the Earth.
pub fn photo_on_earth(scene: &NamedScene, adjusted: &Adjusted, photo: usize) -> Option<GeoreferencedPose> {
    let (frame, pose) = (scene.frame.as_ref()?, adjusted.cam_from_world(photo)?);
    Some(georeferenced_pose(frame, &pose, &adjusted.photo_covariance(photo)?))
}
