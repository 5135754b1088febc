//! An answer in words, for a person with ten minutes.

pub mod scene;

use resight::answer::{GeoreferencedPose, PoseAnswer};
use resight::core::locate::PoseEstimate;
use resight::core::locate::choose::{Hypothesis, Minimum};
use resight::core::locate::warnings::PoseWarning;
use resight::report::explanation::WeighedExplanation;
use resight::report::verdict::{Status, figures};
use resight::report::words::{
    budget, coordinate, counted, degrees, distance_sigma_m, length, percent, position_sigma_m, sigmas,
    weakest, with_sigma, yaw_pitch_roll_rad,
};
use std::fmt::Write;

/// The explanations worth reading: all of an inconsistent answer, else the best one where it is not as stated.
pub fn explained(out: &mut String, all: &[WeighedExplanation], is_inconsistent: bool) {
    for (i, one) in WeighedExplanation::worth_reading(all, is_inconsistent).iter().enumerate() {
        line(out, if i == 0 { "explained" } else { "or" }, &format!("by {}", one.message));
    }
}

/// One paragraph per view: where, how uncertain, verdict and advice.
pub fn describe(answer: &PoseAnswer) -> String {
    let mut out = format!("{}   {}\n", answer.view, headline(answer));
    if let Some(estimate) = &answer.estimate {
        let fitting: Vec<Hypothesis> = estimate.minima().filter(|h| h.is_alternative).collect();
        for (i, fits) in fitting.iter().enumerate() {
            if 1 < fitting.len() {
                let label = format!("pose {} of {}", i + 1, fitting.len());
                line(&mut out, &label, &of_several(fits, answer.image_unit));
            }
            out.push_str(&pose(&fits.minimum));
            if let Some(text) = answer.budget.as_ref().filter(|_| i == 0).and_then(budget) {
                line(&mut out, "budget", &text);
            }
            if let Some(observability) = answer.observability.as_ref().filter(|_| i == 0) {
                line(&mut out, "weakest", &weakest(observability));
            }
        }
        out.push_str(&fit(answer, estimate));
    }
    if let Some(place) = &answer.georeference {
        on_earth(&mut out, place);
    }
    if let Some(focal) = &answer.estimated_focal {
        line(&mut out, "lens", &focal.words());
    }
    if let Some(cost) = &answer.intrinsics_cost {
        line(&mut out, "intrinsics", &cost.words());
    }
    if let Some([w, h]) = answer.scaled_from_px {
        let text = format!(
            "scaled from {w} × {h} px to the size of this image: right where it is the whole image, resized; wrong for a crop"
        );
        line(&mut out, "intrinsics", &text);
    }
    if let Some(agreement) = &answer.agreement {
        line(&mut out, "consensus", &agreement.sentence(&answer.names, answer.image_unit));
    }
    let mut message = capitalised(&answer.verdict.message);
    if !message.ends_with(['.', '!', '?']) {
        message.push('.');
    }
    line(&mut out, "verdict", &message);
    answer.remarks.iter().for_each(|remark| line(&mut out, "remark", remark));
    for skipped in &answer.skipped {
        line(&mut out, "left out", skipped);
    }
    out
}

fn headline(answer: &PoseAnswer) -> &'static str {
    match answer.verdict.status {
        Status::Ok => "OK",
        Status::Ambiguous if answer.estimate.is_some_and(|e| 2 < e.n_alternatives()) => {
            "AMBIGUOUS: more than two poses fit"
        }
        Status::Ambiguous => "AMBIGUOUS: two poses fit",
        Status::Degenerate => "NO POSE: these points do not determine one",
        Status::Inconsistent => "INCONSISTENT: do not trust this pose yet",
        Status::NotFound => "NOT FOUND: no target in this image",
        Status::NotConnected => "NOT CONNECTED: no chain of observations joins all cameras",
        Status::Implausible => "IMPLAUSIBLE: a size or unit that hardly exists",
        Status::Undecided => "UNDECIDED: the data do not say which",
        Status::Error => "ERROR",
    }
}

/// What stands above one of several poses: its error bars hold only if it is the right one.
fn of_several(fits: &Hypothesis, unit: &str) -> String {
    let (probability, rms) = (percent(fits.probability), figures(fits.minimum.rms_px));
    format!(
        "probability {probability}, rms {rms} {unit}; the standard deviations are those of this pose alone"
    )
}

fn pose(e: &Minimum) -> String {
    let mut out = String::new();
    let (distance_m, sigma_m) = distance_sigma_m(&e.cam_from_target, &e.covariance);
    line(&mut out, "distance", &format!("{} from the target's origin", with_sigma(distance_m, sigma_m)));
    let place = e.cam_from_target.origin();
    let sigma = position_sigma_m(&e.cam_from_target, &e.covariance);
    let axes = ["x", "y", "z"].iter().enumerate();
    let coordinates: Vec<String> =
        axes.map(|(i, name)| format!("{name} {}", coordinate(place[i], sigma[i]))).collect();
    line(&mut out, "camera at", &format!("{}   (target frame)", coordinates.join("   ")));
    let [yaw, pitch, roll] = yaw_pitch_roll_rad(&e.cam_from_target);
    let (turn, _) = sigmas(&e.covariance);
    let turned = format!(
        "yaw {:+.2}°   pitch {:+.2}°   roll {:+.2}°   ± {} {} {} about the camera's x y z",
        yaw.to_degrees(),
        pitch.to_degrees(),
        roll.to_degrees(),
        rotation_sigma(turn[0]),
        rotation_sigma(turn[1]),
        rotation_sigma(turn[2])
    );
    line(&mut out, "orientation", &turned);
    let xi = e.cam_from_target.log();
    line(
        &mut out,
        "rotation",
        &format!("[{:+.6} {:+.6} {:+.6}] rad   (cam_from_target, rotation vector)", xi[0], xi[1], xi[2]),
    );
    let t = e.cam_from_target.translation;
    let (x, y, z) = (t.x, t.y, t.z);
    line(&mut out, "translation", &format!("[{x:+.6} {y:+.6} {z:+.6}] m   (cam_from_target)"));
    out
}

