//! The verdicts at each site.

use crate::assess::{Assessment, Found};
use crate::cameras::Cameras;
use resight::report::html::Page;
use std::collections::BTreeMap;

const COUNTED: [(Found, &str); 6] = [
    (Found::Moved, "moved"),
    (Found::WrongMap, "wrong map"),
    (Found::Dead, "dead"),
    (Found::Clock, "clock"),
    (Found::Wandering, "to and fro"),
    (Found::TooFew, "too few"),
];

/// Writes a row for each site at which not every camera is steady.
pub(super) fn table(page: &mut Page, fleet: &Assessment, cameras: &Cameras) {
    let mut sites: BTreeMap<String, (usize, [usize; COUNTED.len()])> = BTreeMap::new();
    for verdict in &fleet.cameras {
        let site = super::site_of(Some(cameras), verdict);
        let (n, counts) = sites.entry(site).or_default();
        *n += 1;
        if let Some(at) = COUNTED.iter().position(|(found, _)| *found == verdict.found) {
            counts[at] += 1;
        }
    }
    sites.remove("");
    let mut rows: Vec<(&String, &(usize, [usize; COUNTED.len()]))> =
        sites.iter().filter(|(_, (_, counts))| counts.iter().any(|n| 0 < *n)).collect();
    if rows.is_empty() {
        return;
    }
    rows.sort_by_key(|(_, (_, counts))| std::cmp::Reverse(*counts));
    let shown = |n: &usize| if *n == 0 { String::new() } else { n.to_string() };
    let row = |(site, (n, counts)): (&String, &(usize, [usize; COUNTED.len()]))| {
        [site.clone(), n.to_string()].into_iter().chain(counts.iter().map(shown)).collect::<Vec<_>>()
    };
    let head: Vec<&str> = ["site", "cameras"].into_iter().chain(COUNTED.map(|(_, word)| word)).collect();
    page.heading("Sites");
    page.table(&head, &rows.into_iter().map(row).collect::<Vec<_>>());
}
