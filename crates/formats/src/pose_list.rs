//! Lists of poses as people have them: of a robot's gripper, or of a target in front of a camera, one for each view.
//!
//! Tables (columns by name, or bare rows of numbers), NumPy arrays, JSON and YAML, programs of robots' controllers, the samples of easy_handeye and of
//! MoveIt's calibration. A file
//! states its convention by the names of its columns or keys, else the caller does; where neither does, the file is refused with the choices.

mod arrays;
mod columns;
mod controllers;
mod documents;
mod npy;
mod words;

pub use words::{LengthUnit, RotationFormat, RotationWord};

use super::document::{Document, Fault};
use super::entry::Entry;
use super::input::table::{self, Table, TableRow};
use super::input::{Kind, what_is_it};
use super::{checks, open};
use crate::FileError;
use crate::core::Pose;
use crate::core::multiview::hand_eye::{AngleUnit, Mounting, RotationConvention, RotationOrder, WrittenPose};
use columns::{Layout, Pairs};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;
use std::path::Path;

/// What the caller states about a file that does not state it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseListOptions {
    /// What the numbers of a rotation mean.
    pub rotation: Option<RotationWord>,
    /// The unit of lengths.
    pub length: Option<LengthUnit>,
    /// Whether the poses are `a_from_b`, and not `b_from_a`.
    pub is_inverse: bool,
    /// Whether the target is on the gripper.
    pub eye_to_hand: bool,
}

/// A pose of a list.
#[derive(Debug, Clone, PartialEq)]
pub struct ListedPose {
    /// Name of its view; `None` where the file has none and poses go by place.
    pub view: Option<String>,
    /// The pose, metres: of a gripper `base_from_gripper`.
    pub b_from_a: Pose,
    /// What the file holds, where its rotation has three numbers.
    pub written: Option<WrittenPose>,
    /// Stated standard deviations per axis, rad and m.
    pub sigmas: Option<[f64; 2]>,
}

/// The poses of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseList {
    /// In the order of the file.
    pub poses: Vec<ListedPose>,
    /// The target in the camera frame, for each pose, in files that hold both.
    pub cam_from_target: Option<Vec<Pose>>,
    /// Whether the camera or the target is on the gripper, where the file states it.
    pub mounting: Option<Mounting>,
    /// What is unusual.
    pub remarks: Vec<String>,
}

/// Reads a list of poses, recognising its format by its content.
///
/// # Errors
/// With its line or pose: a convention that neither the file nor the options state, or that they state differently; numbers that are missing, not
/// finite or no rotation; poses that are all the same; other kinds of files.
pub fn read_pose_list(path: impl AsRef<Path>, options: &PoseListOptions) -> Result<PoseList, FileError> {
    let path = path.as_ref();
    crate::input::must_not_block(path)?;
    let is_table = match std::fs::metadata(path) {
        // A pipe can be read once, so that its content cannot choose the reader.
        Ok(found) => !found.is_file() || Kind::Literal.limit_bytes() < found.len(),
        Err(_) => false,
    };
    let list = match is_table {
        true => of_table(path, options)?,
        false => {
            let bytes = crate::input::read(path, Kind::Literal)?;
            match content(&bytes) {
                Content::Table => of_table(path, options)?,
                content => of_content(path, content, bytes, options).map_err(|fault| fault.in_file(path))?,
            }
        }
    };
    checked(list, options).map_err(|fault| fault.in_file(path))
}

/// Reads as `read_pose_list`, from text in memory (JSON or YAML); `name` is used in messages only.
///
/// # Errors
/// As of `read_pose_list`.
pub fn pose_list_from_text(name: &str, text: &str, options: &PoseListOptions) -> Result<PoseList, FileError> {
    let path = Path::new(name);
    let read = of_content(path, Content::Document, text.as_bytes().to_vec(), options);
    read.and_then(|list| checked(list, options)).map_err(|fault| fault.in_file(path))
}

/// Reads an array in memory: shape (n, 4, 4), (n, 7) or (n, 6); `name` is used in messages only.
///
/// # Errors
/// As of `read_pose_list`.
pub fn pose_list_of_array(
    name: &str,
    shape: &[usize],
    data: Vec<f64>,
    options: &PoseListOptions,
) -> Result<PoseList, FileError> {
    let array = arrays::Array { shape: shape.to_vec(), data, lines: Vec::new() };
    let read = arrays::poses(&array, options).and_then(|list| checked(list, options));
    read.map_err(|fault| fault.in_file(Path::new(name)))
}

/// What a file holds.
enum Content {
    NumPy,
    /// No text; what it is.
    Foreign(String),
    Rows(arrays::Array),
    /// A program of a robot's controller.
    Controller(Vec<controllers::Written>),
    Document,
    Table,
}

