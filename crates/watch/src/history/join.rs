//! Rows of a minute or an hour as one row. Poses and turns are different things: each has its own mean and its own count.

use super::Span;
use super::mean::{Reading, Rotation, Spread, joined};
use super::rows::{Measured, RotationSummary, StoredRotation, StoredRow, Summary};

/// Rows of one pair, session and state, as one. `rows` must not be empty.
pub(super) fn join(rows: &[StoredRow], t_s: f64, span: Span) -> Option<StoredRow> {
    let first = rows.first()?;
    let frames = rows.iter().map(|row| row.frames).sum::<u64>();
    let points: f64 = rows.iter().map(|row| row.n_points * row.frames as f64).sum();
    let (measured, summary) = poses(rows).unzip();
    let (rotated, rotation_summary) = rotations(rows).unzip();
    let is_blind = measured.is_none() && rotated.is_none();
    Some(StoredRow {
        t_s,
        span,
        frames,
        readings: rows.iter().map(|row| row.readings).sum(),
        rotations: rows.iter().map(|row| row.rotations).sum(),
        n_points: points / frames as f64,
        measured,
        summary,
        rotated,
        rotation_summary,
        reason: if is_blind { common_reason(rows) } else { None },
        ..first.clone()
    })
}

/// The reason that all share.
fn common_reason(rows: &[StoredRow]) -> Option<String> {
    let first = rows.first()?.reason.as_ref()?;
    rows.iter().all(|row| row.reason.as_ref() == Some(first)).then(|| first.clone())
}

fn poses(rows: &[StoredRow]) -> Option<(Measured, Summary)> {
    let seen: Vec<(f64, Measured, Option<Summary>)> =
        rows.iter().filter_map(|row| Some((row.readings as f64, row.measured?, row.summary))).collect();
    let reading = |(weight, measured, summary): &(f64, Measured, Option<Summary>)| Reading {
        weight: *weight,
        place: measured.cam_from_target,
        covariance: measured.covariance,
        spread: summary.map_or_else(Spread::none, |s| Spread {
            scatter: s.scatter,
            least: s.least,
            most: s.most,
        }),
    };
    let mean = joined(&seen.iter().map(reading).collect::<Vec<_>>())?;
    let square_sum: f64 = seen.iter().map(|(weight, measured, _)| weight * measured.rms_px.powi(2)).sum();
    let most_rms_px = |(_, measured, summary): &(f64, Measured, Option<Summary>)| {
        summary.map_or(measured.rms_px, |s| s.most_rms_px)
    };
    let measured = Measured {
        cam_from_target: mean.place,
        covariance: mean.covariance,
        rms_px: (square_sum / mean.weight).sqrt(),
    };
    let Spread { scatter, least, most } = mean.spread;
    let most_rms_px = seen.iter().map(most_rms_px).fold(0.0, f64::max);
    Some((measured, Summary { scatter, least, most, most_rms_px }))
}

fn rotations(rows: &[StoredRow]) -> Option<(StoredRotation, RotationSummary)> {
    let seen: Vec<(f64, StoredRotation, Option<RotationSummary>)> = rows
        .iter()
        .filter_map(|row| Some((row.rotations as f64, row.rotated?, row.rotation_summary)))
        .collect();
    let reading = |(weight, rotated, summary): &(f64, StoredRotation, Option<RotationSummary>)| Reading {
        weight: *weight,
        place: Rotation::of(&rotated.rotation_rad),
        covariance: rotated.covariance_rad2,
        spread: summary.map_or_else(Spread::none, |s| Spread {
            scatter: s.scatter_rad2,
            least: s.least_rad,
            most: s.most_rad,
        }),
    };
    let mean = joined(&seen.iter().map(reading).collect::<Vec<_>>())?;
    let landmarks: f64 = seen.iter().map(|(weight, rotated, _)| weight * rotated.n_landmarks).sum();
    let rotated = StoredRotation {
        rotation_rad: mean.place.vector_rad(),
        covariance_rad2: mean.covariance,
        n_landmarks: landmarks / mean.weight,
    };
    let Spread { scatter, least, most } = mean.spread;
    Some((rotated, RotationSummary { scatter_rad2: scatter, least_rad: least, most_rad: most }))
}
