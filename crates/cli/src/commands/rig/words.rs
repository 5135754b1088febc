//! A rig in words and tables.

use crate::text::line;
use resight::answer::SolvedRig;
use resight::core::multiview::rig::shared_views as shared;
use resight::formats::cells;
use resight::report::rig::{
    lens_sentences, rejection_sentence, rig_camera_sentence, rig_explanations, rig_verdict,
    rig_verdict_sentence, scale_sentences, time_sentence, weakest_link_sentence,
};
use resight::report::verdict::{Verdict, figures};
use resight::report::words::{
    budget, coordinate, counted, degrees, distance_sigma_m, length, position_sigma_m, sigmas,
};
use resight::rig::gather::Gathered;
use resight::rig::relative::between;
use std::collections::BTreeMap;

/// What was left out is named up to here; the JSON names all.
const MAX_NAMED: usize = 8;
/// More pairs than this are counted; the JSON names all.
const MAX_PAIRS: usize = 28;

/// The table of shared views, cameras × cameras; the diagonal holds the views of each.
pub fn shared_views(gathered: &Gathered) -> String {
    let names: Vec<&str> = gathered.rig.cameras.iter().map(|camera| camera.name.as_str()).collect();
    let counts = shared(&gathered.rig.problem()).counts;
    let mut table = vec![std::iter::once(String::new()).chain(names.iter().map(|n| n.to_string())).collect()];
    for (name, row) in names.iter().zip(&counts) {
        let cells = row.iter().map(|n| if *n == 0 { "-".to_string() } else { n.to_string() });
        table.push(std::iter::once(name.to_string()).chain(cells).collect());
    }
    format!(
        "shared views ({} in all; on the diagonal those of each camera)\n{}",
        counted(gathered.rig.views.len(), "view"),
        columns(&table)
    )
}

/// Rows of cells, the first column to the left, the others to the right.
fn columns(table: &[Vec<String>]) -> String {
    let n = table.iter().map(Vec::len).max().unwrap_or(0);
    let width = |i: usize| cells::width(table.iter().filter_map(|row| row.get(i)).map(String::as_str));
    let widths: Vec<usize> = (0..n).map(width).collect();
    let mut out = String::new();
    for row in table {
        let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, width))| match i {
            0 => format!("  {}", cells::left(cell, *width)),
            _ => format!("   {}", cells::right(cell, *width)),
        });
        out.push_str(cells.collect::<String>().trim_end());
        out.push('\n');
    }
    out
}

/// The whole answer, whether it can be believed first.
pub fn describe(solved: &SolvedRig) -> String {
    let Verdict { status, message } = rig_verdict(&solved.run);
    let word = status.name().to_uppercase();
    let mut out = match rig_verdict_sentence(&solved.run) {
        Some(sentence) => format!("{word}   {sentence}.\n\n"),
        None => format!("{word}   "),
    };
    out.push_str(&format!("RIG   {message}\n\n"));
    out.push_str(&cameras(solved));
    for (i, text) in solved.run.solution.budgets.iter().map(budget).enumerate() {
        if let Some(text) = text {
            line(&mut out, "budget", &format!("{} {text}", name(solved, i)));
        }
    }
    crate::text::explained(
        &mut out,
        &rig_explanations(&solved.run),
        solved.run.solution.verdict.is_inconsistent,
    );
    for sentence in lens_sentences(&solved.run) {
        line(&mut out, "lens", &sentence);
    }
    if let Some(sentence) = time_sentence(&solved.run) {
        line(&mut out, "times", &sentence);
    }
    contradicted(solved, &mut out);
    out.push('\n');
    out.push_str(&pairs(solved));
    out.push('\n');
    world(solved, &mut out);
    weakest(solved, &mut out);
    line(&mut out, "scale", &scale_sentences(&solved.run).join(" "));
    left_out(solved, &mut out);
    out
}

/// How many were used of those there are.
fn of(n_used: usize, n: usize) -> String {
    if n_used == n { n.to_string() } else { format!("{n_used} of {n}") }
}

fn name(solved: &SolvedRig, camera: usize) -> &str {
    &solved.run.rig.cameras[camera].name
}

/// Where each camera is in the rig, with the standard deviation along the rig's axes, and how uncertain its direction is.
fn cameras(solved: &SolvedRig) -> String {
    let s = &solved.run.solution;
    let head = ["camera", "x", "y", "z", "rotation (x y z)", "±", "views", "seen", "used", "rms px"];
    let mut table = vec![head.map(str::to_string).to_vec()];
    for (i, camera) in s.cameras.iter().enumerate() {
        let place = camera.cam_from_rig.origin();
        let sigma_m = position_sigma_m(&camera.cam_from_rig, &camera.covariance);
        let (turn, _) = sigmas(&camera.covariance);
        let xi = camera.cam_from_rig.log();
        let turned = [0, 1, 2].map(|k| format!("{:+.3}°", xi[k].to_degrees())).join(" ");
        let coordinates = [0, 1, 2].map(|k| match i == s.reference {
            true => "0".to_string(),
            false => coordinate(place[k], sigma_m[k]),
        });
        let turn = turn.iter().copied().fold(0.0, f64::max);
        let (turned, turn) = match i == s.reference {
            true => ("reference".to_string(), String::new()),
            false => (turned, degrees(turn)),
        };
        let views = of(camera.n_views, s.shared.counts[i][i]);
        let counts = [views, camera.n_seen.to_string(), camera.n_used.to_string(), figures(camera.rms_px)];
        let cells = std::iter::once(name(solved, i).to_string()).chain(coordinates).chain([turned, turn]);
        table.push(cells.chain(counts).collect());
    }
    let frame = name(solved, s.reference);
    format!(
        "place in the frame of {frame} (x right, y down, z forward), rotation vector of cam_from_rig\n{}",
        columns(&table)
    )
}

