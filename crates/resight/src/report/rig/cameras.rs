//! The table of cameras: position, rotation, uncertainties, points used.

use super::pieces::{color_class, fixed, row, tabular};
use super::sentences::lens_doubt;
use crate::core::Pose;
use crate::core::budget::{Budget, ErrorSource};
use crate::core::multiview::rig::CameraInRig;
use crate::core::multiview::rig::RigWarning;
use crate::formats::NamedCamera;
use crate::report::html::escaped;
use crate::report::words;
use crate::rig::RigRun;
use crate::scene::geometry;

const HEAD: [&str; 11] = [
    "camera",
    "status",
    "place x",
    "y",
    "z (rig frame)",
    "yaw, pitch, roll",
    "± about its x y z",
    "views used / seen",
    "points used / seen",
    "left out",
    "rms, px",
];

/// Returns the table, one row per camera.
pub(super) fn table(run: &RigRun) -> String {
    let rows: String = (0..run.rig.cameras.len()).map(|camera| row(&cells(run, camera))).collect();
    tabular("cameras", "Where each camera stands; ± is one standard deviation", &HEAD, &rows)
}

fn cells(run: &RigRun, camera: usize) -> Vec<String> {
    let placed = &run.solution.cameras[camera];
    let name = escaped(&run.rig.cameras[camera].name);
    let lens = escaped(run.rig.lenses[camera].model_name());
    let mut cells = vec![format!(
        "<span class=\"swatch {}\"></span>{name}<br><small>{lens}</small>",
        color_class(camera)
    )];
    cells.push(super::camera_status(run, camera).name().to_string());
    cells.extend(if camera == run.solution.reference { reference() } else { place(placed) });
    let left_out = placed.n_seen.saturating_sub(placed.n_used);
    let share = 100.0 * left_out as f64 / placed.n_seen.max(1) as f64;
    cells.extend([
        format!(
            "{} / {}",
            super::grouped(placed.n_views),
            super::grouped(run.solution.shared.counts[camera][camera])
        ),
        format!("{} / {}", super::grouped(placed.n_used), super::grouped(placed.n_seen)),
        format!("{} ({} %)", super::grouped(left_out), fixed(share, 1)),
        fixed(placed.rms_px, 3),
    ]);
    cells
}

fn reference() -> Vec<String> {
    ["0", "0", "0", "the rig's own frame", "exact"].map(String::from).to_vec()
}

fn place(placed: &CameraInRig) -> Vec<String> {
    let covariance = geometry::position_covariance(&placed.cam_from_rig, &placed.covariance);
    let origin = placed.cam_from_rig.origin();
    let coordinate = |i: usize| words::coordinate(origin[i], covariance[(i, i)].max(0.0).sqrt());
    let (turns, _) = words::sigmas(&placed.covariance);
    vec![
        coordinate(0),
        coordinate(1),
        coordinate(2),
        turned(&placed.cam_from_rig, turns),
        turns.map(words::degrees).join(" "),
    ]
}

/// Writes angles with the decimals that the standard deviations justify.
fn turned(cam_from_rig: &Pose, sigmas_rad: [f64; 3]) -> String {
    let decimals = words::decimals(sigmas_rad.into_iter().fold(0.0, f64::max).to_degrees());
    let angle = |x: f64| format!("{:+.decimals$}°", x.to_degrees());
    words::yaw_pitch_roll_rad(cam_from_rig).map(angle).join(" ")
}

/// Describes a warning for which every ± was widened; the others are elsewhere on the page.
fn widened(run: &RigRun, warning: &RigWarning) -> Option<String> {
    match warning {
        RigWarning::Residuals(times) => Some(format!(
            "The residuals are {} times what the stated standard deviations of the points say: every ± here was widened by as much.",
            fixed(*times, 2)
        )),
        RigWarning::Neighbours(times) => Some(format!(
            " Neighbouring points are displaced together: every ± was widened by {} for that.",
            fixed(*times, 2)
        )),
        RigWarning::ViewsApart(times) => Some(format!(
            " Views contradict each other by {} times what their points explain (cameras that are not synchronised, a bent board): every ± holds that.",
            fixed(*times, 2)
        )),
        RigWarning::Lenses(sigma_m) => Some(format!(" Moreover, {}.", escaped(&lens_doubt(run, *sigma_m)))),
        RigWarning::Camera(..) | RigWarning::Target(..) | RigWarning::Views => None,
        RigWarning::Size(_) | RigWarning::LeftOut(_) => None,
    }
}

/// Explains the columns, and the factor on the stated noise.
pub(super) fn legend(run: &RigRun) -> String {
    let warnings = run.solution.warnings(run.rig.views.len());
    let agree = match warnings.iter().any(|warning| matches!(warning, RigWarning::Residuals(_))) {
        true => "",
        false => "The residuals are as large as the stated standard deviations of the points say.",
    };
    let widened: String = warnings.iter().filter_map(|warning| widened(run, warning)).collect();
    let noise = format!("{agree}{widened}");
    format!(
        "<p class=\"note\">Places are those of the cameras' centres along the axes of the rig; cam_from_rig = R_z(roll) · R_x(pitch) · R_y(yaw). {noise}</p>"
    )
}

/// Draws what the variance of each camera's position consists of; nothing where one source is all there is.
pub(super) fn budgets(run: &RigRun) -> String {
    let bar_of = |(budget, camera): (&Budget, &NamedCamera)| {
        let shares = words::budget_shares(budget);
        let (mut at, mut bar, mut named) = (0.0, String::new(), Vec::new());
        for (source, share) in shares {
            let color = color_class(ErrorSource::ALL.iter().position(|one| *one == source).unwrap_or(0));
            let (x, width) = (fixed(at, 2), fixed(100.0 * share, 2));
            bar.push_str(&format!("<rect class=\"{color}\" x=\"{x}\" width=\"{width}\" height=\"2\"/>"));
            named.push(format!(
                "<span class=\"swatch {color}\"></span>{}",
                words::share_words((source, share))
            ));
            at += 100.0 * share;
        }
        let (name, sigma) = (escaped(&camera.name), words::length(words::budget_sigma_m(budget)));
        let text = format!("<p class=\"note\">{name} ± {sigma}: {}</p>", named.join(" "));
        let svg = format!("<svg class=\"budget\" viewBox=\"0 0 100 2\" aria-hidden=\"true\">{bar}</svg>");
        (!named.is_empty()).then(|| text + &svg)
    };
    run.solution.budgets.iter().zip(&run.rig.cameras).filter_map(bar_of).collect()
}
