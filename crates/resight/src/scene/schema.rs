//! Foxglove's message types as a table, and the descriptors with which readers decode them.
//!
//! Names, numbers and types are those of the public foxglove.* schemas (docs.foxglove.dev/docs/sdk/schemas): they are the interface.
//! scripts/judges/mcap_scene.py compares every field with the schemas that Foxglove publishes as a package.

use super::protobuf::Message;

/// Type of a field; the number is that of `FieldDescriptorProto.Type`.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Double,
    Int64,
    Int32,
    Fixed32,
    Bool,
    Text,
    Bytes,
    One(&'static str),
    Choice(&'static str),
}
use Kind::{Bool, Bytes, Choice, Double, Fixed32, Int32, Int64, One, Text};

impl Kind {
    fn number(self) -> u64 {
        match self {
            Double => 1,
            Int64 => 3,
            Int32 => 5,
            Fixed32 => 7,
            Bool => 8,
            Text => 9,
            One(_) => 11,
            Bytes => 12,
            Choice(_) => 14,
        }
    }

    fn type_name(self) -> &'static str {
        match self {
            One(name) | Choice(name) => name,
            _ => "",
        }
    }
}

/// Name, number, type; `true` for a repeated field.
type Field = (&'static str, u64, Kind, bool);

const TIME: &str = ".google.protobuf.Timestamp";
const DURATION: &str = ".google.protobuf.Duration";
const VECTOR: Kind = One(".foxglove.Vector3");
const QUATERNION: Kind = One(".foxglove.Quaternion");
const POSE: Kind = One(".foxglove.Pose");
const POINT: Kind = One(".foxglove.Point3");
const COLOR: Kind = One(".foxglove.Color");
const XYZ: [Field; 3] = [("x", 1, Double, false), ("y", 2, Double, false), ("z", 3, Double, false)];
const MOMENT: [Field; 2] = [("seconds", 1, Int64, false), ("nanos", 2, Int32, false)];

/// Types of package `google.protobuf`, each in a file of its own.
const GOOGLE: [(&str, &str); 2] =
    [("google/protobuf/timestamp.proto", "Timestamp"), ("google/protobuf/duration.proto", "Duration")];

/// Types of package `foxglove` that a scene uses, complete: readers expect every field of a type they know.
const MESSAGES: [(&str, &[Field]); 22] = [
    ("FrameTransforms", &[("transforms", 1, One(".foxglove.FrameTransform"), true)]),
    (
        "FrameTransform",
        &[
            ("timestamp", 1, One(TIME), false),
            ("parent_frame_id", 2, Text, false),
            ("child_frame_id", 3, Text, false),
            ("translation", 4, VECTOR, false),
            ("rotation", 5, QUATERNION, false),
        ],
    ),
    (
        "CameraCalibration",
        &[
            ("timestamp", 1, One(TIME), false),
            ("frame_id", 9, Text, false),
            ("width", 2, Fixed32, false),
            ("height", 3, Fixed32, false),
            ("distortion_model", 4, Text, false),
            ("D", 5, Double, true),
            ("K", 6, Double, true),
            ("R", 7, Double, true),
            ("P", 8, Double, true),
        ],
    ),
    (
        "PointCloud",
        &[
            ("timestamp", 1, One(TIME), false),
            ("frame_id", 2, Text, false),
            ("pose", 3, POSE, false),
            ("point_stride", 4, Fixed32, false),
            ("fields", 5, One(".foxglove.PackedElementField"), true),
            ("data", 6, Bytes, false),
        ],
    ),
    (
        "PackedElementField",
        &[
            ("name", 1, Text, false),
            ("offset", 2, Fixed32, false),
            ("type", 3, Choice(".foxglove.PackedElementField.NumericType"), false),
        ],
    ),
    (
        "SceneUpdate",
        &[
            ("deletions", 1, One(".foxglove.SceneEntityDeletion"), true),
            ("entities", 2, One(".foxglove.SceneEntity"), true),
        ],
    ),
    (
        "SceneEntityDeletion",
        &[
            ("timestamp", 1, One(TIME), false),
            ("type", 2, Choice(".foxglove.SceneEntityDeletion.Type"), false),
            ("id", 3, Text, false),
        ],
    ),
    (
        "SceneEntity",
        &[
            ("timestamp", 1, One(TIME), false),
            ("frame_id", 2, Text, false),
            ("id", 3, Text, false),
            ("lifetime", 4, One(DURATION), false),
            ("frame_locked", 5, Bool, false),
            ("metadata", 6, One(".foxglove.KeyValuePair"), true),
            ("arrows", 7, One(".foxglove.ArrowPrimitive"), true),
            ("cubes", 8, One(".foxglove.CubePrimitive"), true),
            ("spheres", 9, One(".foxglove.SpherePrimitive"), true),
            ("cylinders", 10, One(".foxglove.CylinderPrimitive"), true),
            ("lines", 11, One(".foxglove.LinePrimitive"), true),
            ("triangles", 12, One(".foxglove.TriangleListPrimitive"), true),
            ("texts", 13, One(".foxglove.TextPrimitive"), true),
            ("models", 14, One(".foxglove.ModelPrimitive"), true),
        ],
    ),
    ("KeyValuePair", &[("key", 1, Text, false), ("value", 2, Text, false)]),
    (
        "ArrowPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("shaft_length", 2, Double, false),
            ("shaft_diameter", 3, Double, false),
            ("head_length", 4, Double, false),
            ("head_diameter", 5, Double, false),
            ("color", 6, COLOR, false),
        ],
    ),
    ("CubePrimitive", &[("pose", 1, POSE, false), ("size", 2, VECTOR, false), ("color", 3, COLOR, false)]),
    ("SpherePrimitive", &[("pose", 1, POSE, false), ("size", 2, VECTOR, false), ("color", 3, COLOR, false)]),
    (
        "CylinderPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("size", 2, VECTOR, false),
            ("bottom_scale", 3, Double, false),
            ("top_scale", 4, Double, false),
            ("color", 5, COLOR, false),
        ],
    ),
    (
        "LinePrimitive",
        &[
            ("type", 1, Choice(".foxglove.LinePrimitive.Type"), false),
            ("pose", 2, POSE, false),
            ("thickness", 3, Double, false),
            ("scale_invariant", 4, Bool, false),
            ("points", 5, POINT, true),
            ("color", 6, COLOR, false),
            ("colors", 7, COLOR, true),
            ("indices", 8, Fixed32, true),
        ],
    ),
    (
        "TriangleListPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("points", 2, POINT, true),
            ("color", 3, COLOR, false),
            ("colors", 4, COLOR, true),
            ("indices", 5, Fixed32, true),
        ],
    ),
    (
        "TextPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("billboard", 2, Bool, false),
            ("font_size", 3, Double, false),
            ("scale_invariant", 4, Bool, false),
            ("color", 5, COLOR, false),
            ("text", 6, Text, false),
        ],
    ),
    (
        "ModelPrimitive",
        &[
            ("pose", 1, POSE, false),
            ("scale", 2, VECTOR, false),
            ("color", 3, COLOR, false),
            ("override_color", 4, Bool, false),
            ("url", 5, Text, false),
            ("media_type", 6, Text, false),
            ("data", 7, Bytes, false),
        ],
    ),
    ("Pose", &[("position", 1, VECTOR, false), ("orientation", 2, QUATERNION, false)]),
    ("Vector3", &XYZ),
    ("Point3", &XYZ),
    (
        "Quaternion",
        &[("x", 1, Double, false), ("y", 2, Double, false), ("z", 3, Double, false), ("w", 4, Double, false)],
    ),
    (
        "Color",
        &[("r", 1, Double, false), ("g", 2, Double, false), ("b", 3, Double, false), ("a", 4, Double, false)],
    ),
];

