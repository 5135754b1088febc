//! Touch, release and slip-off, from the load alone, each sample answered as it comes.
//!
//! ```text
//!   q = lᵀ Σ⁻¹ l, χ² with 3 degrees of freedom while nothing is touched          docs/math/whisker_events.md eqs. (1)–(3)
//! ```

use crate::{Cell, HubLoad, Sample};
use nalgebra::Vector3;

/// One sample beyond this is a touch: one free sample in a million exceeds it.
pub const TOUCH_AT_ONCE: f64 = 30.665;
/// Two samples in a row beyond this are a touch, and a sample below it is free: 5 in 1000 free samples exceed it, 25 in a million
/// pairs. A force of 4 σ exceeds it nine times in ten even where the torque says nothing.
pub const TOUCH_TWICE: f64 = 12.838;
/// The load expected from the two samples before is six times as uncertain as a sample: 1 + 2² + 1 variances. A load expected beyond
/// `TOUCH_AT_ONCE` in that metric that is found free has not been let go but has slipped off.
const EXTRAPOLATION_VARIANCE: f64 = 6.0;

/// The change by a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// The whisker touches something, at this sample or, where it took two to be sure, at the one before.
    Touch,
    /// The load faded: the hub has let go.
    Release,
    /// The load was there and is gone from one sample to the next: the whisker slipped off.
    SlipOff,
}

/// Watches the loads of one sweep after another. Constant memory, one answer per sample.
#[derive(Debug, Clone, PartialEq)]
pub struct TouchDetector {
    cell: Cell,
    touching: bool,
    sweep: Option<u32>,
    /// The last two loads of this sweep, the later one first.
    before: [Option<Vector3<f64>>; 2],
}

impl TouchDetector {
    /// A detector that starts free. `cell` gives the noise of a tared load cell.
    pub fn new(cell: &Cell) -> Self {
        TouchDetector { cell: *cell, touching: false, sweep: None, before: [None; 2] }
    }

    /// Whether something is touched, as far as is known.
    pub fn is_touching(&self) -> bool {
        self.touching
    }

    /// Takes the next sample. A load that is not a number changes nothing; a new sweep starts free.
    pub fn push(&mut self, sample: &Sample) -> Change {
        if self.sweep != Some(sample.sweep) {
            (self.sweep, self.touching, self.before) = (Some(sample.sweep), false, [None; 2]);
        }
        if !sample.load.is_finite() {
            return Change::None;
        }
        let change = self.change(&sample.load);
        self.touching = match change {
            Change::Touch => true,
            Change::Release | Change::SlipOff => false,
            Change::None => self.touching,
        };
        self.before = [Some(sample.load.to_vector()), self.before[0]];
        change
    }

    fn change(&self, load: &HubLoad) -> Change {
        let now = chi2(&self.cell, &load.to_vector());
        let before = self.before[0].map_or(0.0, |before| chi2(&self.cell, &before));
        let is_loaded = TOUCH_AT_ONCE < now || TOUCH_TWICE < now && TOUCH_TWICE < before;
        match self.touching {
            false if is_loaded => Change::Touch,
            true if now <= TOUCH_TWICE && self.was_leaving() => Change::Release,
            true if now <= TOUCH_TWICE => Change::SlipOff,
            _ => Change::None,
        }
    }

    /// Whether the samples before led one to expect no load now, eq. (3).
    fn was_leaving(&self) -> bool {
        let [Some(last), earlier] = self.before else { return true };
        let expected = last * 2.0 - earlier.unwrap_or(last);
        chi2(&self.cell, &expected) <= EXTRAPOLATION_VARIANCE * TOUCH_AT_ONCE
    }
}

/// q, eq. (1).
pub fn chi2(cell: &Cell, load: &Vector3<f64>) -> f64 {
    let covariance = cell.load_covariance();
    (0..3).map(|i| load[i] * load[i] / covariance[(i, i)].max(f64::MIN_POSITIVE)).sum()
}
