//! Snapshots of version 3, which knew of one motion: read, never written.

use super::Monitor;
use super::again::Motions;
use super::place::Places;
use crate::temporal::snapshot::{Numbers, Rest};

/// A monitor as version 3 has it.
pub(super) struct Version3(pub Monitor);

impl Numbers for Version3 {
    /// As version 3 wrote it; only tests write one.
    fn put(&self, numbers: &mut Vec<f64>) {
        let monitor = &self.0;
        monitor.reference.put(numbers);
        monitor.config.put(numbers);
        monitor.old_from_level.put(numbers);
        monitor.test.put(numbers);
        monitor.gate.put(numbers);
        monitor.drift.put(numbers);
        monitor.held_until_s.put(numbers);
        monitor.transients.put(numbers);
        monitor.aftermath.put(numbers);
        (monitor.last_s, monitor.last_usable_s).put(numbers);
        monitor.inconsistent_share.put(numbers);
        (monitor.outliers, monitor.out_of_order).put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let mut monitor = Monitor {
            reference: Numbers::take(rest)?,
            config: Numbers::take(rest)?,
            old_from_level: Numbers::take(rest)?,
            test: Numbers::take(rest)?,
            gate: Numbers::take(rest)?,
            drift: Numbers::take(rest)?,
            held_until_s: Numbers::take(rest)?,
            transients: Numbers::take(rest)?,
            aftermath: Numbers::take(rest)?,
            last_s: Numbers::take(rest)?,
            last_usable_s: Numbers::take(rest)?,
            inconsistent_share: Numbers::take(rest)?,
            outliers: Numbers::take(rest)?,
            out_of_order: Numbers::take(rest)?,
            motions: Motions::none(Default::default()),
            places: Places::default(),
            whereabouts: Default::default(),
        };
        monitor.motions = monitor.aftermath.motions(&monitor.drift);
        Some(Version3(monitor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::temporal::monitor::{DriftNoise, MonitorConfig, Reading, Reference, VERSION_3};
    use crate::temporal::snapshot::Snapshot;
    use crate::{Matrix6, Pose, Vector6};

    /// A step of five standard deviations after a hundred readings.
    fn reading(i: usize) -> Reading {
        let noise = Vector6::from_fn(|axis, _| 1e-3 * ((7 * i + 3 * axis) as f64).sin());
        let moved = if 100 < i { Vector6::y() * 5e-3 } else { Vector6::zeros() };
        let (a_from_b, covariance) = (Pose::exp(&(noise + moved)), Matrix6::identity() * 1e-6);
        Reading { t_s: i as f64, a_from_b, covariance, is_consistent: true }
    }

    #[test]
    fn a_monitor_of_version_3_goes_on_as_it_would_have() {
        let spread = |scale: f64| Matrix6::identity() * scale * 1e-6;
        let (bias, diurnal) = (spread(0.2), spread(0.1));
        let noise =
            DriftNoise { reference: spread(0.1), reading: spread(1.0), bias, bias_time_s: 60.0, diurnal };
        let reference = Reference { a_from_b: Pose::identity(), noise };
        let mut monitor = Monitor::new(&reference, &MonitorConfig::default(), 0.0).expect("a monitor");
        for i in 0..200 {
            if i % 30 == 0 {
                let restored = Monitor::restore(&Snapshot::of(&Version3(monitor.clone()), VERSION_3));
                let restored = restored.expect("version 3");
                assert_eq!((&restored.test, &restored.gate), (&monitor.test, &monitor.gate));
                monitor = restored;
            }
            monitor.push(&reading(i));
        }
        let drift = monitor.drift().expect("a drift");
        assert!(drift.again.is_none() && (99.0..104.0).contains(&drift.first_began_s()), "{drift:?}");
    }
}
