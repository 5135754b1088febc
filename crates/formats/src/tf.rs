//! ROS static transforms: `static_transform_publisher` in launch files (Python, XML) and shell scripts, and lists of
//! `geometry_msgs/TransformStamped` in YAML (what `ros2 topic echo /tf_static` prints), and what `tf2_echo` prints. Poses only.
//!
//! A transform is the pose of the child frame in its parent: x_parent = R x_child + t; quaternions x, y, z, w.
//! Camera frames are optical (x right, y down, z forward): camera `left` is the frame `left_optical_frame`.

use super::document::{Document, Fault, Node, Syntax, Value};
use super::emit::{number, quoted};
use super::entry::Entry;
use super::euler::rotation_of_rpy;
use super::frames::Frames;
use super::tf_echo;
use super::tf_launch::{Command, commands};
use super::{
    CameraFile, CameraFormat, Contents, Format, OutFile, Placement, Reads, WriteError, Writer, Written,
    checks,
};
use crate::core::Pose;
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::StaticTransforms,
    words: &["tf", "static_transforms"],
    reads: Some(Reads { recognises, read, together: None }),
    write: Some(Writer::Rig(write_launch)),
    traps: &[
        "A transform is the pose of the child frame in the parent (x_parent = R x_child + t): the inverse of \
            OpenCV's R, T and of Kalibr's T_cam_imu.",
        "Six positional numbers are x y z yaw pitch roll, in this order; URDF's rpy and the named flags are roll, \
            pitch, yaw. Seven are x y z qx qy qz qw: w comes last.",
        "A camera's points need its optical frame (x right, y down, z forward), not its link (x forward, z up).",
    ],
};

/// The same transforms as a list; read by the row above.
pub(super) const YAML: CameraFormat = CameraFormat {
    format: Format::StaticTransformsYaml,
    words: &["tf-yaml"],
    reads: None,
    write: Some(Writer::Rig(write_yaml)),
    traps: FORMAT.traps,
};

/// Frames that a robot's transforms hang from.
const ROOTS: [&str; 5] = ["base_link", "base", "rig", "body", "world"];

fn recognises(document: &Document) -> bool {
    match document.syntax {
        Syntax::Launch => true,
        Syntax::Lines => tf_echo::is_echo(&document.text),
        Syntax::Xml => element_is(&document.root, "launch"),
        _ => stamped(document).is_some_and(|list| list.iter().any(|e| e.has("child_frame_id"))),
    }
}

pub(super) fn element_is(node: &Node, name: &str) -> bool {
    node.get("element").is_some_and(|e| e.value == Value::Text(name.to_owned()))
}

fn stamped(document: &Document) -> Option<Vec<Entry<'_>>> {
    let root = document.entry();
    let list = root.get("transforms").unwrap_or(root);
    list.items().ok()
}

fn read(document: &Document) -> Result<Contents, Fault> {
    if document.syntax == Syntax::Lines {
        return tf_echo::read(document);
    }
    let mut contents = Contents::default();
    if matches!(document.syntax, Syntax::Launch | Syntax::Xml) {
        for command in commands(document)? {
            contents.notes.extend(order_note(&command));
            contents.relations.push(placement_of(&command)?);
        }
        return Ok(contents);
    }
    for entry in stamped(document).unwrap_or_default() {
        contents.relations.push(stamped_placement(&entry)?);
    }
    Ok(contents)
}

fn order_note(command: &Command) -> Option<String> {
    (leading_numbers(&command.words) == 6)
        .then(|| format!("line {}: six positional numbers, read as x y z yaw pitch roll.", command.line))
}

fn leading_numbers(words: &[String]) -> usize {
    words.iter().take_while(|w| w.parse::<f64>().is_ok()).count()
}

fn placement_of(command: &Command) -> Result<Placement, Fault> {
    let named = command.words.iter().any(|w| w.starts_with("--") && w != "--ros-args");
    if named { named_placement(command) } else { positional_placement(command) }
}

fn finite(command: &Command, word: &str) -> Result<f64, Fault> {
    match word.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => {
            let short: String = word.chars().take(40).collect();
            Err(command
                .fault(format!("`{short}` is not a finite number; write it out instead of an expression")))
        }
    }
}

