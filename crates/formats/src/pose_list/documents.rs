//! Poses in JSON and YAML: lists of matrices or of records, poses by the name of their view, the samples of easy_handeye and MoveIt.
//!
//! easy_handeye 2 saves `parameters` with `calibration_type`, and `samples` of `robot` and `tracking` (`optical` in its first version), both as
//! geometry_msgs/Transform. `robot` is base_from_effector with `eye_in_hand` and effector_from_base with `eye_on_base`.
//! MoveIt's calibration saves a list of `effector_wrt_world` and `object_wrt_sensor`, 16 numbers each, row by row.

use super::arrays::{self, scale};
use super::columns::Layout;
use super::words::{LengthUnit, RotationWord, WHERE, choices};
use super::{ListedPose, PoseList, PoseListOptions, Rotation, RotationFormat, VIEW, matrix_pose, pose_of};
use crate::core::Pose;
use crate::core::multiview::hand_eye::Mounting;
use crate::document::{Fault, Value};
use crate::entry::Entry;
use nalgebra::{Matrix3, Vector3};

/// Reads the poses of a document.
pub(super) fn poses(root: &Entry<'_>, options: &PoseListOptions) -> Result<PoseList, Fault> {
    match &root.node.value {
        Value::List(_) => of_list(root, options),
        Value::Map(_) => of_map(root, options),
        other => Err(root.fault(format!("is {}; a list of poses is needed", other.kind()))),
    }
}

fn listed(poses: Vec<ListedPose>) -> PoseList {
    PoseList { poses, cam_from_target: None, mounting: None, remarks: Vec::new() }
}

fn is_map(entry: &Entry<'_>) -> bool {
    matches!(entry.node.value, Value::Map(_))
}

fn of_list(list: &Entry<'_>, options: &PoseListOptions) -> Result<PoseList, Fault> {
    let items = list.items()?;
    match items.first() {
        None => Ok(listed(Vec::new())),
        Some(first) if first.has("effector_wrt_world") => moveit(&items, options),
        Some(first) if is_map(first) => {
            let read = items.iter().map(|item| {
                let view = VIEW.iter().find_map(|key| item.get(key)).map(|view| name(&view)).transpose()?;
                Ok(ListedPose { view, ..record(item, options)? })
            });
            let read = PoseList {
                cam_from_target: seen_beside(&items, options)?,
                ..listed(read.collect::<Result<_, Fault>>()?)
            };
            Ok(read)
        }
        Some(_) => arrays::poses(&arrays::of_lists(list)?, options),
    }
}

/// The target's poses of records that hold the gripper's too; `None` of others.
fn seen_beside(items: &[Entry<'_>], options: &PoseListOptions) -> Result<Option<Vec<Pose>>, Fault> {
    let is_pair = |item: &Entry<'_>| {
        item.has("cam_from_target") && item.first_of(&["base_from_gripper", "gripper_from_base"]).is_some()
    };
    if !items.iter().any(is_pair) {
        return Ok(None);
    }
    let plain = PoseListOptions { is_inverse: false, ..*options };
    let seen = items.iter().map(|item| Ok(record(&item.need("cam_from_target")?, &plain)?.b_from_a));
    seen.collect::<Result<_, Fault>>().map(Some)
}

/// A view's name, which may be a number.
fn name(view: &Entry<'_>) -> Result<String, Fault> {
    match &view.node.value {
        Value::Number(x) => Ok(x.to_string()),
        _ => view.text().map(str::to_owned),
    }
}

/// Keys of lists of poses, and whether they are inverse, where the key states it.
const LISTS: [(&str, Option<bool>); 3] =
    [("poses", None), ("base_from_gripper", Some(false)), ("gripper_from_base", Some(true))];
/// Keys beside them.
const STATED: [&str; 3] = ["rotation", "length", "cam_from_target"];

fn of_map(root: &Entry<'_>, options: &PoseListOptions) -> Result<PoseList, Fault> {
    if root.has("samples") {
        return easy_handeye(root, options);
    }
    let Some((list, inverse)) = LISTS.iter().find_map(|(key, inverse)| Some((root.get(key)?, *inverse)))
    else {
        return by_name(root, options);
    };
    let known: Vec<&str> = LISTS.iter().map(|(key, _)| *key).chain(STATED).collect();
    root.only(&known)?;
    let options = stated(root, options)?;
    let options = PoseListOptions { is_inverse: direction(&list, inverse, &options)?, ..options };
    let mut read = match is_map(&list) {
        true => by_name(&list, &options)?,
        false => of_list(&list, &options)?,
    };
    if let Some(seen) = root.get("cam_from_target") {
        let plain = PoseListOptions { is_inverse: false, ..options };
        let poses = of_list(&seen, &plain)?.poses;
        if poses.len() != read.poses.len() {
            return Err(seen.fault(format!(
                "holds {} poses, and the robot has {}; they go by place",
                poses.len(),
                read.poses.len()
            )));
        }
        read.cam_from_target = Some(poses.into_iter().map(|pose| pose.b_from_a).collect());
    }
    Ok(read)
}

