//! Files of poses as matrices, under keys that state what they map: `cam_from_lidar: [[…]]` is x_cam = M x_lidar, 4×4 or 3×4, row by row;
//! `body_T_cam` means the same (VINS). Read only, poses only, metres.
//!
//! A matrix alone in a file is read where the file's name (`cam_from_lidar.txt`) or a comment (`# cam_from_lidar`) states the same. One without, or under
//! another key, may map either way (T_a_b is a_from_b to Kalibr and b_from_a to others): it is refused with the two names that it may mean.

use super::document::{Document, Fault, Node, Syntax, Value};
use super::entry::Entry;
use super::{CameraFormat, Contents, Format, Placement, Reads, checks};
use crate::core::Pose;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::PoseMatrices,
    words: &[],
    reads: Some(Reads {
        recognises: |document| is_bare(document) || !matrices(document).is_empty(),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "b_from_a maps points of frame a into frame b (x_b = R x_a + t); t is the position of a's origin in b.",
    ],
};

/// Nothing but 16 numbers, as JSON or in four lines of four.
fn is_bare(document: &Document) -> bool {
    match document.syntax {
        Syntax::Lines => is_bare_text(&document.text),
        _ => is_4x4(&document.entry()),
    }
}

fn rows(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
}

/// Four lines of four numbers.
pub(super) fn is_bare_text(text: &str) -> bool {
    let rows: Vec<&str> = rows(text).take(5).collect();
    let is_row = |line: &&str| {
        let words: Vec<&str> = line.split([' ', '\t', ',']).filter(|w| !w.is_empty()).collect();
        words.len() == 4 && words.iter().all(|w| w.trim().parse::<f64>().is_ok())
    };
    rows.len() == 4 && rows.iter().all(is_row)
}

/// A homogeneous matrix: its last row is 0 0 0 1.
fn is_4x4(entry: &Entry<'_>) -> bool {
    matches!(entry.node.value, Value::List(_) | Value::Map(_))
        && entry.numbers().is_ok_and(|n| n.len() == 16 && n[12..] == [0.0, 0.0, 0.0, 1.0])
}

/// Frames b and a of a key that states them.
fn frames(key: &str) -> Option<(&str, &str)> {
    let (b, a) = key.split_once("_from_").or_else(|| key.split_once("_T_"))?;
    (!b.is_empty() && !a.is_empty()).then_some((b, a))
}

/// The matrix of a file that holds nothing else.
fn bare_pose(document: &Document) -> Result<Pose, Fault> {
    if document.syntax != Syntax::Lines {
        return checks::pose4x4(&document.entry());
    }
    let numbers = rows(&document.text).flat_map(|line| line.split([' ', '\t', ',']));
    let number = |word: &str| word.trim().parse().ok().map(|x| Node { line: 1, value: Value::Number(x) });
    let node = Node { line: 1, value: Value::List(numbers.filter_map(number).collect()) };
    checks::pose4x4(&Entry::called("the matrix", &node))
}

fn matrices(document: &Document) -> Vec<Entry<'_>> {
    let is_pose = |entry: &Entry<'_>| {
        is_4x4(entry)
            || frames(entry.name()).is_some()
                && matches!(entry.node.value, Value::List(_) | Value::Map(_))
                && entry.numbers().is_ok_and(|n| n.len() == 12)
    };
    document.entry().entries().unwrap_or_default().into_iter().filter(is_pose).collect()
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    if is_bare(document) {
        let stem = document.stem();
        let comments = document.text.lines().filter_map(|line| line.trim_start().strip_prefix('#'));
        let stated: Vec<(&str, &str)> =
            comments.flat_map(str::split_whitespace).chain([stem.as_str()]).filter_map(frames).collect();
        if let Some((b, a)) = stated.first() {
            let b_from_a = bare_pose(document)?;
            let [b, a] = [b, a].map(|name| (*name).trim_end_matches([':', ',', '=']).to_owned());
            contents.relations.push(Placement { b, a, b_from_a, covariance: None });
            return Ok(contents);
        }
        return Err(Fault::new(
            "a 4×4 matrix alone, which states no frames; write it under a key that does: `cam_from_world: [[…], …]` where x_cam = M x_world, \
                `world_from_cam` where x_world = M x_cam; a file called so, or with the comment `# cam_from_world`, is read too",
        ));
    }
    for entry in matrices(document) {
        let Some((b, a)) = frames(entry.name()) else {
            return Err(entry.fault(
                "is a pose, but the key does not state which frame it maps into; call it `b_from_a` where x_b = M x_a, with the names of the frames",
            ));
        };
        let b_from_a = checks::pose3x4_or_4x4(&entry)?;
        contents.relations.push(Placement { b: b.into(), a: a.into(), b_from_a, covariance: None });
    }
    Ok(contents)
}