/// Cameras that do not fit, other than the one that the verdict names.
fn contradicted(solved: &SolvedRig, out: &mut String) {
    for camera in 0..solved.run.solution.cameras.len() {
        if let Some(sentence) = rig_camera_sentence(&solved.run, camera) {
            line(out, "camera", &format!("{} inconsistent: {sentence}", name(solved, camera)));
        }
    }
}

fn pairs(solved: &SolvedRig) -> String {
    let s = &solved.run.solution;
    let n = s.cameras.len();
    let shares = |(a, b): &(usize, usize)| 0 < s.shared.counts[*a][*b];
    let pairs: Vec<(usize, usize)> =
        (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).filter(shares).collect();
    let mut table =
        vec![["pair", "shared views", "apart", "±", "rotation", "±"].map(str::to_string).to_vec()];
    for (a, b) in pairs.iter().take(MAX_PAIRS) {
        let Some(pose) = between(s, *a, *b) else { continue };
        let turn = sigmas(&pose.covariance).0.into_iter().fold(0.0, f64::max);
        let (distance_m, sigma_m) = distance_sigma_m(&pose.b_from_a, &pose.covariance);
        table.push(vec![
            format!("{} – {}", name(solved, *a), name(solved, *b)),
            of(s.verdict.used_views[*a][*b], s.shared.counts[*a][*b]),
            format!("{:.1} mm", 1e3 * distance_m),
            length(sigma_m),
            format!("{:.3}°", pose.b_from_a.angle_to_rad(&resight::core::Pose::identity()).to_degrees()),
            degrees(turn),
        ]);
    }
    let more = pairs.len().saturating_sub(MAX_PAIRS);
    let more = if 0 < more { format!("  … and {more} more pairs, see --json\n") } else { String::new() };
    columns(&table) + &more
}

fn world(solved: &SolvedRig, out: &mut String) {
    let (Some(world), Some(target)) = (&solved.in_world, &solved.world_target) else { return };
    for (i, pose) in world.world_from_cam.iter().enumerate() {
        let place = pose.b_from_a.translation;
        let sigma_m = position_sigma_m(&pose.inverse().b_from_a, &pose.inverse().covariance);
        let coordinates: Vec<String> = ["x", "y", "z"]
            .iter()
            .enumerate()
            .map(|(k, axis)| format!("{axis} {}", coordinate(place[k], sigma_m[k])))
            .collect();
        let text = format!("{} at {}   (frame of {target})", name(solved, i), coordinates.join("   "));
        line(out, if i == 0 { "world" } else { "" }, &text);
    }
}

fn weakest(solved: &SolvedRig, out: &mut String) {
    if let Some(text) = weakest_link_sentence(&solved.run) {
        line(out, "weakest", &text);
    }
}

fn left_out(solved: &SolvedRig, out: &mut String) {
    let mut reasons: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for left_out in &solved.left_out {
        let place = format!("{} {}", left_out.camera, left_out.view);
        let what = if left_out.what == "frame" { place } else { format!("{place} {}", left_out.what) };
        reasons.entry(&left_out.reason).or_default().push(what);
    }
    for (reason, places) in reasons {
        let named = places.iter().take(MAX_NAMED).cloned().collect::<Vec<_>>().join(", ");
        let more = if MAX_NAMED < places.len() {
            format!(" and {} more", places.len() - MAX_NAMED)
        } else {
            String::new()
        };
        line(out, "left out", &format!("{named}{more}: {reason}"));
    }
    let results = solved.run.solution.observations.iter().enumerate();
    let rejected: Vec<(usize, String)> = results
        .filter_map(|(i, r)| r.rejected.as_ref().map(|reason| (i, rejection_sentence(reason))))
        .collect();
    for (i, reason) in rejected.iter().take(MAX_NAMED) {
        let observation = &solved.run.rig.observations[*i];
        let target = &solved.run.rig.targets[observation.target].name;
        let text =
            format!("{} {}, {target}: {reason}", name(solved, observation.camera), solved.taken_in[*i]);
        line(out, "rejected", &text);
    }
    if MAX_NAMED < rejected.len() {
        line(out, "rejected", &format!("and {} more observations, see --json", rejected.len() - MAX_NAMED));
    }
    let single = solved.run.solution.observations.iter().filter(|r| r.rejected.is_none());
    let n_points: usize =
        single.map(|r| r.residuals_px.iter().filter(|p| !matches!(p, Some((_, true)))).count()).sum();
    if 0 < n_points {
        line(
            out,
            "rejected",
            &format!("{n_points} single points farther off than their sigma allows; --json names them"),
        );
    }
}
