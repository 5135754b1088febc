//! Arrays of numbers without names: (n, 4, 4) matrices, (n, 7) positions with quaternions, (n, 6) positions with three numbers of a rotation.

use super::words::{WHERE, choices};
use super::{ListedPose, PoseList, PoseListOptions, Rotation, RotationFormat, matrix_pose, pose_of};
use crate::document::{Fault, Node, Value};
use crate::entry::Entry;
use nalgebra::Vector3;

/// Numbers, row by row.
#[derive(Debug)]
pub(super) struct Array {
    pub shape: Vec<usize>,
    pub data: Vec<f64>,
    /// The line of each row, for tables in text.
    pub lines: Vec<usize>,
}

/// A flat list of numbers as a value of a file.
pub(super) fn node(line: usize, numbers: &[f64]) -> Node {
    let number = |x: &f64| Node { line, value: Value::Number(*x) };
    Node { line, value: Value::List(numbers.iter().map(number).collect()) }
}

/// Rows of numbers alone, separated by commas, semicolons, tabs or spaces, or in brackets as NumPy prints them; `None` where a row has another
/// word.
pub(super) fn rows_of_numbers(text: &str) -> Option<Array> {
    // Lists of JSON have commas.
    let is_printed = text.contains('[') && !text.contains(',');
    let printed = is_printed.then(|| text.replace(['[', ']'], " "));
    let text = printed.as_deref().unwrap_or(text);
    let (mut data, mut lines, mut width) = (Vec::new(), Vec::new(), 0);
    for (n, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let (line, marks): (String, &[char]) = match line.contains([';', '\t']) {
            true if !line.contains('.') => (line.replace(',', "."), &[';', '\t', ' ']),
            _ => (line.to_owned(), &[',', ';', '\t', ' ']),
        };
        let words = line.split(marks).filter(|word| !word.is_empty());
        let numbers: Vec<f64> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
        // A row of another length makes the shape impossible, which is reported with its line.
        width = if lines.is_empty() { numbers.len() } else { width };
        if numbers.len() != width {
            return Some(Array {
                shape: vec![numbers.len(), n + 1, width],
                data: Vec::new(),
                lines: vec![n + 1],
            });
        }
        data.extend(numbers);
        lines.push(n + 1);
    }
    (!lines.is_empty()).then(|| Array { shape: vec![lines.len(), width], data, lines })
}

/// Nested lists of one shape; `None` for others.
pub(super) fn of_lists(at: &Entry<'_>) -> Result<Array, Fault> {
    let mut shape = Vec::new();
    let mut first = at.clone();
    while let Value::List(items) = &first.node.value {
        shape.push(items.len());
        match first.items()?.into_iter().next() {
            Some(inner) => first = inner,
            None => break,
        }
    }
    let data = at.numbers()?;
    if shape.iter().product::<usize>() != data.len() {
        return Err(at.fault(format!(
            "holds {} numbers, and its first lists have the shape {shape:?}: poses of different lengths",
            data.len()
        )));
    }
    Ok(Array { shape, data, lines: Vec::new() })
}

const SHAPES: &str = "(n, 4, 4) matrices, (n, 7) positions and quaternions, or (n, 6) positions and three numbers of a rotation are needed";

/// Reads an array of poses.
pub(super) fn poses(array: &Array, options: &PoseListOptions) -> Result<PoseList, Fault> {
    if let [seen, line, needed] = array.shape[..]
        && array.lines == [line]
        && array.data.is_empty()
    {
        return Err(Fault::at(line, format!("{seen} numbers where the first row has {needed}")));
    }
    let poses = match array.shape[..] {
        [0, ..] => Vec::new(),
        [4, 4] => matrices(array, 16, options)?,
        [_, 4, 4] | [_, 16] => matrices(array, 16, options)?,
        [_, 3, 4] | [_, 12] => matrices(array, 12, options)?,
        [n, 4] if n.is_multiple_of(4) => matrices(array, 16, options)?,
        [_, 7] => quaternions(array, options)?,
        [_, 6] => angles(array, options)?,
        [4, 4, n] => {
            return Err(Fault::new(format!(
                "an array of shape (4, 4, {n}); the number of the pose comes first: numpy.moveaxis(poses, -1, 0)"
            )));
        }
        [_, 2, 4, 4] | [2, _, 4, 4] => {
            return Err(Fault::new(
                "pairs of matrices, of which nothing says which is the robot's; save them apart (`--motions robot.npy --poses target.npy`), or in JSON under the keys `base_from_gripper` and `cam_from_target`",
            ));
        }
        _ => {
            return Err(Fault::new(format!("an array of shape {:?}; {SHAPES}", array.shape)));
        }
    };
    Ok(PoseList { poses, cam_from_target: None, mounting: None, remarks: Vec::new() })
}

