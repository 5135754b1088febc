//! Settings of ORB-SLAM2 and 3: `Camera.fx` or, of two cameras, `Camera1.fx` and `Camera2.fx`; read only.
//!
//! Pixel (0, 0) is the centre of the first pixel and coefficients are OpenCV's: k1 k2 p1 p2 [k3] of a PinHole, the four of its fisheye of a
//! KannalaBrandt8 (`Settings.cc`). `Stereo.T_c1_c2`, before version 1.0 `Tlr`, is first_from_second; `IMU.T_b_c1`, before `Tbc`, is
//! imu_from_first. Metres.

use super::document::{Document, Fault};
use super::entry::Entry;
use super::scalar_keys::{has_number, number_of, one};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks};
use crate::core::camera::ImageSize;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::OrbSlam,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            ["Camera.fx", "Camera1.fx"].iter().any(|key| has_number(&document.entry(), key))
        },
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "Stereo.T_c1_c2 (Tlr) maps points of the second camera into the first; its translation is the place of the second camera.",
        "IMU.T_b_c1 (Tbc) maps points of the first camera into the IMU: the inverse of Kalibr's T_cam_imu.",
        "Camera.newWidth and newHeight scale images after reading; the intrinsics belong to Camera.width × height.",
        "ORB-SLAM3 takes Camera1.k1 to k4 for the second fisheye too; here each camera has its own.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    let (is_fisheye, size) = (is_fisheye(&root)?, size(&root)?);
    for name in ["Camera", "Camera1", "Camera2"] {
        let Some(fx) = root.get(&format!("{name}.fx")) else { continue };
        let camera = one(&fx, &root, &format!("{name}."), is_fisheye, size, &mut contents)?;
        let name = name.to_owned();
        contents.cameras.push(NamedCamera::new(name, camera, None));
    }
    let first = contents.cameras[0].name.clone();
    let pose = |b: &str, a: &str, at: &Entry<'_>| {
        let b_from_a = checks::pose3x4_or_4x4(at)?;
        Ok(Placement { b: b.into(), a: a.into(), b_from_a, covariance: None })
    };
    if let ([_, second], Some(at)) =
        (contents.cameras.as_mut_slice(), root.first_of(&["Stereo.T_c1_c2", "Tlr"]))
    {
        second.placement = Some(pose(&first, &second.name, &at)?);
    }
    if let Some(at) = root.first_of(&["IMU.T_b_c1", "Tbc"]) {
        contents.relations.push(pose("imu", &first, &at)?);
    }
    contents.notes.extend(baseline(&root)?);
    Ok(contents)
}

fn is_fisheye(root: &Entry<'_>) -> Result<bool, Fault> {
    let Some(model) = root.get("Camera.type") else { return Ok(false) };
    match model.text()?.to_ascii_lowercase().as_str() {
        "pinhole" | "rectified" => Ok(false),
        "kannalabrandt8" => Ok(true),
        other => {
            Err(model
                .fault(format!("unknown model `{other}`; PinHole, Rectified or KannalaBrandt8 are read")))
        }
    }
}

fn size(root: &Entry<'_>) -> Result<Option<ImageSize>, Fault> {
    let (width, height) = ("Camera.width", "Camera.height");
    if !root.has(width) && !root.has(height) {
        return Ok(None);
    }
    Ok(Some(ImageSize { width_px: root.need(width)?.count(1)?, height_px: root.need(height)?.count(1)? }))
}

/// Of a rectified pair, or the made-up one of a depth camera: the file does not say which, so it places no camera.
fn baseline(root: &Entry<'_>) -> Result<Option<String>, Fault> {
    let of_bf = || {
        let (bf, fx) = (number_of(root, "Camera.bf")?, number_of(root, "Camera.fx")?);
        Ok(bf.zip(fx).map(|(bf, fx)| bf / fx))
    };
    let metres = match number_of(root, "Stereo.b")? {
        Some(b) => Some(b),
        None => of_bf()?,
    };
    Ok(metres.map(|b| {
        format!(
            "The baseline is {b:.4} m (Stereo.b, or Camera.bf over fx): of rectified images, or of the virtual pair of a depth camera."
        )
    }))
}
