//! Poses of the same views.

use super::input::ViewPoses;
use super::words::{Figures, headline, motion_sentence};
use super::{Compare, MotionObject, motion};
use crate::output::Printer;
use crate::text::line;
use anyhow::{Result, bail};
use resight::core::temporal::compare::{Moved, compare_poses};
use resight::report::verdict::Status;
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct PoseObject {
    kind: &'static str,
    view: String,
    /// `unmoved`, `moved`, or `error` where a file has no pose of this view.
    verdict: &'static str,
    alpha: f64,
    #[serde(flatten)]
    motion: Option<MotionObject>,
    message: String,
}

/// Compares view by view and prints; whether any moved. The chance of a false alarm is shared among the views.
pub fn compare(
    args: &Compare,
    before: &[ViewPoses],
    after: &[ViewPoses],
    printer: &mut Printer,
) -> Result<bool> {
    let pairs = pairs(before, after);
    if pairs.is_empty() {
        let (a, b) = (&before[0].view, &after[0].view);
        bail!("no view is in both files (A begins with {a}, B with {b}); views are matched by name");
    }
    let alpha = args.alpha / pairs.len() as f64;
    let mut has_moved = false;
    for (a, b) in &pairs {
        let found = nearest(a, b)?;
        let moved = found.as_ref().is_some_and(|m| m.probability < alpha);
        has_moved |= moved;
        let (verdict, message) = match &found {
            None => {
                ("error", format!("no pose of this view in {}", if a.poses.is_empty() { "A" } else { "B" }))
            }
            Some(m) if moved => ("moved", motion_sentence(&Figures::of(m), m)),
            Some(m) => ("unmoved", headline(m.chi2, 6, m.probability)),
        };
        let words = words(&a.view, verdict, &message);
        let (view, motion) = (a.view.clone(), found.as_ref().map(motion));
        let object = PoseObject { kind: "pose", view, verdict, alpha, motion, message };
        printer.result(&object, &words, if found.is_some() { Status::Ok } else { Status::Error })?;
    }
    Ok(has_moved)
}

/// Of all poses that fit the two views, the two nearest each other: an ambiguous view that could have stayed has not moved.
fn nearest(a: &ViewPoses, b: &ViewPoses) -> Result<Option<Moved>> {
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

/// Views of one name, else of one file name whatever the folder; two single views whatever their names.
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

fn words(view: &str, verdict: &str, message: &str) -> String {
    let mut out = format!("{view}   {}\n", verdict.to_uppercase());
    line(&mut out, "verdict", &format!("{message}."));
    out
}
