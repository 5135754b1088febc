//! URDF: fixed joints place links in their parents. Poses only.
//!
//! `<origin xyz rpy>` of a joint is the pose of the child link in the parent: x_parent = R x_child + t with
//! R = R_z(yaw) R_y(pitch) R_x(roll), metres and radians.

use super::document::{Document, Fault};
use super::emit::number;
use super::entry::Entry;
use super::euler::{rotation_of_rpy, rpy_of_rotation};
use super::tf::{element_is, tree};
use super::tf_launch::named;
use super::{CameraFile, CameraFormat, Contents, Format, OutFile, Placement, Reads, Writer, Written};
use crate::core::Pose;
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Urdf,
    words: &["urdf"],
    reads: Some(Reads { recognises: |document| element_is(&document.root, "robot"), read, together: None }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "A joint's origin is the pose of the child in the parent (x_parent = R x_child + t): the inverse of OpenCV's R, T.",
        "rpy is roll, pitch, yaw in radians, R = Rz(yaw) Ry(pitch) Rx(roll); static_transform_publisher's positional \
            arguments are yaw, pitch, roll.",
        "A camera's points need its optical frame (x right, y down, z forward), rpy = \"-1.5708 0 -1.5708\" from a link \
            with x forward and z up.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    for element in document.entry().need("children")?.items()? {
        if !element_is(element.node, "joint") {
            continue;
        }
        let name = element.get("@name").map_or(Ok("?"), |n| n.text())?;
        let joint = named(format!("joint {name}"), element.node);
        match joint.get("@type").map_or(Ok("?"), |t| t.text())? {
            "fixed" => contents.relations.push(placement(&joint)?),
            moving => contents.warnings.push(format!(
                "line {}: joint {name} is {moving}: what hangs from it has no fixed pose, so it is left out",
                element.node.line
            )),
        }
    }
    if contents.relations.is_empty() {
        return Err(document.entry().fault("a robot without any fixed joint; it states no fixed pose"));
    }
    Ok(contents)
}

fn placement(joint: &Entry<'_>) -> Result<Placement, Fault> {
    let link = |role: &str| match child(joint, role)? {
        Some(element) => Ok(element.need("@link")?.text()?.to_owned()),
        None => Err(joint.fault(format!("<{role} link=\"…\"/> is missing"))),
    };
    let (b, a) = (link("parent")?, link("child")?);
    let b_from_a = match child(joint, "origin")? {
        None => Pose::identity(),
        Some(origin) => {
            let [x, y, z] = triple(&origin, "@xyz")?;
            Pose::new(rotation_of_rpy(triple(&origin, "@rpy")?), Vector3::new(x, y, z))
        }
    };
    Ok(Placement { b, a, b_from_a, covariance: None })
}

fn child<'a>(joint: &Entry<'a>, name: &str) -> Result<Option<Entry<'a>>, Fault> {
    let found = joint.need("children")?.items()?.into_iter().find(|e| element_is(e.node, name));
    Ok(found.map(|e| named(format!("{}.{name}", joint.path), e.node)))
}

/// Three numbers of an attribute; zeros where it is left out.
fn triple(origin: &Entry<'_>, key: &str) -> Result<[f64; 3], Fault> {
    let Some(at) = origin.get(key) else { return Ok([0.0; 3]) };
    let text = at.text()?;
    if text.contains("${") {
        return Err(
            at.fault("holds a xacro expression; expand it first: `xacro robot.urdf.xacro > robot.urdf`")
        );
    }
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    match numbers.as_slice() {
        [x, y, z] if numbers.iter().all(|x| x.is_finite()) && text.split_whitespace().count() == 3 => {
            Ok([*x, *y, *z])
        }
        _ => {
            let short: String = text.chars().take(60).collect();
            Err(at.fault(format!("is `{short}`; three finite numbers, separated by blanks, are needed")))
        }
    }
}

fn write(rig: &CameraFile) -> Written {
    let (parent, children) = tree(rig, Format::Urdf)?;
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<!-- Camera frames are optical: x right, y down, z forward. -->\n<robot \
            name=\"camera_rig\">\n  <link name=\"{parent}\"/>\n"
    );
    for (child, parent_from_child) in children {
        let three = |v: [f64; 3]| v.map(number).join(" ");
        let xyz = three(parent_from_child.translation.into());
        let rpy = three(rpy_of_rotation(&parent_from_child.rotation));
        out += &format!(
            "  <link name=\"{child}\"/>\n  <joint name=\"{child}_joint\" type=\"fixed\">\n    <parent \
                link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>\n  </joint>\n"
        );
    }
    Ok(OutFile::only("rig.urdf", out + "</robot>\n"))
}
