//! The examples of the library run in the root of the repository, as they say, and a project of one's own compiles with it.

use crate::book_support;
use crate::support::{folder, resight};

/// Runs an example in the root: the test runs itself there, for a process has one current folder.
fn runs(name: &str, main: impl FnOnce() -> Result<(), Box<dyn std::error::Error>>) -> String {
    const IN_ROOT: &str = "RESIGHT_RUNS_THE_EXAMPLE";
    if std::env::var_os(IN_ROOT).is_some() {
        main().unwrap();
        return String::new();
    }
    let test = format!("examples::{name}::runs");
    let test = std::process::Command::new(std::env::current_exe().unwrap())
        .args([&test, "--exact", "--nocapture"])
        .env(IN_ROOT, "1")
        .current_dir(book_support::root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&test.stdout).into_owned();
    assert!(test.status.success(), "{said}\n{}", String::from_utf8_lossy(&test.stderr));
    said
}

macro_rules! examples {
    ($($name:ident in $file:literal says $wanted:literal,)*) => {$(
        mod $name {
            include!($file);

            #[test]
            fn runs() {
                let said = super::runs(stringify!($name), main);
                let is_child = said.is_empty();
                assert!(is_child || said.contains($wanted), "{said}");
                let program = include_str!($file).lines().skip(3); // How to run it, and what it uses.
                assert!(program.count() <= 20, "more than twenty lines of program");
            }
        }
    )*};
}

examples! {
    locate_image in "../../resight/examples/locate_image.rs" says "ok: ",
    points in "../../resight/examples/points.rs" says "camera at",
    own_detector in "../../resight/examples/own_detector.rs" says "\"status\": \"ok\"",
    rig in "../../resight/examples/rig.rs" says "\"status\": \"ok\"",
    hand_eye in "../../resight/examples/hand_eye.rs" says "\"cam_from_gripper\"",
    measure in "../../resight/examples/measure.rs" says "\"status\":\"ok\"",
    covariance in "../../resight/examples/covariance.rs" says " m ± ",
    watch in "../../watch/examples/watch.rs" says "s: ",
    touch in "../../whisker/examples/touch.rs" says "Ok: x 0.10",
    own_project in "data/own_project.rs" says " m ± ",
}

/// A new project that depends on the crate by path compiles, with the features that it brings itself: checked, for its code is generated
/// with the tests. What its program prints is the JSON of `resight locate` for the same job.
#[test]
fn a_project_of_ones_own_compiles_and_answers_as_the_program_does() {
    let (project, root) = (folder("own_project"), book_support::root());
    let library = root.join("crates/resight").display().to_string();
    // By the workspace's profile, what its check made of other people's crates is taken from there.
    let workspace = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let profile = workspace.parse::<toml::Table>().unwrap().remove("profile").unwrap();
    let profile = toml::to_string(&toml::Table::from_iter([("profile".to_string(), profile)])).unwrap();
    let manifest = format!(
        "[package]\nname = \"own\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\n[dependencies]\nresight = {{ path = {library:?} }}\n\
         serde_json = \"1\"\n\n[workspace]\n\n{profile}",
    );
    std::fs::create_dir_all(project.join("src")).unwrap();
    std::fs::write(project.join("Cargo.toml"), manifest).unwrap();
    std::fs::write(project.join("src/main.rs"), include_str!("data/own_project.rs")).unwrap();
    std::fs::copy(root.join("Cargo.lock"), project.join("Cargo.lock")).unwrap();
    let target = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let check = std::process::Command::new(env!("CARGO"))
        .args(["check", "--quiet", "--offline", "--manifest-path"])
        .arg(project.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(target)
        .output()
        .unwrap();
    assert!(check.status.success(), "{}", String::from_utf8_lossy(&check.stderr));
    let said = runs("own_project", || unreachable!("the test of the example runs it"));
    let json = said.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("{said}"));
    let at = |file: &str| root.join("examples/photo").join(file).display().to_string();
    let program = resight(&[
        "locate",
        &at("left03.jpg"),
        "--camera",
        &at("left.yml"),
        "--target",
        &at("board.toml"),
        "--json",
    ]);
    let without_name = |json: &str| -> serde_json::Value {
        let mut object: serde_json::Value = serde_json::from_str(json).unwrap();
        object["view"] = serde_json::Value::Null;
        object
    };
    assert_eq!(without_name(json), without_name(&program.stdout), "{said}");
}