/// The message that contains the enumeration, its name, and its values counted from 0.
const CHOICES: [(&str, &str, &[&str]); 3] = [
    ("SceneEntityDeletion", "Type", &["MATCHING_ID", "ALL"]),
    ("LinePrimitive", "Type", &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"]),
    (
        "PackedElementField",
        "NumericType",
        &["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"],
    ),
];

/// Returns `foxglove.ROOT` and all types that it contains, as a `FileDescriptorSet`.
pub(super) fn descriptor_set(root: &str) -> Vec<u8> {
    let google = GOOGLE.map(|(file, name)| {
        let file = Message::new().text(1, file).text(2, "google.protobuf");
        file.message(4, &descriptor(name, &MOMENT)).text(12, "proto3")
    });
    let used = reachable(root);
    let own = Message::new().text(1, &format!("foxglove/{root}.proto")).text(2, "foxglove");
    let own = GOOGLE.iter().fold(own, |own, (file, _)| own.text(3, file));
    let own = own.messages(4, used.iter().map(|&i| descriptor(MESSAGES[i].0, MESSAGES[i].1)));
    Message::new().messages(1, google).message(1, &own.text(12, "proto3")).into_bytes()
}

/// Returns the rows of `MESSAGES` for all types that `root` contains, itself first.
fn reachable(root: &str) -> Vec<usize> {
    let row = |name: &str| MESSAGES.iter().position(|(n, _)| *n == name);
    let mut found: Vec<usize> = row(root).into_iter().collect();
    let mut next = 0;
    while next < found.len() {
        for (_, _, kind, _) in MESSAGES[found[next]].1 {
            let part = match kind {
                One(name) => name.strip_prefix(".foxglove.").and_then(row),
                _ => None,
            };
            found.extend(part.filter(|part| !found.contains(part)));
        }
        next += 1;
    }
    found
}

/// Returns a `DescriptorProto`.
fn descriptor(name: &str, fields: &[Field]) -> Message {
    let choices = CHOICES.iter().filter(|(holder, _, _)| *holder == name).map(|(_, name, values)| {
        let value = |(i, text): (usize, &&str)| Message::new().text(1, text).integer(2, i as u64);
        Message::new().text(1, name).messages(2, values.iter().enumerate().map(value))
    });
    Message::new().text(1, name).messages(2, fields.iter().map(field)).messages(4, choices)
}

/// Returns a `FieldDescriptorProto`; label 1 is optional, 3 repeated.
fn field(&(name, number, kind, is_repeated): &Field) -> Message {
    let label = if is_repeated { 3 } else { 1 };
    Message::new()
        .text(1, name)
        .integer(3, number)
        .integer(4, label)
        .integer(5, kind.number())
        .text(6, kind.type_name())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A type that a field names but that is missing in the table would make the whole schema unreadable.
    #[test]
    fn every_named_type_is_in_the_table() {
        for (_, fields) in MESSAGES {
            for (name, _, kind, _) in fields {
                let known = match kind {
                    One(TIME) | One(DURATION) => true,
                    One(type_name) => MESSAGES.iter().any(|(n, _)| format!(".foxglove.{n}") == *type_name),
                    Choice(type_name) => {
                        CHOICES.iter().any(|(holder, n, _)| format!(".foxglove.{holder}.{n}") == *type_name)
                    }
                    _ => true,
                };
                assert!(known, "{name}");
            }
        }
        assert_eq!(reachable("SceneUpdate").len(), 17);
    }
}
