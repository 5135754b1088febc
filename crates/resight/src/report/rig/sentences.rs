//! The weakest link of a rig, and the test of its scale, in sentences.

use super::pieces::number;
use crate::core::locate::suspects::{Fault, correction};
use crate::core::multiview::rig::{LensOffset, RejectedObservation, RigExplanation, RigWarning, TargetScale};
use crate::formats::NamedCamera;
use crate::report::explanation::{Named, WeighedExplanation};
use crate::report::html::escaped;
use crate::report::verdict::figures;
use crate::report::words;
use crate::rig::{LensChange, NamedRig, RigRun};

/// A relative uncertainty from which a size counts as unknown.
const WORTHLESS_SIGMA: f64 = 0.5;
/// So many corrections of a rig without a solution are named.
const MOST_CORRECTIONS: usize = 3;

/// Names the weakest connection of the rig and what would strengthen it; `None` for a single camera.
pub fn weakest_link_sentence(run: &RigRun) -> Option<String> {
    let link = run.solution.weakest_link.as_ref()?;
    let name = |camera: usize| run.rig.cameras.get(camera).map_or("?", |c| c.name.as_str());
    let views = if link.n_shared_views == 1 { "view" } else { "views" };
    Some(format!(
        "The rig hangs on {} – {}: {} is known least, ± {} and ± {} in the worst direction, with {} shared {views}. More views that show one \
         target to both cameras help most.",
        name(link.camera),
        name(link.with),
        name(link.camera),
        words::length(link.sigma_m),
        words::degrees(link.sigma_rad),
        link.n_shared_views,
    ))
}

/// States for each target whether its stated size agrees with all other measurements.
pub fn scale_sentences(run: &RigRun) -> Vec<String> {
    run.rig.targets.iter().zip(&run.solution.scales).map(|(t, scale)| of_scale(&t.name, scale)).collect()
}

fn of_scale(name: &str, scale: &TargetScale) -> String {
    let (off, sigma) = (scale.ratio - 1.0, scale.sigma);
    if !(sigma < WORTHLESS_SIGMA && off.is_finite()) {
        return format!(
            "{name}: nothing else here has a length to compare its size with; an error of 1 % in it is an error of 1 % in every distance."
        );
    }
    let decimals = words::decimals(100.0 * sigma);
    let share = format!("{:.decimals$} ± {:.decimals$} %", 100.0 * off.abs(), 100.0 * sigma);
    if !scale.is_clearly_off() {
        return format!("{name}: its stated size agrees with everything else within {share}.");
    }
    format!(
        "{name}: its stated size is {share} too {}: {} mm of {}; every ± holds that.",
        if off < 0.0 { "large" } else { "small" },
        number(1e3 * off.abs() * scale.extent_m, 2),
        words::length(scale.extent_m),
    )
}

/// Returns the explanations of the observations with the motion of every camera, the most probable first.
pub fn rig_explanations(run: &RigRun) -> Vec<WeighedExplanation> {
    let cameras: Vec<String> = run.rig.cameras.iter().map(|camera| camera.name.clone()).collect();
    let named = |what: RigExplanation| match what {
        RigExplanation::Lens { camera } => {
            let name = &cameras[camera];
            Named { key: "lens", of: Some(name.clone()), words: format!("another lens of {name}") }
        }
        RigExplanation::Size { target } => {
            let name = &run.rig.targets[target].name;
            Named { key: "target_size", of: Some(name.clone()), words: format!("another size of {name}") }
        }
        RigExplanation::Exchanged { a, b } => {
            let (a, b) = (&cameras[a], &cameras[b]);
            Named {
                key: "exchanged_lenses",
                of: Some(a.clone()),
                words: format!("each other's lens for {a} and {b}"),
            }
        }
        RigExplanation::Fault { camera, fault, second } => named_fault(&run.rig, camera, fault, second),
        RigExplanation::Late { camera, views } => {
            let name = &cameras[camera];
            let words = format!("cameras that do not expose together, {name} {views:+.2} views later");
            Named { key: "time", of: Some(name.clone()), words }
        }
        _ => Named::as_stated(),
    };
    let all = run.solution.explanations.iter().filter(|one| one.is_probable());
    all.map(|one| WeighedExplanation::of(one, named(one.what), &cameras)).collect()
}

