//! What an unknown file may be meant for: the formats whose keys it shares most, and which of theirs it lacks.

use super::Format;
use super::document::{Document, Node, Value};
use std::collections::BTreeSet;

/// Keys without which a file is none of the format. Lists are of readable files only: the row that reads them is in `table`.
const KEYS: [(Format, &[&str]); 26] = [
    (Format::Own, &["model", "fx_px", "fy_px", "cx_px", "cy_px"]),
    (Format::OpenCv, &["camera_matrix", "distortion_coefficients"]),
    (
        Format::RosCameraInfo,
        &[
            "image_width",
            "image_height",
            "camera_matrix",
            "distortion_model",
            "distortion_coefficients",
            "projection_matrix",
        ],
    ),
    (Format::Kalibr, &["camera_model", "distortion_model", "distortion_coeffs", "intrinsics", "resolution"]),
    (
        Format::Euroc,
        &["T_BS", "sensor_type", "camera_model", "intrinsics", "distortion_coefficients", "resolution"],
    ),
    (Format::PlainKeys, &["fx", "fy", "cx", "cy"]),
    (Format::OrbSlam, &["Camera.fx", "Camera.fy", "Camera.cx", "Camera.cy"]),
    (
        Format::Camodocal,
        &["model_type", "projection_parameters", "distortion_parameters", "image_width", "image_height"],
    ),
    (Format::NerfTransforms, &["fl_x", "w", "h", "frames"]),
    (Format::OpenSfm, &["projection_type", "width", "height", "focal"]),
    (Format::Basalt, &["value0", "camera_type", "intrinsics", "resolution"]),
    (Format::PhotonVision, &["cameraIntrinsics", "distCoeffs", "resolution"]),
    (Format::Multical, &["cameras", "camera_poses", "K", "dist", "image_size"]),
    (Format::McCalib, &["camera_matrix", "distortion_vector", "camera_pose_matrix"]),
    (Format::DepthAi, &["cameraData", "intrinsicMatrix", "distortionCoeff", "width", "height"]),
    (
        Format::AzureKinect,
        &["CalibrationInformation", "Cameras", "ModelParameters", "SensorWidth", "SensorHeight"],
    ),
    (Format::RealSense, &["width", "height", "ppx", "ppy", "fx", "fy", "model", "coeffs"]),
    (Format::NuScenes, &["sensor_token", "translation", "rotation", "camera_intrinsic"]),
    (
        Format::Matlab,
        &["RadialDistortion", "TangentialDistortion", "FocalLength", "PrincipalPoint", "ImageSize"],
    ),
    (
        Format::Argoverse,
        &["camera_data_", "key", "focal_length_x_px_", "focal_center_x_px_", "vehicle_SE3_camera_"],
    ),
    (Format::Argoverse, &["sensor_name", "fx_px", "fy_px", "cx_px", "cy_px", "width_px", "height_px"]),
    (Format::Gyroflow, &["calib_dimension", "fisheye_params", "camera_matrix", "distortion_coeffs"]),
    (Format::EasyHandeyeOnBase, &["transformation", "eye_on_hand", "tracking_base_frame"]),
    (Format::Autoware, &["x", "y", "z", "roll", "pitch", "yaw"]),
    (Format::StaticTransforms, &["child_frame_id", "frame_id", "translation", "rotation"]),
    (Format::Kitti, &["P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam"]),
];

/// Formats named at most.
const MOST_NAMED: usize = 3;
/// Keys looked at, and how deep they stand: enough for every format above, cheap in any file.
const MOST_KEYS: usize = 2000;
const DEPTH: usize = 5;

/// In words, the nearest first; none where the file shares no key with any format.
pub(super) fn nearest(document: &Document) -> Option<String> {
    let mut seen = BTreeSet::new();
    collect(&document.root, DEPTH, &mut seen);
    let mut near: Vec<(usize, usize, String)> = Vec::new();
    for (format, keys) in KEYS {
        let missing: Vec<&str> = keys.iter().copied().filter(|key| !seen.contains(key)).collect();
        let shared = keys.len() - missing.len();
        if 0 < shared {
            near.push((missing.len(), usize::MAX - shared, in_words(format, &missing)));
        }
    }
    near.sort();
    let words: Vec<String> = near.into_iter().take(MOST_NAMED).map(|(.., words)| words).collect();
    (!words.is_empty()).then(|| words.join("; "))
}

fn in_words(format: Format, missing: &[&str]) -> String {
    match missing {
        [] => format!("{}, whose keys are all there but not where they belong", format.name()),
        some => format!("{}, which needs {} too", format.name(), some.join(", ")),
    }
}

fn collect<'a>(node: &'a Node, depth: usize, seen: &mut BTreeSet<&'a str>) {
    if depth == 0 || MOST_KEYS < seen.len() {
        return;
    }
    match &node.value {
        Value::Map(entries) => {
            for (key, child) in entries.iter().take(MOST_KEYS) {
                seen.insert(key);
                collect(child, depth - 1, seen);
            }
        }
        Value::List(items) => items.iter().take(3).for_each(|item| collect(item, depth - 1, seen)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{open, table::camera_format};

    /// A file that is read has every key that the table asks of its format, or is of another dialect: one of each must have them.
    #[test]
    fn every_format_has_a_file_with_these_keys() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/formats");
        let entries = |folder| std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
        let below =
            |path: std::path::PathBuf| if path.is_dir() { entries(path).collect() } else { vec![path] };
        let documents: Vec<Document> = entries(folder)
            .chain(entries(
                std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/formats/golden/rigs"),
            ))
            .flat_map(below)
            .filter(|path| path.is_file())
            .filter_map(|path| open::read(&path).ok())
            .collect();
        for (format, keys) in KEYS {
            let has_all = |document: &&Document| {
                let mut seen = BTreeSet::new();
                collect(&document.root, DEPTH, &mut seen);
                keys.iter().all(|key| seen.contains(key))
                    && camera_format(document).is_some_and(|(row, _)| row.format == format)
            };
            assert!(documents.iter().any(|document| has_all(&document)), "{format:?}: {keys:?}");
        }
    }
}
