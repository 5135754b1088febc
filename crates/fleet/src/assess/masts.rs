//! Finds cameras of one site that moved together: their mast moved, not the cameras.

use super::verdict::{CameraVerdict, Found};
use crate::cameras::Cameras;
use crate::words::utc;
use std::collections::{BTreeMap, BTreeSet};

/// Cameras of a site that moved at the same time.
#[derive(Debug, Clone, PartialEq)]
pub struct Together {
    /// The site's name, or its place.
    pub site: String,
    /// The cameras, by name.
    pub cameras: Vec<String>,
    /// Number of cameras of the site that were tested.
    pub of: usize,
    /// Times of the first and the last motion, seconds.
    pub span_s: (f64, f64),
}

impl Together {
    /// For people.
    pub fn in_words(&self) -> String {
        let Together { site, cameras, of, span_s } = self;
        format!(
            "{site}: {} of {of} cameras moved together at {} ({}): the mast, not the camera",
            cameras.len(),
            utc(0.5 * (span_s.0 + span_s.1)),
            cameras.join(", ")
        )
    }
}

/// Standard deviations by which two motions at one time may be apart.
const APART: f64 = 3.0;

/// Sites at which several cameras, and half of those tested at least, moved at one time, as is not known.
pub(super) fn together(verdicts: &[CameraVerdict], cameras: &Cameras) -> Vec<Together> {
    let mut sites: BTreeMap<String, Vec<&CameraVerdict>> = BTreeMap::new();
    let is_tested = |v: &&CameraVerdict| matches!(v.found, Found::Moved | Found::Steady | Found::Wandering);
    for verdict in verdicts.iter().filter(is_tested) {
        if let Some(site) = name_of(cameras, &verdict.camera) {
            sites.entry(site).or_default().push(verdict);
        }
    }
    sites.iter().flat_map(|(site, verdicts)| at_one_time(site, verdicts)).collect()
}

fn name_of(cameras: &Cameras, camera: &str) -> Option<String> {
    let site = cameras.number(camera).and_then(|number| cameras.site(number))?;
    match (site.name.as_str(), site.east_north) {
        ("", Some([east, north])) => Some(format!("{east}, {north}")),
        ("", None) => None,
        (name, _) => Some(name.to_string()),
    }
}

fn at_one_time(site: &str, verdicts: &[&CameraVerdict]) -> Vec<Together> {
    let mut events: Vec<(f64, f64, &str)> = Vec::new();
    for verdict in verdicts {
        let new = verdict.new_motions();
        events.extend(new.map(|event| (event.since_s, event.since_sigma_s, verdict.camera.as_str())));
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_near = |a: &(f64, f64, &str), b: &(f64, f64, &str)| b.0 - a.0 <= APART * a.1.hypot(b.1);
    let groups = events.chunk_by(is_near);
    groups
        .filter_map(|group| {
            let cameras: BTreeSet<&str> = group.iter().map(|event| event.2).collect();
            let is_mast = 2 <= cameras.len() && verdicts.len() <= 2 * cameras.len();
            is_mast.then(|| Together {
                site: site.to_string(),
                cameras: cameras.into_iter().map(str::to_string).collect(),
                of: verdicts.len(),
                span_s: (group[0].0, group[group.len() - 1].0),
            })
        })
        .collect()
}
