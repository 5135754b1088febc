//! Poses as programs of robots' controllers hold them, whose spelling states the convention: `p[…]` of URScript, frames in braces of KUKA's KRL and
//! Fanuc's LS, robtargets and poses of ABB's RAPID, positions of Yaskawa's JBI.

use super::words::{RotationFormat, RotationWord};
use super::{ListedPose, PoseList, PoseListOptions, Rotation, arrays, pose_of};
use crate::document::Fault;
use crate::entry::Entry;
use nalgebra::Vector3;

/// A pose as it stands: the word of its convention, position and rotation.
pub(super) struct Written {
    line: usize,
    word: &'static str,
    numbers: Vec<f64>,
}

/// Names in braces, and the convention that they state.
const BRACES: [(&str, [&str; 6]); 2] =
    [("kuka", ["X", "Y", "Z", "A", "B", "C"]), ("fanuc", ["X", "Y", "Z", "W", "P", "R"])];

/// Every pose of a text; none where it is no such program.
pub(super) fn written(text: &str) -> Option<Vec<Written>> {
    let found: [fn(&str) -> Vec<Written>; 4] = [of_brackets, of_braces, of_rapid, of_job];
    found.into_iter().map(|find| find(text)).find(|poses| !poses.is_empty())
}

/// Reads the poses in metres.
pub(super) fn poses(written: &[Written], options: &PoseListOptions) -> Result<PoseList, Fault> {
    let read = written.iter().enumerate().map(|(i, pose)| read(i, pose, options));
    let poses = read.collect::<Result<Vec<_>, Fault>>()?;
    Ok(PoseList { poses, cam_from_target: None, mounting: None, remarks: Vec::new() })
}

fn read(i: usize, pose: &Written, options: &PoseListOptions) -> Result<ListedPose, Fault> {
    let node = arrays::node(pose.line, &pose.numbers);
    let at = Entry::called(format!("pose {}", i + 1), &node);
    at.numbers()?;
    let word = RotationWord::parse(pose.word).map_err(|reason| at.fault(reason))?;
    if options.rotation.is_some_and(|stated| stated.format != word.format) {
        return Err(
            at.fault(format!("is written in the convention `{}`, and the option states another", word.word))
        );
    }
    let unit = options.length.unwrap_or(word.length).in_m();
    let (t, r) = pose.numbers.split_at(3);
    let rotation = match (word.format, r) {
        (RotationFormat::QuaternionWxyz, [w, x, y, z]) => Rotation::Wxyz([*w, *x, *y, *z]),
        (RotationFormat::Angles(convention), [a, b, c]) => Rotation::Angles([*a, *b, *c], convention),
        _ => return Err(at.fault(format!("holds {} numbers of a rotation", r.len()))),
    };
    pose_of(&at, &rotation, Vector3::from_row_slice(t) * unit, options.is_inverse)
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count()
}

/// What stands behind each occurrence of a mark, with its place.
fn behind<'a>(text: &'a str, mark: &'a str) -> impl Iterator<Item = (usize, &'a str)> {
    text.match_indices(mark).map(move |(at, _)| (at, &text[at + mark.len()..]))
}

/// What stands before the next closing bracket; none where another one opens first, so that no text is searched twice.
fn closed(text: &str, [open, close]: [char; 2]) -> Option<(&str, &str)> {
    let at = text.find([open, close])?;
    text[at..].starts_with(close).then(|| (&text[..at], &text[at + close.len_utf8()..]))
}

/// A line's beginning is looked for so many bytes before a pose.
const LONGEST: usize = 200;

/// Numbers separated by commas up to a bracket; none as soon as anything else is there.
fn listed(text: &str) -> Option<Vec<f64>> {
    let (inner, _) = closed(text, ['[', ']'])?;
    inner.split(',').map(|word| word.trim().parse().ok()).collect()
}

