//! The scale of a printed sheet, from its measured rulers.

use crate::error::Error;
use resight_core::Target;
use resight_core::target::{MOST_PRINTED_ERROR, PrintedScale};

/// Lengths measured on the two rulers of a printed sheet, between the middles of their end marks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredRulers {
    /// Along x, millimetres.
    pub x_mm: f64,
    /// Along y, millimetres.
    pub y_mm: f64,
    /// Standard deviation of either, millimetres.
    pub sigma_mm: f64,
}

impl MeasuredRulers {
    /// Returns the target with the scale of its print.
    pub(super) fn applied(
        &self,
        target: &Target,
        designed_mm: [f64; 2],
        n_sheets: usize,
    ) -> Result<Target, Error> {
        if 1 < n_sheets {
            return Err(Error::request(format!(
                "the {n_sheets} tags of this map are printed on sheets of their own, each with a scale of its own; state each tag's size_m as measured"
            )));
        }
        let possible = 0.0 < self.sigma_mm && self.sigma_mm.is_finite();
        if !possible {
            return Err(Error::request(format!(
                "--measured-sigma-mm is {}; the standard deviation of a measured length is positive, e.g. 0.1 with a steel ruler and a loupe",
                self.sigma_mm
            )));
        }
        for (axis, measured, designed) in [("x", self.x_mm, designed_mm[0]), ("y", self.y_mm, designed_mm[1])]
        {
            check(axis, measured, designed)?;
        }
        let scale = PrintedScale::from_rulers(designed_mm, [self.x_mm, self.y_mm], self.sigma_mm);
        let printed = target.printed_at(scale);
        printed.check()?;
        Ok(printed)
    }
}

fn check(axis: &str, measured: f64, designed: f64) -> Result<(), Error> {
    let error = measured / designed - 1.0;
    if error.abs() <= MOST_PRINTED_ERROR {
        return Ok(());
    }
    let percent = 100.0 * error;
    let most = 100.0 * MOST_PRINTED_ERROR;
    Err(Error::request(format!(
        "--measured-{axis}-mm is {measured}; the {axis} ruler of this sheet is {designed} mm long, so the print would be {percent:+.1} % off, and a print is \
         within {most} %: print at 100 % and not fitted to the page, give the --paper that was printed on, and measure between the end marks"
    )))
}
