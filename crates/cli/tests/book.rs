//! The book's examples: the commands on a page work, and their output is that shown on the page.

use crate::book_support;
use crate::support::{folder, resight, same, table_two};
use std::path::Path;

fn page(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name)).unwrap()
}

/// The n-th fenced block of a language.
fn block(page: &str, language: &str, n: usize) -> String {
    let fence = format!("```{language}\n");
    let after = page.split(&fence).nth(n + 1).unwrap();
    after.split("```").next().unwrap().to_string()
}

#[test]
fn table_two_is_shown_as_it_is() {
    let (points, camera) = (table_two("points1.csv"), table_two("camera1.toml"));
    let run = resight(&["solve", &points, "--camera", &camera]);
    let shown = block(&page("table-two.md"), "text", 0);
    assert!(same(&run.stdout, &shown), "said\n{}\nshown\n{shown}", run.stdout);
}

#[test]
fn reading_the_answer_shows_a_real_one() {
    let run = resight(&[
        "locate",
        &crate::support::demo("left.png"),
        "--camera",
        &crate::support::demo("left.toml"),
        "--target",
        &crate::support::demo("dots.toml"),
    ]);
    let said = run.stdout.replace(&crate::support::demo(""), "");
    let shown = block(&page("reading-the-answer.md"), "text", 0);
    assert!(same(&said, &shown), "said\n{said}\nshown\n{shown}");
}

/// The page's commands, run where its files are.
#[test]
fn whisker_page_shows_what_the_program_says() {
    let (page, folder) = (page("whisker.md"), folder("book-whisker"));
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/whisker");
    let file = |name: &str| shipped.join(name).display().to_string();
    let contacts = folder.join("contacts.csv").display().to_string();
    let solve = ["whisker", "solve", "--whisker", &file("whisker.json"), &file("hub.csv"), "-o", &contacts];
    let identify = ["whisker", "identify", &contacts];
    let check = ["whisker", "check", &contacts, &file("truth.csv")];
    // Block 0 draws the conventions, 2 is another mode, 4 the calibration, 5 its drift.
    for (arguments, n) in [(&solve[..], 1), (&identify[..], 3), (&check[..], 6)] {
        let run = resight(arguments);
        let said = run.stdout.replace(&format!("{}/", shipped.display()), "");
        let said = said.replace(&format!("{}/", folder.display()), "");
        let said: String = said
            .lines()
            .filter(|line| !line.starts_with("  written"))
            .map(|line| format!("{line}\n"))
            .collect();
        let shown = block(&page, "text", n);
        assert!(same(&said, &shown), "said\n{said}\nshown\n{shown}");
    }
}

/// A page whose commands run as printed, on files of the repository and on shipped ones under the names that the page uses (a folder, `.`, stands
/// for the files in it), and the least numbers of commands and of answers shown.
struct Followed {
    page: &'static str,
    files: &'static [(&'static str, &'static str)],
    at_least: [usize; 2],
}

/// A folder of snapshots, and the camera and target that they fit.
const SNAPSHOTS: &[(&str, &str)] = &[
    ("snapshots", "examples/photo"),
    ("gate.yaml", "examples/photo/left.yml"),
    ("tag.toml", "examples/photo/board.toml"),
];

