//! Hub readings: `sweep, sample, t, hub_angle, hub_x, hub_y, fx, fy, mz` in any order, units in the header or by default; of a six-axis
//! cell also `fz, mx, my`.

use super::TextError;
use super::line::{self, Cells, Layout};
use super::units::{Quantity, Units};
use crate::{HubLoad, PlanarPose, Sample};
use nalgebra::Vector2;
use std::ops::Range;

/// In which axes the load cell reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ForceFrame {
    /// It turns with the hub: x along the clamped whisker, y to its left.
    #[default]
    Hub,
    /// It stands still.
    World,
}

/// Whose force the load cell reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sign {
    /// What the whisker exerts on the hub.
    #[default]
    OnHub,
    /// What the hub exerts on the whisker: the opposite.
    OnWhisker,
}

/// How readings are meant where their header does not say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Conventions {
    /// Units of columns without one.
    pub units: Units,
    /// Axes of fx and fy.
    pub force_frame: ForceFrame,
    /// Sign of fx, fy and mz.
    pub sign: Sign,
}

/// The columns, in the order of `Field`.
const COLUMNS: [(&str, Quantity, &[&str]); 12] = [
    ("sweep", Quantity::Count, &[]),
    ("sample", Quantity::Count, &[]),
    ("t", Quantity::Time, &["time", "timestamp"]),
    ("hub_angle", Quantity::Angle, &["psi"]),
    ("hub_x", Quantity::Length, &[]),
    ("hub_y", Quantity::Length, &[]),
    ("fx", Quantity::Force, &[]),
    ("fy", Quantity::Force, &[]),
    ("mz", Quantity::Moment, &["tz"]),
    ("fz", Quantity::Force, &[]),
    ("mx", Quantity::Moment, &["tx"]),
    ("my", Quantity::Moment, &["ty"]),
];
/// Those of `COLUMNS` without which a reading says nothing.
const NEEDED: Range<usize> = 3..9;
/// Those of `COLUMNS` that a six-axis cell has besides, all three or none.
const SIX_AXIS: Range<usize> = 9..12;

/// Where a column is and what one of its units is.
#[derive(Debug, Clone, PartialEq)]
struct Column {
    index: usize,
    /// As the file writes it.
    name: String,
    factor: f64,
}

/// How the lines of one source are read.
#[derive(Debug, Clone, PartialEq)]
pub struct HubFormat {
    layout: Layout,
    /// Of a CSV text from its header; of JSON Lines from the latest object.
    columns: [Option<Column>; 12],
    /// How many keys the object had that they are of.
    keys: usize,
    conventions: Conventions,
    /// Number of the next sample where the file has none: the sweep it counts in, and how many it has had.
    counted: (u32, u32),
}

/// What one line said.
#[derive(Debug, Clone, PartialEq)]
pub struct HubRow {
    /// Line in the text, counted from 1.
    pub line: u64,
    /// Which sweep; 0 where the file has no such column.
    pub sweep: u32,
    /// Which sample of the sweep; counted where the file has no such column.
    pub sample: u32,
    /// When, seconds.
    pub t_s: Option<f64>,
    /// The reading, SI and hub axes, or the names of the cells that are empty.
    pub reading: Result<Sample, Vec<String>>,
    /// Of a six-axis cell what acts out of the plane: fz, mx, my; N, N·m, N·m, hub axes.
    pub out_of_plane: Option<[f64; 3]>,
}

/// Reads a whole text.
///
/// # Errors
/// A line that cannot be read, with its number and column; a text without rows. Empty cells are no error.
pub fn read_hub(text: &str, conventions: Conventions) -> Result<Vec<HubRow>, TextError> {
    let mut lines = line::lines(text).peekable();
    let Some((first, header)) = lines.peek().copied() else {
        return Err(TextError::whole(format!("no readings; a header line {} is needed", names())));
    };
    let mut format = HubFormat::of_first_line(first, header, conventions)?;
    if !format.is_json_lines() {
        lines.next();
    }
    let rows: Vec<HubRow> = lines.map(|(line, text)| format.row(line, text)).collect::<Result<_, _>>()?;
    match rows.is_empty() {
        true => Err(TextError::whole("no rows below the header")),
        false => Ok(rows),
    }
}

fn names() -> String {
    COLUMNS.map(|(name, ..)| name)[..NEEDED.end].join(",")
}

