//! Snapshots of version 1, before a rig measured its noise: read, never written.

use super::evidence::Evidence;
use super::filter::RigFilter;
use super::noises::Noises;
use super::{Held, MonitorConfig, RigMonitor, RigReference};
use crate::Pose;
use crate::temporal::snapshot::{Numbers, Rest};

/// The change detector of a rig as version 1 has it.
pub(super) struct Version1(pub RigMonitor);

impl Numbers for Version1 {
    /// As version 1 wrote it; only tests write one.
    fn put(&self, numbers: &mut Vec<f64>) {
        let rig = &self.0;
        rig.reference.put(numbers);
        rig.config.put(numbers);
        rig.old_from_level.put(numbers);
        rig.noises.filter().0.put(numbers);
        rig.evidence.put_version_1(numbers);
        rig.held.put(numbers);
        rig.typical.put(numbers);
        (rig.last_onset_s, rig.last_s).put(numbers);
        rig.observed_s.put(numbers);
        rig.seen_s.put(numbers);
        rig.inconsistent_share.put(numbers);
        rig.drifts.put(numbers);
        rig.open.put(numbers);
        rig.alternatives.put(numbers);
        (rig.outliers, rig.out_of_order).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let (reference, config) = (RigReference::take(rest)?, MonitorConfig::take(rest)?);
        let old_from_level = <Vec<Pose> as Numbers>::take(rest)?;
        let filter = RigFilter::take(rest)?;
        let evidence = Evidence::take_version_1(rest)?;
        let n = reference.cam_from_rig.len();
        // Sizes that do not fit together would be a panic in what follows.
        if reference.check().is_err() || old_from_level.len() != n || !filter.is_sound(n) {
            return None;
        }
        Some(Version1(RigMonitor {
            noises: Noises::of_learned(filter, n),
            reference,
            config,
            old_from_level,
            evidence,
            held: Held::take(rest)?,
            typical: Numbers::take(rest)?,
            last_onset_s: f64::take(rest)?,
            last_s: f64::take(rest)?,
            observed_s: Numbers::take(rest)?,
            seen_s: Numbers::take(rest)?,
            inconsistent_share: Numbers::take(rest)?,
            drifts: Numbers::take(rest)?,
            open: Numbers::take(rest)?,
            alternatives: Numbers::take(rest)?,
            outliers: u64::take(rest)?,
            out_of_order: u64::take(rest)?,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::ObservationNoise;
    use super::*;
    use crate::Vector6;
    use crate::temporal::snapshot::Snapshot;
    use nalgebra::DMatrix;

    /// What an earlier version wrote is read, and continues.
    #[test]
    fn version_1_is_read() {
        let place = |x: f64| Pose::exp(&Vector6::new(0.0, 0.1 * x, 0.0, x, 0.0, 2.0));
        let reference = RigReference {
            cam_from_rig: vec![place(-0.5), place(0.5)],
            covariance: DMatrix::identity(12, 12) * 1e-6,
            noise: vec![ObservationNoise::white(); 2],
        };
        let rig = RigMonitor::new(&reference, &MonitorConfig::default(), 3.0).expect("a monitor");
        let snapshot = Snapshot::of(&Version1(rig.clone()), 1);
        assert_eq!(RigMonitor::restore(&snapshot), Ok(rig));
        for end in (0..snapshot.numbers.len()).step_by(97) {
            let numbers = snapshot.numbers[..end].to_vec();
            assert!(RigMonitor::restore(&Snapshot { version: 1, numbers }).is_err(), "{end} numbers");
        }
    }
}
