//! Compares two rigs.

use super::CompareOptions;
use super::words::{motion, motion_sentence};
use crate::Error;
use crate::answer::SchemaNumber;
use crate::answer::compare::{CameraMotion, RigsCompared, Verdict};
use crate::core::temporal::compare::{Correlation, Moved, RigComparison, RigPoses, compare_rigs};
use crate::rig::names::natural;
use crate::rig::places::PlacedRig;

/// Largest number of alternatives named in the message; the JSON names all.
const MAX_RIVALS: usize = 3;

/// A rig with its name for messages.
type Named<'a> = (&'a str, &'a PlacedRig);

/// Determines what moved from one rig to the other.
pub(super) fn compare(before: Named, after: Named, options: &CompareOptions) -> Result<RigsCompared, Error> {
    let (names, only_in_a, only_in_b) = matched(before.1, after.1);
    if names.len() < 2 {
        return Err(Error::request(format!(
            "the files share {} camera(s); two or more are needed, names must agree (A has {}; B has {})",
            names.len(),
            listed(before.1),
            listed(after.1)
        )));
    }
    let (a, b) = (places(before, options, &names)?, places(after, options, &names)?);
    let found = compare_rigs(&a, &b, options.alpha)?;
    let name = |camera: &usize| names[*camera].clone();
    let moved =
        |m: &Moved| CameraMotion { camera: name(&m.camera), motion: motion(m), message: motion_sentence(m) };
    let verdict = verdict(&found);
    Ok(RigsCompared {
        schema: SchemaNumber,
        kind: "rigs",
        status: verdict.status(),
        verdict,
        alpha: options.alpha,
        chi2: found.chi2,
        degrees_of_freedom: found.degrees_of_freedom,
        noise_degrees_of_freedom: found.noise_degrees_of_freedom,
        p: found.probability,
        unmoved: found.unmoved.iter().map(name).collect(),
        moved: found.moved.iter().map(moved).collect(),
        alternatives: found.alternatives.iter().map(|set| set.iter().map(name).collect()).collect(),
        only_in_a,
        only_in_b,
        joint_covariance: before.1.joint.is_some() && after.1.joint.is_some(),
        assumed: assumed(options, (before.1, &a), (after.1, &b)),
        message: message(&found, &names),
    })
}

/// Explains what the files do not state about the cameras' joint covariance, and what the test assumes instead.
fn assumed(
    options: &CompareOptions,
    a: (&PlacedRig, &RigPoses),
    b: (&PlacedRig, &RigPoses),
) -> Option<String> {
    let is_silent = |(rig, places): (&PlacedRig, &RigPoses)| {
        places.correlation == Correlation::Unknown && 2 < rig.cameras.len()
    };
    let who = match (is_silent(a), is_silent(b)) {
        (true, true) => "A and B do",
        (true, false) => "A does",
        (false, true) => "B does",
        (false, false) if options.stated.is_some() => {
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

fn verdict(found: &RigComparison) -> Verdict {
    match (found.moved.is_empty(), found.alternatives.is_empty()) {
        (true, _) => Verdict::Unmoved,
        (false, true) => Verdict::Moved,
        (false, false) => Verdict::Undecided,
    }
}

/// Returns the names in both rigs, only in the first, and only in the second; sorted.
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

fn places((name, rig): Named, options: &CompareOptions, names: &[String]) -> Result<RigPoses, Error> {
    rig.places(names, options.stated.as_ref()).ok_or_else(|| {
        Error::request(format!(
            "{name}: states no covariance for its cameras; state the uncertainty of their poses, e.g. --sigma-mm 0.5 --sigma-deg 0.02"
        ))
    })
}

fn message(found: &RigComparison, names: &[String]) -> String {
    let listed = |cameras: Vec<usize>| {
        cameras.iter().map(|camera| names[*camera].as_str()).collect::<Vec<_>>().join(", ")
    };
    let moved: Vec<usize> = found.moved.iter().map(|m| m.camera).collect();
    let stayed = |set: &[usize]| (0..names.len()).filter(|camera| !set.contains(camera)).collect();
    match verdict(found) {
        Verdict::Unmoved => "nothing moved".to_string(),
        Verdict::Moved => format!("{} moved", listed(moved)),
        _ if found.unmoved.len() == 1 && 2 < names.len() => {
            "something moved: no two cameras kept their relative pose, so nothing says which of them stayed"
                .to_string()
        }
        _ => {
            let mut others: Vec<String> =
                found.alternatives.iter().take(MAX_RIVALS).map(|set| listed(stayed(set))).collect();
            if MAX_RIVALS < found.alternatives.len() {
                others.push(format!("{} other sets", found.alternatives.len() - MAX_RIVALS));
            }
            format!(
                "something moved, but which is not decided: {} or {} (a camera more that stayed would decide)",
                listed(moved),
                others.join(" or ")
            )
        }
    }
}
