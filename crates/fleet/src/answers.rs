//! Answers as columns: one row per view, in the order of the views.

use nalgebra::Vector3;
use resight::PoseAnswer;
use resight::core::locate::PoseEstimate;
use resight::core::locate::choose::Ambiguity;
use resight::core::locate::consistency::Consistency;
use resight::core::{Error as MathError, Matrix6, Pose};
use resight::report::verdict::{self, Status, Verdict};
use std::collections::HashMap;

/// The answer of `core` for a view.
pub type Solved = Result<PoseEstimate, MathError>;

/// The fault of a row, found before it is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Its camera is not in the table.
    UnknownCamera,
    /// Neither the row nor its camera states the positions of the points.
    NoPoints,
    /// The numbers of pixels and points do not match.
    Counts {
        /// Points seen.
        seen: usize,
        /// Points known.
        known: usize,
    },
    /// A pixel, point or sigma that is missing, not finite or out of range.
    Number {
        /// The quantity.
        what: &'static str,
        /// Index of the point.
        point: usize,
        /// Its value; NaN where it is missing.
        value: f64,
    },
}

/// Numbers of an answer: quaternion, translation, the covariance's upper triangle row by row, probability, χ², rms.
pub const NUMBERS: usize = 31;
/// Column at which the covariance begins.
const COVARIANCE: usize = 7;
/// Column at which probability, χ² and rms begin.
const FIT: usize = 28;

/// Poses, covariances, probabilities and reasons.
#[derive(Debug, Clone, PartialEq)]
pub struct Answers {
    /// Returns whether the answer may be relied on.
    pub status: Vec<Status>,
    /// Points of each view.
    pub n_points: Vec<u32>,
    /// The columns, 0 where there is no pose: see [`NUMBERS`].
    pub numbers: Vec<Vec<f64>>,
    /// The reason why a row is not `ok`, by its number.
    pub reasons: HashMap<u32, String>,
}

/// Of rows whose second pose `solve` names.
const AMBIGUOUS: &str = "two poses fit; this is the more probable one, column `probability` says how much";

impl Answers {
    /// Rows without an answer yet.
    pub fn new(rows: usize) -> Self {
        Answers {
            status: vec![Status::Error; rows],
            n_points: vec![0; rows],
            numbers: vec![vec![0.0; rows]; NUMBERS],
            reasons: HashMap::new(),
        }
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.status.len()
    }

