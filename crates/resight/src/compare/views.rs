//! Compares poses of the same views.

use super::CompareOptions;
use super::read::ViewPoses;
use super::words::{evidence, motion, motion_sentence};
use crate::Error;
use crate::answer::SchemaNumber;
use crate::answer::compare::{Verdict, ViewCompared};
use crate::core::temporal::compare::{Moved, compare_poses};
use std::path::Path;

/// Compares view by view. The probability of a false alarm is divided among the views.
pub(super) fn compare(
    before: &[ViewPoses],
    after: &[ViewPoses],
    options: &CompareOptions,
) -> Result<Vec<ViewCompared>, Error> {
    let pairs = pairs(before, after);
    if pairs.is_empty() {
        let first = |views: &[ViewPoses]| views.first().map_or(String::new(), |view| view.view.clone());
        return Err(Error::request(format!(
            "no view is in both files (A begins with {}, B with {}); views are matched by name",
            first(before),
            first(after)
        )));
    }
    let alpha = options.alpha / pairs.len() as f64;
    pairs.into_iter().map(|(a, b)| one(a, b, alpha)).collect()
}

fn one(a: &ViewPoses, b: &ViewPoses, alpha: f64) -> Result<ViewCompared, Error> {
    let found = nearest(a, b)?;
    let (verdict, message) = match &found {
        None => {
            let lacking = if a.poses.is_empty() { "A" } else { "B" };
            (Verdict::Error, format!("no pose of this view in {lacking}"))
        }
        Some(m) if m.probability < alpha => (Verdict::Moved, motion_sentence(m)),
        Some(m) => (Verdict::Unmoved, evidence(m.chi2, 6, m.probability)),
    };
    Ok(ViewCompared {
        schema: SchemaNumber,
        kind: "pose",
        status: verdict.status(),
        view: a.view.clone(),
        verdict,
        alpha,
        motion: found.as_ref().map(motion),
        message,
    })
}

/// Compares the two poses nearest to each other among all that fit the two views: an ambiguous view that may be unmoved counts as unmoved.
fn nearest(a: &ViewPoses, b: &ViewPoses) -> Result<Option<Moved>, Error> {
    let mut nearest: Option<Moved> = None;
    for before in &a.poses {
        for after in &b.poses {
            let found = compare_poses((&before.0, &before.1), (&after.0, &after.1))?;
            if nearest.as_ref().is_none_or(|least| found.chi2 < least.chi2) {
                nearest = Some(found);
            }
        }
    }
    Ok(nearest)
}

/// Pairs views of equal name, else of equal file name in any folder; two single views are paired whatever their names.
fn pairs<'a>(before: &'a [ViewPoses], after: &'a [ViewPoses]) -> Vec<(&'a ViewPoses, &'a ViewPoses)> {
    if let ([a], [b]) = (before, after) {
        return vec![(a, b)];
    }
    let by = |key: fn(&str) -> String| -> Vec<(&'a ViewPoses, &'a ViewPoses)> {
        let find = |a: &'a ViewPoses| after.iter().find(|b| key(&b.view) == key(&a.view)).map(|b| (a, b));
        before.iter().filter_map(find).collect()
    };
    let same = by(str::to_string);
    match same.is_empty() {
        false => same,
        true => by(|view| Path::new(view).file_name().unwrap_or_default().to_string_lossy().into_owned()),
    }
}