impl HubFormat {
    /// Told by the first line that says something.
    ///
    /// # Errors
    /// A needed column is missing, or has a unit of another kind.
    pub fn of_first_line(line: u64, text: &str, conventions: Conventions) -> Result<Self, TextError> {
        let layout = Layout::of_first_line(line, text.trim_start_matches('\u{feff}'))?;
        let none = [const { None }; 12];
        let mut format = HubFormat { layout, columns: none, keys: 0, conventions, counted: (0, 0) };
        if let Layout::Csv { header, .. } = &format.layout {
            format.columns = columns(line, header, &conventions.units)?;
        }
        Ok(format)
    }

    /// Whether the first line was already a reading.
    pub fn is_json_lines(&self) -> bool {
        self.layout == Layout::JsonLines
    }

    /// Reads one line below the header.
    ///
    /// # Errors
    /// The line, the column, what was seen and what is needed.
    pub fn row(&mut self, line: u64, text: &str) -> Result<HubRow, TextError> {
        let cells = line::read(&self.layout, line, text.trim_start_matches('\u{feff}'))?;
        if let Cells::Object(object) = &cells {
            self.match_keys(line, object)?;
        }
        let mut values = [None; 12];
        for (value, column) in values.iter_mut().zip(&self.columns) {
            if let Some(column) = column {
                let seen = line::number(&cells, line, column.index, &column.name)?;
                *value = seen.map(|x| x * column.factor);
            }
        }
        let (sweep, sample) = self.numbers(line, &values)?;
        let reading = self.reading(sweep, sample, &values);
        let out_of_plane = reading.as_ref().ok().and_then(|sample| self.out_of_plane(sample, &values));
        Ok(HubRow { line, sweep, sample, t_s: values[2], reading, out_of_plane })
    }

    /// Objects may change their keys; those of the line before are the likely ones.
    fn match_keys(
        &mut self,
        line: u64,
        object: &serde_json::Map<String, serde_json::Value>,
    ) -> Result<(), TextError> {
        let known = |column: &Option<Column>| column.as_ref().is_some_and(|c| object.contains_key(&c.name));
        if self.keys != object.len() || !self.columns[NEEDED].iter().all(known) {
            self.keys = object.len();
            let keys: Vec<String> = object.keys().cloned().collect();
            self.columns = columns(line, &keys, &self.conventions.units)?;
        }
        Ok(())
    }

    fn numbers(&mut self, line: u64, values: &[Option<f64>; 12]) -> Result<(u32, u32), TextError> {
        let whole = |i: usize| match values[i] {
            None => Ok(None),
            Some(x) if x.fract() == 0.0 && 0.0 <= x && x <= f64::from(u32::MAX) => Ok(Some(x as u32)),
            Some(x) => {
                let name = COLUMNS[i].0;
                Err(TextError::at(line, format!("column `{name}` is {x}; a whole number from 0 is needed")))
            }
        };
        let sweep = whole(0)?.unwrap_or(0);
        let next = if self.counted.0 == sweep { self.counted.1 } else { 0 };
        let sample = whole(1)?.unwrap_or(next);
        self.counted = (sweep, next + 1);
        Ok((sweep, sample))
    }

    fn reading(&self, sweep: u32, sample: u32, values: &[Option<f64>; 12]) -> Result<Sample, Vec<String>> {
        let is_asked = |i: &usize| NEEDED.contains(i) || self.columns[*i].is_some();
        let missing: Vec<usize> =
            (NEEDED.start..SIX_AXIS.end).filter(is_asked).filter(|i| values[*i].is_none()).collect();
        let [_, _, t_s, Some(angle_rad), Some(x_m), Some(y_m), Some(fx), Some(fy), Some(mz), ..] = *values
        else {
            return Err(named(&missing));
        };
        if !missing.is_empty() {
            return Err(named(&missing));
        }
        let world_from_hub = PlanarPose { x_m, y_m, angle_rad };
        let force = self.in_hub(&world_from_hub, fx, fy);
        let load = HubLoad { fx_n: force.x, fy_n: force.y, mz_n_m: self.sign() * mz };
        Ok(Sample { sweep, sample, t_s, world_from_hub, load })
    }

    fn out_of_plane(&self, sample: &Sample, values: &[Option<f64>; 12]) -> Option<[f64; 3]> {
        let (fz, mx, my) = (values[9]?, values[10]?, values[11]?);
        let moment = self.in_hub(&sample.world_from_hub, mx, my);
        Some([self.sign() * fz, moment.x, moment.y])
    }

