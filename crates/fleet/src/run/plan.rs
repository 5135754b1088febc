//! What a run is about, as text: parts of another run are none of this one.

use super::Job;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::time::UNIX_EPOCH;

/// Raised when parts are written in another way.
const VERSION: u32 = 2;

/// Inputs with their sizes and times, cameras, noise; equal where every part would be the same.
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
