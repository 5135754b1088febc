//! The page of a rig: one file with the cameras' poses, their uncertainty and the data behind them, without a network.
//!
//! Everything is shown without scripts too: tables, drawings and a three-dimensional view. With scripts the view can be rotated and every single
//! residual inspected. The same run gives the same bytes.

mod cameras;
mod data;
mod origin;
mod pairs;
mod pieces;
mod plan;
mod residuals;
mod sentences;
mod space;
mod verdict;
mod views;

use super::html::{Page, escaped};
use crate::report::verdict::Status;
use crate::rig::RigRun;
use crate::scene::geometry::{self, Extent, TargetInView};

pub(crate) use sentences::corrections_of_unsolved;
pub use sentences::{
    lens_sentences, rejection_sentence, rig_explanations, scale_sentences, time_sentence,
    weakest_link_sentence,
};
pub use verdict::{camera_status, rig_camera_sentence, rig_status, rig_verdict, rig_verdict_sentence};

const STYLE: &str = include_str!("rig/page.css");
/// The parts of one script, which share one scope and nothing else on the page.
const SCRIPTS: [&str; 5] = [
    include_str!("rig/data.js"),
    include_str!("rig/view.js"),
    include_str!("rig/space.js"),
    include_str!("rig/residuals.js"),
    include_str!("rig/controls.js"),
];

/// Data shared by several parts of the page, computed once.
struct Drawn<'a> {
    run: &'a RigRun,
    targets: Vec<TargetInView>,
    extent: Extent,
    ellipse_magnification: f64,
}

impl<'a> Drawn<'a> {
    fn new(run: &'a RigRun) -> Self {
        let targets = geometry::targets_in_views(run);
        let extent = geometry::extent(run, &targets);
        let ellipse_magnification = geometry::ellipse_magnification(run, &extent);
        Drawn { run, targets, extent, ellipse_magnification }
    }

    fn camera_name(&self, camera: usize) -> String {
        escaped(&self.run.rig.cameras[camera].name)
    }
}

/// Returns the whole page as HTML: the file that `--report FILE.html` writes.
pub fn rig_page(run: &RigRun) -> String {
    let drawn = Drawn::new(run);
    let packed = residuals::packed(run);
    let n = run.rig.cameras.len();
    let mut page = Page::new(&format!("Rig of {n} camera{}", if n == 1 { "" } else { "s" }));
    page.style(STYLE).verdict(rig_status(run), &judged(run), &summary(run)).markup(controls());
    page.heading("Cameras")
        .markup(&cameras::table(run))
        .markup(&cameras::legend(run))
        .markup(&cameras::budgets(run));
    page.heading("In space").markup(&space::figure(&drawn)).markup(&plan::figure(&drawn));
    page.heading("Residuals").markup(&residuals::figures(&drawn, &packed));
    page.heading("What hangs on what").markup(&sentences::section(run)).markup(&pairs::table(run));
    page.heading("Views and cameras").markup(&views::table(run));
    page.heading("Left out").markup(&views::rejected(run));
    page.heading("Where this comes from").markup(&origin::section(run));
    page.markup(&data::json(&drawn, &packed)).markup(&script());
    page.html()
}

fn script() -> String {
    format!("<script>\n\"use strict\";(()=>{{\n{}}})();\n</script>", SCRIPTS.concat())
}

fn judged(run: &RigRun) -> String {
    match rig_verdict_sentence(run) {
        Some(sentence) => format!("{sentence}."),
        None if rig_status(run) == Status::Implausible => format!("{}.", run.rig.size_remarks().join("; ")),
        None => "Nothing seen contradicts this rig.".to_string(),
    }
}

/// Returns the key figures of the run.
fn summary(run: &RigRun) -> [(&'static str, String); 6] {
    let s = &run.solution;
    let share = 100.0 * s.n_used as f64 / s.n_seen.max(1) as f64;
    let per_dof = s.chi2 / s.degrees_of_freedom.max(1) as f64;
    [
        ("reprojection error, rms", format!("{} px", pieces::fixed(s.rms_px, 3))),
        ("points used", format!("{} of {} ({share:.1} %)", grouped(s.n_used), grouped(s.n_seen))),
        ("views", grouped(run.rig.views.len())),
        ("χ² per degree of freedom", pieces::fixed(per_dof, 2)),
        ("every ± widened by", format!("× {}", pieces::fixed((s.noise_scale * s.view_scale).sqrt(), 2))),
        ("frame of the rig", run.rig.cameras.get(s.reference).map_or(String::new(), |c| c.name.clone())),
    ]
}

/// Returns the controls of the view, for the three-dimensional image and the residuals; shown once scripts run.
fn controls() -> &'static str {
    "<div class=\"bar\" id=\"bar\" hidden><label>View <select id=\"view\"></select></label>\
     <button type=\"button\" id=\"before\" aria-label=\"view before\">◀</button>\
     <button type=\"button\" id=\"after\" aria-label=\"view after\">▶</button>\
     <span id=\"said\" role=\"status\"></span></div>"
}

/// Writes a number with narrow spaces: `12 345`.
fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if 0 < i && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn thousands_are_set_apart() {
        assert_eq!(super::grouped(7), "7");
        assert_eq!(super::grouped(1_234_567), "1\u{202f}234\u{202f}567");
    }
}
