//! The examples of the library run in the root of the repository, as they say, and a project of one's own builds on it.

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
}

/// A new project that depends on the crate by path prints a pose with its uncertainty from a photograph, and the JSON that the program
/// prints for the same job.
#[test]
fn a_project_of_ones_own_builds_and_answers_as_the_program_does() {
    let (project, root) = (folder("own_project"), book_support::root());
    let library = root.join("crates/resight");
    // By the workspace's profile other people's crates are those that its tests have built. Ours are built again for a project elsewhere:
    // not optimised, for the answer is the same to the last bit.
    let workspace = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let mut profile = workspace.parse::<toml::Table>().unwrap().remove("profile").unwrap();
    let packages = profile["dev"]["package"].as_table_mut().unwrap();
    for ours in ["resight", "resight-core", "resight-formats", "resight-recording"] {
        packages.insert(ours.into(), toml::Table::from_iter([("opt-level".into(), 0.into())]).into());
    }
    let profile = toml::to_string(&toml::Table::from_iter([("profile".to_string(), profile)])).unwrap();
    let manifest = format!(
        "[package]\nname = \"own\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\n[dependencies]\nresight = {{ path = {:?} }}\n\
         serde_json = \"1\"\n\n[workspace]\n\n{profile}",
        library.display().to_string()
    );
    let program = r#"use resight::{GrayImage, locate_image, read_camera, read_target, report::words::position_sigma_m};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (camera, target) = (read_camera("examples/photo/left.yml")?, read_target("examples/photo/board.toml")?);
    let image = GrayImage::read("examples/photo/left03.jpg".as_ref())?;
    let answer = locate_image(&image, &camera, &target, &Default::default())?;
    let pose = answer.estimate.as_ref().ok_or("no pose")?;
    let (x, sigma) = (pose.cam_from_target.origin(), position_sigma_m(&pose.cam_from_target, &pose.covariance));
    println!("{:.4} m ± {:.4} m\n{}", x[2], sigma[2], serde_json::to_string(&answer)?);
    Ok(())
}
"#;
    std::fs::create_dir_all(project.join("src")).unwrap();
    std::fs::write(project.join("Cargo.toml"), manifest).unwrap();
    std::fs::write(project.join("src/main.rs"), program).unwrap();
    std::fs::copy(root.join("Cargo.lock"), project.join("Cargo.lock")).unwrap();
    let target = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let run = std::process::Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--offline", "--manifest-path"])
        .arg(project.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(target)
        .current_dir(&root)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let (pose, json) = said.trim_end().split_once('\n').filter(|(pose, _)| pose.contains(" m ± ")).unwrap();
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
    assert_eq!(without_name(json), without_name(&program.stdout), "{pose}");
}