/// Whether poses are inverse, by their key or else by the option.
fn direction(at: &Entry<'_>, by_key: Option<bool>, options: &PoseListOptions) -> Result<bool, Fault> {
    match by_key {
        Some(_) if options.is_inverse => Err(
            at.fault("states the direction of its poses itself; leave out the option that they are inverse")
        ),
        Some(is_inverse) => Ok(is_inverse),
        None => Ok(options.is_inverse),
    }
}

/// Adds what keys state to what the caller states.
fn stated(root: &Entry<'_>, options: &PoseListOptions) -> Result<PoseListOptions, Fault> {
    let mut options = *options;
    if let Some(key) = root.get("rotation") {
        let word = RotationWord::parse(key.text()?).map_err(|reason| key.fault(reason))?;
        if options.rotation.is_some_and(|other| other != word) {
            return Err(key
                .fault(format!("is `{}`, and the option states another; leave one of them out", word.word)));
        }
        options.rotation = Some(word);
    }
    if let Some(key) = root.get("length") {
        let unit = LengthUnit::parse(key.text()?).map_err(|reason| key.fault(reason))?;
        if options.length.is_some_and(|other| other != unit) {
            return Err(key.fault("contradicts the option; leave one of them out"));
        }
        options.length = Some(unit);
    }
    Ok(options)
}

/// Poses under the names of their views.
fn by_name(root: &Entry<'_>, options: &PoseListOptions) -> Result<PoseList, Fault> {
    let read = root.entries()?.into_iter().map(|entry| {
        let pose = match &entry.node.value {
            Value::List(_) | Value::Map(_) => record(&entry, options)?,
            other => {
                return Err(entry.fault(format!(
                    "is {}; a list under `poses`, or a pose under the name of each view, is needed",
                    other.kind()
                )));
            }
        };
        Ok(ListedPose { view: Some(entry.name().to_owned()), ..pose })
    });
    read.collect::<Result<_, Fault>>().map(listed)
}

/// Keys of a matrix, and whether it is inverse, where the key states it.
const MATRICES: [(&str, Option<bool>); 5] = [
    ("base_from_gripper", Some(false)),
    ("gripper_from_base", Some(true)),
    ("cam_from_target", Some(false)),
    ("matrix", None),
    ("transform", None),
];

/// One pose: a matrix, a message of ROS, or the columns of a table as keys.
fn record(item: &Entry<'_>, options: &PoseListOptions) -> Result<ListedPose, Fault> {
    let scale_m = options.length.map_or(1.0, |unit| unit.in_m());
    if !is_map(item) {
        return match item.numbers()?.len() {
            12 | 16 => matrix_pose(item, scale_m, options.is_inverse),
            n => Err(item.fault(format!("holds {n} numbers; a 4×4 matrix is needed, or keys"))),
        };
    }
    if let Some(inner) = ["transform", "pose"].iter().find_map(|key| item.get(key)).filter(is_map) {
        return record(&inner, options);
    }
    if let Some((matrix, inverse)) =
        MATRICES.iter().find_map(|(key, inverse)| Some((item.get(key)?, *inverse)))
    {
        return matrix_pose(&matrix, scale_m, direction(&matrix, inverse, options)?);
    }
    let parts = (
        item.first_of(&["translation", "position"]),
        item.first_of(&["rotation", "orientation", "quaternion", "rotation_wxyz", "rotation_xyzw"]),
    );
    if let (Some(position), Some(rotation)) = parts {
        let t = xyz(&position)? * scale(options);
        return pose_of(item, &rotation_of(&rotation, options)?, t, options.is_inverse);
    }
    let entries = item.entries()?;
    let names: Vec<String> = entries.iter().map(|entry| entry.name().to_owned()).collect();
    let layout = Layout::of(&names, options).map_err(|reason| item.fault(reason.replace("column", "key")))?;
    let numbers: Vec<f64> =
        layout.columns().into_iter().map(|at| entries[at].number()).collect::<Result<_, Fault>>()?;
    let sigmas = match (item.get("sigma_deg"), item.get("sigma_mm")) {
        (Some(deg), Some(mm)) => Some([deg.number()?.to_radians(), 1e-3 * mm.number()?]),
        (None, None) => None,
        _ => return Err(item.fault("sigma_deg and sigma_mm belong together; one is missing")),
    };
    Ok(ListedPose { sigmas, ..layout.pose(item, &numbers)? })
}

fn xyz(at: &Entry<'_>) -> Result<Vector3<f64>, Fault> {
    match is_map(at) {
        true => {
            let part = |key: &str| at.need(key)?.number();
            Ok(Vector3::new(part("x")?, part("y")?, part("z")?))
        }
        false => crate::checks::vector3(at),
    }
}

