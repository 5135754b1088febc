//! The book's examples: what a page tells the reader to write works, and what it shows is what the program says.

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
