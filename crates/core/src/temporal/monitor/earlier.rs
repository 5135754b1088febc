//! Snapshots of version 2, before noise was measured and before it was kept what came before an alarm: read, never written.

use super::aftermath::Aftermath;
use super::milestones::Milestone;
use super::test::DriftTest;
use super::transients::Transients;
use super::{Drift, Gate, Monitor, MonitorConfig, Reference};
use crate::temporal::snapshot::{Numbers, Rest};
use crate::{Pose, Vector6};

/// A monitor as version 2 has it.
pub(super) struct Version2(pub Monitor);

impl Numbers for Version2 {
    /// As version 2 wrote it; only tests write one.
    fn put(&self, numbers: &mut Vec<f64>) {
        let monitor = &self.0;
        monitor.reference.put(numbers);
        monitor.config.put(numbers);
        monitor.old_from_level.put(numbers);
        monitor.test.put_version_2(numbers);
        monitor.gate.put(numbers);
        monitor.drift.put(numbers);
        (monitor.last_s, monitor.last_usable_s).put(numbers);
        monitor.inconsistent_share.put(numbers);
        (monitor.outliers, monitor.out_of_order).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let reference = Reference::take(rest)?;
        let config = MonitorConfig::take(rest)?;
        let old_from_level = Pose::take(rest)?;
        let test = DriftTest::take_version_2(rest, &reference.noise)?;
        let (gate, drift) = (Gate::take(rest)?, <Option<Drift> as Numbers>::take(rest)?);
        let last_s = f64::take(rest)?;
        // It continues from its reference; what it had learned of that since is in its test.
        let covariance = reference.noise.reference;
        let mut aftermath = Aftermath::new(Milestone { t_s: last_s, motion: Vector6::zeros(), covariance });
        drift.iter().for_each(|drift| aftermath.was_found(drift));
        Some(Version2(Monitor {
            reference,
            config,
            old_from_level,
            test,
            gate,
            drift,
            held_until_s: None,
            transients: Transients::default(),
            aftermath,
            last_s,
            last_usable_s: f64::take(rest)?,
            inconsistent_share: f64::take(rest)?,
            outliers: u64::take(rest)?,
            out_of_order: u64::take(rest)?,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::temporal::monitor::{DriftNoise, Reading};
    use crate::temporal::snapshot::Snapshot;
    use crate::{Matrix6, Vector6};

    /// A step of five standard deviations after a hundred readings.
    fn reading(i: usize) -> Reading {
        let noise = Vector6::from_fn(|axis, _| 1e-3 * ((7 * i + 3 * axis) as f64).sin());
        let moved = if 100 < i { Vector6::y() * 5e-3 } else { Vector6::zeros() };
        let (a_from_b, covariance) = (Pose::exp(&(noise + moved)), Matrix6::identity() * 1e-6);
        Reading { t_s: i as f64, a_from_b, covariance, is_consistent: true }
    }

    #[test]
    fn a_monitor_of_version_2_goes_on_as_it_would_have() {
        let spread = |scale: f64| Matrix6::identity() * scale * 1e-6;
        let (bias, diurnal) = (spread(0.2), spread(0.1));
        let noise =
            DriftNoise { reference: spread(0.1), reading: spread(1.0), bias, bias_time_s: 60.0, diurnal };
        let reference = Reference { a_from_b: Pose::identity(), noise };
        let mut monitor = Monitor::new(&reference, &MonitorConfig::default(), 0.0).expect("a monitor");
        monitor.push(&reading(0));
        // The count that version 2 had.
        assert_eq!(Snapshot::of(&Version2(monitor.clone()), 2).numbers.len(), 540);
        for i in 1..200 {
            if i % 30 == 0 {
                let restored = Monitor::restore(&Snapshot::of(&Version2(monitor.clone()), 2));
                let restored = restored.expect("version 2");
                assert_eq!((&restored.test, &restored.gate), (&monitor.test, &monitor.gate));
                monitor = restored;
            }
            monitor.push(&reading(i));
        }
        assert!(monitor.drift().is_some() && !monitor.measures_noise());
    }
}
