//! The house rules a machine can check: layers, what the core must not touch, names of poses, sources of solvers.

use crate::tidy_rules::{code, files, product};

#[test]
fn modules_use_only_those_above_them() {
    crate::tidy_rules::modules_use_only_those_above_them(30);
}

#[test]
fn submodules_use_only_those_above_them() {
    crate::tidy_rules::submodules_use_only_those_above_them(60);
}

#[test]
fn the_core_touches_nothing_outside() {
    crate::tidy_rules::nothing_outside_is_touched();
}

#[test]
fn the_core_does_not_panic_on_purpose() {
    crate::tidy_rules::nothing_panics_on_purpose();
}

#[test]
fn every_cited_equation_exists() {
    crate::tidy_rules::every_cited_equation_exists(5);
}

fn says_from_which_frame(name: &str) -> bool {
    matches!(name.split_once("_from_"), Some((to, from)) if !to.is_empty() && !from.is_empty())
}

/// Methods of `Pose` itself: they make or change a pose and cannot know its frames.
const FRAMELESS: [&str; 8] =
    ["identity", "new", "from_quaternion_wxyz", "inverse", "exp", "moved", "mul", "pose"];

/// Every public field that is a pose, and every public function that returns one, says `b_from_a`.
#[test]
fn every_public_pose_says_from_which_frame() {
    let mut seen = 0;
    for (file, text) in files() {
        for line in product(&text).lines().map(|l| code(l).trim()) {
            let Some(item) = line.strip_prefix("pub ") else { continue };
            let field = item.split_once(": ").filter(|(_, kind)| kind.trim_end_matches(',') == "Pose");
            let function = item.strip_prefix("fn ").and_then(|f| f.split_once('(')).filter(|(_, rest)| {
                let returned = rest.split_once("-> ").map_or("", |(_, r)| r.trim_end_matches(" {"));
                let bare = returned.trim_start_matches("Option<").trim_start_matches("Result<");
                bare.split([',', '>']).next() == Some("Pose") || (file == "pose.rs" && returned == "Self")
            });
            for (name, _) in field.into_iter().chain(function) {
                seen += 1;
                let frameless = file == "pose.rs" || file == "least_squares/pose.rs";
                let exempt = frameless && FRAMELESS.contains(&name);
                assert!(
                    exempt || says_from_which_frame(name),
                    "{file}: `{name}` is a pose; name it b_from_a"
                );
            }
            for forbidden in ["extrinsics:", "world_to_cam", "cam_to_world", "pose:", "T:"] {
                assert!(!item.starts_with(forbidden), "{file}: {item}");
            }
        }
    }
    assert!(8 < seen, "only {seen} poses seen");
}

/// The first line of a solver names its paper or its derivation.
#[test]
fn every_solver_names_its_source() {
    let mut solvers = 0;
    for (name, text) in files().iter().filter(|f| f.0.starts_with("solve/")) {
        let first = text.lines().next().unwrap_or_default();
        let named = first.contains("docs/math/") || first.contains("Paper:");
        assert!(first.starts_with("//!") && named, "{name}: {first}");
        solvers += 1;
    }
    assert!(4 < solvers);
}

/// All tests of a crate are one program; a file that its `main.rs` does not name would never run.
#[test]
fn every_test_file_is_run() {
    let crates = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("crates/");
    let mut n_files = 0;
    for folder in std::fs::read_dir(crates).expect("crates/") {
        let tests = folder.expect("a crate").path().join("tests");
        let Ok(main) = std::fs::read_to_string(tests.join("main.rs")) else { continue };
        for file in std::fs::read_dir(&tests).expect("tests/") {
            let file = file.expect("a file").path();
            let stem = file.file_stem().expect("a name").to_string_lossy().to_string();
            if file.extension().is_some_and(|e| e == "rs") && stem != "main" {
                n_files += 1;
                assert!(
                    main.lines().any(|line| line == format!("mod {stem};")),
                    "{} does not run",
                    file.display()
                );
            }
        }
    }
    assert!(100 < n_files, "{n_files}");
}

/// `./test.sh fast` leaves these out by name; a name that is none would leave nothing out.
#[test]
fn every_slow_test_exists() {
    let (root, packages) = (crate::crates_support::root(), crate::crates_support::packages());
    let list = std::fs::read_to_string(root.join("scripts/slow_tests.txt")).expect("the list");
    for name in list.lines() {
        let (module, test) = name.split_once("::").expect("module::test");
        let is_there = packages.iter().any(|one| {
            let file = root.join(format!("crates/{}/tests/{module}.rs", one.folder));
            std::fs::read_to_string(file).is_ok_and(|text| text.contains(&format!("fn {test}(")))
        });
        assert!(is_there, "{name}");
    }
}