fn positional_placement(command: &Command) -> Result<Placement, Fault> {
    let n = leading_numbers(&command.words);
    let numbers =
        command.words[..n].iter().map(|w| finite(command, w)).collect::<Result<Vec<f64>, Fault>>()?;
    let t = |n: &[f64]| Vector3::new(n[0], n[1], n[2]);
    let parent_from_child = match numbers.as_slice() {
        [x, y, z, yaw, pitch, roll] => Pose::new(rotation_of_rpy([*roll, *pitch, *yaw]), t(&[*x, *y, *z])),
        [x, y, z, qx, qy, qz, qw] => pose(command, [*qw, *qx, *qy, *qz], t(&[*x, *y, *z]))?,
        _ => {
            return Err(command.fault(format!(
                "{n} numbers before the frame names; 6 (x y z yaw pitch roll) or 7 (x y z qx qy qz qw) are \
                    needed, written out"
            )));
        }
    };
    match &command.words[n..] {
        [parent, child, ..] => Ok(placement(parent, child, parent_from_child)),
        _ => Err(command.fault("the frame names are missing: parent, then child")),
    }
}

/// Every flag takes one value.
const FLAGS: [&str; 12] = [
    "--x",
    "--y",
    "--z",
    "--qx",
    "--qy",
    "--qz",
    "--qw",
    "--roll",
    "--pitch",
    "--yaw",
    "--frame-id",
    "--child-frame-id",
];

fn named_placement(command: &Command) -> Result<Placement, Fault> {
    let words: Vec<&str> =
        command.words.iter().map(String::as_str).take_while(|w| *w != "--ros-args").collect();
    let pairs: Vec<&[&str]> = words.chunks(2).collect();
    if let Some(odd) = pairs.iter().find(|p| p.len() != 2 || !FLAGS.contains(&p[0])) {
        return Err(command.fault(format!(
            "`{}` is no flag with a value; the flags are {}",
            odd[0],
            FLAGS.join(" ")
        )));
    }
    let text = |flag: &str| pairs.iter().find(|p| p[0] == flag).map(|p| p[1]);
    let some = |flags: &[&str]| flags.iter().any(|f| text(f).is_some());
    let get = |flag: &str| text(flag).map_or(Ok(0.0), |word| finite(command, word));
    let t = Vector3::new(get("--x")?, get("--y")?, get("--z")?);
    let quaternion = ["--qw", "--qx", "--qy", "--qz"];
    let parent_from_child = match (some(&quaternion), some(&["--roll", "--pitch", "--yaw"])) {
        (true, true) => return Err(command.fault("both a quaternion and roll, pitch, yaw; remove one")),
        (true, false) if quaternion.iter().any(|f| text(f).is_none()) => {
            return Err(command.fault("--qx --qy --qz --qw belong together; one is missing"));
        }
        (true, false) => pose(command, [get("--qw")?, get("--qx")?, get("--qy")?, get("--qz")?], t)?,
        (false, _) => Pose::new(rotation_of_rpy([get("--roll")?, get("--pitch")?, get("--yaw")?]), t),
    };
    match (text("--frame-id"), text("--child-frame-id")) {
        (Some(parent), Some(child)) => Ok(placement(parent, child, parent_from_child)),
        _ => Err(command.fault("--frame-id and --child-frame-id are needed")),
    }
}

fn pose(command: &Command, wxyz: [f64; 4], t: Vector3<f64>) -> Result<Pose, Fault> {
    let node = Node { line: command.line, value: Value::Null };
    checks::quaternion_pose(&Entry::called("static_transform_publisher", &node), wxyz, t)
}

/// Some publishers write a leading `/`, which tf2 does not know.
fn placement(parent: &str, child: &str, parent_from_child: Pose) -> Placement {
    let [b, a] = [parent, child].map(|name| name.trim_start_matches('/').to_owned());
    Placement { b, a, b_from_a: parent_from_child, covariance: None }
}

/// One `TransformStamped`, with or without its header.
fn stamped_placement(entry: &Entry<'_>) -> Result<Placement, Fault> {
    let header = entry.get("header").unwrap_or_else(|| entry.clone());
    let parent = header.first_of(&["frame_id", "parent_frame_id", "parent_frame"]);
    let parent = parent.ok_or_else(|| entry.fault("the key `header.frame_id` (the parent) is missing"))?;
    let child = entry.need("child_frame_id")?;
    let transform = entry.get("transform").unwrap_or_else(|| entry.clone());
    let xyz = transform.need("translation")?;
    let rotation = transform.need("rotation")?;
    if matches!(rotation.node.value, Value::List(_)) {
        return Err(rotation.fault(
            "is a list: a quaternion of unclear order; write {x: …, y: …, z: …, w: …}, or {roll: …, pitch: …, yaw: …} \
                in radians",
        ));
    }
    let get = |at: &Entry<'_>, key: &str| at.need(key)?.number();
    let t = Vector3::new(get(&xyz, "x")?, get(&xyz, "y")?, get(&xyz, "z")?);
    let parent_from_child = if rotation.has("roll") {
        let rpy = [get(&rotation, "roll")?, get(&rotation, "pitch")?, get(&rotation, "yaw")?];
        Pose::new(rotation_of_rpy(rpy), t)
    } else {
        let wxyz = [get(&rotation, "w")?, get(&rotation, "x")?, get(&rotation, "y")?, get(&rotation, "z")?];
        checks::quaternion_pose(&rotation, wxyz, t)?
    };
    Ok(placement(parent.text()?, child.text()?, parent_from_child))
}

