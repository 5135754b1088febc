//! Two rigs.

use super::words::{Figures, headline, motion_sentence};
use super::{Compare, MotionObject, motion};
use crate::output::Printer;
use crate::text::line;
use anyhow::{Context, Result, bail};
use resight::core::temporal::compare::{Correlation, Moved, RigComparison, RigPlaces, compare_rigs};
use resight::report::verdict::{Status, figures};
use resight::rig::names::natural;
use resight::rig::places::PlacedRig;
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct RigsObject {
    kind: &'static str,
    /// `unmoved`, `moved`, or `undecided`: something moved, but other sets of cameras explain it as well.
    verdict: &'static str,
    alpha: f64,
    chi2: f64,
    dof: usize,
    /// Degrees of freedom of the noise, where A or B estimated it: `p` is of an F distribution then.
    #[serde(skip_serializing_if = "Option::is_none")]
    noise_dof: Option<f64>,
    p: f64,
    unmoved: Vec<String>,
    moved: Vec<CameraMotionObject>,
    /// Other sets of unmoved cameras that explain the poses about as well.
    rivals: Vec<Vec<String>>,
    only_in_a: Vec<String>,
    only_in_b: Vec<String>,
    /// Whether both files state the covariance of all cameras together.
    joint_covariance: bool,
    /// Of files that do not: what the test takes for granted instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    assumed: Option<String>,
    message: String,
}

#[derive(Serialize)]
struct CameraMotionObject {
    camera: String,
    #[serde(flatten)]
    motion: MotionObject,
}

/// Rivals named in words; the JSON names all.
const MAX_RIVALS: usize = 3;

/// Compares and prints; whether something moved.
pub fn compare(args: &Compare, before: &PlacedRig, after: &PlacedRig, printer: &mut Printer) -> Result<bool> {
    let (names, only_in_a, only_in_b) = matched(before, after);
    if names.len() < 2 {
        bail!(
            "the files share {} camera(s); two or more are needed, names must agree (A has {}; B has {})",
            names.len(),
            listed(before),
            listed(after)
        );
    }
    let (a, b) = (places(args, &args.before, before, &names)?, places(args, &args.after, after, &names)?);
    let found = compare_rigs(&a, &b, args.alpha)?;
    let name = |camera: &usize| names[*camera].clone();
    let verdict = verdict(&found);
    let has_joint = before.joint.is_some() && after.joint.is_some();
    let message = message(&found, &names);
    let object = RigsObject {
        kind: "rigs",
        verdict,
        alpha: args.alpha,
        chi2: found.chi2,
        dof: found.degrees_of_freedom,
        noise_dof: found.noise_degrees_of_freedom,
        p: found.probability,
        unmoved: found.unmoved.iter().map(name).collect(),
        moved: found
            .moved
            .iter()
            .map(|m| CameraMotionObject { camera: name(&m.camera), motion: motion(m) })
            .collect(),
        rivals: found.rivals.iter().map(|set| set.iter().map(name).collect()).collect(),
        only_in_a,
        only_in_b,
        joint_covariance: has_joint,
        assumed: assumed(args, (before, &a), (after, &b)),
        message,
    };
    printer.result(&object, &words(&object, &found, &names), Status::Ok)?;
    Ok(verdict != "unmoved")
}

/// What is not stated of the cameras' common errors, and what the test does about it.
fn assumed(args: &Compare, a: (&PlacedRig, &RigPlaces), b: (&PlacedRig, &RigPlaces)) -> Option<String> {
    let is_silent = |(rig, places): (&PlacedRig, &RigPlaces)| {
        places.correlation == Correlation::Unknown && 2 < rig.cameras.len()
    };
    let who = match (is_silent(a), is_silent(b)) {
        (true, true) => "A and B do",
        (true, false) => "A does",
        (false, true) => "B does",
        (false, false) if args.stated().is_some() => {
            return Some(
                "the errors given with --sigma-mm and --sigma-deg are independent from camera to camera"
                    .into(),
            );
        }
        (false, false) => return None,
    };
    Some(format!(
        "{who} not state what the cameras' errors have in common; the test allows for anything, so small motions stay hidden (`rig -o` \
         and `rig --json --joint-covariance` state it)"
    ))
}

