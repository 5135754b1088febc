//! The verdict on a rig in words: the first line of the program's output, its files and the page.

use super::sentences::{figures_of, off};
use crate::core::multiview::rig::{Cause, LensOffset, Losses};
use crate::report::verdict::{Status, Verdict, figures};
use crate::rig::RigRun;

/// Returns the status of the whole rig, and the key figures in one line; a size that hardly exists comes before them.
pub fn rig_verdict(run: &RigRun) -> Verdict {
    let status = if run.solution.verdict.is_inconsistent { Status::Inconsistent } else { Status::Ok };
    Verdict { status, message: figures_of(run) }.with_sizes(&run.rig.size_remarks())
}

/// Returns the status of the whole rig.
pub fn rig_status(run: &RigRun) -> Status {
    rig_verdict(run).status
}

/// Returns the status of one camera of the rig; where a size is implausible, no camera is `ok`.
pub fn camera_status(run: &RigRun, camera: usize) -> Status {
    let losses = run.solution.verdict.cameras.get(camera);
    let status = if losses.is_none_or(Losses::is_ok) { Status::Ok } else { Status::Inconsistent };
    Verdict { status, message: String::new() }.with_sizes(&run.rig.size_remarks()).status
}

/// Describes the contradiction with its camera or target and the likely cause; `None` where nothing contradicts.
pub fn rig_verdict_sentence(run: &RigRun) -> Option<String> {
    let verdict = &run.solution.verdict;
    if !verdict.is_inconsistent {
        return None;
    }
    let of_lens = verdict.worst_camera.filter(|c| verdict.cameras[*c].cause == Some(Cause::Intrinsics));
    let of_target = verdict.targets.iter().position(|t| !t.is_ok());
    Some(match (of_lens, of_target, verdict.worst_camera) {
        (None, Some(target), _) => target_sentence(run, target),
        (_, _, Some(camera)) => rig_camera_sentence(run, camera).unwrap_or_default(),
        _ => views_sentence(run),
    })
}

/// Describes the fault of one camera; `None` without a fault.
pub fn rig_camera_sentence(run: &RigRun, camera: usize) -> Option<String> {
    let (solution, name) = (&run.solution, &run.rig.cameras[camera].name);
    let losses = &solution.verdict.cameras[camera];
    Some(match losses.cause? {
        Cause::Intrinsics => {
            let offset = solution.verdict.lens_offsets[camera].filter(LensOffset::is_off);
            let what = offset.map_or(String::new(), |offset| format!(" ({})", off(&offset, offset.worst())));
            format!(
                "{}; its intrinsics{what} are the likely cause: focal length, principal point, distortion or image size",
                lost(name, losses)
            )
        }
        Cause::ExchangedIntrinsics { with } => {
            let other = &run.rig.cameras[with].name;
            format!(
                "the camera files (or the images) of {name} and {other} look exchanged: with each other's lens the views agree; exchange the two and run again"
            )
        }
        Cause::Contradiction => format!(
            "{} of {} observations of {name} contradict the other cameras although most of them fit by themselves; views labelled wrongly, cameras that are not synchronised or are exchanged, or a target that moved are the likely cause",
            losses.n_lost, losses.n_observations
        ),
        Cause::Target => format!(
            "{}; the target is the likely cause: its kind, its rows and columns or its labels",
            lost(name, losses)
        ),
        Cause::Reference => {
            let reference = &run.rig.cameras[solution.reference].name;
            format!("{name} is placed in the frame of {reference}, which does not fit")
        }
        _ => format!(
            "residuals are {} times what the stated sigmas say, those of {name} most; intrinsics, a bent target, cameras that are not synchronised or a sigma stated too small are the likely cause",
            figures((solution.chi2 / solution.degrees_of_freedom.max(1) as f64).sqrt())
        ),
    })
}

fn lost(name: &str, losses: &Losses) -> String {
    match 100.0 * losses.share_lost() {
        percent if percent < 1.0 => format!("{name} does not agree with the other cameras"),
        percent => format!("{percent:.0} % of {name}'s points do not fit"),
    }
}

fn target_sentence(run: &RigRun, target: usize) -> String {
    let (name, scale) = (&run.rig.targets[target].name, &run.solution.scales[target]);
    match run.solution.verdict.targets[target].cause {
        Some(Cause::Size) => format!(
            "target {name} seems {:.4} ± {:.4} times as large as stated, judged by the other lengths; a size or a distance stated wrongly is the likely cause",
            scale.ratio, scale.sigma
        ),
        _ => format!(
            "the points of target {name} fit by themselves in no camera; its kind, its rows and columns, its labels or a sigma stated far too small are the likely cause"
        ),
    }
}

fn views_sentence(run: &RigRun) -> String {
    let views = &run.solution.verdict.contradicting_views;
    let named: Vec<&str> = views.iter().take(4).map(|view| run.rig.views[*view].as_str()).collect();
    let more = if named.len() < views.len() { ", …" } else { "" };
    format!(
        "{} of {} views {} ({}{more}); labels of views, synchronisation or a target that moved are the likely cause",
        views.len(),
        run.rig.views.len(),
        if views.len() == 1 { "contradicts itself" } else { "contradict themselves" },
        named.join(", ")
    )
}
