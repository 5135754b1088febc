//! Advice in words.

use resight::advise::words::{self, sigma_m, sigma_rad};
use resight::answer::advise::{
    BoardAdvice, CameraFigures, Figures, OutlookObject, PointsAdvice, SpreadObject, TargetAdvice,
};
use std::collections::BTreeMap;

/// Where the next point goes.
pub fn points(advice: &PointsAdvice) -> String {
    let (now, [x, y, z]) = (&advice.now, advice.now.camera_m);
    let mut out = format!(
        "{} marks at σ {} px, camera at ({x:.2}, {y:.2}, {z:.2}) m\n  now   {}\n{}\nthe next one, best first for the {}\n",
        now.n_points,
        now.sigma_px,
        figures(&now.figures),
        lens(now.figures.sigma_position_m, now.figures.sigma_position_exact_intrinsics_m)
            + &warnings(&now.figures),
        advice.aim
    );
    for s in &advice.suggestions {
        let [x, y, z] = s.x_in_target_m;
        let at = format!("{:<6} x {x:.2}  y {y:.2}  z {z:.2} m", s.id);
        out += &format!("  {}  {at:<36} {}\n{}", s.rank, figures(&s.figures), warnings(&s.figures));
    }
    let tried = &advice.tried;
    let sigma = if advice.aim == "rotation" { sigma_rad } else { sigma_m };
    let spread = match tried.sigma {
        None => "none tells the poses apart".to_string(),
        Some([best, median, worst]) => format!(
            "{} from ± {} to ± {}, half below ± {}",
            advice.aim,
            sigma(best),
            sigma(worst),
            sigma(median)
        ),
    };
    out + &format!(
        "\nof {} places tried: {spread}; {} out of sight, {} would leave the pose ambiguous\n",
        tried.n_tried, tried.n_hidden, tried.n_ambiguous
    )
}

/// `place ± 31 mm   rotation ± 0.21°   length ± 19 mm`.
fn figures(f: &Figures) -> String {
    let place = f.sigma_position_m.map_or("unknown".into(), sigma_m);
    let rotation = f.sigma_rotation_rad.map_or("unknown".into(), sigma_rad);
    let length = f.sigma_length_m.map_or(String::new(), |s| format!("   length ± {}", sigma_m(s)));
    format!("place ± {place}   rotation ± {rotation}{length}")
}

/// What uncertain intrinsics cost; nothing where they are exact.
fn lens(now: Option<f64>, exact: Option<f64>) -> String {
    let Some((now, exact)) = now.zip(exact) else { return String::new() };
    format!(
        "    the camera's intrinsics are uncertain: place ± {}, ± {} with exact ones\n",
        sigma_m(now),
        sigma_m(exact)
    )
}

/// Doubts and faults, one a line.
fn warnings(f: &Figures) -> String {
    f.layout_warnings.iter().chain(&f.first_order_limits).map(|text| format!("    ! {text}\n")).collect()
}

/// How well a target is seen.
pub fn target(advice: &TargetAdvice, sigma_px: f64) -> String {
    let (kind, n_points) = advice.target;
    let mut out = format!(
        "{kind} of {n_points} points at σ {sigma_px} px; standard deviations as the answers will state them\n\n{}",
        header("distance and tilt")
    );
    for (i, row) in advice.outlooks.iter().enumerate() {
        let ([a, b], [c, d]) = (row.distance_m, row.tilt_rad.map(f64::to_degrees));
        let name = match i {
            0 => "whole volume".to_string(),
            _ => format!("{a:.2} to {b:.2} m, {c:.0}° to {d:.0}°"),
        };
        out += &outlook(&name, &row.outlook);
    }
    out += &advice.outlooks.first().map_or(String::new(), |whole| {
        let median = |s: Option<SpreadObject>| s.map(|s| s.median);
        let o = &whole.outlook;
        lens(median(o.sigma_position_m), median(o.sigma_position_exact_intrinsics_m)) + &target_remarks(o)
    });
    if !advice.changes.is_empty() {
        out += &format!("\n{}", header("changes, best first"));
    }
    for change in &advice.changes {
        out += &outlook(&words::change(&change.change), &change.outlook);
    }
    match advice.changes.iter().find(|t| !t.enlarges_target) {
        None => out,
        Some(free) if free.cost_ratio < 0.97 => {
            out + &format!("\nwithout making it larger: {}\n", words::change(&free.change))
        }
        Some(_) => out + "\nwithout making it larger, nothing tried helps\n",
    }
}

