//! `print`: files, flags and refusals; the scale that was measured reaches the poses of other commands.

use crate::support::{Run, demo, folder, json_lines, resight};
use std::path::Path;

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of UTF-8")
}

fn refused(run: &Run, wanted: &str) {
    assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{wanted}: {}", run.stderr);
    assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
}

#[test]
fn flags_make_a_sheet_and_its_target_file() {
    let folder = folder("print_flags");
    let pdf = folder.join("tag.pdf");
    let run =
        resight(&["print", "--kind", "tag", "--id", "7", "--size-m", "0.1", "-o", text(&pdf), "--json"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["ruler_mm"], serde_json::json!([150.0, 150.0]));
    assert_eq!(answer["n_pages"], 1);
    assert!(std::fs::read(&pdf).unwrap().starts_with(b"%PDF-1.4"));
    let toml = std::fs::read_to_string(folder.join("tag.toml")).unwrap();
    assert!(
        toml.contains("id = 7") && toml.contains("size_m = 0.1") && !toml.contains("printed_scale"),
        "{toml}"
    );

    // From a file nothing but the sheet is written.
    let again = folder.join("again.svg");
    let run = resight(&[
        "print",
        "--target",
        text(&folder.join("tag.toml")),
        "--paper",
        "letter",
        "-o",
        text(&again),
    ]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(std::fs::read_to_string(&again).unwrap().contains("width=\"215.9mm\""));
    assert!(!folder.join("again.toml").exists());

    // A range of tags is a map; a board larger than the paper comes on several sheets.
    let sheet = folder.join("tags.pdf");
    let run = resight(&["print", "--kind", "tag", "--id", "0-5", "--size-m", "0.05", "-o", text(&sheet)]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let map = std::fs::read_to_string(folder.join("tags.toml")).unwrap();
    assert!(map.contains("kind = \"tag_map\"") && map.matches("[[tag]]").count() == 6, "{map}");
    let board = ["--kind", "chessboard", "--rows", "6", "--columns", "9", "--square-m", "0.05"];
    let run = resight(&[&["print"], &board[..], &["-o", text(&folder.join("large.svg"))]].concat());
    assert!(run.code == 0 && run.stderr.contains("joints"), "{}", run.stderr);
    assert!(
        folder.join("large-1.svg").exists()
            && folder.join("large-6.svg").exists()
            && !folder.join("large.svg").exists()
    );
}

/// The scale goes into the target file, the points move, and poses are as uncertain as the rulers.
#[test]
fn what_the_rulers_say_is_used_by_locate() {
    let folder = folder("print_measured");
    let path = |name: &str| folder.join(name);
    let (camera, image) = (demo("left.toml"), demo("left.png"));
    let grid = path("grid.toml");
    std::fs::copy(demo("grid.toml"), &grid).unwrap();
    let sheet = resight(&[
        "print",
        "--target",
        text(&grid),
        "-o",
        text(&path("grid.pdf")),
        "--paper",
        "A2",
        "--json",
    ]);
    assert_eq!(sheet.code, 0, "{}", sheet.stderr);
    let ruler = |axis: usize| json_lines(&sheet)[0]["ruler_mm"][axis].as_f64().unwrap();
    let measure = |ratio: f64, sigma_mm: &str, out: &str| {
        let [x, y] = [0, 1].map(|axis| (ratio * ruler(axis)).to_string());
        let arguments =
            ["print", "--target", text(&grid), "--paper", "A2", "--measured-x-mm", &x, "--measured-y-mm", &y];
        resight(&[&arguments[..], &["--measured-sigma-mm", sigma_mm, "-o", out]].concat())
    };
    let printed = path("printed.toml");
    let run = measure(0.99, "0.3", text(&printed));
    assert!(run.code == 0 && run.stdout.contains("-1.000 %"), "{} {}", run.stdout, run.stderr);
    let locate = |target: &Path| {
        let run = resight(&["locate", &image, "--camera", &camera, "--target", text(target), "--json"]);
        assert_eq!(run.code, 0, "{} {}", run.stdout, run.stderr);
        json_lines(&run)[0].clone()
    };
    let (designed, measured) = (locate(&grid), locate(&printed));
    let distance = |pose: &serde_json::Value| {
        let t = &pose["cam_from_target"]["translation_m"];
        (0..3).map(|i| t[i].as_f64().unwrap().powi(2)).sum::<f64>().sqrt()
    };
    let ratio = distance(&measured) / distance(&designed);
    assert!((ratio - 0.99).abs() < 1e-6, "the camera is nearer by the print's 1 %: {ratio}");
    let sigma = |pose: &serde_json::Value| {
        (0..3).map(|i| pose["sigma_m"][i].as_f64().unwrap().powi(2)).sum::<f64>().sqrt()
    };
    let relative = 0.3 / ruler(0).min(ruler(1));
    let share = (sigma(&measured).powi(2) - sigma(&designed).powi(2)).sqrt() / distance(&measured);
    assert!(
        (0.6 * relative..4.0 * relative).contains(&share),
        "{share} of the distance, rulers known to {relative}"
    );
    assert_eq!(measured["printed_scale"]["x"], 0.99);
    assert!(designed.get("printed_scale").is_none());

    // In place: the same file with its scale; measured anew, the new scale replaces the old one.
    assert_eq!(measure(1.01, "0.2", text(&grid)).code, 0);
    assert!((distance(&locate(&grid)) / distance(&designed) - 1.01).abs() < 1e-6);
    let said = resight(&["explain", text(&grid)]).stdout;
    assert!(said.contains("+1.000 %"), "{said}");

    // Where the uncertainty is not carried, its size is said.
    let run = resight(&["advise", "--camera", &camera, "--target", text(&grid)]);
    assert!(run.stderr.contains("not in the answer's ±"), "{}", run.stderr);
}

#[test]
fn mistakes_are_named_with_the_way_out() {
    let folder = folder("print_mistakes");
    let out = folder.join("a.pdf").display().to_string();
    let print = |words: &[&str]| resight(&[&["print"], words, &["-o", &out]].concat());
    let tag = ["--kind", "tag", "--id", "7", "--size-m", "0.1"];
    refused(&print(&[]), "a target is needed: --target FILE, or --kind");
    refused(&print(&["--kind", "tg", "--id", "7"]), "did you mean `tag`?");
    refused(
        &print(&["--kind", "chessboard", "--rows", "6"]),
        "--kind chessboard needs --columns, --square-m, e.g. --columns 9 --square-m 0.025",
    );
    refused(&print(&["--kind", "tag", "--id", "7", "--size-m", "nan"]), "a positive number is needed");
    refused(&print(&["--kind", "tag", "--id", "587", "--size-m", "0.1"]), "0 to 586, 587 asked for");
    refused(&print(&["--kind", "tag", "--id", "580-590", "--size-m", "0.1"]), "0 to 586, 590 asked for");
    refused(&print(&["--kind", "tag", "--id", "9-3", "--size-m", "0.1"]), "the last is not below the first");
    refused(&print(&["--kind", "tag", "--id", "x", "--size-m", "0.1"]), "a whole number of 0 or more");
    refused(
        &print(&["--kind", "tag", "--id", "0-3", "--size-m", "0.1", "--tag-spacing-ratio", "0.1"]),
        "needs 0.125",
    );
    refused(&print(&[&tag[..], &["--rows", "3"]].concat()), "rows");
    refused(&print(&[&tag[..], &["--paper", "A9"]].concat()), "no such paper: `A9`");
    refused(&print(&[&tag[..], &["--measured-x-mm", "150"]].concat()), "--measured-y-mm");
    let fitted = [&tag[..], &["--measured-x-mm", "140", "--measured-y-mm", "187"]].concat();
    refused(&print(&fitted), "print at 100 % and not fitted to the page");
    refused(
        &print(&["--target", &demo("grid.toml"), "--kind", "tag"]),
        "--kind and --target exclude each other",
    );
    refused(&resight(&[&["print"], &tag[..], &["-o", "x.png"]].concat()), "give FILE.pdf or FILE.svg");
    refused(&resight(&[&["print"], &tag[..], &["-o", "x.toml"]].concat()), "is written with --measured-x-mm");
    refused(&resight(&[&["print"], &tag[..], &["-o", "none/x.pdf"]].concat()), "make it first");
    assert!(
        !folder.join("a.pdf").exists() && !folder.join("a.toml").exists(),
        "nothing is written on a refusal"
    );
}

/// `-h` fits a screen.
#[test]
fn short_help_is_one_screen() {
    let run = resight(&["print", "-h"]);
    assert!(run.stdout.lines().count() <= 24, "{} lines:\n{}", run.stdout.lines().count(), run.stdout);
    assert!(run.stdout.contains("Example:") && resight(&["print", "--help"]).stdout.contains("Examples:"));
}
