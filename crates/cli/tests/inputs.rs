//! Inputs as people give them, a row each in `data/inputs.toml`: exit status, named cause, hint, and the outcome once the hint is followed.

use crate::book_support::root;
use crate::support::{data, folder};
use assert_cmd::Command;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Inputs {
    base: BTreeMap<String, String>,
    input: Vec<Input>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Input {
    name: String,
    of: Option<String>,
    text: Option<String>,
    bytes: Option<Vec<u8>>,
    start: Option<Start>,
    file: Option<String>,
    #[serde(default)]
    change: Vec<[String; 2]>,
    scale: Option<Scale>,
    run: String,
    exit: i32,
    says: Vec<String>,
    then: Option<Then>,
}

/// The first bytes of a file of the repository.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Start {
    of: String,
    bytes: usize,
}

/// Columns of a table that are multiplied.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Scale {
    columns: Vec<String>,
    by: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Then {
    #[serde(default)]
    change: Vec<[String; 2]>,
    scale: Option<Scale>,
    text: Option<String>,
    run: Option<String>,
    exit: i32,
    says: Vec<String>,
}

/// Files of the examples that rows start from.
const EXAMPLES: [&str; 4] = [
    "examples/robot/motions.csv",
    "testdata/measure/accident.toml",
    "testdata/measure/clicks.csv",
    "testdata/measure/camera.toml",
];

fn changed(text: &str, changes: &[[String; 2]]) -> String {
    changes.iter().fold(text.to_owned(), |text, [from, to]| {
        assert!(text.contains(from), "{from} is not there");
        text.replace(from, to)
    })
}

fn scaled(text: &str, Scale { columns, by }: &Scale) -> String {
    let header: Vec<&str> = text.lines().next().expect("a header").split(',').collect();
    let row = |line: &str| {
        let cell = |(name, cell): (&&str, &str)| match columns.iter().any(|column| column == name) {
            true => (by * cell.parse::<f64>().expect("a number")).to_string(),
            false => cell.to_owned(),
        };
        header.iter().zip(line.split(',')).map(cell).collect::<Vec<_>>().join(",")
    };
    let rows = text.lines().skip(1).map(row);
    [header.join(",")].into_iter().chain(rows).map(|line| line + "\n").collect()
}

/// Replaces texts, then scales columns.
fn mended(text: &str, changes: &[[String; 2]], scale: Option<&Scale>) -> String {
    let text = changed(text, changes);
    scale.map_or(text.clone(), |scale| scaled(&text, scale))
}

/// Runs a row's command in its folder; returns the exit status and all that is said, its lines joined.
fn run(command: &str, folder: &Path) -> (i32, String) {
    let examples = root().join("examples");
    let place = |word: &str| {
        let known = [("{photo}", "photo"), ("{gate}", "gate"), ("{robot}", "robot"), ("{rig}", "rig")];
        let word = word.replace("{demo}", &root().join("testdata/demo").display().to_string());
        known
            .iter()
            .fold(word, |word, (mark, name)| word.replace(mark, &examples.join(name).display().to_string()))
    };
    let words = command.split_whitespace().map(place);
    let output =
        Command::cargo_bin("resight").expect("it").args(words).current_dir(folder).output().expect("it runs");
    let text = [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("text")).concat();
    (output.status.code().expect("an exit status"), text.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn assert_said(name: &str, (exit, said): (i32, String), wanted_exit: i32, wanted: &[String]) {
    assert_eq!(exit, wanted_exit, "{name}: {said}");
    wanted.iter().for_each(|wanted| assert!(said.contains(wanted), "{name}: no {wanted:?} in: {said}"));
}

#[test]
fn each_input_has_its_status_its_cause_and_a_hint_that_helps() {
    let inputs: Inputs =
        toml::from_str(&std::fs::read_to_string(data("inputs.toml")).expect("the table")).expect("rows");
    for input in &inputs.input {
        let folder = folder("inputs");
        let mut files = inputs.base.clone();
        for example in
            EXAMPLES.iter().filter(|_| input.run.starts_with("measure") || input.run.starts_with("hand-eye"))
        {
            let (_, name) = example.rsplit_once('/').expect("a folder");
            files.insert(name.to_owned(), std::fs::read_to_string(root().join(example)).expect("an example"));
        }
        files.iter().for_each(|(name, text)| std::fs::write(folder.join(name), text).expect("written"));
        let name = input.file.as_ref().or(input.of.as_ref()).expect("a file");
        let own = folder.join(name);
        if let Some(bytes) = &input.bytes {
            std::fs::write(&own, bytes).expect("written");
        }
        if let Some(Start { of, bytes }) = &input.start {
            let whole = std::fs::read(root().join(of)).expect("a file of the repository");
            std::fs::write(&own, &whole[..*bytes]).expect("written");
        }
        let text = input.text.as_ref().or_else(|| files.get(input.of.as_ref()?));
        let text = text.map(|text| mended(text, &input.change, input.scale.as_ref()));
        text.iter().for_each(|text| std::fs::write(&own, text).expect("written"));
        assert_said(&input.name, run(&input.run, &folder), input.exit, &input.says);
        if let Some(then) = &input.then {
            let text = then.text.as_ref().or(text.as_ref());
            let text = text.map(|text| mended(text, &then.change, then.scale.as_ref()));
            text.iter().for_each(|text| std::fs::write(&own, text).expect("written"));
            let command = then.run.as_ref().unwrap_or(&input.run);
            assert_said(&format!("{}, mended", input.name), run(command, &folder), then.exit, &then.says);
        }
    }
}
