//! Intrinsics in words.

use resight::answer::NumbersPartObject;
use resight::answer::intrinsics::{
    CameraCheck, CameraIntrinsics, IntrinsicsAnswer, IntrinsicsCheckAnswer, IntrinsicsObject,
};
use resight::report::words::{all_share_words, counted, shares};
use std::fmt::Write;
use std::path::Path;

/// At most so many bad corners are named.
const NAMED: usize = 5;

/// The answer for a person.
pub fn describe(answer: &IntrinsicsAnswer, output: Option<&Path>) -> String {
    let mut text: String = answer.cameras.iter().map(camera).collect::<Vec<_>>().join("\n");
    if let Some(path) = output {
        let written: Vec<String> = answer.reliable().into_iter().map(|camera| camera.name).collect();
        let _ = match written.is_empty() {
            true => writeln!(text, "\nnothing was written to {}: no answer may be relied on", path.display()),
            false => writeln!(text, "\nwrote {} ({})", path.display(), written.join(", ")),
        };
    }
    text
}

fn camera(camera: &CameraIntrinsics) -> String {
    let weak = if camera.is_weak() { ", WEAK" } else { "" };
    let mut text = format!("{}   {}{weak}\n  {}\n", camera.name, shout(camera.status.name()), camera.message);
    if let Some(found) = &camera.intrinsics {
        parameters(&mut text, found);
        views(&mut text, found);
    }
    for finding in camera.findings.iter().filter(|finding| finding.message != camera.message) {
        let _ = writeln!(text, "  - {}", finding.message);
    }
    for one in &camera.left_out {
        let _ = writeln!(text, "  left out: {} ({}): {}", one.view, one.what, one.reason);
    }
    if let Some(next) = camera.intrinsics.as_ref().and_then(|found| found.next_view.as_ref()) {
        let _ = writeln!(text, "  next view: {}", next.message);
    }
    text
}

fn shout(name: &str) -> String {
    name.to_uppercase().replace('_', " ")
}

fn parameters(text: &mut String, found: &IntrinsicsObject) {
    let _ = writeln!(text, "  {} for {} × {} px", found.model, found.width_px, found.height_px);
    for p in &found.parameters {
        let _ = match (p.name.ends_with("_px"), p.estimated) {
            (true, _) => writeln!(text, "    {:<6} {:>11.3} ± {:.3}", p.name, p.value, p.sigma),
            (false, true) => writeln!(text, "    {:<6} {:>11.6} ± {:.6}", p.name, p.value, p.sigma),
            (false, false) => writeln!(text, "    {:<6} {:>11} (the views do not need it)", p.name, p.value),
        };
    }
}

fn views(text: &mut String, found: &IntrinsicsObject) {
    let _ = writeln!(
        text,
        "  residuals {:.3} px over {} of {}; corners reach {:.0} % of the image",
        found.rms_px,
        counted(found.n_corners, "corner"),
        counted(found.views.len(), "view"),
        100.0 * found.coverage.share
    );
    if let Some(px) = found.projection.rms_px {
        let worst = found.projection.sigma_px.iter().flatten().copied().fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "  projection uncertainty {px:.3} px in the mean over the image, {worst:.3} px at worst"
        );
    }
    if let Some(parts) = all_share_words(shares(found.budget.iter().map(NumbersPartObject::share))) {
        let _ = writeln!(text, "  budget of that: {parts}");
    }
    if let Some(held) = &found.held_out {
        let _ = writeln!(
            text,
            "  views left out are predicted to {:.3} px ({:.3} px with all views); the two halves agree with p = {:.2}",
            held.rms_px, held.with_all_px, held.p
        );
    }
    for bad in &found.bad_views {
        let _ = writeln!(text, "  bad view: {}: {}", bad.view, bad.reason);
    }
    for bad in found.bad_corners.iter().take(NAMED) {
        let off = bad
            .residual_px
            .map_or("out of the camera's field".to_string(), |[u, v]| format!("{:.2} px off", u.hypot(v)));
        let _ = writeln!(text, "  bad corner: {} of {}: {off}", bad.point, bad.view);
    }
    if NAMED < found.bad_corners.len() {
        let _ =
            writeln!(text, "  and {} more bad corners (--json lists them)", found.bad_corners.len() - NAMED);
    }
}

/// A check for a person.
pub(super) fn describe_check(answer: &IntrinsicsCheckAnswer) -> String {
    answer.cameras.iter().map(check).collect::<Vec<_>>().join("\n")
}

fn check(camera: &CameraCheck) -> String {
    let mut text = format!("{}   {}\n  {}\n", camera.name, shout(camera.status.name()), camera.message);
    for p in &camera.offsets {
        let mark = if p.blamed { "  off" } else { "" };
        let _ = writeln!(
            text,
            "    {:<6} given {:>12.5}, add {:+.5} ± {:.5}{mark}",
            p.name, p.given, p.offset, p.sigma
        );
    }
    if let Some(p) = camera.p {
        let _ = writeln!(text, "  {}, p = {p:.1e}", counted(camera.n_views, "view"));
    }
    text
}