/// A rotation by keys x, y, z, w, as a matrix, or as numbers of a stated convention.
fn rotation_of(at: &Entry<'_>, options: &PoseListOptions) -> Result<Rotation, Fault> {
    if is_map(at) && !at.has("rows") {
        let part = |key: &str| at.need(key)?.number();
        return Ok(Rotation::Wxyz([part("w")?, part("x")?, part("y")?, part("z")?]));
    }
    let stated = match at.name() {
        "rotation_wxyz" => Some(RotationFormat::QuaternionWxyz),
        "rotation_xyzw" => Some(RotationFormat::QuaternionXyzw),
        _ => options.rotation.map(|word| word.format),
    };
    match (at.numbers()?.as_slice(), stated) {
        (r @ [_, _, _, _, _, _, _, _, _], None) => Ok(Rotation::Matrix(Matrix3::from_row_slice(r))),
        ([w, x, y, z], Some(RotationFormat::QuaternionWxyz)) => Ok(Rotation::Wxyz([*w, *x, *y, *z])),
        ([x, y, z, w], Some(RotationFormat::QuaternionXyzw)) => Ok(Rotation::Wxyz([*w, *x, *y, *z])),
        ([a, b, c], Some(RotationFormat::Angles(convention))) => {
            Ok(Rotation::Angles([*a, *b, *c], convention))
        }
        (numbers @ ([_, _, _, _] | [_, _, _]), None) => {
            let is_choice = |word: &RotationWord| {
                matches!(word.format, RotationFormat::Angles(_)) == (numbers.len() == 3)
            };
            Err(at.fault(format!(
                "is {} numbers, and nothing says what they mean; {}: {WHERE}",
                numbers.len(),
                choices(is_choice)
            )))
        }
        (numbers, _) => Err(at.fault(format!(
            "is {} numbers, which is no rotation of the stated convention; a 3×3 matrix has nine",
            numbers.len()
        ))),
    }
}

/// What the samples of a program hold.
fn pairs(robot: Vec<ListedPose>, cam_from_target: Vec<Pose>, mounting: Option<Mounting>) -> PoseList {
    PoseList { poses: robot, cam_from_target: Some(cam_from_target), mounting, remarks: Vec::new() }
}

fn moveit(items: &[Entry<'_>], options: &PoseListOptions) -> Result<PoseList, Fault> {
    let (mut robot, mut seen) = (Vec::new(), Vec::new());
    for item in items {
        let effector = item.need("effector_wrt_world")?;
        direction(&effector, Some(false), options)?;
        robot.push(record(&effector, options)?);
        seen.push(record(&item.need("object_wrt_sensor")?, options)?.b_from_a);
    }
    Ok(pairs(robot, seen, None))
}

/// Whether the target is on the gripper.
fn mounting(root: &Entry<'_>, options: &PoseListOptions) -> Result<Mounting, Fault> {
    let parameters = root.get("parameters").unwrap_or_else(|| root.clone());
    let stated = match parameters.first_of(&["calibration_type", "eye_on_hand"]) {
        Some(key) => match (&key.node.value, key.name()) {
            (Value::Text(text), _) if text.is_empty() => None,
            (Value::Text(text), _) if text == "eye_in_hand" => Some(Mounting::CameraOnGripper),
            (Value::Text(text), _) if text == "eye_on_base" => Some(Mounting::TargetOnGripper),
            (Value::Bool(true), "eye_on_hand") => Some(Mounting::CameraOnGripper),
            (Value::Bool(false), "eye_on_hand") => Some(Mounting::TargetOnGripper),
            _ => return Err(key.fault("is none of eye_in_hand and eye_on_base")),
        },
        None => None,
    };
    match (stated, options.eye_to_hand) {
        (None, true) => Ok(Mounting::TargetOnGripper),
        (None, false) => Err(parameters.fault(
            "`calibration_type` is missing or empty, on which the direction of the robot's poses depends; write eye_in_hand or eye_on_base (that is --eye-to-hand) there",
        )),
        (Some(Mounting::CameraOnGripper), true) => Err(parameters.fault(
            "states a camera on the gripper (eye_in_hand), and --eye-to-hand a target on it; leave one of them out",
        )),
        (Some(mounting), _) => Ok(mounting),
    }
}

fn easy_handeye(root: &Entry<'_>, options: &PoseListOptions) -> Result<PoseList, Fault> {
    let mounting = mounting(root, options)?;
    let samples = root.need("samples")?;
    let is_inverse = direction(&samples, Some(mounting == Mounting::TargetOnGripper), options)?;
    let robot_options = PoseListOptions { is_inverse, ..*options };
    let (mut robot, mut seen) = (Vec::new(), Vec::new());
    for sample in samples.items()? {
        robot.push(record(&sample.need("robot")?, &robot_options)?);
        let tracking = match sample.first_of(&["tracking", "optical"]) {
            Some(tracking) => tracking,
            None => return Err(sample.fault("the key `tracking` is missing")),
        };
        seen.push(record(&tracking, options)?.b_from_a);
    }
    Ok(pairs(robot, seen, Some(mounting)))
}
