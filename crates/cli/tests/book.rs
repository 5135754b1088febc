//! The book's examples: the commands on a page work, and their output is that shown on the page.

use crate::book_support::{self, Command, Piece};
use crate::support::{folder, json_lines, resight, same, table_two};
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
fn getting_started_gets_a_pose() {
    let (page, folder) = (page("getting-started.md"), folder("book"));
    let write = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let camera = write("camera.toml", block(&page, "toml", 0));
    let target = write("target.toml", block(&page, "toml", 1));
    let points = write("points.csv", block(&page, "csv", 0));
    for file in [&camera, &target] {
        assert_eq!(resight(&["explain", file]).code, 0, "{file}");
    }
    let flag =
        page.split("--intrinsics-sigma ").nth(1).and_then(|rest| rest.split_whitespace().next()).unwrap();
    for extra in [vec![], vec!["--intrinsics-sigma", flag]] {
        let run = resight(&[&["solve", &points, "--camera", &camera, "--json"], extra.as_slice()].concat());
        assert_eq!(json_lines(&run)[0]["status"], "ok", "{}{}", run.stdout, run.stderr);
    }
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

/// The README and the guides: every command runs as printed, on files of the repository, with the exit status promised, and prints what
/// the page shows. The tests themselves and what installs the program are left out.
#[cfg(unix)]
fn the_page_can_be_followed(file: &str, [commands_at_least, shown_at_least]: [usize; 2]) {
    let page = std::fs::read_to_string(book_support::root().join(file)).unwrap();
    let folder = folder(&format!("book-{}", file.replace(['/', '.'], "-")));
    for shipped in ["examples", "testdata", "docs"] {
        std::os::unix::fs::symlink(book_support::root().join(shipped), folder.join(shipped)).unwrap();
    }
    let program = assert_cmd::cargo::cargo_bin("resight");
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", program.parent().unwrap().display());
    let (mut printed, mut runs, mut comparisons) = (String::new(), 0, 0);
    for piece in book_support::pieces(&page) {
        match piece {
            Piece::Commands(commands) => {
                printed.clear();
                for Command { line, code } in commands {
                    let mut shell = std::process::Command::new("sh");
                    let run =
                        shell.args(["-c", &line]).current_dir(&folder).env("PATH", &path).output().unwrap();
                    let said = String::from_utf8_lossy(&run.stdout);
                    let complaint = String::from_utf8_lossy(&run.stderr);
                    assert_eq!(run.status.code(), Some(code), "{file}: {line}\n{said}{complaint}");
                    printed += &said;
                    runs += 1;
                }
            }
            Piece::Printed(shown) => {
                let (p, s): (Vec<&str>, Vec<&str>) =
                    (printed.trim_end().lines().collect(), shown.lines().collect());
                assert!(book_support::is_shown(&p, &s), "{file}: printed\n{printed}\nshown\n{shown}");
                comparisons += 1;
            }
        }
    }
    assert!(commands_at_least <= runs, "{file}: only {runs} commands seen");
    assert!(shown_at_least <= comparisons, "{file}: only {comparisons} answers seen");
}

#[test]
#[cfg(unix)]
fn the_readme_can_be_followed() {
    the_page_can_be_followed("README.md", [15, 1]);
}

#[test]
#[cfg(unix)]
fn the_guides_can_be_followed() {
    for (guide, at_least) in
        [("operator", [6, 2]), ("robot", [8, 1]), ("surveyor", [5, 3]), ("developer", [2, 0])]
    {
        the_page_can_be_followed(&format!("docs/guide-{guide}.md"), at_least);
    }
}

#[test]
#[cfg(unix)]
fn the_page_on_live_intrinsics_can_be_followed() {
    the_page_can_be_followed("docs/capture.md", [2, 1]);
}

#[test]
#[cfg(unix)]
fn the_page_on_unknown_focal_lengths_can_be_followed() {
    the_page_can_be_followed("docs/unknown-focal.md", [2, 1]);
}

#[test]
#[cfg(unix)]
fn the_page_on_marked_lines_can_be_followed() {
    the_page_can_be_followed("docs/marked-lines.md", [1, 1]);
}

#[test]
#[cfg(unix)]
fn the_page_on_maps_can_be_followed() {
    the_page_can_be_followed("docs/map.md", [4, 2]);
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