fn verdict(found: &RigComparison) -> &'static str {
    match (found.moved.is_empty(), found.rivals.is_empty()) {
        (true, _) => "unmoved",
        (false, true) => "moved",
        (false, false) => "undecided",
    }
}

/// Names in both, only before, only after; in order.
fn matched(before: &PlacedRig, after: &PlacedRig) -> (Vec<String>, Vec<String>, Vec<String>) {
    let names = |rig: &PlacedRig| {
        let mut names: Vec<String> = rig.cameras.iter().map(|camera| camera.name.clone()).collect();
        names.sort_by(|a, b| natural(a, b));
        names
    };
    let (a, b) = (names(before), names(after));
    let only = |from: &[String], other: &[String]| -> Vec<String> {
        from.iter().filter(|name| !other.contains(name)).cloned().collect()
    };
    let both = a.iter().filter(|name| b.contains(name)).cloned().collect();
    (both, only(&a, &b), only(&b, &a))
}

fn listed(rig: &PlacedRig) -> String {
    rig.cameras.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>().join(", ")
}

fn places(args: &Compare, path: &Path, rig: &PlacedRig, names: &[String]) -> Result<RigPlaces> {
    rig.places(names, args.stated().as_ref()).with_context(|| {
        format!(
            "{}: states no covariance for its cameras; say how sure their places are, e.g. --sigma-mm 0.5 --sigma-deg 0.02",
            path.display()
        )
    })
}

fn message(found: &RigComparison, names: &[String]) -> String {
    let listed = |cameras: Vec<usize>| {
        cameras.iter().map(|camera| names[*camera].as_str()).collect::<Vec<_>>().join(", ")
    };
    let moved: Vec<usize> = found.moved.iter().map(|m| m.camera).collect();
    let stayed = |set: &[usize]| (0..names.len()).filter(|camera| !set.contains(camera)).collect();
    match verdict(found) {
        "unmoved" => "nothing moved".to_string(),
        "moved" => format!("{} moved", listed(moved)),
        _ if found.unmoved.len() == 1 && 2 < names.len() => {
            "something moved: no two cameras kept their relative pose, so nothing says which of them stayed"
                .to_string()
        }
        _ => {
            let mut others: Vec<String> =
                found.rivals.iter().take(MAX_RIVALS).map(|set| listed(stayed(set))).collect();
            if MAX_RIVALS < found.rivals.len() {
                others.push(format!("{} other sets", found.rivals.len() - MAX_RIVALS));
            }
            format!(
                "something moved, but which is not decided: {} or {} (a camera more that stayed would decide)",
                listed(moved),
                others.join(" or ")
            )
        }
    }
}

fn words(object: &RigsObject, found: &RigComparison, names: &[String]) -> String {
    let evidence = headline(object.chi2, object.dof, object.p);
    let mut out = format!("{}   {} cameras compared\n", object.verdict.to_uppercase(), names.len());
    line(&mut out, "verdict", &format!("{}; of all together {evidence}.", capital(&object.message)));
    let say = |m: &Moved| motion_sentence(&Figures::of(m), m);
    for m in &found.moved {
        line(&mut out, &names[m.camera], &say(m));
    }
    if !object.unmoved.is_empty() && !found.moved.is_empty() {
        line(&mut out, "stayed", &object.unmoved.join(", "));
    }
    for (only, side) in [(&object.only_in_a, "A"), (&object.only_in_b, "B")] {
        if !only.is_empty() {
            line(&mut out, "left out", &format!("{}: only in {side}", only.join(", ")));
        }
    }
    if let Some(degrees) = object.noise_dof {
        let said = format!(
            "estimated from loops of pairs with {} degrees of freedom; the chances allow for that",
            figures(degrees)
        );
        line(&mut out, "noise", &said);
    }
    if let Some(assumed) = &object.assumed {
        line(&mut out, "assumed", assumed);
    }
    out
}

fn capital(text: &str) -> String {
    match text.starts_with("nothing") || text.starts_with("something") {
        true => format!("{}{}", text[..1].to_uppercase(), &text[1..]),
        false => text.to_string(), // A camera's name keeps its spelling.
    }
}
