//! contacts.csv: one row for every reading, in its order, SI units, world frame; unknown cells are empty.

mod object;
mod read;

pub use object::ContactObject;
pub use read::read;

use super::line::{self, Cells, Layout};
use crate::estimate::{ContactEstimate, Mode, Status};
use crate::events::{Change, Label};
use crate::{Rod, Sample};
use nalgebra::{Matrix3, Vector2};
use object::COLUMNS;
use serde_json::{Value, json};

/// What is said of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowStatus {
    /// The verdict on a complete reading.
    Read(Status),
    /// A cell of the reading is empty.
    Missing,
    /// The line could not be read (only in a stream, which continues).
    Error,
}

const STATUSES: [(RowStatus, &str); 8] = [
    (RowStatus::Read(Status::Ok), "ok"),
    (RowStatus::Read(Status::NoContact), "no_contact"),
    (RowStatus::Read(Status::LowForce), "low_force"),
    (RowStatus::Read(Status::NoZero), "no_zero"),
    (RowStatus::Read(Status::BeyondTip), "beyond_tip"),
    (RowStatus::Read(Status::Inconsistent), "inconsistent"),
    (RowStatus::Missing, "missing"),
    (RowStatus::Error, "error"),
];
const MODES: [(Mode, &str); 3] = [(Mode::Free, "free"), (Mode::Mid, "mid"), (Mode::Tip, "tip")];

const FEATURES: [(Label, &str); 4] = [
    (Label::Corner, "corner"),
    (Label::Tangent, "tangent"),
    (Label::Tip, "tip"),
    (Label::Undecided, "undecided"),
];
const EVENTS: [(Change, &str); 3] =
    [(Change::Touch, "touch"), (Change::Release, "release"), (Change::SlipOff, "slip_off")];
const SIDES: [(Side, &str); 2] = [(Side::Left, "left"), (Side::Right, "right")];

/// The file's word for a value; none where it has none.
fn word<T: PartialEq>(table: &[(T, &'static str)], value: &T) -> Option<&'static str> {
    table.iter().find(|(known, _)| known == value).map(|(_, word)| *word)
}

impl RowStatus {
    /// The file's word.
    pub fn name(self) -> &'static str {
        word(&STATUSES, &self).unwrap_or("error")
    }

    /// Every word there is, in the order in which they are counted.
    pub fn names() -> [&'static str; 8] {
        STATUSES.map(|(_, name)| name)
    }

    /// Whether something is touched.
    pub fn is_touching(self) -> bool {
        matches!(self, RowStatus::Read(status) if status != Status::NoContact)
    }
}

/// The file's word for a mode.
pub fn mode_name(mode: Mode) -> &'static str {
    word(&MODES, &mode).unwrap_or("free")
}

/// On which side of the whisker, looking from clamp to tip, the object lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The moment is negative.
    Left,
    /// The moment is positive.
    Right,
}

impl Side {
    /// Of a moment; none where it is 0.
    pub fn of_moment(mz_n_m: f64) -> Option<Self> {
        match mz_n_m {
            m if 0.0 < m => Some(Side::Right),
            m if m < 0.0 => Some(Side::Left),
            _ => None,
        }
    }

    /// The file's word.
    pub fn name(self) -> &'static str {
        if self == Side::Right { "right" } else { "left" }
    }

    /// Sign of the moment.
    pub fn moment_sign(self) -> f64 {
        if self == Side::Right { 1.0 } else { -1.0 }
    }
}

/// The contact's numbers, world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// The point of the centre line, metres.
    pub x_in_world: Vector2<f64>,
    /// Arc length, metres.
    pub s_m: f64,
    /// Its standard deviation, metres; none in files that do not say.
    pub s_sigma_m: Option<f64>,
    /// Direction of the whisker there, radians.
    pub theta_rad: f64,
    /// Across the whisker, away from the object, newtons.
    pub f_normal_n: f64,
    /// Along it, towards the tip, newtons.
    pub f_tangent_n: f64,
    /// asin(F·t/|F|), radians.
    pub friction_angle_rad: f64,
    /// Its standard deviation, radians; none in files that do not say.
    pub friction_angle_sigma_rad: Option<f64>,
    /// k² of the elastica.
    pub k2: f64,
    /// Of `[x, y, θ]`, m², m·rad, rad²; the entries of θ are NaN in files that do not say.
    pub covariance: Matrix3<f64>,
    /// The whisker's radius there, metres: so far from the outline lies the point, along the normal.
    pub radius_m: f64,
}

/// What a six-axis cell adds, world frame: the plane of the hub's motion is z = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spatial {
    /// Height of the contact above the plane, metres; none where there is no contact.
    pub z_m: Option<f64>,
    /// Covariance of x, y and z with z, m².
    pub covariance_z: Option<[f64; 3]>,
    /// Turn about the clamped whisker from the plane of the hub's motion to the plane of bending, radians.
    pub roll_rad: f64,
    /// Its standard deviation, radians.
    pub roll_sigma_rad: f64,
    /// Probability of signals as far from one force in one plane.
    pub plane_p: f64,
}

