//! EuRoC / ASL `sensor.yaml`: one camera a file; T_BS maps sensor points into the body (the IMU).

use super::document::{Document, Fault};
use super::emit::{file_stem, list, quoted};
use super::entry::Entry;
use super::frames::Frames;
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    Written, checks, kalibr,
};
use crate::core::Pose;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Euroc,
    words: &["euroc"],
    reads: Some(Reads {
        recognises: |document| {
            let root = &document.root;
            root.get("T_BS").is_some()
                || (root.get("sensor_type").is_some() && root.get("intrinsics").is_some())
        },
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "T_BS maps sensor points into the body (x_body = R x_cam + t): the inverse of Kalibr's T_cam_imu.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    if root.get("sensor_type").is_some_and(|k| k.text().is_ok_and(|k| k != "camera")) {
        contents.relations.extend(placement(&root, &name_of(document))?);
        return Ok(contents);
    }
    let camera = kalibr::camera_of(&root, "distortion_coefficients", &mut contents.warnings)?;
    let name = name_of(document);
    let placement = placement(&root, &name)?;
    contents.cameras.push(NamedCamera::new(name, camera, placement));
    Ok(contents)
}

fn placement(root: &Entry<'_>, name: &str) -> Result<Option<Placement>, Fault> {
    let Some(t) = root.get("T_BS") else { return Ok(None) };
    let (b, a) = ("body".to_owned(), name.to_owned());
    Ok(Some(Placement { b, a, b_from_a: checks::pose4x4(&t)?, covariance: None }))
}

/// A folder per camera; the body is the rig's own body or IMU, else the frame its cameras share.
fn write(rig: &CameraFile) -> Written {
    let frames = Frames::of_rig(rig);
    let body = frames.common(&rig.cameras, &["body", "imu"], Format::Euroc)?;
    let file = |camera: &NamedCamera| {
        let body_from_cam = frames.between(&body, &camera.name).unwrap_or_else(Pose::identity);
        let name = format!("{}/sensor.yaml", file_stem(&camera.name));
        Ok(OutFile { name, text: sensor(camera, &body_from_cam)? })
    };
    rig.cameras.iter().map(file).collect()
}

fn sensor(camera: &NamedCamera, body_from_cam: &Pose) -> Result<String, WriteError> {
    let numbers = kalibr::numbers("EuRoC", camera)?;
    let rows: Vec<String> =
        body_from_cam.matrix().iter().map(|row| list(row).trim_matches(['[', ']']).to_owned()).collect();
    // ASL's word for what Kalibr calls radtan.
    let distortion = if numbers.distortion == "radtan" { "radial-tangential" } else { numbers.distortion };
    Ok([
        "# T_BS maps points of this camera into the body.\n".to_owned(),
        format!("sensor_type: camera\ncomment: {}\n", quoted(&camera.name)),
        format!("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", rows.join(",\n         ")),
        format!("resolution: [{}, {}]\n", numbers.size.width_px, numbers.size.height_px),
        format!("camera_model: {}\nintrinsics: {}\n", numbers.model, list(&numbers.intrinsics)),
        format!("distortion_model: {distortion}\n"),
        format!("distortion_coefficients: {}\n", list(&numbers.coefficients)),
    ]
    .concat())
}

/// `mav0/cam0/sensor.yaml` is `cam0`: the folder, not the file, tells the cameras apart.
fn name_of(document: &Document) -> String {
    let folder = document.path.parent().and_then(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
    match (document.stem().as_str(), folder) {
        ("sensor", Some(folder)) => folder,
        (stem, _) => stem.to_owned(),
    }
}