const FOLLOWED: [Followed; 22] = [
    Followed { page: "README.md", files: &[], at_least: [15, 1] },
    Followed { page: "docs/guide-operator.md", files: &[], at_least: [8, 3] },
    Followed { page: "docs/guide-robot.md", files: &[], at_least: [11, 2] },
    Followed { page: "docs/guide-surveyor.md", files: &[], at_least: [6, 4] },
    Followed { page: "docs/guide-developer.md", files: &[], at_least: [3, 1] },
    Followed { page: "docs/from-apriltag.md", files: &[], at_least: [3, 1] },
    Followed { page: "docs/capture.md", files: &[], at_least: [2, 1] },
    Followed { page: "docs/unknown-focal.md", files: &[], at_least: [2, 1] },
    Followed { page: "docs/marked-lines.md", files: &[], at_least: [1, 1] },
    Followed { page: "docs/georeference.md", files: &[], at_least: [2, 2] },
    Followed { page: "docs/zones.md", files: &[], at_least: [3, 2] },
    Followed { page: "docs/map.md", files: &[], at_least: [4, 2] },
    Followed {
        page: "docs/getting-started.md",
        files: &[("my_camera.yaml", "testdata/formats/ros_plumb_bob.yaml")],
        at_least: [5, 0],
    },
    Followed { page: "docs/table-two.md", files: &[], at_least: [2, 1] },
    Followed { page: "docs/printing.md", files: &[], at_least: [9, 0] },
    Followed { page: "docs/measuring.md", files: &[], at_least: [2, 1] },
    Followed { page: "docs/intrinsics.md", files: &[], at_least: [4, 0] },
    Followed { page: "docs/report.md", files: &[(".", "examples/rig")], at_least: [1, 0] },
    Followed { page: "docs/files.md", files: &[], at_least: [5, 0] },
    Followed { page: "docs/hand-eye.md", files: &[], at_least: [5, 0] },
    Followed { page: "docs/uncertain-intrinsics.md", files: SNAPSHOTS, at_least: [4, 0] },
    Followed { page: "docs/watch.md", files: SNAPSHOTS, at_least: [10, 1] },
];

/// Pages with commands that other tests run.
const FOLLOWED_ELSEWHERE: [&str; 9] = [
    "c.md",
    "compare.md",
    "first-pose.md",
    "rigs.md",
    "robust.md",
    "touch-meets-sight.md",
    "whisker.md",
    "python.md",
    "vehicle.md",
];

#[cfg(unix)]
fn can_be_followed(followed: &Followed) {
    use std::os::unix::fs::symlink;
    let Followed { page: file, files, at_least } = followed;
    let root = book_support::root();
    let page = std::fs::read_to_string(root.join(file)).unwrap();
    let folder = folder(&format!("book-{}", file.replace(['/', '.'], "-")));
    for shipped in ["examples", "testdata", "docs"] {
        symlink(root.join(shipped), folder.join(shipped)).unwrap();
    }
    for (name, shipped) in *files {
        if *name != "." {
            symlink(root.join(shipped), folder.join(name)).unwrap();
            continue;
        }
        for entry in std::fs::read_dir(root.join(shipped)).unwrap().map(|entry| entry.unwrap()) {
            symlink(entry.path(), folder.join(entry.file_name())).unwrap();
        }
    }
    let [runs, answers] = book_support::follow(&page, &folder);
    assert!(at_least[0] <= runs, "{file}: only {runs} commands seen");
    assert!(at_least[1] <= answers, "{file}: only {answers} answers seen");
}

/// Every command of these pages runs as printed, with the exit status promised, and prints what the page shows. The tests themselves and what
/// installs the program are left out.
#[test]
#[cfg(unix)]
fn the_pages_can_be_followed() {
    FOLLOWED.iter().for_each(can_be_followed);
}

/// No page has commands that no test runs.
#[test]
fn every_page_with_commands_is_followed() {
    for path in book_support::pages() {
        let page = std::fs::read_to_string(&path).unwrap();
        let Ok(name) = path.strip_prefix(book_support::root()) else { continue };
        let has_commands = page.contains("\n```sh\n") || page.contains("\n    resight ");
        if !name.starts_with("docs") || !has_commands {
            continue;
        }
        let name = name.display().to_string();
        let is_followed = FOLLOWED.iter().any(|followed| followed.page == name)
            || FOLLOWED_ELSEWHERE.iter().any(|known| name == format!("docs/{known}"));
        assert!(is_followed, "no test runs the commands of {name}");
    }
}

/// Whoever opens the repository reads the first page to its end.
#[test]
fn the_readme_is_short() {
    let page = std::fs::read_to_string(book_support::root().join("README.md")).unwrap();
    let words = page.split_whitespace().count();
    assert!(words <= 900, "{words} words");
}