/// A camera's frame as ROS names it: the optical one, so that it is not confused with the link (x forward).
pub(super) fn optical_frame(camera: &str) -> String {
    let said = camera.ends_with("optical_frame") || camera.ends_with("optical");
    if said { camera.to_owned() } else { format!("{camera}_optical_frame") }
}

/// Parent, and every other frame of the rig with its pose in the parent; cameras under the names of their optical frames.
pub(super) fn tree(rig: &CameraFile, format: Format) -> Result<(String, Vec<(String, Pose)>), WriteError> {
    let frames = Frames::of_rig(rig);
    let parent = frames.common(&rig.cameras, &ROOTS, format)?;
    let ros_name = |frame: &str| {
        let camera = rig.cameras.iter().any(|c| c.name == frame);
        plain(if camera { optical_frame(frame) } else { frame.to_owned() })
    };
    let mut children = Vec::new();
    for (frame, parent_from_frame) in frames.seen_from(&parent) {
        children.push((ros_name(&frame)?, parent_from_frame));
    }
    if children.is_empty() {
        return Err(WriteError("no pose between any two frames, so there is no transform to write".into()));
    }
    Ok((ros_name(&parent)?, children))
}

fn plain(name: String) -> Result<String, WriteError> {
    let ok = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '/' | '.');
    if !name.is_empty() && name.chars().all(ok) && !name.starts_with('-') && name.parse::<f64>().is_err() {
        return Ok(name);
    }
    let short: String = name.chars().take(40).collect();
    Err(WriteError(format!(
        "frame name `{short}`: ROS frames take letters, digits, _, -, / and . only; rename it"
    )))
}

const HEADER: &str = "# Poses of camera frames (optical: x right, y down, z forward) in their parent: \
    x_parent = R x_child + t, metres.\n";

fn write_launch(rig: &CameraFile) -> Written {
    let (parent, children) = tree(rig, Format::StaticTransforms)?;
    let mut out = format!(
        "{HEADER}from launch import LaunchDescription\nfrom launch_ros.actions import Node\n\n\ndef \
            generate_launch_description():\n    return LaunchDescription([\n"
    );
    for (child, parent_from_child) in children {
        let [w, x, y, z] = parent_from_child.quaternion_wxyz();
        let t = parent_from_child.translation;
        let line = |flags: [&str; 4], values: [f64; 4]| {
            let pairs = flags.iter().zip(values).filter(|(flag, _)| !flag.is_empty());
            let pairs = pairs.map(|(flag, value)| format!("\"--{flag}\", \"{}\",", number(value)));
            format!("                {}\n", pairs.collect::<Vec<_>>().join(" "))
        };
        out += "        Node(\n            package=\"tf2_ros\",\n            \
            executable=\"static_transform_publisher\",\n            arguments=[\n";
        out += &line(["x", "y", "z", ""], [t.x, t.y, t.z, 0.0]);
        out += &line(["qx", "qy", "qz", "qw"], [x, y, z, w]);
        out += &format!(
            "                \"--frame-id\", \"{parent}\", \"--child-frame-id\", \"{child}\",\n            ],\n        \
                ),\n"
        );
    }
    Ok(OutFile::only("static_transforms.launch.py", out + "    ])\n"))
}

fn write_yaml(rig: &CameraFile) -> Written {
    let (parent, children) = tree(rig, Format::StaticTransformsYaml)?;
    let mut out = format!("{HEADER}transforms:\n");
    for (child, parent_from_child) in children {
        let [w, x, y, z] = parent_from_child.quaternion_wxyz().map(number);
        let [tx, ty, tz] = parent_from_child.translation.into();
        out += &format!(
            "- header:\n    frame_id: {}\n  child_frame_id: {}\n  transform:\n    translation: {{x: {}, y: {}, z: {}}}\n    \
                rotation: {{x: {x}, y: {y}, z: {z}, w: {w}}}\n",
            quoted(&parent),
            quoted(&child),
            number(tx),
            number(ty),
            number(tz)
        );
    }
    Ok(OutFile::only("static_transforms.yaml", out))
}
