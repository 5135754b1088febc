//! The factory calibration of Stereolabs's ZED cameras (`SN….conf`, INI); read only.
//!
//! A section for each camera and resolution, `LEFT_CAM_HD`, with fx fy cx cy, and k1 k2 p1 p2 k3 as OpenCV has them; later cameras have these
//! in `LEFT_DISTO`, with k4 alone a fisheye's, with k4 to k6 the rational model. `STEREO` holds the pose of the right camera: rotation vector
//! (RX, CV, RZ) radians, and −Baseline, TY, TZ in millimetres, right_from_left as `cv::stereoCalibrate` gives it (Stereolabs's
//! zed-opencv-native and stereo calibration tool; the C++ sample zed-open-capture has Baseline without its sign). Pixel (0, 0) is the centre
//! of the first pixel: the samples pass the numbers to OpenCV.

use super::document::{Document, Fault, Syntax};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::scalar_keys::{brown_conrady, fisheye, has_number, matrix};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks};
use crate::core::Pose;
use crate::core::camera::ImageSize;
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Zed,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            let is_eye = |e: &Entry<'_>| side_and_mode(e.name()).is_some();
            document.syntax == Syntax::Ini
                && document.entry().entries().is_ok_and(|all| all.iter().any(is_eye))
        },
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "These are the cameras before rectification. The images of the ZED SDK and of zed-ros2-wrapper are rectified by default: for those take \
            the camera_info that is published with them.",
        "Baseline, TY and TZ are millimetres; the right camera stands at +Baseline along the left one's x.",
        "Each resolution has a camera of its own; HD and VGA are crops of the sensor, not only scaled.",
    ],
};

/// Resolutions by name (sl::RESOLUTION).
const MODES: [(&str, u32, u32); 9] = [
    ("2K", 2208, 1242),
    ("FHD", 1920, 1080),
    ("FHD1200", 1920, 1200),
    ("HD", 1280, 720),
    ("VGA", 672, 376),
    ("SVGA", 960, 600),
    ("4K", 3840, 2160),
    ("QHDPLUS", 3200, 1800),
    ("HD1200", 1920, 1200),
];

/// `LEFT_CAM_HD`: the side, and the mode in upper case.
fn side_and_mode(section: &str) -> Option<(&'static str, String)> {
    let upper = section.to_ascii_uppercase();
    ["LEFT", "RIGHT"].into_iter().find_map(|side| {
        let mode = upper.strip_prefix(side)?.strip_prefix("_CAM_")?;
        Some((side, mode.to_owned()))
    })
}

/// Sections and keys are without case.
fn find<'a>(at: &Entry<'a>, key: &str) -> Option<Entry<'a>> {
    at.entries().ok()?.into_iter().find(|e| e.name().eq_ignore_ascii_case(key))
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    for section in root.entries()? {
        let Some((side, mode)) = side_and_mode(section.name()) else { continue };
        let Some((_, width_px, height_px)) = MODES.into_iter().find(|(name, ..)| *name == mode) else {
            contents.warnings.push(format!("{}: an unknown resolution; it is left out", section.name()));
            continue;
        };
        let size = ImageSize { width_px, height_px };
        let lens = lens_numbers(&root, &section, side)?;
        let k = matrix(&section, ["fx", "fy", "cx", "cy"])?;
        let camera = lens::camera(&section, &lens, k, Some(size), &mut contents.warnings)?;
        let name = section.name().to_owned();
        let placement = match side {
            "RIGHT" => placement(&root, &mode, &name)?,
            _ => None,
        };
        contents.cameras.push(NamedCamera::new(name, camera, placement));
    }
    Ok(contents)
}

/// In the camera's own section, or in that of its side.
fn lens_numbers(root: &Entry<'_>, section: &Entry<'_>, side: &str) -> Result<LensNumbers, Fault> {
    let common = find(root, &format!("{side}_DISTO"));
    let at = common.as_ref().filter(|_| !has_number(section, "k1")).unwrap_or(section);
    if !has_number(at, "k1") {
        return Err(
            section.fault(format!("k1 is neither here nor in {side}_DISTO; the distortion is missing"))
        );
    }
    match has_number(at, "k4") && !has_number(at, "p1") {
        true => fisheye(at, ["k1", "k2", "k3", "k4"]),
        false => brown_conrady(at, ""),
    }
}

fn placement(root: &Entry<'_>, mode: &str, right: &str) -> Result<Option<Placement>, Fault> {
    let Some(stereo) = find(root, "STEREO") else { return Ok(None) };
    let left = format!("LEFT{}", &right["RIGHT".len()..]);
    let Some(left) = find(root, &left) else { return Ok(None) };
    let value = |key: &str| {
        let own = find(&stereo, &format!("{key}_{mode}")).or_else(|| find(&stereo, key));
        own.map_or(Ok(0.0), |found| found.number())
    };
    let baseline = find(&stereo, "Baseline").ok_or_else(|| stereo.fault("the key `Baseline` is missing"))?;
    let baseline_mm = baseline.number()?;
    if !(0.0 < baseline_mm) {
        return Err(baseline.fault(format!("is {baseline_mm} mm; a positive length is needed")));
    }
    let r = checks::rodrigues(&stereo, Vector3::new(value("RX")?, value("CV")?, value("RZ")?))?;
    let t = 1e-3 * Vector3::new(-baseline_mm, value("TY")?, value("TZ")?);
    let (b, a) = (right.to_owned(), left.name().to_owned());
    Ok(Some(Placement { b, a, b_from_a: Pose::new(r, t), covariance: None }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_have_a_side_and_a_mode() {
        assert_eq!(side_and_mode("Left_cam_2k"), Some(("LEFT", "2K".to_owned())));
        assert_eq!(side_and_mode("LEFT_DISTO"), None);
        assert_eq!(side_and_mode("STEREO"), None);
    }
}
