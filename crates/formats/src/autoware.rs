//! Autoware's `sensors_calibration.yaml` and `sensor_kit_calibration.yaml`: a parent frame, its children, and x y z roll pitch yaw for each;
//! read only, poses only.
//!
//! They become the `origin` of URDF joints (Autoware documentation, "Creating a sensor model"): parent_from_child, metres, radians,
//! R = R_z(yaw) R_y(pitch) R_x(roll).

use super::document::{Document, Fault};
use super::entry::Entry;
use super::euler::rotation_of_rpy;
use super::scalar_keys::has_number;
use super::{CameraFormat, Contents, Format, Placement, Reads};
use crate::core::Pose;
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Autoware,
    words: &[],
    reads: Some(Reads { recognises, read, together: None }),
    write: None,
    traps: &[
        "x y z roll pitch yaw are the pose of the child frame in its parent (x_parent = R x_child + t).",
        "camera_link has x forward and z up; its URDF adds camera_optical_link (x right, y down, z forward) with rpy -90° 0 -90°.",
    ],
};

const KEYS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// Every table of the file holds tables with x and yaw: six keys of such names alone are no such file.
fn recognises(document: &Document) -> bool {
    let all = children(document).unwrap_or_default();
    !all.is_empty() && all.iter().all(|(_, child)| has_number(child, "x") && has_number(child, "yaw"))
}

/// Parents and children.
fn children(document: &Document) -> Result<Vec<(String, Entry<'_>)>, Fault> {
    let mut all = Vec::new();
    for parent in document.entry().entries()? {
        all.extend(parent.entries()?.into_iter().map(|child| (parent.name().to_owned(), child)));
    }
    Ok(all)
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    for (b, child) in children(document)? {
        let mut n = [0.0; 6];
        for (value, key) in n.iter_mut().zip(KEYS) {
            *value = child.need(key)?.number()?;
        }
        let [x, y, z, roll, pitch, yaw] = n;
        if let Some(i) = (3..6).find(|i| std::f64::consts::TAU < n[*i].abs()) {
            let at = child.need(KEYS[i])?;
            return Err(at.fault(format!(
                "is {}, more than a full turn; radians are needed (is it in degrees?)",
                n[i]
            )));
        }
        let b_from_a = Pose::new(rotation_of_rpy([roll, pitch, yaw]), Vector3::new(x, y, z));
        contents.relations.push(Placement { b, a: child.name().to_owned(), b_from_a, covariance: None });
    }
    Ok(contents)
}