const ARCHIVE: &str = "a NumPy archive (.npz), which is not read here; save its array of poses alone: numpy.save(\"poses.npy\", numpy.load(FILE)[\"NAME\"])";
const PICKLE: &str = "a Python pickle, which is a program and is not run here; save its array of poses: numpy.save(\"poses.npy\", poses)";

fn content(bytes: &[u8]) -> Content {
    if bytes.starts_with(npy::MAGIC) {
        return Content::NumPy;
    }
    if let Some(what) = what_is_it::that_is_no_text(bytes) {
        let is_pickle = matches!(bytes, [0x80, 2..=5, ..]);
        return Content::Foreign(match what {
            what if what.contains("(.npz") => ARCHIVE.to_owned(),
            _ if is_pickle => PICKLE.to_owned(),
            what => what,
        });
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return Content::Document };
    if let Some(rows) = arrays::rows_of_numbers(text) {
        return Content::Rows(rows);
    }
    if let Some(written) = controllers::written(text) {
        return Content::Controller(written);
    }
    let significant = |line: &&str| !line.is_empty() && !line.starts_with('#');
    let text = text.trim_start_matches('\u{feff}');
    let first = text.lines().map(str::trim).find(significant).unwrap_or_default();
    let is_document =
        first.is_empty() || first.starts_with(['{', '[', '-', '%']) || first.contains([':', '=']);
    if is_document { Content::Document } else { Content::Table }
}

fn of_content(
    path: &Path,
    content: Content,
    bytes: Vec<u8>,
    options: &PoseListOptions,
) -> Result<PoseList, Fault> {
    match content {
        Content::NumPy => arrays::poses(&npy::array(&bytes)?, options),
        Content::Foreign(what) => Err(Fault::new(what)),
        Content::Rows(rows) => arrays::poses(&rows, options),
        Content::Controller(written) => controllers::poses(&written, options),
        Content::Document | Content::Table => {
            let document: Document = open::parse(path, bytes)?;
            documents::poses(&document.entry(), options)
        }
    }
}

/// Columns that name the view.
const VIEW: [&str; 5] = ["view", "image", "file", "filename", "name"];

fn of_table(path: &Path, options: &PoseListOptions) -> Result<PoseList, FileError> {
    let rows = Table::open(path, "view,qw,qx,qy,qz,x_m,y_m,z_m")?;
    let pairs = Pairs::of(rows.header(), options).map_err(|reason| rows.complaint(reason))?;
    let layout = match &pairs {
        Some(pairs) => Ok(pairs.robot.clone()),
        None => Layout::of(rows.header(), options),
    };
    let layout = layout.map_err(|reason| rows.complaint(reason))?;
    let view = VIEW.iter().find_map(|name| rows.find(name));
    let sigmas = (rows.find("sigma_deg"), rows.find("sigma_mm"));
    if sigmas.0.is_some() != sigmas.1.is_some() {
        return Err(rows.complaint("sigma_deg and sigma_mm belong together; one is missing"));
    }
    let (mut poses, mut seen) = (Vec::new(), Vec::new());
    rows.each(|row| {
        let name = match view.map(|column| (column, row.text(column))) {
            Some((column, None)) => {
                return Err(row.complaint(column, "is empty; a view's name is needed"));
            }
            found => found.and_then(|(_, text)| text).map(str::to_owned),
        };
        let pose = pose_of_row(&row, &layout)?;
        if let Some(pairs) = &pairs {
            seen.push(pose_of_row(&row, &pairs.target)?.b_from_a);
        }
        let own = row.optional_number(sigmas.0)?.zip(row.optional_number(sigmas.1)?);
        let sigmas = own.map(|(deg, mm)| [deg.to_radians(), 1e-3 * mm]);
        poses.push(ListedPose { view: name, sigmas, ..pose });
        Ok::<(), FileError>(())
    })?;
    let remarks = table::how_read(path).into_iter().collect();
    Ok(PoseList { poses, cam_from_target: pairs.map(|_| seen), mounting: None, remarks })
}

fn pose_of_row(row: &TableRow<'_>, layout: &Layout) -> Result<ListedPose, FileError> {
    let numbers = layout.columns().into_iter().map(|column| finite(row, column));
    let numbers: Vec<f64> = numbers.collect::<Result<_, _>>()?;
    let node = arrays::node(row.line as usize, &numbers);
    layout.pose(&Entry::called("", &node), &numbers).map_err(|fault| row.complaint_of(&fault.reason))
}

fn finite(row: &TableRow<'_>, column: usize) -> Result<f64, FileError> {
    let number = row.number(column)?;
    match number.is_finite() {
        true => Ok(number),
        false => Err(row.complaint(column, &format!("is {number}; a finite number is needed"))),
    }
}

