//! WPILib field layout JSON: `tags`/`field` and, from 2027, `field-tags`/`field-dimensions`.
//!
//! WPILib's frames are x forward, y left, z up. A tag's x axis comes out of its face and z points up, so y runs to
//! the viewer's right. Ours: x right = their y, y down = −their z, z into the surface = −their x. The field frame
//! stays as it is and is the map's world (origin in the blue alliance's right corner, metres).

use super::document::{Document, Fault};
use super::emit::{number, quoted};
use super::entry::Entry;
use super::{Format, OutFile, TargetFormat, WriteError, checks};
use crate::FileError;
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
const FAMILY: &str = "tag36h11";

/// The field's outline and which of the two spellings a layout has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Along x, from the blue alliance's wall to the red one's.
    pub length_m: f64,
    /// Along y.
    pub width_m: f64,
    /// `field-tags` and `field-dimensions` instead of `tags` and `field`.
    pub keys_of_2027: bool,
}

/// The field of a WPILib layout file; its tags are read by `read_target`.
pub fn read_field(path: &std::path::Path) -> Result<Field, FileError> {
    let document = Document::read(path)?;
    field(&document.entry()).map_err(|fault| fault.in_file(path))
}

fn field(root: &Entry<'_>) -> Result<Field, Fault> {
    let keys_of_2027 = root.has("field-tags");
    let size = root.need(if keys_of_2027 { "field-dimensions" } else { "field" })?;
    let (length_m, width_m) = (size.need("length")?.number()?, size.need("width")?.number()?);
    Ok(Field { length_m, width_m, keys_of_2027 })
}

fn layout<'a>(root: &Entry<'a>) -> Option<Entry<'a>> {
    root.get("field-tags").or_else(|| root.get("tags").filter(|_| root.has("field")))
}

fn read(document: &Document) -> Result<(Target, Vec<String>), Fault> {
    let root = document.entry();
    let list = layout(&root).ok_or_else(|| root.fault("the key `tags` is missing"))?;
    let family = root.get("family").map_or(Ok(FAMILY), |f| f.text())?.to_owned();
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

/// A tag map as a WPILib field layout. Family and size, for which a layout has no place, follow under keys of our own
/// where they are not those of the seasons since 2024; WPILib reads past them.
///
/// Errors for other targets, tags of different sizes, and fields without an extent.
pub fn write_field_layout(target: &Target, field: &Field) -> Result<OutFile, WriteError> {
    let Target::TagMap(map) = target else {
        let kind = target.kind();
        return Err(WriteError(format!("a WPILib layout holds a tag_map, not a target of kind `{kind}`")));
    };
    if !(0.0 < field.length_m
        && field.length_m.is_finite()
        && 0.0 < field.width_m
        && field.width_m.is_finite())
    {
        let (l, w) = (field.length_m, field.width_m);
        return Err(WriteError(format!("the field is {l} m by {w} m; both sides must be positive")));
    }
    let size_m = map.tags.first().map_or(SIZE_M, |tag| tag.size_m);
    if let Some(odd) = map.tags.iter().find(|tag| tag.size_m != size_m) {
        let (id, other) = (odd.id, odd.size_m);
        return Err(WriteError(format!(
            "tag {id} is {other} m wide, the first {size_m} m; a WPILib layout has tags of one size"
        )));
    }
    let (tags, outline) =
        if field.keys_of_2027 { ("field-tags", "field-dimensions") } else { ("tags", "field") };
    let list: Vec<String> = map.tags.iter().map(tag_text).collect();
    let (length, width) = (number(field.length_m), number(field.width_m));
    let text = format!(
        "{{\n  {}: [\n{}\n  ],\n  {}: {{ \"length\": {length}, \"width\": {width} }}{}\n}}\n",
        quoted(tags),
        list.join(",\n"),
        quoted(outline),
        family_text(&map.family, size_m)
    );
    Ok(OutFile { name: "field_layout.json".into(), text })
}

fn family_text(family: &str, size_m: f64) -> String {
    if family == FAMILY && size_m == SIZE_M {
        return String::new();
    }
    format!(",\n  \"family\": {},\n  \"size_m\": {}", quoted(family), number(size_m))
}

fn tag_text(tag: &MapTag) -> String {
    let field_from_wpilib_tag = tag.world_from_tag * wpilib_tag_from_tag().inverse();
    let t = field_from_wpilib_tag.translation;
    let [w, x, y, z] = field_from_wpilib_tag.quaternion_wxyz().map(number);
    let [tx, ty, tz] = [t.x, t.y, t.z].map(number);
    format!(
        "    {{ \"ID\": {}, \"pose\": {{\n      \"translation\": {{ \"x\": {tx}, \"y\": {ty}, \"z\": {tz} }},\n      \
            \"rotation\": {{ \"quaternion\": {{ \"W\": {w}, \"X\": {x}, \"Y\": {y}, \"Z\": {z} }} }} }} }}",
        tag.id
    )
}
