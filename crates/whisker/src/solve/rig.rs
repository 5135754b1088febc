//! A whisker on its cell, as its file and a tare have it.

use crate::calibrate::{Calibration, Parameter, Tare};
use crate::estimate::Mode;
use crate::files::{ContactRow, HubRow, WhiskerFile, six_axis};
use crate::{Cell, ContactEstimate, Error, Rod, Sample};

/// The remedy for functions that work in the plane only.
pub const SIX_AXES: &str = "readings of a six-axis cell (fz, mx, my) are each solved for themselves; leave those columns out to solve \
                            fx, fy, mz in the plane";

/// The whisker and its cell as the calibration has them.
pub struct Rig {
    /// None where nothing is to be corrected.
    calibration: Option<Calibration>,
    /// The whisker.
    pub rod: Rod,
    /// The noise of loads as they are meant.
    pub cell: Cell,
}

impl Rig {
    /// As the file has it, with the zeros of a tare in place of its own.
    pub fn new(file: &WhiskerFile, tare: Option<&Tare>) -> Self {
        match calibration(file, tare) {
            Some(calibration) => Rig {
                rod: calibration.rod(),
                cell: calibration.apply_to_cell(&file.cell),
                calibration: Some(calibration),
            },
            None => Rig { calibration: None, rod: file.rod.clone(), cell: file.cell },
        }
    }

    /// A reading as it is meant.
    pub fn meant(&self, read: &Sample) -> Sample {
        self.calibration.as_ref().map_or(*read, |calibration| calibration.apply(read))
    }

    /// A calibration or a tare says nothing of fz, mx and my.
    ///
    /// # Errors
    /// There is one.
    pub fn must_know_six_axes(&self) -> Result<(), Error> {
        match self.calibration.is_some() {
            true => Err(Error::request(format!(
                "a calibration or a tare corrects fx, fy and mz, not fz, mx and my; {SIX_AXES}"
            ))),
            false => Ok(()),
        }
    }

    /// The row of a six-axis reading.
    ///
    /// # Errors
    /// Signals that are no numbers; a line without them.
    pub fn row_in_space(&self, reading: &HubRow) -> Result<ContactRow, Error> {
        Ok(match (&reading.reading, reading.out_of_plane) {
            (Ok(sample), Some(rest)) => six_axis::row(&self.rod, &self.cell, sample, rest)?,
            (Ok(_), None) => {
                let reason =
                    format!("line {}: fz, mx and my are missing here, but not elsewhere", reading.line);
                return Err(Error::request(reason));
            }
            (Err(cells), _) => ContactRow::missing(reading.sweep, reading.sample, reading.t_s, cells),
        })
    }

    /// What is not known of the rig makes every contact less certain.
    pub fn widen(&self, estimate: &mut ContactEstimate, read: &Sample, is_raw: bool) {
        let mode = if is_raw { Mode::Free } else { estimate.mode };
        if let Some(contact) = &mut estimate.contact
            && let Some(calibration) = &self.calibration
            && let Some(added) = calibration.systematic_covariance(&self.cell, read, mode)
            && added.iter().all(|x| x.is_finite())
        {
            contact.covariance += added;
        }
    }
}

/// That of the file, with the zeros of the tare in place of its own.
fn calibration(file: &WhiskerFile, tare: Option<&Tare>) -> Option<Calibration> {
    let Some(tare) = tare else { return file.calibration.clone() };
    let mut calibration = file.calibration.clone().unwrap_or_else(|| Calibration::ideal(&file.rod));
    let zeros = [Parameter::ForceXZero, Parameter::ForceYZero, Parameter::TorqueZero].map(Parameter::index);
    for (i, place) in zeros.into_iter().enumerate() {
        calibration.values[place] = tare.zeros[i];
        calibration.covariance.row_mut(place).fill(0.0);
        calibration.covariance.column_mut(place).fill(0.0);
    }
    for (i, a) in zeros.into_iter().enumerate() {
        for (j, b) in zeros.into_iter().enumerate() {
            calibration.covariance[(a, b)] = tare.covariance[(i, j)];
        }
    }
    Some(calibration)
}
