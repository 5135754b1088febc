//! Running the program and comparing what it says with golden text, numbers within a tolerance.

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// What one run said.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

/// A file beside the tests.
pub fn data(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name).display().to_string()
}

/// A file of the shipped demo.
pub fn demo(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/demo").join(name).display().to_string()
}

/// A fresh folder for one test.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Runs `resight` with arguments.
pub fn resight(arguments: &[&str]) -> Run {
    let output = Command::cargo_bin("resight").unwrap().args(arguments).output().unwrap();
    Run {
        code: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Every line of stdout as JSON, each an answer of the schema that `resight schema` prints.
pub fn json_lines(run: &Run) -> Vec<serde_json::Value> {
    run.stdout.lines().map(answer).collect()
}

/// An answer, which follows the schema.
pub fn answer(line: &str) -> serde_json::Value {
    let object = serde_json::from_str(line).unwrap();
    follows_schema(&object);
    object
}

/// Fails where an object has another number than that of the schema, lacks a key that the schema demands, or has one that it does not
/// name.
fn follows_schema(object: &serde_json::Value) {
    static SCHEMA: OnceLock<jsonschema::Validator> = OnceLock::new();
    let validator = SCHEMA.get_or_init(|| {
        let mut schema: serde_json::Value = serde_json::from_str(&resight(&["schema"]).stdout).unwrap();
        // Users must expect further keys; the program itself must not have any.
        close(&mut schema["$defs"]);
        close(&mut schema["answers"]);
        jsonschema::validator_for(&schema).unwrap()
    });
    assert_eq!(object["schema"], 2, "{object}");
    let faults: Vec<String> = validator.iter_errors(object).map(|fault| fault.to_string()).collect();
    assert!(faults.is_empty(), "{object}\n{}", faults.join("\n"));
}

/// Every object with properties has no others.
fn close(schema: &mut serde_json::Value) {
    match schema {
        serde_json::Value::Object(map) => {
            map.values_mut().for_each(close);
            if map.get("properties").is_some_and(|p| p.is_object())
                && !map.contains_key("additionalProperties")
            {
                map.insert("unevaluatedProperties".into(), false.into());
            }
        }
        serde_json::Value::Array(list) => list.iter_mut().for_each(close),
        _ => {}
    }
}

/// Words equal, numbers within 0.1 % or one unit of the last digit shown. `RESIGHT_BLESS=1` rewrites the golden file.
pub fn matches_golden(name: &str, said: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    let said = said.replace(env!("CARGO_MANIFEST_DIR"), "<crate>");
    if std::env::var_os("RESIGHT_BLESS").is_some() {
        std::fs::write(&path, &said).unwrap();
    }
    let golden = std::fs::read_to_string(&path).unwrap();
    assert!(same(&said, &golden), "{name}: said\n{said}\nwanted\n{golden}");
}

/// Words equal, numbers nearly so.
pub fn same(said: &str, wanted: &str) -> bool {
    let (a, b) = (pieces(said), pieces(wanted));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| alike(a, b))
}

fn alike(a: &str, b: &str) -> bool {
    match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(x), Ok(y)) => {
            let decimals = b.split_once('.').map_or(0, |(_, d)| d.len() as i32);
            (x - y).abs() <= (1e-3 * y.abs()).max(1.01 * 10f64.powi(-decimals))
        }
        _ => a == b,
    }
}

/// Cuts a text into numbers and everything between them.
fn pieces(text: &str) -> Vec<String> {
    let mut pieces = vec![String::new()];
    let mut in_number = false;
    for letter in text.chars() {
        let number = letter.is_ascii_digit() || (in_number && letter == '.');
        if number != in_number {
            pieces.push(String::new());
            in_number = number;
        }
        if let Some(last) = pieces.last_mut() {
            last.push(letter);
        }
    }
    pieces
}

/// A file of the paper's Table II as shipped.
pub fn table_two(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/wang2004").join(name).display().to_string()
}