fn target_remarks(o: &OutlookObject) -> String {
    let mut text = String::new();
    if 0.01 < o.ambiguous {
        text += &format!(
            "\n  ! {:.0} % of the answers over this volume will be ambiguous, {:.1} % have the wrong pose first; tilt the target, come closer or make it larger\n",
            100.0 * o.ambiguous,
            100.0 * o.wrong
        );
    }
    if 0.01 < o.first_order_fails {
        text += &format!(
            "  ! in {:.0} % of the views first-order figures do not hold (frontal, or a second pose near); there the table rests on drawn images\n",
            100.0 * o.first_order_fails
        );
    }
    if o.n_out_of_view != 0 {
        let share = 100.0 * o.n_out_of_view as f64 / o.n_views as f64;
        text += &format!(
            "  ! in {share:.0} % of the views the target does not fit into the image; step back or make it smaller\n"
        );
    }
    text
}

/// One row of the table of a target: place (median, 95 %), rotation, shares.
fn outlook(name: &str, o: &OutlookObject) -> String {
    let pair = |s: Option<SpreadObject>, write: fn(f64) -> String| match s {
        Some(s) => (write(s.median), write(s.p95)),
        None => ("–".into(), "–".into()),
    };
    let (place, place95) = pair(o.sigma_position_m, sigma_m);
    let (rotation, rotation95) = pair(o.sigma_rotation_rad, sigma_rad);
    let unseen = (o.n_out_of_view + o.n_undetermined) as f64 / o.n_views.max(1) as f64;
    format!(
        "  {name:<40} {place:>9} {place95:>9}   {rotation:>8} {rotation95:>8}   {:>8} {:>8} {:>8}\n",
        share(o.ambiguous),
        share(o.wrong),
        share(unseen)
    )
}

fn header(name: &str) -> String {
    format!(
        "  {name:<40} {:>9} {:>9}   {:>8} {:>8}   {:>8} {:>8} {:>8}\n",
        "position ±", "95 %", "rotation ±", "95 %", "ambig.", "wrong", "stale"
    )
}

fn share(part: f64) -> String {
    format!("{:.1} %", 100.0 * part)
}

/// Where the next boards go.
pub fn boards(advice: &BoardAdvice, sigma_px: f64) -> String {
    let now = &advice.now;
    let mut out = format!(
        "{} views, σ {sigma_px} px; each camera relative to {}: place and rotation, worst direction\n  now   {}\n\nboards to show next, each with those before it\n",
        now.n_views,
        now.reference,
        cameras(&now.cameras)
    );
    for s in &advice.suggestions {
        let ([x, y, z], [a, b, c]) = (s.centre_in_rig_m, s.front_in_rig);
        let first_order_limits =
            s.first_order_limits.iter().map(|d| format!("    ! in each camera alone: {d}\n"));
        out += &format!(
            "  {}  centre x {x:.2}  y {y:.2}  z {z:.2} m, front towards ({a:+.2} {b:+.2} {c:+.2}), seen by {}\n        {}\n{}",
            s.rank,
            s.seen_by.join(", "),
            cameras(&s.cameras),
            first_order_limits.collect::<String>()
        );
    }
    out
}

fn cameras(all: &BTreeMap<String, CameraFigures>) -> String {
    let one = |(name, c): (&String, &CameraFigures)| match c.determined {
        true => format!("{name} ± {} ± {}", sigma_m(c.sigma_position_m), sigma_rad(c.sigma_rotation_rad)),
        false => format!("{name} unknown"),
    };
    all.iter().map(one).collect::<Vec<_>>().join("   ")
}