/// The rotation of a pose.
enum Rotation {
    Wxyz([f64; 4]),
    Angles([f64; 3], RotationConvention),
    Matrix(Matrix3<f64>),
}

/// More than this is no angle of a robot, degrees.
const MAX_DEGREES: f64 = 720.0;

/// Puts a pose together.
fn pose_of(
    at: &Entry<'_>,
    rotation: &Rotation,
    t: Vector3<f64>,
    is_inverse: bool,
) -> Result<ListedPose, Fault> {
    let (written, pose) = match rotation {
        Rotation::Wxyz(wxyz) => (None, checks::quaternion_pose(at, *wxyz, t)?),
        Rotation::Matrix(matrix) => (None, Pose::new(checks::rotation(at, matrix)?, t)),
        Rotation::Angles(numbers, convention) => {
            let largest = match convention.order {
                RotationOrder::Vector => Vector3::from(*numbers).norm(),
                _ => numbers.iter().fold(0.0, |most: f64, x| most.max(x.abs())),
            };
            let (most, unit, hint) = match convention.unit {
                AngleUnit::Radians => (std::f64::consts::TAU, "rad", "is it in degrees?"),
                AngleUnit::Degrees => (MAX_DEGREES, "degrees", "is it a length?"),
            };
            if !(..=most + 1e-9).contains(&largest) {
                return Err(at.fault(format!(
                    "has an angle of {largest:.3} {unit}, read as {convention}; at most {most:.2} are accepted; {hint}"
                )));
            }
            let written =
                WrittenPose { rotation: *numbers, translation_m: t, convention: *convention, is_inverse };
            (Some(written), Pose::new(convention.rotation(*numbers), t))
        }
    };
    let b_from_a = if is_inverse { pose.inverse() } else { pose };
    Ok(ListedPose { view: None, b_from_a, written, sigmas: None })
}

/// A homogeneous matrix.
fn matrix_pose(at: &Entry<'_>, scale: f64, is_inverse: bool) -> Result<ListedPose, Fault> {
    let mut pose = checks::pose3x4_or_4x4(at)?;
    pose.translation *= scale;
    let b_from_a = if is_inverse { pose.inverse() } else { pose };
    Ok(ListedPose { view: None, b_from_a, written: None, sigmas: None })
}

/// Poses that differ by less are copies: far below the repeatability of a robot, rad and m.
const COPY: f64 = 1e-9;

/// Refuses lists without a pose, with a view twice, or of copies of one pose; adds remarks.
fn checked(mut list: PoseList, options: &PoseListOptions) -> Result<PoseList, Fault> {
    let poses = &list.poses;
    let mut views = BTreeSet::new();
    if let Some(view) = poses.iter().filter_map(|pose| pose.view.as_ref()).find(|view| !views.insert(*view)) {
        return Err(Fault::new(format!("has view `{view}` twice; give each view once")));
    }
    let is_copy = |a: &Pose, b: &Pose| {
        (a.rotation - b.rotation).amax() < COPY && (a.translation - b.translation).amax() < COPY
    };
    match &poses[..] {
        [] => return Err(Fault::new("no pose in it")),
        [_] => {}
        [first, others @ ..] if others.iter().all(|pose| is_copy(&first.b_from_a, &pose.b_from_a)) => {
            return Err(Fault::new(format!(
                "all {} poses are the same: the robot did not move, or one pose was saved again and again; poses that differ are needed",
                poses.len()
            )));
        }
        _ => {}
    }
    let n_copies = poses.windows(2).filter(|pair| is_copy(&pair[0].b_from_a, &pair[1].b_from_a)).count();
    if poses.len() < 3 * n_copies {
        list.remarks.push(format!(
            "{n_copies} of {} poses equal the one before: was the pose saved before the robot had moved?",
            poses.len()
        ));
    }
    let farthest_m = poses.iter().map(|pose| pose.b_from_a.translation.norm()).fold(0.0, f64::max);
    if options.length.is_none() {
        list.remarks.extend(checks::unit_warning("the farthest position", farthest_m));
    }
    let written: Vec<&WrittenPose> = list.poses.iter().filter_map(|pose| pose.written.as_ref()).collect();
    let is_small = |pose: &&WrittenPose| {
        pose.convention.unit == AngleUnit::Degrees
            && pose.rotation.iter().all(|angle| angle.abs() <= std::f64::consts::TAU)
    };
    if !written.is_empty() && written.iter().all(is_small) {
        list.remarks.push("no angle exceeds 6.3 degrees; are they in radians?".to_owned());
    }
    Ok(list)
}