/// One row.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactRow {
    /// Which sweep.
    pub sweep: u32,
    /// Which sample of it.
    pub sample: u32,
    /// When, seconds.
    pub t_s: Option<f64>,
    /// The verdict.
    pub status: RowStatus,
    /// Where on the whisker.
    pub mode: Mode,
    /// Probability of that mode.
    pub mode_probability: f64,
    /// The numbers; none where nothing is touched or the moment never vanishes.
    pub figures: Option<Figures>,
    /// Where the object lies; none where nothing is touched.
    pub side: Option<Side>,
    /// Which zero of the moment the contact is, counted from 0 at the clamp.
    pub branch: u32,
    /// Arc lengths of the other zeros on the whisker, metres.
    pub other_s_m: Vec<f64>,
    /// What is touched, where the contacts around it tell.
    pub feature: Option<Label>,
    /// What changed with this reading: touch, release or slip-off.
    pub event: Change,
    /// Hub steps until the whisker slips off, and their standard deviation; none where that was not asked or is not predicted.
    pub steps_to_slip_off: Option<[f64; 2]>,
    /// Of a six-axis cell; none where nothing bends the whisker in a plane.
    pub spatial: Option<Spatial>,
    /// Why there is no more to say; empty where nothing is amiss.
    pub note: String,
}

impl ContactRow {
    /// Of an estimate.
    pub fn new(rod: &Rod, sample: &Sample, estimate: &ContactEstimate) -> Self {
        let status = RowStatus::Read(estimate.status);
        let is_touching = status.is_touching();
        ContactRow {
            mode: estimate.mode,
            mode_probability: estimate.mode_probability,
            figures: estimate.contact.filter(|_| is_touching).map(|contact| figures(rod, &contact)),
            side: Side::of_moment(sample.load.mz_n_m).filter(|_| is_touching),
            other_s_m: estimate.branches.iter().map(|branch| branch.s_m).collect(),
            ..ContactRow::blank(sample.sweep, sample.sample, sample.t_s, status)
        }
    }

    /// A row about which nothing is known.
    pub fn blank(sweep: u32, sample: u32, t_s: Option<f64>, status: RowStatus) -> Self {
        ContactRow {
            sweep,
            sample,
            t_s,
            status,
            mode: Mode::Free,
            mode_probability: 0.0,
            figures: None,
            side: None,
            branch: 0,
            other_s_m: Vec::new(),
            feature: None,
            event: Change::None,
            steps_to_slip_off: None,
            spatial: None,
            note: String::new(),
        }
    }

    /// A reading with empty cells.
    pub fn missing(sweep: u32, sample: u32, t_s: Option<f64>, cells: &[String]) -> Self {
        let verb = if cells.len() == 1 { "is" } else { "are" };
        ContactRow {
            note: format!("{} {verb} empty", cells.join(" ")),
            ..ContactRow::blank(sweep, sample, t_s, RowStatus::Missing)
        }
    }

    /// Whether its point may be used without a second thought.
    pub fn is_ok(&self) -> bool {
        self.status == RowStatus::Read(Status::Ok)
    }
}

fn figures(rod: &Rod, contact: &crate::estimate::Contact) -> Figures {
    Figures {
        x_in_world: contact.x_in_world,
        s_m: contact.s_m,
        s_sigma_m: Some(contact.s_sigma_m),
        theta_rad: contact.theta_rad,
        f_normal_n: contact.f_normal_n,
        f_tangent_n: contact.f_tangent_n,
        friction_angle_rad: contact.friction_angle_rad,
        friction_angle_sigma_rad: Some(contact.friction_angle_sigma_rad),
        k2: contact.modulus_squared,
        covariance: contact.covariance,
        radius_m: 0.5 * rod.diameter_m_at(contact.s_m),
    }
}

/// The header line of a contacts file, without its end.
pub fn header() -> String {
    COLUMNS.join(",")
}

/// A row as a line of CSV, without its end. Numbers read back are the same numbers.
pub fn to_csv(row: &ContactRow) -> String {
    let json = json!(ContactObject::from(row));
    COLUMNS.iter().map(|name| cell(&json[*name])).collect::<Vec<_>>().join(",")
}

fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) if text.contains([',', '"', '\n', ';']) => {
            format!("\"{}\"", text.replace('"', "\"\""))
        }
        Value::String(text) => text.clone(),
        Value::Array(list) => list.iter().map(Value::to_string).collect::<Vec<_>>().join(";"),
        number => number.to_string(),
    }
}

/// A whole contacts file.
pub fn write_csv(rows: &[ContactRow]) -> String {
    let mut out = header() + "\n";
    for row in rows {
        out += &(to_csv(row) + "\n");
    }
    out
}

/// Returns whether a text is a contacts file, by its first line.
pub fn is_contacts(text: &str) -> bool {
    let first = line::lines(text).next().and_then(|(line, text)| {
        let layout = Layout::of_first_line(line, text).ok()?;
        Some((layout.clone(), line::read(&layout, line, text).ok()?))
    });
    match first {
        Some((Layout::Csv { header, .. }, _)) => header.iter().any(|name| name == "status"),
        Some((_, Cells::Object(object))) => object.contains_key("status"),
        _ => false,
    }
}