/// Returns the correction of the faults of one camera, or of those that all cameras have.
fn named_fault(rig: &NamedRig, camera: Option<usize>, fault: Fault, second: Option<Fault>) -> Named {
    let faults: Vec<Fault> = [Some(fault), second].into_iter().flatten().collect();
    let stated = camera.map(|camera| &rig.cameras[camera]);
    let label = |point| format!("point {point}");
    let correction = correction(&faults, stated.map(|stated| &stated.camera), false, label);
    let of = stated.map(|stated| stated.name.clone());
    let words = format!("{} {correction}", of.as_deref().unwrap_or("every camera"));
    Named { key: fault.name(), of, words }
}

/// Names the corrections with one of which a rig without a solution is consistent; empty without one.
pub fn corrections_of_unsolved(rig: &NamedRig, faults: &[RigExplanation]) -> String {
    let named = |what: &RigExplanation| match *what {
        RigExplanation::Fault { camera, fault, second } => {
            Some(named_fault(rig, camera, fault, second).words)
        }
        _ => None,
    };
    let all: Vec<String> = faults.iter().filter_map(named).take(MOST_CORRECTIONS).collect();
    if all.is_empty() {
        return String::new();
    }
    format!("; the points agree for {}", all.join(", or for "))
}

/// Describes a warning for which every ± was widened; the others have sentences of their own.
fn widened(run: &RigRun, warning: &RigWarning) -> Option<String> {
    match warning {
        RigWarning::Residuals(times) => Some(format!(
            "; residuals are {} times what the sigmas say, and every ± is widened by as much",
            figures(*times)
        )),
        RigWarning::Neighbours(times) => Some(format!(
            "; neighbouring points are displaced together, and every ± is widened by {} for that",
            figures(*times)
        )),
        RigWarning::ViewsApart(times) => Some(format!(
            "; views contradict each other by {} times what their points explain, and every ± holds that",
            figures(*times)
        )),
        RigWarning::Lenses(sigma_m) => Some(format!("; {}", lens_doubt(run, *sigma_m))),
        RigWarning::Camera(..) | RigWarning::Target(..) | RigWarning::Views => None,
        RigWarning::Size(_) | RigWarning::LeftOut(_) => None,
    }
}

/// Describes what views show of the intrinsics where it is in every ±: whose are off most, and by what.
pub(super) fn lens_doubt(run: &RigRun, sigma_m: f64) -> String {
    let offsets = run.solution.verdict.lens_offsets.iter().enumerate();
    let most = offsets
        .filter_map(|(camera, offset)| Some((camera, (*offset)?)))
        .max_by(|a, b| a.1.explained_chi2.total_cmp(&b.1.explained_chi2));
    let whose = most.map_or(String::new(), |(camera, offset)| {
        format!(", those of {} most ({})", run.rig.cameras[camera].name, off(&offset, offset.clearest()))
    });
    format!(
        "views agree that intrinsics are off{whose}, and every ± holds that: places are known to ± {}",
        words::length(sigma_m)
    )
}

/// Describes the error of a parameter by the correction to be added to it.
pub(super) fn off(offset: &LensOffset, parameter: &'static str) -> String {
    let percent = |x: f64, sigma: f64| format!("by about {:+.1} % ± {:.1} %", 100.0 * x, 100.0 * sigma);
    match parameter {
        "focal length" => format!("the focal length is off {}", percent(offset.focal, offset.sigma_focal)),
        "principal point" => {
            let [right, down] = offset.centre.map(|x| 100.0 * x);
            format!(
                "the principal point is off by about {right:+.1} % and {down:+.1} % of the focal length, right and down"
            )
        }
        what => format!(
            "the {what} moves its points {} of the focal length",
            percent(offset.distortion, offset.sigma_distortion)
        ),
    }
}

/// Returns one line: the numbers of cameras, views and points, and the residual.
pub(super) fn figures_of(run: &RigRun) -> String {
    let s = &run.solution;
    let warnings: String =
        s.warnings(run.rig.views.len()).iter().filter_map(|warning| widened(run, warning)).collect();
    format!(
        "{}, {}, {} of {} points used, rms {} px{warnings}",
        words::counted(s.cameras.len(), "camera"),
        words::counted(run.rig.views.len(), "view"),
        s.n_used,
        s.n_seen,
        figures(s.rms_px)
    )
}