    fn sign(&self) -> f64 {
        match self.conventions.sign {
            Sign::OnHub => 1.0,
            Sign::OnWhisker => -1.0,
        }
    }

    /// The x and y of a force or a moment as the cell says them, in hub axes and with our sign.
    fn in_hub(&self, world_from_hub: &PlanarPose, x: f64, y: f64) -> Vector2<f64> {
        match self.conventions.force_frame {
            ForceFrame::Hub => Vector2::new(x, y) * self.sign(),
            ForceFrame::World => world_from_hub.rotate_back(Vector2::new(x, y)) * self.sign(),
        }
    }
}

fn named(columns: &[usize]) -> Vec<String> {
    columns.iter().map(|i| COLUMNS[*i].0.to_string()).collect()
}

/// Finds the columns in a header; in JSON Lines also the keys of one object.
fn columns(line: u64, header: &[String], units: &Units) -> Result<[Option<Column>; 12], TextError> {
    let mut found = [const { None }; 12];
    for (index, name) in header.iter().enumerate() {
        let Some((field, unit)) = field(name) else { continue };
        let (canonical, quantity, _) = COLUMNS[field];
        let factor = match unit {
            None => units.of(quantity),
            Some(unit) => quantity.factor(unit).ok_or_else(|| {
                let known = quantity.known();
                TextError::at(
                    line,
                    format!("column `{name}`: `{unit}` is no unit of {}; there are {known}", quantity.name()),
                )
            })?,
        };
        if let Some(Column { name: other, .. }) = &found[field] {
            return Err(TextError::at(
                line,
                format!("columns `{other}` and `{name}` both mean {canonical}; keep one"),
            ));
        }
        found[field] = Some(Column { index, name: name.clone(), factor });
    }
    let (six, planar): (Vec<usize>, _) = SIX_AXIS.partition(|i| found[*i].is_some());
    if let (Some(has), Some(lacks)) = (six.first(), planar.first()) {
        return Err(TextError::at(
            line,
            format!(
                "column `{}` without `{}`: a six-axis cell gives fz, mx and my besides fx, fy and mz",
                COLUMNS[*has].0, COLUMNS[*lacks].0
            ),
        ));
    }
    match NEEDED.into_iter().find(|i| found[*i].is_none()) {
        Some(missing) => Err(TextError::at(
            line,
            format!(
                "no column `{}`; the columns are {}; needed are {} (units as in `mz[N mm]` or by --units)",
                COLUMNS[missing].0,
                header.join(","),
                COLUMNS[NEEDED].iter().map(|c| c.0).collect::<Vec<_>>().join(",")
            ),
        )),
        None => Ok(found),
    }
}

/// Which column a name means, and the unit it states: `mz[N mm]`, `hub_x (mm)`, `hub_angle_deg`.
fn field(name: &str) -> Option<(usize, Option<&str>)> {
    let name = name.trim();
    if let Some((before, rest)) = name.split_once(['[', '(']) {
        let unit = rest.trim_end().trim_end_matches([']', ')']).trim();
        return position(before.trim()).map(|field| (field, Some(unit).filter(|unit| !unit.is_empty())));
    }
    if let Some(field) = position(name) {
        return Some((field, None));
    }
    let cut = |(i, _): (usize, &str)| {
        let (before, unit) = (&name[..i], &name[i + 1..]);
        position(before)
            .filter(|field| COLUMNS[*field].1.factor(unit).is_some())
            .map(|field| (field, Some(unit)))
    };
    name.match_indices('_').find_map(cut)
}

fn position(name: &str) -> Option<usize> {
    let name = name.to_lowercase();
    COLUMNS.iter().position(|(known, _, others)| *known == name || others.contains(&name.as_str()))
}

/// A CSV text of readings: SI, hub axes, every digit.
pub fn write_hub(samples: &[Sample]) -> String {
    let mut out = names() + "\n";
    for sample in samples {
        let (hub, load) = (&sample.world_from_hub, &sample.load);
        let t = sample.t_s.map_or(String::new(), |t| format!("{t:?}"));
        out += &format!(
            "{},{},{t},{:?},{:?},{:?},{:?},{:?},{:?}\n",
            sample.sweep, sample.sample, hub.angle_rad, hub.x_m, hub.y_m, load.fx_n, load.fy_n, load.mz_n_m
        );
    }
    out
}
