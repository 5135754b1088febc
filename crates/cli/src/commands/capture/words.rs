//! A capture in words.

use indicatif::ProgressStyle;
use resight::answer::CaptureAnswer;
use resight::answer::capture::CaptureViewAnswer;
use resight::capture::MATRIX;
use resight::report::words::counted;
use std::fmt::Write;
use std::path::Path;

/// The line of a kept image: the intrinsics so far, with ± as they shrink.
pub(super) fn kept(answer: &CaptureViewAnswer) -> String {
    let frame =
        Path::new(&answer.frame).file_name().map_or(answer.frame.as_str().into(), |n| n.to_string_lossy());
    let mut text = format!("{}  {frame}  {}", answer.view, counted(answer.n_points, "point"));
    match &answer.parameters {
        Some(parameters) => {
            for p in parameters.iter().filter(|p| MATRIX.contains(&p.name)) {
                let _ = write!(text, "  {} {:.1} ± {:.1}", p.name.trim_end_matches("_px"), p.value, p.sigma);
            }
            if let Some(px) = answer.progress.worst_px {
                let _ = write!(text, "  worst {px:.2} px");
            }
            let _ = write!(text, "  coverage {:.0} %", 100.0 * answer.progress.coverage_share);
        }
        None => text += "  no camera yet",
    }
    text + "\n"
}

/// The answer: whether it is enough, and the intrinsics in words.
pub(super) fn verdict(answer: &CaptureAnswer, intrinsics: &str) -> String {
    let name = answer.status.name().to_uppercase().replace('_', " ");
    let (kept, frames) = (answer.views.len(), counted(answer.n_frames, "image"));
    format!("capture   {name}   {kept} of {frames} kept\n  {}\n\n{intrinsics}", answer.message)
}

/// The line on a terminal that says what became of the newest image.
pub(super) fn style() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}
