//! Builds a scene from the cameras of a rig file and their poses.

use super::build::{Builder, with_floor};
use super::{NamedQuery, NamedScene, QueryKind, SceneCamera, ScenePhoto};
use crate::FileError;
use crate::core::Pose;
use crate::core::multiview::network::Constraint;
use crate::formats;
use crate::input::table::how_file_is_read;
use crate::locate::IntrinsicsCovariance;
use crate::measure::clicks::read_image_points;
use std::path::{Path, PathBuf};

/// Builds a scene from the cameras of a rig file with their poses, and from image points in photographs of those cameras; the query is the
/// position of every point.
///
/// # Errors
/// Errors of the files; cameras without a pose in the rig.
pub fn rig_scene(
    rig: impl AsRef<Path>,
    image_points: impl AsRef<Path>,
    sigma_px: Option<f64>,
) -> Result<NamedScene, FileError> {
    let rig = rig.as_ref();
    let image_points = image_points.as_ref();
    let file = formats::read_cameras(rig)?;
    let mut builder = Builder::new(rig, PathBuf::new(), sigma_px)?;
    builder.scene.is_camera_frame = true;
    builder.scene.remarks = file.warnings.iter().map(|w| format!("{}: {w}", rig.display())).collect();
    check_one_frame(rig, &file.cameras)?;
    file.cameras.iter().for_each(|named| add_camera(&mut builder, named));
    let read = read_image_points(image_points)?;
    builder.scene.remarks.extend(how_file_is_read(image_points));
    for image_point in &read {
        let known: Vec<&str> = builder.scene.photos.iter().map(|p| p.name.as_str()).collect();
        if !known.contains(&image_point.photo.as_str()) {
            let reason = format!(
                "camera `{}` is not in {}; it has {}",
                image_point.photo,
                rig.display(),
                known.join(", ")
            );
            return Err(FileError::new(image_points, reason));
        }
        builder.image_point(image_point)?;
    }
    builder.scene.queries = all_positions(&builder.scene.points);
    Ok(builder.finished())
}

/// Adds a camera of the rig as a photograph with a known pose.
fn add_camera(builder: &mut Builder, named: &formats::NamedCamera) {
    let photo = builder.scene.photos.len();
    let camera = named.camera.clone();
    let intrinsics_covariance = IntrinsicsCovariance::of(named).map(|known| known.covariance(&camera));
    builder.scene.cameras.push(SceneCamera { camera, intrinsics_covariance });
    builder.scene.camera_of_photo.push(photo);
    builder.scene.photos.push(ScenePhoto { name: named.name.clone(), file: None, camera: photo });
    let (cam_from_world, covariance) = match &named.placement {
        None => (Pose::identity(), None),
        Some(p) if p.b == named.name => (p.b_from_a, p.covariance),
        Some(p) => (p.b_from_a.inverse(), p.covariance.map(|c| p.b_from_a.inverse_covariance(&c))),
    };
    let covariance = covariance.filter(|c| 0.0 < c.amax()).map(|c| with_floor(&c));
    builder.scene.constraints.push(Constraint::Pose { photo, cam_from_world, covariance });
}

/// Returns queries for the position of each point, and for its distance from the previous one.
fn all_positions(points: &[String]) -> Vec<NamedQuery> {
    let position =
        |p: usize| NamedQuery { name: points[p].clone(), kind: QueryKind::Position, points: vec![p] };
    let from_the_last = |p: usize| NamedQuery {
        name: format!("{}–{}", points[p - 1], points[p]),
        kind: QueryKind::Distance,
        points: vec![p - 1, p],
    };
    (0..points.len()).map(position).chain((1..points.len()).map(from_the_last)).collect()
}

/// Checks that all poses of a rig are relative to one frame.
fn check_one_frame(rig: &Path, cameras: &[formats::NamedCamera]) -> Result<(), FileError> {
    let base = |c: &formats::NamedCamera| match &c.placement {
        Some(p) if p.b == c.name => Some(p.a.clone()),
        Some(p) if p.a == c.name => Some(p.b.clone()),
        _ => None,
    };
    let frames: Vec<String> = cameras.iter().filter_map(base).collect();
    let first = frames.first().cloned().ok_or_else(|| {
        FileError::new(rig, "no camera has a place; give a rig file with [camera.placement]")
    })?;
    let lost = cameras.iter().find(|c| base(c).as_ref() != Some(&first) && c.name != first);
    match lost {
        Some(camera) => Err(FileError::new(
            rig,
            format!(
                "camera `{}` has no place in frame `{first}` as the others have; write all places relative to one frame",
                camera.name
            ),
        )),
        None => Ok(()),
    }
}
