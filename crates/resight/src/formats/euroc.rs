//! EuRoC / ASL `sensor.yaml`: one camera a file; T_BS maps sensor points into the body (the IMU).

use super::document::{Document, Fault};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, kalibr};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Euroc,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            let root = &document.root;
            root.get("T_BS").is_some()
                || (root.get("sensor_type").is_some() && root.get("intrinsics").is_some())
        },
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "T_BS maps sensor points into the body (x_body = R x_cam + t): the inverse of Kalibr's T_cam_imu.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    if let Some(kind) = root.get("sensor_type").filter(|k| k.text().is_ok_and(|k| k != "camera")) {
        return Err(kind.fault(format!("is `{}`; only cameras are read", kind.text()?)));
    }
    let camera = kalibr::camera_of(&root, "distortion_coefficients", &mut contents.warnings)?;
    let name = name_of(document);
    let placement = match root.get("T_BS") {
        Some(t) => Some(Placement {
            b: "body".into(),
            a: name.clone(),
            b_from_a: checks::pose4x4(&t)?,
            covariance: None,
        }),
        None => None,
    };
    contents.cameras.push(NamedCamera { name, camera, placement });
    Ok(contents)
}

/// `mav0/cam0/sensor.yaml` is `cam0`: the folder, not the file, tells the cameras apart.
fn name_of(document: &Document) -> String {
    let folder = document.path.parent().and_then(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
    match (document.stem().as_str(), folder) {
        ("sensor", Some(folder)) => folder,
        (stem, _) => stem.to_owned(),
    }
}