/// Calls each pose by its number from 1, and by its line where it has one.
fn each(
    array: &Array,
    n_numbers: usize,
    mut pose: impl FnMut(&Entry<'_>, &[f64]) -> Result<ListedPose, Fault>,
) -> Result<Vec<ListedPose>, Fault> {
    let n_rows = n_numbers.checked_div(array.shape.last().copied().unwrap_or_default());
    let of = |(i, numbers): (usize, &[f64])| {
        let line = array.lines.get(i * n_rows.unwrap_or(1).max(1)).copied().unwrap_or_default();
        let node = node(line, numbers);
        let at = Entry::called(format!("pose {}", i + 1), &node);
        at.numbers()?;
        pose(&at, numbers)
    };
    array.data.chunks(n_numbers).enumerate().map(of).collect()
}

fn matrices(array: &Array, n_numbers: usize, options: &PoseListOptions) -> Result<Vec<ListedPose>, Fault> {
    let scale = options.length.map_or(1.0, |unit| unit.in_m());
    each(array, n_numbers, |at, _| matrix_pose(at, scale, options.is_inverse))
}

/// Metres in the unit of positions that state none.
pub(super) fn scale(options: &PoseListOptions) -> f64 {
    let by_maker = options.rotation.map(|word| word.length);
    options.length.or(by_maker).map_or(1.0, |unit| unit.in_m())
}

/// Largest deviation of a quaternion from unit length.
const UNIT: f64 = 1e-3;

/// Seven numbers: which four are the quaternion follows from their length.
fn quaternions(array: &Array, options: &PoseListOptions) -> Result<Vec<ListedPose>, Fault> {
    let is_scalar_first = match options.rotation.map(|word| word.format) {
        Some(RotationFormat::QuaternionWxyz) => true,
        Some(RotationFormat::QuaternionXyzw) => false,
        other => {
            let problem = match other {
                Some(_) => "the stated convention has three numbers, a quaternion four",
                None => "nothing says which number of the quaternion is its scalar",
            };
            let choices = choices(|word| !matches!(word.format, RotationFormat::Angles(_)));
            return Err(Fault::new(format!("rows of seven numbers: {problem}; {choices}: {WHERE}")));
        }
    };
    let is_unit_from = |at: usize| {
        let rows = array.data.chunks(7);
        rows.map(|row| row[at..at + 4].iter().map(|x| x * x).sum::<f64>().sqrt())
            .all(|length| (length - 1.0).abs() < UNIT)
    };
    let from = match (is_unit_from(3), is_unit_from(0)) {
        (true, true) => {
            return Err(Fault::new(
                "rows of seven numbers, of which both the first four and the last four have length 1; name the columns: x_m,y_m,z_m,qw,qx,qy,qz",
            ));
        }
        (_, false) => 3,
        (false, true) => 0,
    };
    each(array, 7, |at, row| {
        let mut wxyz = [0, 1, 2, 3].map(|i| row[from + i]);
        if !is_scalar_first {
            wxyz.rotate_right(1);
        }
        let t = Vector3::from([0, 1, 2].map(|i| row[(from + 4) % 7 + i])) * scale(options);
        pose_of(at, &Rotation::Wxyz(wxyz), t, options.is_inverse)
    })
}

/// Six numbers: the position, then the rotation.
fn angles(array: &Array, options: &PoseListOptions) -> Result<Vec<ListedPose>, Fault> {
    let Some(RotationFormat::Angles(convention)) = options.rotation.map(|word| word.format) else {
        let choices = choices(|word| matches!(word.format, RotationFormat::Angles(_)));
        return Err(Fault::new(format!(
            "rows of six numbers (the position, then the rotation): nothing says what the three numbers of the rotation mean; {choices}: {WHERE}"
        )));
    };
    each(array, 6, |at, row| {
        let t = Vector3::new(row[0], row[1], row[2]) * scale(options);
        pose_of(at, &Rotation::Angles([row[3], row[4], row[5]], convention), t, options.is_inverse)
    })
}
