//! WPILib field layout JSON: `tags`/`field` and, from 2027, `field-tags`/`field-dimensions`.
//!
//! WPILib's frames are x forward, y left, z up. A tag's x axis comes out of its face and z points up, so y runs to
//! the viewer's right. Ours: x right = their y, y down = −their z, z into the surface = −their x. The field frame
//! stays as it is and is the map's world (origin in the blue alliance's right corner, metres).

use super::document::{Document, Fault};
use super::entry::Entry;
use super::{Format, TargetFormat, checks};
use crate::core::target::{MapTag, TagMap};
use crate::core::{Pose, Target};
use nalgebra::{Matrix3, Vector3};

pub(super) const FORMAT: TargetFormat = TargetFormat {
    format: Format::WpilibLayout,
    recognises: |document| layout(&document.entry()).is_some(),
    read,
    traps: &[
        "The same season has two physical fields, welded and AndyMark, whose tags stand centimetres \
            apart; take the layout of the field you play on.",
        "Poses are x forward, y left, z up with the origin at the blue alliance wall; flipping to red is \
            not done here.",
        "The file states neither family nor size: tag36h11 of 165.1 mm (6.5 in, black edge) is assumed, \
            as in the seasons since 2024.",
    ],
};

const SIZE_M: f64 = 0.1651;

fn layout<'a>(root: &Entry<'a>) -> Option<Entry<'a>> {
    root.get("field-tags").or_else(|| root.get("tags").filter(|_| root.has("field")))
}

fn read(document: &Document) -> Result<(Target, Vec<String>), Fault> {
    let root = document.entry();
    let list = layout(&root).ok_or_else(|| root.fault("the key `tags` is missing"))?;
    let family = root.get("family").map_or(Ok("tag36h11"), |f| f.text())?.to_owned();
    let size_m = root.get("size_m").map_or(Ok(SIZE_M), |s| s.number())?;
    let mut tags: Vec<MapTag> = Vec::new();
    for entry in list.items()? {
        let id = entry.need("ID")?.id()?;
        if tags.iter().any(|t| t.id == id) {
            return Err(entry.fault(format!("tag {id} is listed twice")));
        }
        let world_from_tag = field_from_wpilib_tag(&entry.need("pose")?)? * wpilib_tag_from_tag();
        tags.push(MapTag { id, size_m, world_from_tag });
    }
    if tags.is_empty() {
        return Err(list.fault("holds no tags"));
    }
    let assumed = !(root.has("family") && root.has("size_m"));
    let warnings = assumed.then(|| {
        "the layout states no tag size; tag36h11 with a black edge of 165.1 mm is assumed".to_owned()
    });
    Ok((Target::TagMap(TagMap { family, tags }), warnings.into_iter().collect()))
}

fn field_from_wpilib_tag(pose: &Entry<'_>) -> Result<Pose, Fault> {
    let t = pose.need("translation")?;
    let translation = Vector3::new(t.need("x")?.number()?, t.need("y")?.number()?, t.need("z")?.number()?);
    let q = pose.need("rotation")?.need("quaternion")?;
    let part = |key: &str| q.need(key)?.number();
    checks::quaternion_pose(&q, [part("W")?, part("X")?, part("Y")?, part("Z")?], translation)
}

/// Columns: our x, y, z in WPILib's tag frame.
fn wpilib_tag_from_tag() -> Pose {
    Pose::new(Matrix3::new(0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0), Vector3::zeros())
}
