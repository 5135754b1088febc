//! The change detector of a rig as plain numbers, and back: a program that stops can go on later as if nothing had been.

use super::earlier::Version1;
use super::{Open, RigMonitor, RigReference};
use crate::Error;
use crate::temporal::monitor::{NOT_POSITIVE, check};
use crate::temporal::snapshot::{Snapshot, numbers};

/// Of `snapshot`: raised when a field, or the meaning of one, changes.
const SNAPSHOT_VERSION: u32 = 2;
/// Before noise was measured.
const VERSION_1: u32 = 1;

impl RigMonitor {
    /// All of its state: what `restore` makes of it continues as this one would. 150 000 numbers for four cameras; it grows with the square of
    /// their number.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot::of(self, SNAPSHOT_VERSION)
    }

    /// Goes on from a snapshot, of this version or the one before. The time in between counts: what was not seen since is stale, and what is no drift has had time to wander.
    ///
    /// # Errors
    /// `SnapshotVersion`, `SnapshotNumbers` for numbers that are no rig's, `InvalidSetting` as `new`.
    pub fn restore(snapshot: &Snapshot) -> Result<Self, Error> {
        let monitor = match snapshot.version {
            VERSION_1 => snapshot.state::<Version1>(VERSION_1)?.0,
            _ => snapshot.state::<RigMonitor>(SNAPSHOT_VERSION)?,
        };
        check(&monitor.config)?;
        monitor.reference.check()?;
        if !monitor.is_sound() {
            return Err(Error::SnapshotNumbers { seen: snapshot.numbers.len(), unread: 0 });
        }
        Ok(monitor)
    }

    /// What it compares with.
    pub fn reference(&self) -> &RigReference {
        &self.reference
    }

    /// Time of the last frame set, or of the start, seconds.
    pub fn last_s(&self) -> f64 {
        self.last_s
    }

    /// Whether all parts are of the same number of cameras.
    fn is_sound(&self) -> bool {
        let n = self.reference.cam_from_rig.len();
        let of_cameras = [
            self.old_from_level.len(),
            self.observed_s.len(),
            self.seen_s.len(),
            self.inconsistent_share.len(),
            self.drifts.len(),
        ];
        of_cameras == [n; 5]
            && self.noises.is_sound(n)
            && self.evidence.is_sound(n)
            && self.held.is_sound(n)
            && self.typical.is_sound(n)
            && are_below(&self.alternatives, n)
            && self.open.as_ref().is_none_or(|open| open.is_sound(n))
    }
}

impl Open {
    fn is_sound(&self, cameras: usize) -> bool {
        let moved = &self.attribution.moved;
        moved.len() == self.drifts.len()
            && moved.iter().all(|moved| moved.node < cameras)
            && are_below(&self.attribution.alternatives, cameras)
    }
}

fn are_below(sets: &[Vec<usize>], cameras: usize) -> bool {
    sets.iter().flatten().all(|camera| *camera < cameras)
}

impl RigReference {
    /// # Errors
    /// `InvalidSetting` for fewer than two cameras, parts of different numbers of them, or numbers that are none.
    pub fn check(&self) -> Result<(), Error> {
        let n = self.cam_from_rig.len();
        if n < 2 || self.noise.len() != n || self.covariance.shape() != (6 * n, 6 * n) {
            let needed = "two cameras at least, six rows of covariance and one noise for each";
            return Err(Error::InvalidSetting { setting: "cameras of a rig", seen: n as f64, needed });
        }
        let poses = self.cam_from_rig.iter().flat_map(|p| p.rotation.iter().chain(p.translation.iter()));
        if !poses.chain(self.covariance.iter()).all(|v| v.is_finite()) {
            return Err(NOT_POSITIVE);
        }
        self.noise.iter().try_for_each(|noise| noise.check())
    }
}

numbers!(RigReference { cam_from_rig, covariance, noise });
numbers!(Open { attribution, drifts });
numbers!(RigMonitor {
    reference,
    config,
    old_from_level,
    noises,
    evidence,
    held,
    typical,
    last_onset_s,
    last_s,
    observed_s,
    seen_s,
    inconsistent_share,
    drifts,
    open,
    alternatives,
    outliers,
    out_of_order,
});
