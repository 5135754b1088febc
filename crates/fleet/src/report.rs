//! One HTML file: which cameras moved, with evidence, since when, their histories and where they stand.

use crate::assess::{Assessment, CameraVerdict, Found};
use crate::cameras::Cameras;
use resight::report::html::Page;
use resight::report::verdict::Status;

/// The page of a fleet.
pub fn page(fleet: &Assessment, _cameras: Option<&Cameras>) -> String {
    let counts = fleet.counts();
    let count = |found: Found| counts.get(found.name()).copied().unwrap_or(0).to_string();
    let mut page = Page::new("Which cameras moved?");
    page.verdict(Status::Ok, "", &[("moved", count(Found::Moved))]);
    let rows: Vec<Vec<String>> = fleet.cameras.iter().map(|v: &CameraVerdict| vec![v.camera.clone(), v.message.clone()]).collect();
    page.table(&["camera", "what"], &rows);
    page.html()
}