    /// Returns whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.status.is_empty()
    }

    /// The pose of a row and its covariance, `[rotation_rad; translation_m]`, camera frame.
    pub fn pose(&self, row: usize) -> Option<(Pose, Matrix6)> {
        self.status.get(row).filter(|status| status.has_pose())?;
        let at = |i: usize| self.numbers[i][row];
        let cam_from_target =
            Pose::from_quaternion_wxyz([at(0), at(1), at(2), at(3)], Vector3::new(at(4), at(5), at(6)));
        Some((cam_from_target, of_triangle(&self.covariance_triangle(row))))
    }

    /// Upper triangle, row by row, of the covariance of a row's pose; zeros where it has none.
    pub(crate) fn covariance_triangle(&self, row: usize) -> [f64; 21] {
        std::array::from_fn(|k| self.numbers[COVARIANCE + k][row])
    }

    /// A row that is not solved.
    pub(crate) fn refuse(&mut self, row: usize, fault: &Fault) {
        self.fail(row, reason_of(fault));
    }

    /// A row without a pose, and why.
    pub(crate) fn fail(&mut self, row: usize, reason: String) {
        self.status[row] = Status::Error;
        self.reasons.insert(row as u32, reason);
    }

    /// The answer of an image.
    pub(crate) fn take(&mut self, row: usize, answer: &PoseAnswer) {
        self.status[row] = answer.status();
        self.n_points[row] = answer.n_points as u32;
        if let Some(estimate) = answer.estimate.as_ref().filter(|_| answer.status().has_pose()) {
            self.set_numbers(row, estimate);
        }
        if answer.status() != Status::Ok {
            self.reasons.insert(row as u32, answer.verdict.message.clone());
        }
    }

    pub(crate) fn set(&mut self, row: usize, solved: &Solved) {
        match solved {
            Ok(estimate) => {
                self.status[row] = status_of(estimate);
                self.set_numbers(row, estimate);
                if let Some(reason) = doubt(estimate, self.status[row]) {
                    self.reasons.insert(row as u32, reason);
                }
            }
            Err(reason) => {
                let verdict = verdict::of_error(reason);
                self.status[row] = verdict.status;
                self.reasons.insert(row as u32, verdict.message);
            }
        }
    }

    /// Changes a row that is `ok` to `implausible`, for this remark on its points.
    pub(crate) fn doubt_size(&mut self, row: usize, remark: String) {
        let verdict = Verdict { status: self.status[row], message: "one pose fits".into() };
        let verdict = verdict.with_sizes(&[remark]);
        if verdict.status == Status::Implausible {
            self.status[row] = verdict.status;
            self.reasons.insert(row as u32, verdict.message);
        }
    }

    /// Stores the results of rows that were solved together; where that failed, each of them has the reason.
    pub(crate) fn set_all(&mut self, rows: &[u32], done: Result<usize, MathError>) {
        if let Err(reason) = done {
            rows.iter().for_each(|row| self.set(*row as usize, &Err(reason.clone())));
        }
    }

    fn set_numbers(&mut self, row: usize, estimate: &PoseEstimate) {
        let [w, x, y, z] = estimate.cam_from_target.quaternion_wxyz();
        let t = &estimate.cam_from_target.translation;
        for (i, value) in [w, x, y, z, t.x, t.y, t.z].into_iter().enumerate() {
            self.numbers[i][row] = value;
        }
        for (i, j, k) in upper_triangle() {
            self.numbers[COVARIANCE + k][row] = estimate.covariance[(i, j)];
        }
        for (i, value) in [estimate.probability, estimate.chi2, estimate.rms_px].into_iter().enumerate() {
            self.numbers[FIT + i][row] = value;
        }
    }
}

/// Row, column and place of each number of a symmetric 6×6 matrix, row by row.
pub fn upper_triangle() -> impl Iterator<Item = (usize, usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j))).enumerate().map(|(k, (i, j))| (i, j, k))
}

/// Returns the symmetric matrix whose upper triangle is given row by row.
pub(crate) fn of_triangle(triangle: &[f64; 21]) -> Matrix6 {
    let mut matrix = Matrix6::zeros();
    for (i, j, k) in upper_triangle() {
        matrix[(i, j)] = triangle[k];
        matrix[(j, i)] = triangle[k];
    }
    matrix
}

/// The rule of `report::verdict`, without its words.
fn status_of(estimate: &PoseEstimate) -> Status {
    match estimate.consistency {
        Consistency::Consistent => match estimate.ambiguity {
            Ambiguity::Ambiguous { .. } => Status::Ambiguous,
            Ambiguity::Unique { .. } => Status::Ok,
        },
        _ => Status::Inconsistent,
    }
}

fn doubt(estimate: &PoseEstimate, status: Status) -> Option<String> {
    match status {
        Status::Ok => None,
        Status::Ambiguous => Some(AMBIGUOUS.into()),
        _ => Some(verdict::of_estimate(estimate, |i| format!("point {i}"), "px").message),
    }
}

fn reason_of(fault: &Fault) -> String {
    match fault {
        Fault::UnknownCamera => "the camera of this row is not among the cameras; add it to --cameras".into(),
        Fault::NoPoints => {
            "neither this row nor its camera says where the points are; add x0_m … to the rows or to the cameras, or give --target".into()
        }
        Fault::Counts { seen, known } => {
            format!("{seen} points are seen and {known} are known; as many of each are needed, in the same order")
        }
        Fault::Number { what: "sigma_px", value, .. } => {
            format!("sigma_px is {value}; a positive number of pixels is needed")
        }
        Fault::Number { what, point, value } if value.is_nan() => {
            format!("{what} {point} is missing or not a number; leave the row out or correct it")
        }
        Fault::Number { what, point, value } => {
            format!("{what} {point} is {value:e}, which is no finite number below 1e60; check the unit")
        }
    }
}
