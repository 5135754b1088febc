//! Which columns of a table hold a pose, and what their names state about it.

use super::arrays::scale;
use super::words::{LengthUnit, RotationFormat, RotationWord, WHERE, choices};
use super::{ListedPose, PoseListOptions, Rotation, pose_of};
use crate::core::multiview::hand_eye::{AngleUnit, RotationConvention, RotationOrder};
use crate::document::Fault;
use crate::entry::Entry;
use nalgebra::{Matrix3, Vector3};

/// The columns of two poses in a row: each name begins with what the pose maps.
pub(super) struct Pairs {
    pub robot: Layout,
    pub target: Layout,
}

const TARGET: &str = "cam_from_target_";
/// Beginnings of the robot's columns, and whether its poses are inverse.
const ROBOT: [(&str, bool); 2] = [("base_from_gripper_", false), ("gripper_from_base_", true)];

impl Pairs {
    /// Finds the columns of both; none where no name begins so.
    ///
    /// # Errors
    /// As of `Layout::of`; a direction that the option states too; the target's columns alone.
    pub fn of(names: &[String], options: &PoseListOptions) -> Result<Option<Self>, String> {
        let is_there = |begin: &str| names.iter().any(|name| name.starts_with(begin));
        if !is_there(TARGET) {
            return Ok(None);
        }
        let Some((begin, is_inverse)) = ROBOT.into_iter().find(|(begin, _)| is_there(begin)) else {
            return Err(format!(
                "columns `{TARGET}…` need `base_from_gripper_…` beside them, the robot's pose in the same row"
            ));
        };
        if options.is_inverse {
            return Err(format!(
                "columns `{begin}…` state their direction; leave out the option that they are inverse"
            ));
        }
        // Places stay those of the whole header.
        let of = |begin: &str, options: &PoseListOptions| {
            let own = names.iter().map(|name| name.strip_prefix(begin).unwrap_or_default().to_owned());
            Layout::of(&own.collect::<Vec<_>>(), options)
        };
        let target =
            of(TARGET, &PoseListOptions { rotation: None, length: None, is_inverse: false, ..*options })?;
        Ok(Some(Pairs { robot: of(begin, &PoseListOptions { is_inverse, ..*options })?, target }))
    }
}

/// The columns of a pose.
#[derive(Clone)]
pub(super) struct Layout {
    /// Columns of the rotation: w, x, y, z; three numbers; or a 3×3 matrix row by row.
    rotation: Vec<usize>,
    meaning: Meaning,
    translation: [usize; 3],
    scale: f64,
    is_inverse: bool,
}

#[derive(Clone, Copy)]
enum Meaning {
    Wxyz,
    Angles(RotationConvention),
    Matrix,
}

/// The last part of a column's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Unit {
    Length(LengthUnit),
    Angle(AngleUnit),
}

/// A column's name without its unit, in small letters.
struct Column {
    stem: String,
    unit: Option<Unit>,
}

fn unit_of(word: &str) -> Option<Unit> {
    match word {
        "deg" | "degrees" | "°" => Some(Unit::Angle(AngleUnit::Degrees)),
        "rad" | "radians" => Some(Unit::Angle(AngleUnit::Radians)),
        _ => LengthUnit::parse(word).ok().map(Unit::Length),
    }
}

impl Column {
    fn of(name: &str) -> Self {
        let name = name.trim().to_lowercase();
        let split = match name.strip_suffix([']', ')']) {
            Some(opened) => opened.rsplit_once(['[', '(']),
            None => name.rsplit_once('_'),
        };
        let found = split.and_then(|(stem, unit)| Some((stem.trim().to_owned(), unit_of(unit.trim())?)));
        match found {
            Some((stem, unit)) => Column { stem, unit: Some(unit) },
            None => Column { stem: name, unit: None },
        }
    }
}

/// Names of a position.
const POSITIONS: [[&str; 3]; 6] = [
    ["x", "y", "z"],
    ["tx", "ty", "tz"],
    ["px", "py", "pz"],
    ["pos_x", "pos_y", "pos_z"],
    ["position_x", "position_y", "position_z"],
    ["translation_x", "translation_y", "translation_z"],
];

/// Names that state which number of a quaternion is the scalar.
const QUATERNIONS: [[&str; 4]; 5] = [
    ["qw", "qx", "qy", "qz"],
    ["q_w", "q_x", "q_y", "q_z"],
    ["quat_w", "quat_x", "quat_y", "quat_z"],
    ["orientation_w", "orientation_x", "orientation_y", "orientation_z"],
    ["rotation_w", "rotation_x", "rotation_y", "rotation_z"],
];

/// Names that do not.
const BARE_QUATERNIONS: [[&str; 4]; 2] = [["q1", "q2", "q3", "q4"], ["q0", "q1", "q2", "q3"]];

