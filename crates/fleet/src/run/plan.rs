//! The identity of a run, as text: the parts of a run with another identity are not used.

use super::Job;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::time::UNIX_EPOCH;

/// Raised when the format of the parts changes.
const VERSION: u32 = 2;

/// Returns inputs with their sizes and times, cameras, noise; equal where every part would be the same.
pub(super) fn of(job: &Job) -> String {
    let mut plan = format!("resight batch, parts of version {VERSION}\n");
    for path in job.inputs {
        let about = std::fs::metadata(path).ok();
        let bytes = about.as_ref().map_or(0, std::fs::Metadata::len);
        let modified = about.and_then(|about| about.modified().ok()?.duration_since(UNIX_EPOCH).ok());
        let _ = writeln!(plan, "{} {bytes} {}", path.display(), modified.map_or(0, |at| at.as_nanos()));
    }
    let cameras = &job.solver.cameras;
    let mut digest = Sha256::new();
    for (number, name) in cameras.names().iter().enumerate() {
        digest.update(name.as_bytes());
        digest
            .update(format!("{:?}{:?}", cameras.cameras()[number], cameras.points(number as u32)).as_bytes());
    }
    let bytes: String = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    let _ = writeln!(plan, "cameras {bytes}\nsigma_px {}", job.solver.sigma_px);
    plan
}