/// Where the camera is on the Earth, and where it looks.
fn on_earth(out: &mut String, place: &GeoreferencedPose) {
    if let (Some(lat), Some(lon)) = (place.lat_deg, place.lon_deg) {
        let height = with_sigma(place.height_m, place.height_sigma_m);
        line(out, "on Earth", &format!("latitude {lat:.8}°   longitude {lon:.8}°   height {height}"));
    }
    if let (Some(easting), Some(northing)) = (place.easting_m, place.northing_m) {
        let height = with_sigma(place.height_m, place.height_sigma_m);
        let text = format!(
            "easting {easting:.3} m   northing {northing:.3} m   height {height}   ({})",
            place.coordinate_system
        );
        line(out, "in the grid", &text);
    }
    let sigmas = [place.east_sigma_m, place.north_sigma_m, place.height_sigma_m].map(length);
    line(out, "", &format!("± {} east, {} north, {} up", sigmas[0], sigmas[1], sigmas[2]));
    let angle = |x: f64, sigma: f64| format!("{:.2}° ± {}", x.to_degrees(), degrees(sigma));
    let mut parts = Vec::new();
    if let (Some(heading), Some(sigma)) = (place.heading_rad, place.heading_sigma_rad) {
        parts.push(format!("heading {}", angle(heading, sigma)));
    }
    let side = if place.tilt_rad < 0.0 { "above" } else { "below" };
    parts.push(format!("{} {side} the horizon", angle(place.tilt_rad.abs(), place.tilt_sigma_rad)));
    if let (Some(roll), Some(sigma)) = (place.roll_rad, place.roll_sigma_rad) {
        parts.push(format!("roll {}", angle(roll, sigma)));
    }
    // The top of an image that looks down, where the heading of its axis says little.
    if let (true, Some(up), Some(sigma)) =
        (NEARLY_DOWN_RAD < place.tilt_rad, place.image_up_heading_rad, place.image_up_heading_sigma_rad)
    {
        parts.push(format!("the image's top towards {}", angle(up, sigma)));
    }
    line(out, "looks", &format!("{}   ({} north)", parts.join("   "), place.north));
}

/// A camera that is tilted by more looks down.
const NEARLY_DOWN_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// Half a turn is all there is.
fn rotation_sigma(sigma_rad: f64) -> String {
    if std::f64::consts::PI < sigma_rad { "> 180°".into() } else { degrees(sigma_rad) }
}

fn fit(answer: &PoseAnswer, e: &PoseEstimate) -> String {
    let mut out = String::new();
    let unit = answer.image_unit;
    let sigma = answer.sigma_px.map(|s| format!(" at σ {} {unit}", figures(s))).unwrap_or_default();
    let chi2 = match e.degrees_of_freedom {
        0 => "nothing left over to check it with".to_string(),
        degrees_of_freedom => format!("χ² {} for {degrees_of_freedom} degrees of freedom", figures(e.chi2)),
    };
    let counted = match answer.n_lines {
        0 => counted(e.n_points, "point"),
        n => format!("{} and {}", counted(answer.n_points, "point"), counted(n, "line")),
    };
    let of_which = if 1 < e.n_alternatives() { " (pose 1)" } else { "" };
    let text = format!(
        "rms {} {unit} over {counted}{sigma}, {chi2}, by {}{of_which}",
        figures(e.rms_px),
        resight::locate::method_name(e.method)
    );
    line(&mut out, "fit", &text);
    for doubt in e.warnings() {
        match doubt {
            PoseWarning::SharedError(px) => {
                let text = format!(
                    "neighbouring points are displaced together by about {} {unit}, most of it taken up by the pose (a bent target, a lens not quite known); every ± holds that",
                    figures(px)
                );
                line(&mut out, "shared", &text);
            }
            // The verdict says these.
            PoseWarning::Contradiction | PoseWarning::SecondSolution => {}
            PoseWarning::NothingChecks | PoseWarning::Unrefined => {}
        }
    }
    out
}

/// Width of printed text, letters.
const WIDTH: usize = 110;

/// One labelled line, broken between words and continued under the text where it is long.
pub fn line(out: &mut String, label: &str, text: &str) {
    const INDENT: usize = 14;
    let (mut column, mut label) = (INDENT, label);
    out.push_str("  ");
    // Split at single spaces only: columns are set with several.
    for (i, word) in text.split(' ').enumerate() {
        let n = word.chars().count();
        if i == 0 {
            // Writing to a String cannot fail.
            let _ = write!(out, "{label:<11} {word}");
            label = "";
        } else if 0 < n && WIDTH < column + 1 + n {
            let _ = write!(out, "\n  {label:<11} {word}");
            column = INDENT;
        } else {
            let _ = write!(out, " {word}");
            column += 1;
        }
        column += n;
    }
    out.push('\n');
}

fn capitalised(text: &str) -> String {
    let first_word = text.split(' ').next().unwrap_or_default();
    if !first_word.chars().all(char::is_alphabetic) {
        return text.to_string(); // A name such as `wang2004` keeps its spelling.
    }
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}
