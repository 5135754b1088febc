//! WPILib field layout JSON: `tags`/`field` and, from 2027, `field-tags`/`field-dimensions`.
//!
//! WPILib's frames are x forward, y left, z up. A tag's x axis comes out of its face and z points up, so y runs to
//! the viewer's right. Ours: x right = their y, y down = −their z, z into the surface = −their x. The field frame
//! stays as it is and is the map's world (origin in the blue alliance's right corner, metres).

use super::document::{Document, Fault};
use super::emit::{number, quoted};
use super::entry::Entry;
use super::{Format, OutFile, TargetFormat, WriteError, checks, open};
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
            as in the seasons since 2024; --tag-family and --tag-size-m state others (2023: tag16h5, 0.1524).",
        "The file states no tolerance: each tag is taken to be where it says to ±10 mm along each axis and ±0.8° \
            about each (1σ), after the ±1/2 in and ±1° of the field's layout drawings; --tag-sigma-m states another.",
    ],
};

pub(super) const SIZE_M: f64 = 0.1651;
pub(super) const FAMILY: &str = "tag36h11";
/// The layout and marking drawings of FRC fields (FE-2024 and others) state ±1/2 in and ±1°. That holds for the element of the field and once
/// more for the tag on it, each anywhere within: √2 · 12.7 mm / √3 = 10 mm …
pub(super) const SIGMA_M: f64 = 0.010;
/// … and √2 · 1° / √3 = 0.8°.
pub(super) const SIGMA_RAD: f64 = 0.014;

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
    let document = open::read(path)?;
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
    let number = |key: &str, otherwise: f64| root.get(key).map_or(Ok(otherwise), |value| value.number());
    let size_m = number("size_m", SIZE_M)?;
    let (sigma_m, sigma_rad) = (number("sigma_m", SIGMA_M)?, number("sigma_rad", SIGMA_RAD)?);
    let mut tags: Vec<MapTag> = Vec::new();
    for entry in list.items()? {
        let id = entry.need("ID")?.id()?;
        if tags.iter().any(|t| t.id == id) {
            return Err(entry.fault(format!("tag {id} is listed twice")));
        }
        let world_from_tag = field_from_wpilib_tag(&entry.need("pose")?)? * wpilib_tag_from_tag();
        tags.push(MapTag { id, size_m, world_from_tag, sigma_m, sigma_rad });
    }
    if tags.is_empty() {
        return Err(list.fault("holds no tags"));
    }
    Ok((Target::TagMap(TagMap { family, tags, joint_covariance: None }), Vec::new()))
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

/// A tag map as a WPILib field layout. Family, size and tolerances, for which a layout has no place, follow under keys of our own
/// where they are not those of the seasons since 2024; WPILib reads past them.
///
/// Errors for other targets, tags of different sizes or tolerances, and fields without an extent.
pub fn write_field_layout(target: &Target, field: &Field) -> Result<OutFile, WriteError> {
    if let Some(scale) = target.printed_scale() {
        let [x, y] = scale.ratio;
        return Err(WriteError(format!(
            "a WPILib layout has no place for a printed scale (x {x}, y {y}); take printed_scale out of the file and state sizes and positions as printed"
        )));
    }
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
    let tolerance = map.tags.first().map_or((SIGMA_M, SIGMA_RAD), |tag| (tag.sigma_m, tag.sigma_rad));
    if let Some(odd) = map.tags.iter().find(|tag| (tag.sigma_m, tag.sigma_rad) != tolerance) {
        let (id, other) = (odd.id, odd.sigma_m);
        return Err(WriteError(format!(
            "tag {id} is known to ±{other} m, the first to ±{} m; a WPILib layout has tags of one tolerance",
            tolerance.0
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
        own_keys(&map.family, size_m, tolerance)
    );
    Ok(OutFile { name: "field_layout.json".into(), text })
}

fn own_keys(family: &str, size_m: f64, (sigma_m, sigma_rad): (f64, f64)) -> String {
    let mut text = String::new();
    if family != FAMILY || size_m != SIZE_M {
        text += &format!(",\n  \"family\": {},\n  \"size_m\": {}", quoted(family), number(size_m));
    }
    if (sigma_m, sigma_rad) != (SIGMA_M, SIGMA_RAD) {
        text += &format!(",\n  \"sigma_m\": {},\n  \"sigma_rad\": {}", number(sigma_m), number(sigma_rad));
    }
    text
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