/// Names that state the axes, and the unit where only one is in use.
const ANGLES: [([&str; 3], RotationOrder, Option<AngleUnit>); 7] = [
    (["rotvec_x", "rotvec_y", "rotvec_z"], RotationOrder::Vector, None),
    (["rvec_x", "rvec_y", "rvec_z"], RotationOrder::Vector, None),
    (["rv_x", "rv_y", "rv_z"], RotationOrder::Vector, None),
    (["roll", "pitch", "yaw"], RotationOrder::FixedXyz, None),
    (["w", "p", "r"], RotationOrder::FixedXyz, Some(AngleUnit::Degrees)),
    (["ex", "ey", "ez"], RotationOrder::FixedXyz, Some(AngleUnit::Degrees)),
    (["o", "a", "t"], RotationOrder::MovingZyz, Some(AngleUnit::Degrees)),
];

/// Names that several makers use differently, and the orders that they may mean: those by axis name no rotation about z first.
const BARE_ANGLES: [([&str; 3], &[RotationOrder]); 3] = [
    (["rx", "ry", "rz"], &[RotationOrder::Vector, RotationOrder::FixedXyz, RotationOrder::MovingXyz]),
    (["a", "b", "c"], &[RotationOrder::FixedXyz, RotationOrder::MovingZyx]),
    (
        ["alpha", "beta", "gamma"],
        &[
            RotationOrder::FixedXyz,
            RotationOrder::MovingXyz,
            RotationOrder::MovingZyx,
            RotationOrder::MovingZyz,
        ],
    ),
];

/// Names of matrices, by row and column from 1 or 0.
const MATRICES: [(&str, usize); 5] = [("r", 1), ("r", 0), ("m", 0), ("m", 1), ("t", 0)];

struct Header<'h> {
    names: &'h [String],
    columns: Vec<Column>,
}

impl Header<'_> {
    fn all<const N: usize>(&self, stems: &[&str; N]) -> Option<[usize; N]> {
        let mut at = [0; N];
        for (at, stem) in at.iter_mut().zip(stems) {
            *at = self.columns.iter().position(|column| column.stem == **stem)?;
        }
        Some(at)
    }

    /// Returns the unit that columns share.
    fn unit(&self, columns: &[usize]) -> Result<Option<Unit>, String> {
        let units: Vec<Option<Unit>> = columns.iter().map(|at| self.columns[*at].unit).collect();
        match units.iter().all(|unit| *unit == units[0]) {
            true => Ok(units[0]),
            false => Err(format!("columns {} have different units; write all in one", self.written(columns))),
        }
    }

    fn written(&self, columns: &[usize]) -> String {
        columns.iter().map(|at| self.names[*at].as_str()).collect::<Vec<_>>().join(",")
    }

    fn matrix(&self) -> Option<(Vec<usize>, Option<[usize; 3]>)> {
        MATRICES.iter().find_map(|(letter, from)| {
            let cell = |row: usize, column: usize| {
                let stem = format!("{letter}{}{}", row + from, column + from);
                self.columns.iter().position(|column| column.stem == stem)
            };
            let rotation = (0..9).map(|i| cell(i / 3, i % 3)).collect::<Option<Vec<usize>>>()?;
            let last = [cell(0, 3), cell(1, 3), cell(2, 3)];
            Some((rotation, last[0].zip(last[1]).zip(last[2]).map(|((x, y), z)| [x, y, z])))
        })
    }
}

impl Layout {
    /// Finds the columns of a pose.
    ///
    /// # Errors
    /// A rotation or position that is missing, there twice, or of a convention that nothing states.
    pub fn of(names: &[String], options: &PoseListOptions) -> Result<Self, String> {
        let header = Header { names, columns: names.iter().map(|name| Column::of(name)).collect() };
        let (rotation, meaning, position) = rotation(&header, options)?;
        let position = position.or_else(|| POSITIONS.iter().find_map(|stems| header.all(stems)));
        let translation = position.ok_or_else(|| {
            format!("no column `x_m`; the columns are {}; the position is x_m,y_m,z_m", names.join(","))
        })?;
        let scale = match header.unit(&translation)? {
            Some(Unit::Angle(_)) => {
                return Err(format!("columns {}: a position is no angle", header.written(&translation)));
            }
            Some(Unit::Length(unit)) if options.length.is_some_and(|stated| stated != unit) => {
                return Err(format!(
                    "columns {} state another unit of length than the option; leave one of them out",
                    header.written(&translation)
                ));
            }
            Some(Unit::Length(unit)) => unit.in_m(),
            None => scale(options),
        };
        Ok(Layout { rotation, meaning, translation, scale, is_inverse: options.is_inverse })
    }

    /// Returns the columns whose numbers `pose` takes, in its order.
    pub fn columns(&self) -> Vec<usize> {
        self.rotation.iter().chain(&self.translation).copied().collect()
    }

