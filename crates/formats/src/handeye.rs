//! easy_handeye's YAML: the pose of a camera on a robot's hand or base. It holds no intrinsics.
//!
//! `transformation` is robot_from_cam as TF states it: parent the effector (`eye_on_hand`) or the base, child
//! `tracking_base_frame`, the camera. Quaternion under keys qx qy qz qw, metres.

use super::document::{Document, Fault};
use super::emit::{number, quoted};
use super::entry::Entry;
use super::placed::{placed, the_only};
use super::{
    CameraFile, CameraFormat, Contents, Format, OutFile, Placement, Reads, WriteError, Writer, checks,
};
use nalgebra::Vector3;

pub(super) const ON_BASE: CameraFormat = CameraFormat {
    format: Format::EasyHandeyeOnBase,
    words: &["easy-handeye-on-base"],
    reads: Some(Reads { recognises, read, together: None }),
    write: Some(Writer::Rig(|file| write(file, false))),
    traps: &[
        "transformation maps camera points into the robot's frame (x_robot = R x_cam + t): the effector's with \
            eye_on_hand, the base's without; t is the camera's position itself.",
        "tracking_base_frame is often the camera's body (camera_link, x forward), not its optical frame (z \
            forward); the fixed turn between the two is then missing here.",
    ],
};

/// Another word to write the same file; which of the two a rig is, its poses do not say.
pub(super) const ON_HAND: CameraFormat = CameraFormat {
    format: Format::EasyHandeyeOnHand,
    words: &["easy-handeye-on-hand"],
    reads: None,
    write: Some(Writer::Rig(|file| write(file, true))),
    traps: &[],
};

fn recognises(document: &Document) -> bool {
    let root = &document.root;
    let parameters = root.get("parameters").unwrap_or(root);
    root.get("transformation").is_some() && parameters.get("eye_on_hand").is_some()
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let parameters = root.get("parameters").unwrap_or_else(|| root.clone());
    let on_hand = parameters.need("eye_on_hand")?.flag()?;
    let robot = if on_hand {
        frame(&parameters, &["robot_effector_frame", "tool_frame"])?
    } else {
        frame(&parameters, &["robot_base_frame", "base_link_frame"])?
    };
    let camera = frame(&parameters, &["tracking_base_frame", "optical_origin_frame"])?;
    let t = root.need("transformation")?;
    let part = |key: &str| t.need(key)?.number();
    let wxyz = [part("qw")?, part("qx")?, part("qy")?, part("qz")?];
    let b_from_a = checks::quaternion_pose(&t, wxyz, Vector3::new(part("x")?, part("y")?, part("z")?))?;
    let relation = Placement { b: robot, a: camera, b_from_a, covariance: None };
    Ok(Contents { relations: vec![relation], ..Contents::default() })
}

fn frame(parameters: &Entry<'_>, keys: &[&str]) -> Result<String, Fault> {
    let found = parameters.first_of(keys);
    let found = found.ok_or_else(|| parameters.fault(format!("the key `{}` is missing", keys[0])))?;
    match found.text()?.trim() {
        "" => Err(found.fault("is empty; the name of a frame is needed")),
        name => Ok(name.to_owned()),
    }
}

/// One camera; the keys stand both at the top, where older versions look, and below `parameters`.
fn write(file: &CameraFile, on_hand: bool) -> Result<Vec<OutFile>, WriteError> {
    let camera = the_only(&file.cameras, "easy_handeye")?;
    let rig = placed(file, Format::EasyHandeyeOnBase)?;
    if rig.root_is_camera {
        return Err(WriteError(format!(
            "{}: easy_handeye holds the pose of a camera on a robot, and no pose of this one is known",
            camera.name
        )));
    }
    let (base, effector) = if on_hand { ("", rig.root.as_str()) } else { (rig.root.as_str(), "") };
    let keys = [
        format!("eye_on_hand: {on_hand}\n"),
        format!("robot_base_frame: {}\n", quoted(base)),
        format!("robot_effector_frame: {}\n", quoted(effector)),
        format!("tracking_base_frame: {}\n", quoted(&camera.name)),
    ];
    let pose = rig.cameras[0].root_from_cam();
    let [w, x, y, z] = pose.quaternion_wxyz().map(number);
    let [tx, ty, tz] = [pose.translation.x, pose.translation.y, pose.translation.z].map(number);
    let below: String = keys.iter().map(|line| format!("  {line}")).collect();
    let text = format!(
        "{}parameters:\n{below}transformation:\n  qw: {w}\n  qx: {x}\n  qy: {y}\n  qz: {z}\n  x: {tx}\n  y: {ty}\n  \
            z: {tz}\n",
        keys.concat()
    );
    Ok(OutFile::only("easy_handeye.yaml", text))
}
