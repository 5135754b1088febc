//! Snapshots of earlier versions.

use super::aftermath::Aftermath;
use super::gate::Gate;
use super::milestones::Milestone;
use super::test::DriftTest;
use super::{Drift, Monitor, MonitorConfig, Reference};
use crate::snapshot::{Snapshot, numbers};
use crate::{Error, Pose, Vector6};

/// Version 2: without what came before an alarm.
struct Second {
    reference: Reference,
    config: MonitorConfig,
    old_from_level: Pose,
    test: DriftTest,
    gate: Gate,
    drift: Option<Drift>,
    last_s: f64,
    last_usable_s: f64,
    inconsistent_share: f64,
    outliers: u64,
    out_of_order: u64,
}

pub(super) const SECOND: u32 = 2;

/// A monitor of version 2 goes on from its reference; what it had learned of it since is in its test.
///
/// # Errors
/// `SnapshotNumbers`.
pub(super) fn second(snapshot: &Snapshot) -> Result<Monitor, Error> {
    let Second { reference, config, old_from_level, test, gate, drift, .. } = snapshot.state(SECOND)?;
    let Second { last_s, last_usable_s, inconsistent_share, outliers, out_of_order, .. } =
        snapshot.state(SECOND)?;
    let start = Milestone { t_s: last_s, motion: Vector6::zeros(), covariance: reference.noise.reference };
    let mut aftermath = Aftermath::new(start);
    if let Some(drift) = &drift {
        aftermath.was_found(drift);
    }
    Ok(Monitor {
        reference,
        config,
        old_from_level,
        test,
        gate,
        drift,
        aftermath,
        last_s,
        last_usable_s,
        inconsistent_share,
        outliers,
        out_of_order,
    })
}

numbers!(Second {
    reference,
    config,
    old_from_level,
    test,
    gate,
    drift,
    last_s,
    last_usable_s,
    inconsistent_share,
    outliers,
    out_of_order,
});
