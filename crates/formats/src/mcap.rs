//! Intrinsics in recordings: the first `sensor_msgs/CameraInfo` (or Foxglove `CameraCalibration`) of each topic of an MCAP file.
//!
//! K and d belong to the images as the sensor gives them. `TOPIC/rectified` is the camera of the rectified images: P without
//! distortion, which is what detectors of rectified images need.

use super::checks;
use super::document::{Document, Fault, Node, Syntax, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Reads, ros};
use crate::core::camera::ImageSize;
use nalgebra::DMatrix;
use resight_recording::ros::decoder::{Decoder, Kind};
use resight_recording::ros::value;
use resight_recording::{Next, Recording, Topic, topics};
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Mcap,
    words: &[],
    reads: Some(Reads { recognises: |document| document.syntax == Syntax::Mcap, read, together: None }),
    write: None,
    traps: &[
        "K and d belong to images as the sensor gives them. For rectified images, and for detections in them (apriltag_ros \
            looks at those), give FILE#TOPIC/rectified: P without distortion.",
        "The first message of each topic counts: a zoom during the recording is not followed.",
    ],
};

const RECTIFIED: &str = "/rectified";

/// What a recording says of its cameras, as a tree: topics, and the fields of their first message.
pub(super) fn document(path: &Path, from: &mut (impl Read + Seek)) -> Result<Document, Fault> {
    let all = topics(from).map_err(|e| Fault::new(e.0))?;
    let is_camera = |t: &&Topic| Kind::of(&t.channel.kind) == Some(Kind::CameraInfo) && 0 < t.messages;
    let mut waiting: BTreeMap<String, Topic> =
        all.iter().filter(is_camera).map(|t| (t.channel.topic.clone(), t.clone())).collect();
    if waiting.is_empty() {
        let names: Vec<String> =
            all.iter().map(|t| format!("{} ({})", t.channel.topic, t.channel.kind)).collect();
        return Err(Fault::new(format!(
            "a recording without intrinsics (no sensor_msgs/CameraInfo); its topics are {}. Give the camera's file",
            if names.is_empty() { "none".to_string() } else { names.join(", ") }
        )));
    }
    from.seek(SeekFrom::Start(0)).map_err(|e| Fault::new(e.to_string()))?;
    let mut recording = Recording::new(from, |channel| Kind::of(&channel.kind) == Some(Kind::CameraInfo));
    let (mut entries, mut lacking) = (Vec::new(), String::new());
    while !waiting.is_empty() {
        match recording.read_next() {
            Ok(Next::Message(message)) => {
                if let Some(topic) = waiting.remove(&message.channel.topic) {
                    entries.push((message.channel.topic.clone(), fields(&topic, &message.data)));
                }
            }
            Ok(Next::Nothing) => {}
            Ok(Next::Damaged(reason)) => lacking = format!(" ({reason})"),
            Ok(Next::Unfinished) => drop(recording.close().map_err(|e| Fault::new(e.0))?),
            Ok(Next::End) => break,
            Err(reason) if entries.is_empty() => return Err(Fault::new(reason.0)),
            Err(reason) => {
                lacking = format!(" ({reason})");
                break;
            }
        }
    }
    let reason = format!("no message of this topic can be read{lacking}");
    entries.extend(waiting.into_keys().map(|topic| (topic, node(Value::Text(reason.clone())))));
    entries.sort_by(|a, b| a.0.cmp(&b.0));
    let root = node(Value::Map(entries));
    Ok(Document { path: path.to_path_buf(), syntax: Syntax::Mcap, text: String::new(), root })
}

/// The fields of a message; of one that cannot be read the reason, as a text: the recording's other cameras are none the worse.
fn fields(topic: &Topic, data: &[u8]) -> Node {
    let channel = &topic.channel;
    let decoder = Decoder::new(
        &channel.kind,
        &channel.message_encoding,
        &channel.definition_encoding,
        &channel.definition,
    );
    let read = decoder.and_then(|decoder| match decoder.read(data)? {
        message @ value::Value::Message(_) => Ok(tree(&message)),
        _ => Err("the message has no fields".to_string()),
    });
    read.unwrap_or_else(|reason| node(Value::Text(reason)))
}

/// What every camera of a recording must be: readable, and of whole images.
fn usable(entry: &Entry<'_>) -> Result<(), Fault> {
    match &entry.node.value {
        Value::Text(reason) => Err(entry.fault(reason)),
        _ => ros::refuse_crops(entry),
    }
}

/// A recording has no lines.
fn node(value: Value) -> Node {
    Node { line: 0, value }
}

fn tree(message: &value::Value<'_>) -> Node {
    let numbers = |all: &[f64]| all.iter().map(|x| node(Value::Number(*x))).collect();
    node(match message {
        value::Value::Number(x) => Value::Number(*x),
        value::Value::Text(text) => Value::Text(text.clone().into_owned()),
        value::Value::Bytes(_) => Value::Null,
        value::Value::Numbers(all) => Value::List(numbers(all)),
        value::Value::List(list) => Value::List(list.iter().map(tree).collect()),
        value::Value::Message(fields) => {
            Value::Map(fields.iter().map(|(name, value)| (name.clone().into_owned(), tree(value))).collect())
        }
    })
}

/// Every topic that holds a usable camera; what is wrong with the others is a warning.
fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let mut first = None;
    for entry in document.entry().entries()? {
        let topic = entry.path.clone();
        if let Err(fault) = usable(&entry).and_then(|()| ros::camera(&entry, topic, &mut contents)) {
            contents.warnings.push(format!("left out: {}", fault.reason));
            first = first.or(Some(fault));
        }
    }
    match first {
        Some(fault) if contents.cameras.is_empty() => Err(fault),
        _ => Ok(contents),
    }
}

/// The camera of one topic, or of its rectified images; says why a topic that is there holds none.
pub(super) fn camera(document: &Document, name: &str) -> Option<Result<NamedCamera, Fault>> {
    let entries = document.entry().entries().ok()?;
    let of = |topic: &str| entries.iter().find(|entry| entry.path == topic);
    if let Some(entry) = of(name) {
        let mut contents = Contents::default();
        let read = usable(entry).and_then(|()| ros::camera(entry, name.to_string(), &mut contents));
        return Some(
            read.and_then(|()| contents.cameras.pop().ok_or_else(|| entry.fault("holds no camera"))),
        );
    }
    let entry = of(name.strip_suffix(RECTIFIED)?)?;
    Some(rectified(entry, name))
}

fn rectified(entry: &Entry<'_>, name: &str) -> Result<NamedCamera, Fault> {
    usable(entry)?;
    let missing = || entry.fault("has no P; publish camera_info with a projection matrix");
    let p = entry.first_of(&["p", "P"]).ok_or_else(missing)?.matrix(3, 4)?;
    let three: DMatrix<f64> = p.columns(0, 3).into();
    let list = three.transpose().iter().map(|x| node(Value::Number(*x))).collect();
    let (list, path) = (node(Value::List(list)), format!("{}.P", entry.path));
    let at = Entry::called(path, &list);
    let size =
        ImageSize { width_px: entry.need("width")?.count(1)?, height_px: entry.need("height")?.count(1)? };
    let matrix = checks::camera_matrix(&at)?;
    let camera = lens::camera(&at, &LensNumbers::Pinhole, matrix, Some(size), &mut Vec::new())?;
    Ok(NamedCamera::new(name, camera, None))
}