/// The README's program is the example, which compiles with the tests; what it prints in the root of the repository is shown. The test runs
/// itself there for that.
#[test]
fn the_readme_shows_the_example_and_what_it_prints() {
    const IN_ROOT: &str = "RESIGHT_RUNS_THE_EXAMPLE";
    if std::env::var_os(IN_ROOT).is_some() {
        println!();
        return example::run();
    }
    let root = book_support::root();
    let page = std::fs::read_to_string(root.join("README.md")).unwrap();
    let example = std::fs::read_to_string(root.join("crates/resight/examples/locate_image.rs")).unwrap();
    let (_, program) = example.split_once('\n').unwrap(); // The first line says how to run it.
    assert_eq!(block(&page, "rust", 0), program);
    let shown = page.split("```rust\n").nth(1).unwrap();
    let shown = block(shown, "text", 0);
    let test = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["book::the_readme_shows_the_example_and_what_it_prints", "--exact", "--nocapture"])
        .env(IN_ROOT, "1")
        .current_dir(&root)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&test.stdout);
    let said: Vec<&str> = said.lines().skip_while(|line| !line.starts_with("ok: ")).take(4).collect();
    let shown: Vec<&str> = shown.lines().collect();
    assert!(
        test.status.success() && book_support::is_shown(&said, &shown),
        "said {said:#?}\nshown {shown:#?}"
    );
}

mod example {
    include!("../../resight/examples/locate_image.rs");

    pub fn run() {
        main().unwrap();
    }
}

/// Every relative link of every page leads to a file, and to a heading where it names one.
#[test]
fn every_link_resolves() {
    let mut checked = 0;
    for path in book_support::pages() {
        let page = std::fs::read_to_string(&path).unwrap();
        for link in book_support::links(&page) {
            let (file, anchor) = link.split_once('#').map_or((link.as_str(), None), |(f, a)| (f, Some(a)));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: {link} leads nowhere", path.display());
            if let Some(anchor) = anchor.filter(|_| target.extension().is_some_and(|e| e == "md")) {
                let there = book_support::anchors(&std::fs::read_to_string(&target).unwrap());
                assert!(there.iter().any(|a| a == anchor), "{}: {link} names no heading", path.display());
            }
            checked += 1;
        }
    }
    assert!(200 < checked, "only {checked} links seen");
}

/// The contents of the book name every page of it.
#[test]
fn the_contents_are_complete() {
    let contents = book_support::links(&page("SUMMARY.md"));
    for path in book_support::pages() {
        let Ok(name) = path.strip_prefix(book_support::root().join("docs")) else { continue };
        let name = name.display().to_string();
        let is_listed = contents.contains(&name) || name == "SUMMARY.md" || name.starts_with("math/");
        assert!(is_listed, "docs/SUMMARY.md does not name {name}");
    }
}

/// Messages and statuses that the page for troubleshooting explains are those of the program, and it explains every status.
#[test]
fn troubleshooting_explains_what_the_program_says() {
    let page = page("troubleshooting.md");
    let sources = book_support::sources();
    let first_cells = page.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
    let messages: Vec<&str> = first_cells.filter_map(|c| c.strip_prefix('`')?.strip_suffix('`')).collect();
    for message in &messages {
        assert!(sources.contains(message), "no source says: {message}");
    }
    for status in ["ok", "ambiguous", "degenerate", "inconsistent", "not_found", "undecided", "error"]
        .into_iter()
        .chain(["learning", "steady", "checking", "drifted", "stale", "tracking"])
    {
        assert!(messages.contains(&status), "{status} is not explained");
    }
    assert!(80 < messages.len(), "only {} messages seen", messages.len());
}

/// Every file that the map of the code names is there.
#[test]
fn the_files_of_the_map_exist() {
    let mut checked = 0;
    for name in ["ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let map = std::fs::read_to_string(book_support::root().join(name)).unwrap();
        for path in map.split('`').skip(1).step_by(2) {
            let path = path.strip_prefix("crates/").unwrap_or(path);
            let is_ours = ["core/", "resight/", "whisker/", "cli/"].iter().any(|c| path.starts_with(c));
            // NAME stands for what a contributor adds.
            if is_ours && !path.contains("NAME") {
                assert!(book_support::root().join("crates").join(path).exists(), "{name}: {path} is missing");
                checked += 1;
            }
        }
    }
    assert!(15 < checked, "only {checked} files seen");
}
