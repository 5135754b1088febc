//! Speeds of the vehicle, from a CSV file.

use crate::error::Error;
use crate::input::table::{Table, TableRow};
use std::path::Path;

/// The speed at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedSample {
    /// Time, seconds of the frames' clock.
    pub t_s: f64,
    /// Speed, negative in reverse, m/s.
    pub speed_m_s: f64,
}

/// A larger gap between two speeds is not interpolated, seconds.
pub(super) const LARGEST_GAP_S: f64 = 2.0;
/// No vehicle is faster, m/s.
const FASTEST_M_S: f64 = 200.0;

/// Reads a CSV file with the columns t_s and speed_m_s.
///
/// # Errors
/// A missing column, a cell that is no number, a speed that no vehicle has.
pub fn read_speeds(path: impl AsRef<Path>) -> Result<Vec<SpeedSample>, Error> {
    let table = Table::open(path.as_ref(), "t_s,speed_m_s")?;
    let t_s = table.need("t_s", Some("the time of each speed, seconds from the first frame"))?;
    let speed = table.need("speed_m_s", Some("the speed, m/s, negative in reverse"))?;
    let mut speeds = Vec::new();
    table.each(|cells: TableRow<'_>| -> Result<(), Error> {
        let sample = SpeedSample { t_s: cells.number(t_s)?, speed_m_s: cells.number(speed)? };
        if !(sample.speed_m_s.abs() <= FASTEST_M_S) {
            let reason = format!("is {} m/s; a speed of a vehicle in m/s is needed", sample.speed_m_s);
            return Err(cells.complaint(speed, &reason).into());
        }
        speeds.push(sample);
        Ok(())
    })?;
    Ok(speeds)
}

/// Interpolates; `None` before the first, after the last, and in a gap.
pub(super) fn speed_at(speeds: &[SpeedSample], t_s: f64) -> Option<f64> {
    let after = speeds.partition_point(|sample| sample.t_s < t_s);
    let later = speeds.get(after)?;
    if later.t_s == t_s {
        return Some(later.speed_m_s);
    }
    let earlier = speeds.get(after.checked_sub(1)?)?;
    let gap_s = later.t_s - earlier.t_s;
    let share = (t_s - earlier.t_s) / gap_s;
    (gap_s <= LARGEST_GAP_S).then_some(earlier.speed_m_s + share * (later.speed_m_s - earlier.speed_m_s))
}
