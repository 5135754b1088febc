//! Many readings as one: their mean on SE(3), how they lie about it, and how well a single one is known.
//!
//! ```text
//!   X_i  poses with weights n_i, each itself a mean with scatter S_i      M  mean: Σ n_i ξ_i = 0 with ξ_i = Log(X_i M⁻¹)
//!   S = Σ n_i (S_i + ξ_i ξ_iᵀ) / Σ n_i      to first order in the ξ; exact where every n_i is 1
//! ```
//! Errors that last from frame to frame do not average out, so the covariance kept is that of a single frame: the mean's own lies between
//! it and its n-th part.

use super::rows::{Measured, StoredRow, Summary};
use resight_core::{Matrix6, Pose, Vector6};

/// Newton steps on the mean; each squares the error, which starts at the scatter's square.
const STEPS: usize = 8;

/// Rows of one pair, session and state, as one. `rows` must not be empty.
pub(super) fn joined(rows: &[StoredRow], t_s: f64, span: super::Span) -> Option<StoredRow> {
    let first = rows.first()?;
    let seen: Vec<Seen> = rows.iter().filter_map(Seen::of).collect();
    let frames = rows.iter().map(|row| row.frames).sum::<u64>();
    let points: f64 = rows.iter().map(|row| row.n_points * row.frames as f64).sum();
    let (measured, summary) = many(&seen).unzip();
    Some(StoredRow {
        t_s,
        span,
        frames,
        readings: rows.iter().map(|row| row.readings).sum(),
        n_points: points / frames as f64,
        measured,
        summary,
        reason: if seen.is_empty() { common_reason(rows) } else { None },
        ..first.clone()
    })
}

/// The reason that all share.
fn common_reason(rows: &[StoredRow]) -> Option<String> {
    let first = rows.first()?.reason.as_ref()?;
    rows.iter().all(|row| row.reason.as_ref() == Some(first)).then(|| first.clone())
}

/// A row with a pose.
struct Seen {
    weight: f64,
    measured: Measured,
    summary: Summary,
}

impl Seen {
    fn of(row: &StoredRow) -> Option<Self> {
        let measured = row.measured?;
        let single = Summary {
            scatter: Matrix6::zeros(),
            least: Vector6::zeros(),
            most: Vector6::zeros(),
            most_rms_px: measured.rms_px,
        };
        Some(Seen { weight: row.readings as f64, measured, summary: row.summary.unwrap_or(single) })
    }
}

fn many(seen: &[Seen]) -> Option<(Measured, Summary)> {
    let mean = mean(seen)?;
    let total: f64 = seen.iter().map(|one| one.weight).sum();
    let average =
        |of: &dyn Fn(&Seen) -> Matrix6| seen.iter().map(|one| of(one) * one.weight).sum::<Matrix6>() / total;
    let motion = |one: &Seen| (one.measured.cam_from_target * mean.inverse()).log();
    let mean_square = seen.iter().map(|one| one.weight * one.measured.rms_px.powi(2)).sum::<f64>() / total;
    let summary = Summary {
        scatter: average(&|one| one.summary.scatter + motion(one) * motion(one).transpose()),
        least: extreme(seen.iter().map(|one| motion(one) + one.summary.least), f64::min),
        most: extreme(seen.iter().map(|one| motion(one) + one.summary.most), f64::max),
        most_rms_px: seen.iter().map(|one| one.summary.most_rms_px).fold(0.0, f64::max),
    };
    let covariance = average(&|one| one.measured.covariance);
    Some((Measured { cam_from_target: mean, covariance, rms_px: mean_square.sqrt() }, summary))
}

/// M.
fn mean(seen: &[Seen]) -> Option<Pose> {
    let mut mean = seen.first()?.measured.cam_from_target;
    let total: f64 = seen.iter().map(|one| one.weight).sum();
    for _ in 0..STEPS {
        let motion = |one: &Seen| (one.measured.cam_from_target * mean.inverse()).log() * one.weight;
        let step = seen.iter().map(motion).sum::<Vector6>() / total;
        mean = mean.moved(&step);
        if step.norm() < 1e-14 {
            break;
        }
    }
    Some(mean)
}

fn extreme(motions: impl Iterator<Item = Vector6>, of: fn(f64, f64) -> f64) -> Vector6 {
    motions.reduce(|a, b| a.zip_map(&b, of)).unwrap_or_else(Vector6::zeros)
}
