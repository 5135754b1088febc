//! The origin of the page: command, files with their hashes, versions; and the conventions of its numbers.

use super::pieces::{row, tabular};
use crate::report::html::escaped;
use crate::rig::RigRun;

const CONVENTIONS: &str = "<ul class=\"note\">\
<li>b_from_a maps coordinates: x_in_b = b_from_a · x_in_a. The frame of the rig is that of its reference camera.</li>\
<li>Cameras: x right, y down, z forward. Pixel (0, 0) is the centre of the top-left pixel; u runs to the right, v down.</li>\
<li>Residual: observed − predicted. Root mean squares are over the points used, both coordinates of a point together.</li>\
<li>Covariances are of a small left motion [rotation; translation] in frame b. ± is one standard deviation; ellipses and ellipsoids hold 95 %.</li>\
</ul>";

pub(super) fn section(run: &RigRun) -> String {
    let files: String = run
        .inputs
        .iter()
        .map(|f| row(&[escaped(&f.path), format!("<code>{}</code>", escaped(&f.sha256))]))
        .collect();
    let files = tabular("files", "The files read", &["file", "SHA-256"], &files);
    let command = run.command.as_ref();
    let command = command.map_or(String::new(), |line| format!("<pre>{}</pre>\n", escaped(line)));
    format!(
        "{command}{files}\n<p class=\"note\">resight {}; {} steps of the joint adjustment.</p>\n{CONVENTIONS}",
        env!("CARGO_PKG_VERSION"),
        run.solution.steps,
    )
}
