//! A contacts file read back: by the names of its columns, in any order.

use super::{COLUMNS, ContactRow, EVENTS, FEATURES, Figures, MODES, RowStatus, SIDES, STATUSES, Spatial};
use crate::estimate::Mode;
use crate::events::Change;
use crate::files::line::{self, Cells, Layout};
use crate::files::{TextError, quoted};
use nalgebra::{Matrix3, Vector2};
use serde_json::Value;

/// Reads a contacts file, CSV or JSON Lines; columns in any order.
///
/// # Errors
/// The line and the column. Needed are `x, y, theta, cov_xx, cov_xy, cov_yy, status, side`.
pub fn read(text: &str) -> Result<Vec<ContactRow>, TextError> {
    let mut lines = line::lines(text).peekable();
    let Some((first, header)) = lines.peek().copied() else {
        return Err(TextError::whole(format!("no contacts; a header line {} is needed", COLUMNS.join(","))));
    };
    let layout = Layout::of_first_line(first, header)?;
    if let Layout::Csv { header, .. } = &layout {
        lines.next();
        check_header(first, header)?;
    }
    lines
        .map(|(line, text)| Reader { layout: &layout, line, cells: line::read(&layout, line, text)? }.row())
        .collect()
}

fn check_header(line: u64, header: &[String]) -> Result<(), TextError> {
    let needed = ["x", "y", "theta", "cov_xx", "cov_xy", "cov_yy", "status", "side"];
    match needed.iter().find(|name| !header.iter().any(|column| column == *name)) {
        Some(name) => Err(TextError::at(
            line,
            format!(
                "no column `{name}`; the columns are {}; write them by `whisker solve`",
                header.join(",")
            ),
        )),
        None => Ok(()),
    }
}

/// One line by the names of its columns.
struct Reader<'a> {
    layout: &'a Layout,
    line: u64,
    cells: Cells,
}

impl Reader<'_> {
    /// Past the end where the header has no such column, which reads as empty.
    fn column(&self, name: &str) -> usize {
        match self.layout {
            Layout::Csv { header, .. } => header.iter().position(|c| c == name).unwrap_or(usize::MAX),
            Layout::JsonLines => 0,
        }
    }

    fn number(&self, name: &str) -> Result<Option<f64>, TextError> {
        line::number(&self.cells, self.line, self.column(name), name)
    }

    fn word<T: Copy>(&self, name: &str, known: &[(T, &'static str)]) -> Result<Option<T>, TextError> {
        let Some(word) = line::text(&self.cells, self.column(name), name) else { return Ok(None) };
        match known.iter().find(|(_, name)| *name == word) {
            Some((value, _)) => Ok(Some(*value)),
            None => {
                let all: Vec<_> = known.iter().map(|(_, name)| *name).collect();
                let message = format!("column `{name}` is {}; there are {}", quoted(word), all.join(", "));
                Err(TextError::at(self.line, message))
            }
        }
    }

    fn row(&self) -> Result<ContactRow, TextError> {
        let count = |name| self.number(name).map(|n| n.map_or(0, |n| n as u32));
        let figures = self.figures()?;
        let status = self.word("status", &STATUSES)?;
        let mode = self.word("mode", &MODES)?;
        let note = line::text(&self.cells, self.column("note"), "note").unwrap_or_default();
        Ok(ContactRow {
            mode: mode.unwrap_or(if figures.is_some() { Mode::Mid } else { Mode::Free }),
            mode_probability: self.number("mode_probability")?.unwrap_or(0.0),
            figures,
            side: self.word("side", &SIDES)?,
            branch: count("branch")?,
            other_s_m: self.other_s_m(),
            feature: self.word("feature", &FEATURES)?,
            event: self.word("event", &EVENTS)?.unwrap_or(Change::None),
            steps_to_slip_off: self
                .number("steps_to_slip_off")?
                .zip(self.number("steps_to_slip_off_sigma")?)
                .map(|(steps, sigma)| [steps, sigma]),
            spatial: self.spatial()?,
            note: note.to_string(),
            ..ContactRow::blank(
                count("sweep")?,
                count("sample")?,
                self.number("t")?,
                status.unwrap_or(RowStatus::Missing),
            )
        })
    }

    /// Where the roll is there.
    fn spatial(&self) -> Result<Option<Spatial>, TextError> {
        let [roll, sigma, p] = ["roll", "roll_sigma", "plane_p"].map(|name| self.number(name));
        let (Some(roll_rad), Some(roll_sigma_rad), Some(plane_p)) = (roll?, sigma?, p?) else {
            return Ok(None);
        };
        let [xz, yz, zz] = ["cov_xz", "cov_yz", "cov_zz"].map(|name| self.number(name));
        let covariance_z = match (xz?, yz?, zz?) {
            (Some(xz), Some(yz), Some(zz)) => Some([xz, yz, zz]),
            _ => None,
        };
        Ok(Some(Spatial { z_m: self.number("z")?, covariance_z, roll_rad, roll_sigma_rad, plane_p }))
    }

    fn other_s_m(&self) -> Vec<f64> {
        match &self.cells {
            Cells::Object(object) => object
                .get("other_s")
                .and_then(Value::as_array)
                .map_or(Vec::new(), |list| list.iter().filter_map(Value::as_f64).collect()),
            Cells::Row(_) => {
                let text = line::text(&self.cells, self.column("other_s"), "other_s").unwrap_or_default();
                text.split(';').filter_map(|s| s.parse().ok()).collect()
            }
        }
    }

    /// Where x, y, θ and the covariance of x, y are there.
    fn figures(&self) -> Result<Option<Figures>, TextError> {
        let needed = ["x", "y", "theta", "cov_xx", "cov_xy", "cov_yy"];
        let mut v = [0.0; 6];
        for (value, name) in v.iter_mut().zip(needed) {
            let Some(seen) = self.number(name)? else { return Ok(None) };
            *value = seen;
        }
        let optional = |name: &str| self.number(name);
        let or_nan = |name: &str| optional(name).map(|x| x.unwrap_or(f64::NAN));
        let (xt, yt, tt) = (or_nan("cov_xtheta")?, or_nan("cov_ytheta")?, or_nan("cov_thetatheta")?);
        Ok(Some(Figures {
            x_in_world: Vector2::new(v[0], v[1]),
            s_m: or_nan("s")?,
            s_sigma_m: optional("s_sigma")?,
            theta_rad: v[2],
            f_normal_n: or_nan("f_normal")?,
            f_tangent_n: or_nan("f_tangent")?,
            friction_angle_rad: or_nan("friction_angle")?,
            friction_angle_sigma_rad: optional("friction_angle_sigma")?,
            k2: or_nan("k2")?,
            covariance: Matrix3::new(v[3], v[4], xt, v[4], v[5], yt, xt, yt, tt),
            radius_m: optional("radius")?.unwrap_or(0.0),
        }))
    }
}