/// URScript: `p[x, y, z, rx, ry, rz]`, metres and a rotation vector.
fn of_brackets(text: &str) -> Vec<Written> {
    let is_word = |at: usize| text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let poses = behind(text, "p[").filter(|(at, _)| !is_word(*at)).filter_map(|(at, rest)| {
        let numbers = listed(rest).filter(|numbers| numbers.len() == 6)?;
        Some((at, numbers))
    });
    lined(text, poses, "ur")
}

/// Lines are counted on from one pose to the next.
fn lined(text: &str, poses: impl Iterator<Item = (usize, Vec<f64>)>, word: &'static str) -> Vec<Written> {
    let (mut line, mut counted) = (1, 0);
    poses
        .map(|(at, numbers)| {
            line += line_of(&text[counted..], at - counted) - 1;
            counted = at;
            Written { line, word, numbers }
        })
        .collect()
}

/// KUKA: `{X 1, Y 2, Z 3, A 4, B 5, C 6}`; Fanuc: `P[1]{ … X = 1 mm, … W = 4 deg, … };`. Tools and bases (`$TOOL = {…}`) are left out.
fn of_braces(text: &str) -> Vec<Written> {
    let group = |names: &[&str; 6], at: usize, rest: &str| {
        let before = &text[text.floor_char_boundary(at.saturating_sub(LONGEST))..at];
        let line = before.rsplit('\n').next().unwrap_or_default();
        let (inner, _) = closed(rest, ['{', '}']).filter(|_| !line.trim_start().starts_with('$'))?;
        let words: Vec<&str> =
            inner.split([' ', '\t', '\n', '\r', ',', '=']).filter(|w| !w.is_empty()).collect();
        let number = |name: &&str| {
            let at = words.iter().position(|word| word == name)?;
            words.get(at + 1)?.parse::<f64>().ok()
        };
        Some((at, names.iter().map(number).collect::<Option<Vec<f64>>>()?))
    };
    let of = |(word, names): &(&'static str, [&str; 6])| {
        lined(text, behind(text, "{").filter_map(|(at, rest)| group(names, at, rest)), word)
    };
    BRACES.iter().map(of).find(|poses| !poses.is_empty()).unwrap_or_default()
}

/// RAPID: `:=[[x, y, z], [q1, q2, q3, q4], …`, millimetres, the scalar first.
fn of_rapid(text: &str) -> Vec<Written> {
    let poses = behind(text, ":=").filter_map(|(at, rest)| {
        let rest = rest.trim_start().strip_prefix('[')?.trim_start().strip_prefix('[')?;
        let position = listed(rest).filter(|numbers| numbers.len() == 3)?;
        let (_, rest) = rest.split_once(']')?;
        let rest = rest.trim_start().strip_prefix(',')?.trim_start().strip_prefix('[')?;
        let rotation = listed(rest).filter(|numbers| numbers.len() == 4)?;
        Some((at, [position, rotation].concat()))
    });
    lined(text, poses, "abb")
}

/// JBI: `C00000=x,y,z,Rx,Ry,Rz` below `///RECTAN`; pulses of joints are none.
fn of_job(text: &str) -> Vec<Written> {
    if !text.lines().any(|line| line.trim() == "///RECTAN") {
        return Vec::new();
    }
    let (mut is_rectangular, mut found) = (false, Vec::new());
    for (i, line) in text.lines().enumerate() {
        is_rectangular = match line.trim() {
            "///RECTAN" => true,
            "///PULSE" => false,
            _ => is_rectangular,
        };
        let Some((name, values)) = line.split_once('=').filter(|_| is_rectangular) else { continue };
        let is_position = name.trim().trim_start_matches(char::is_alphabetic).parse::<u32>().is_ok();
        let numbers: Option<Vec<f64>> = values.split(',').map(|word| word.trim().parse().ok()).collect();
        if let Some(numbers) = numbers.filter(|numbers| is_position && 6 <= numbers.len()) {
            found.push(Written { line: i + 1, word: "yaskawa", numbers: numbers[..6].to_vec() });
        }
    }
    found
}
