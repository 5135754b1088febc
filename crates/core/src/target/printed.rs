//! A target as it came off the printer: a little longer or shorter along each axis than designed.
//!
//! Derivation: docs/math/printed_scale.md.

use super::Target;
use crate::{Error, Point};

/// A print that is farther from its design was fitted to the page, or another ruler was measured; printers err by tenths of a percent.
pub const MOST_PRINTED_ERROR: f64 = 0.05;

/// How long the print is beside its design, along the target's x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrintedScale {
    /// Printed length over designed length; 1 where the print is exact.
    pub ratio: [f64; 2],
    /// Standard deviation of each ratio. All points of the target share the error.
    pub sigma: [f64; 2],
}

/// A flat target, designed, and the scale of its print.
#[derive(Debug, Clone, PartialEq)]
pub struct Printed {
    /// As designed.
    pub design: Box<Target>,
    /// How the print differs from it.
    pub scale: PrintedScale,
}

impl PrintedScale {
    /// From the two rulers on the sheet: lengths designed and measured, and the standard deviation of a measurement, in one unit:
    /// docs/math/printed_scale.md eq. (2).
    pub fn from_rulers(designed: [f64; 2], measured: [f64; 2], sigma: f64) -> Self {
        PrintedScale {
            ratio: [measured[0] / designed[0], measured[1] / designed[1]],
            sigma: designed.map(|length| sigma / length),
        }
    }

    /// Standard deviation of ε in x ← x (1 + ε), eq. (1).
    pub fn relative_sigma(&self) -> [f64; 2] {
        [self.sigma[0] / self.ratio[0], self.sigma[1] / self.ratio[1]]
    }

    /// A point of the design where the print has it.
    pub fn apply(&self, designed: &Point) -> Point {
        Point::new(designed.x * self.ratio[0], designed.y * self.ratio[1], designed.z)
    }

    /// Refuses scales that no print has.
    pub(super) fn check(&self) -> Result<(), Error> {
        for seen in self.ratio {
            let possible = (seen - 1.0).abs() <= MOST_PRINTED_ERROR;
            if !possible {
                let needed = "a print is within 5 % of its design (0.95 to 1.05); print at 100 %, not fitted to the page, and measure the \
                     rulers again, or correct the size that was designed";
                return Err(Error::InvalidTarget { parameter: "printed_scale", seen, needed });
            }
        }
        for seen in self.sigma {
            let possible = (0.0..=MOST_PRINTED_ERROR).contains(&seen);
            if !possible {
                let needed = "the standard deviation of a printed scale is 0 to 0.05 (5 %); measure a longer ruler, or more exactly";
                return Err(Error::InvalidTarget { parameter: "printed_scale sigma", seen, needed });
            }
        }
        Ok(())
    }
}

impl Printed {
    /// Besides the design's own errors: kinds that are not printed in one piece, a print of a print, scales that no print has.
    pub(super) fn check(&self) -> Result<(), Error> {
        let refused = |seen, needed| Err(Error::InvalidTarget { parameter: "printed_scale", seen, needed });
        match &*self.design {
            Target::Printed(_) => return refused(2.0, "a target has one printed scale"),
            Target::Points(points) => {
                return refused(points.len() as f64, "surveyed points are not printed; leave it out");
            }
            Target::TagMap(map) if map.sheet_facing().is_none() => {
                let needed = "the tags of this map do not lie in its plane z = 0, so they are no single sheet; state each tag's own \
                     size_m as measured";
                return refused(map.tags.len() as f64, needed);
            }
            _ => {}
        }
        self.scale.check()?;
        self.design.check()
    }
}