/// Explains why an observation of a target took no part.
pub fn rejection_sentence(reason: &RejectedObservation) -> String {
    match reason {
        RejectedObservation::Undetermined(error) => error.to_string(),
        RejectedObservation::Contradicts { rms_px } => format!(
            "contradicts the other observations (rms {rms_px:.1} px): wrong labels, a moved target or another time"
        ),
        _ => "took no part".to_string(),
    }
}

/// States what became of each lens that was adjusted with the rig.
pub fn lens_sentences(run: &RigRun) -> Vec<String> {
    let sentence = |(change, camera): (&LensChange, &NamedCamera)| {
        let moved = change.moved.map(|moved| {
            format!(
                "differs from its file by {} px, at most {} px",
                figures(moved.rms_px),
                figures(moved.largest_px)
            )
        });
        let known = change.sigma_px.map(|sigma| format!("is known to ± {} px", figures(sigma)));
        let camera_moved = change.moved_camera.filter(|(m, rad)| 0.0 < m + rad).map(|(m, rad)| {
            format!("which moves the camera by {} and {}", words::length(m), words::degrees(rad))
        });
        let said: Vec<String> = [moved, known, camera_moved].into_iter().flatten().collect();
        match said.is_empty() {
            true => format!("The lens of {} was adjusted with the rig.", camera.name),
            false => format!("The lens of {} {}.", camera.name, said.join(", ")),
        }
    };
    run.lenses.iter().zip(&run.rig.cameras).map(sentence).collect()
}

/// States when the cameras exposed, as a moving target shows it; `None` where nothing shows it.
pub fn time_sentence(run: &RigRun) -> Option<String> {
    let times = run.times.as_ref()?;
    let name = |camera: usize| run.rig.cameras[camera].name.as_str();
    let known = || times.offset_s.iter().enumerate().filter_map(|(camera, known)| Some((camera, (*known)?)));
    let (compared_with, _) = known().find(|(_, (_, sigma_s))| *sigma_s == 0.0)?;
    let offset = |(camera, (offset_s, sigma_s)): (usize, (f64, f64))| {
        let (offset_ms, sigma_ms) = (1e3 * offset_s, 1e3 * sigma_s);
        format!("{} {offset_ms:+.*} ± {} ms", name(camera), decimals(sigma_ms), figures(sigma_ms))
    };
    let others: Vec<String> = known().filter(|(camera, _)| *camera != compared_with).map(offset).collect();
    let stamps =
        if times.stamps_count { "" } else { "; stamps scatter more than exposures, and count in the mean" };
    let row = times.line_time_s.map(|(line_s, sigma_s)| {
        let (line_us, sigma_us) = (1e6 * line_s, 1e6 * sigma_s);
        format!("; from row to row {line_us:.*} ± {} µs", decimals(sigma_us), figures(sigma_us))
    });
    let others = match others.is_empty() {
        true => String::new(),
        false => format!(
            "Exposed later than their stamps say, beside {}: {}{stamps}",
            name(compared_with),
            others.join(", ")
        ),
    };
    Some(format!("{others}{}; points of the moving target are moved by this.", row.unwrap_or_default()))
}

/// Returns the number of decimals that a number with this standard deviation has.
fn decimals(sigma: f64) -> usize {
    (1.0 - sigma.log10().floor()).clamp(0.0, 6.0) as usize
}

pub(super) fn section(run: &RigRun) -> String {
    let explanations = rig_explanations(run);
    let is_inconsistent = run.solution.verdict.is_inconsistent;
    let shown = WeighedExplanation::worth_reading(&explanations, is_inconsistent);
    let sentences = shown
        .iter()
        .map(|one| format!("Explained by {}.", one.message))
        .chain(weakest_link_sentence(run))
        .chain(scale_sentences(run))
        .chain(lens_sentences(run))
        .chain(time_sentence(run));
    sentences.map(|s| format!("<p>{}</p>\n", escaped(&s))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_said_with_their_side_and_millimetres() {
        let say = |ratio, sigma| of_scale("board", &TargetScale { ratio, sigma, extent_m: 0.3 });
        assert_eq!(
            say(1.004, 0.0005),
            "board: its stated size is 0.400 ± 0.050 % too small: 1.2 mm of 300 mm; every ± holds that."
        );
        assert!(say(0.996, 0.0005).contains("too large"));
        assert!(say(1.001, 0.0005).contains("agrees"));
        for sigma in [f64::INFINITY, 1.49, f64::NAN] {
            assert!(say(1.0, sigma).contains("1 % in every distance"));
        }
    }
}
