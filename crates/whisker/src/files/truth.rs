//! truth.csv: where the contacts really were, row by row.

use super::TextError;
use super::line::{self, Layout};
use nalgebra::Vector2;

/// One row.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthRow {
    /// Which sweep.
    pub sweep: u32,
    /// Which sample of it.
    pub sample: u32,
    /// The contact, where there is one.
    pub contact: Option<TruthContact>,
}

/// A true contact, world frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthContact {
    /// The point of the centre line, metres.
    pub x_in_world: Vector2<f64>,
    /// Arc length, metres.
    pub s_m: f64,
    /// Direction of the whisker there, radians.
    pub theta_rad: f64,
    /// Force on the whisker, newtons.
    pub force_n: Vector2<f64>,
    /// asin(F·t/|F|), radians.
    pub friction_angle_rad: f64,
    /// As the file names it: free, cornerI, faceI, tan, tip, tipI.
    pub mode: String,
}

impl TruthContact {
    /// Whether the tip touches.
    pub fn is_tip(&self) -> bool {
        self.mode.starts_with("tip")
    }
}

const NAMES: [&str; 11] = [
    "sweep",
    "sample",
    "contact",
    "x",
    "y",
    "s",
    "theta_c",
    "fx_world",
    "fy_world",
    "friction_angle",
    "mode",
];

/// Reads a truth file.
///
/// # Errors
/// The line and the column.
pub fn read(text: &str) -> Result<Vec<TruthRow>, TextError> {
    let mut lines = line::lines(text);
    let Some((first, header)) = lines.next() else {
        return Err(TextError::whole("no truth: the text is empty"));
    };
    let layout = Layout::of_first_line(first, header)?;
    let Layout::Csv { header, .. } = &layout else {
        return Err(TextError::at(first, format!("a header line {} is needed", NAMES.join(","))));
    };
    let place = |name: &str| {
        header.iter().position(|column| column == name).ok_or_else(|| {
            TextError::at(first, format!("no column `{name}`; the columns are {}", header.join(",")))
        })
    };
    let places: Vec<usize> = NAMES.iter().map(|name| place(name)).collect::<Result<_, _>>()?;
    lines.map(|(line, text)| row(&layout, &places, line, text)).collect()
}

fn row(layout: &Layout, places: &[usize], line: u64, text: &str) -> Result<TruthRow, TextError> {
    let cells = line::read(layout, line, text)?;
    let optional = |i: usize| line::number(&cells, line, places[i], NAMES[i]);
    let need = |i: usize| {
        let empty = || TextError::at(line, format!("column `{}` is empty; a number is needed", NAMES[i]));
        optional(i)?.ok_or_else(empty)
    };
    let (sweep, sample) = (need(0)? as u32, need(1)? as u32);
    if need(2)? == 0.0 {
        return Ok(TruthRow { sweep, sample, contact: None });
    }
    let contact = TruthContact {
        x_in_world: Vector2::new(need(3)?, need(4)?),
        s_m: need(5)?,
        theta_rad: need(6)?,
        force_n: Vector2::new(need(7)?, need(8)?),
        friction_angle_rad: need(9)?,
        mode: line::text(&cells, places[10], NAMES[10]).unwrap_or_default().to_string(),
    };
    Ok(TruthRow { sweep, sample, contact: Some(contact) })
}

/// Writes a truth file.
pub fn write(rows: &[TruthRow]) -> String {
    let mut out = NAMES.join(",") + "\n";
    for row in rows {
        out += &format!("{},{},{}", row.sweep, row.sample, u8::from(row.contact.is_some()));
        out += &match &row.contact {
            None => ",nan,nan,nan,nan,nan,nan,nan,free\n".to_string(),
            Some(c) => format!(
                ",{:?},{:?},{:?},{:?},{:?},{:?},{:?},{}\n",
                c.x_in_world.x,
                c.x_in_world.y,
                c.s_m,
                c.theta_rad,
                c.force_n.x,
                c.force_n.y,
                c.friction_angle_rad,
                c.mode
            ),
        };
    }
    out
}