    /// Puts the pose of a row together.
    pub fn pose(&self, at: &Entry<'_>, numbers: &[f64]) -> Result<ListedPose, Fault> {
        let (r, t) = numbers.split_at(self.rotation.len());
        let t = Vector3::from_row_slice(t) * self.scale;
        let rotation = match self.meaning {
            Meaning::Wxyz => Rotation::Wxyz([r[0], r[1], r[2], r[3]]),
            Meaning::Angles(convention) => Rotation::Angles([r[0], r[1], r[2]], convention),
            Meaning::Matrix => Rotation::Matrix(Matrix3::from_row_slice(r)),
        };
        pose_of(at, &rotation, t, self.is_inverse)
    }
}

type Found = (Vec<usize>, Meaning, Option<[usize; 3]>);

/// Finds the one rotation of a table.
fn rotation(header: &Header<'_>, options: &PoseListOptions) -> Result<Found, String> {
    let mut found: Vec<Result<Found, String>> = Vec::new();
    if let Some(columns) = QUATERNIONS.iter().find_map(|stems| header.all(stems)) {
        // The names state the order, in which the option can change nothing.
        let is_quaternion = |word: RotationWord| !matches!(word.format, RotationFormat::Angles(_));
        found.push(match options.rotation.filter(|word| !is_quaternion(*word)) {
            Some(word) => Err(contradicts(header, &columns, word)),
            None => Ok((columns.to_vec(), Meaning::Wxyz, None)),
        });
    } else if let Some(columns) = BARE_QUATERNIONS.iter().find_map(|stems| header.all(stems)) {
        found.push(bare_quaternion(header, columns, options));
    }
    for (stems, order, unit) in &ANGLES {
        if let Some(columns) = header.all(stems) {
            let angles = angles(header, columns, &[*order], *unit, options);
            found.push(angles.map(|meaning| (columns.to_vec(), meaning, None)));
        }
    }
    for (stems, orders) in &BARE_ANGLES {
        if let Some(columns) = header.all(stems) {
            let angles = angles(header, columns, orders, None, options);
            found.push(angles.map(|meaning| (columns.to_vec(), meaning, None)));
        }
    }
    if let Some((columns, position)) = header.matrix() {
        found.push(match options.rotation {
            Some(word) => Err(contradicts(header, &columns, word)),
            None => Ok((columns, Meaning::Matrix, position)),
        });
    }
    let n_found = found.len();
    match (found.pop(), n_found) {
        (Some(only), 1) => only,
        (Some(_), _) => Err("the columns hold several rotations; keep one of them".to_owned()),
        (None, _) => Err(format!(
            "no column `qw`; the columns are {}; a rotation is qw,qx,qy,qz, or r11 to r33, or three angles: {WHERE}",
            header.names.join(",")
        )),
    }
}

fn contradicts(header: &Header<'_>, columns: &[usize], word: RotationWord) -> String {
    format!(
        "columns {} are no rotation of the stated convention `{}`; leave it out, or name the columns otherwise",
        header.written(columns),
        word.word
    )
}

fn bare_quaternion(
    header: &Header<'_>,
    columns: [usize; 4],
    options: &PoseListOptions,
) -> Result<Found, String> {
    let mut wxyz = columns.to_vec();
    match options.rotation.map(|word| word.format) {
        Some(RotationFormat::QuaternionWxyz) => {}
        Some(RotationFormat::QuaternionXyzw) => wxyz.rotate_right(1),
        _ => {
            let choices = choices(|word| !matches!(word.format, RotationFormat::Angles(_)));
            return Err(format!(
                "columns {}: the order of the quaternion must be named: {choices} by `--rotation`, or name the columns qw,qx,qy,qz",
                header.written(&columns)
            ));
        }
    }
    Ok((wxyz, Meaning::Wxyz, None))
}

/// Returns what three columns mean, whose names may state the unit, and leave the orders of `orders` open.
fn angles(
    header: &Header<'_>,
    columns: [usize; 3],
    orders: &[RotationOrder],
    only_unit: Option<AngleUnit>,
    options: &PoseListOptions,
) -> Result<Meaning, String> {
    let unit = match header.unit(&columns)? {
        Some(Unit::Angle(unit)) => Some(unit),
        Some(Unit::Length(_)) => {
            return Err(format!("columns {}: a rotation is no length", header.written(&columns)));
        }
        None => only_unit,
    };
    let fits = |word: &RotationWord| match word.format {
        RotationFormat::Angles(convention) => {
            orders.contains(&convention.order) && unit.is_none_or(|unit| unit == convention.unit)
        }
        _ => false,
    };
    match (options.rotation, orders, unit) {
        (Some(word), ..) if !fits(&word) => Err(contradicts(header, &columns, word)),
        (Some(RotationWord { format: RotationFormat::Angles(convention), .. }), ..) => {
            Ok(Meaning::Angles(convention))
        }
        (_, [order], Some(unit)) => Ok(Meaning::Angles(RotationConvention { order: *order, unit })),
        _ => Err(format!(
            "columns {} may mean several rotations; {}: {WHERE}",
            header.written(&columns),
            choices(fits)
        )),
    }
}
