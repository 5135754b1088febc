//! A whole day with its truth: who moved is found, who stayed is left in peace, the broken are named.

use crate::support::{folder, solved, solver, written};
use resight_fleet::assess::{AssessConfig, Found, assess};
use resight_fleet::report;
use resight_fleet::simulate::{Fate, Simulation};

#[test]
fn who_moved_is_found_and_nobody_else() {
    let folder = folder("day");
    let shares = [0.1, 0.0, 0.04, 0.06, 0.06];
    let day = Simulation { cameras: 120, every_s: 30.0, seed: 11, shares, ..Simulation::default() };
    let fleet = day.fleet().expect("a fleet");
    let (inputs, solver) = (written(&fleet, &folder), solver(&fleet));
    let (_, state, _) = solved(&inputs, &solver, &folder.join("poses.parquet"), 2);
    let judged = assess(state, Some(&*solver.cameras), &AssessConfig::default()).expect("verdicts");
    // What a steady camera promises to find, the middle one of all.
    let mut promised: Vec<f64> = judged
        .cameras
        .iter()
        .filter_map(|v| v.detectable.as_ref())
        .map(|d| d.rotation_rad.into_iter().fold(0.0, f64::max))
        .collect();
    promised.sort_by(f64::total_cmp);
    let promised = promised[promised.len() * 9 / 10];
    let mut moved = 0;
    for camera in &fleet.cameras {
        let verdict = judged.cameras.iter().find(|v| v.camera == camera.name).expect("a verdict");
        match camera.fate {
            Fate::Step { at_s, motion } if promised < motion.fixed_rows::<3>(0).norm() => {
                moved += 1;
                assert_eq!(verdict.found, Found::Moved, "{}: {}", camera.name, verdict.message);
                let found = verdict.motion.as_ref().expect("a motion");
                let off_s = found.since_s - (day.begin_s + at_s);
                assert!(off_s.abs() < 900.0, "{}: {off_s} s off", camera.name);
            }
            Fate::Step { .. } | Fate::Drifting { .. } => {}
            Fate::WrongMap => assert_eq!(verdict.found, Found::WrongMap, "{}", verdict.message),
            Fate::Dead { .. } => assert_eq!(verdict.found, Found::Dead, "{}", verdict.message),
            Fate::Clock { .. } => assert_eq!(verdict.found, Found::Clock, "{}", verdict.message),
            Fate::Steady => {
                let is_quiet = matches!(verdict.found, Found::Steady | Found::Wandering);
                assert!(is_quiet, "{} stayed: {:?}, {}", camera.name, verdict.found, verdict.message);
            }
        }
    }
    assert!(5 <= moved, "only {moved} cameras moved by more than {promised} rad");
    let page = report::page(&judged, Some(&*solver.cameras));
    assert!(page.contains("<svg") && page.contains("Moved cameras") && !page.contains("http"));
}
