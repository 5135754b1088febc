//! The words of the field, kept: public names, JSON keys, flags, help texts, documents and the changelog use no word of the dialect that
//! earlier versions spoke. Modules are not checked, nor are private names.

use crate::tidy_rules::{code, product};
use std::fs;
use std::path::{Path, PathBuf};

/// No part of a public name, a JSON key or a flag.
const NOT_IN_NAMES: [&str; 54] = [
    "sight",
    "sights",
    "sighting",
    "sightings",
    "sighted",
    "glance",
    "glances",
    "glimpse",
    "looked",
    "moment",
    "moments",
    "turn",
    "turns",
    "turned",
    "told",
    "said",
    "knock",
    "knocked",
    "carried",
    "sentry",
    "lasting",
    "wobble",
    "daily",
    "sway",
    "agility",
    "grows",
    "doubt",
    "doubts",
    "concern",
    "concerns",
    "survey",
    "surveys",
    "fact",
    "facts",
    "click",
    "clicks",
    "mark",
    "marks",
    "station",
    "stations",
    "mount",
    "anchor",
    "rival",
    "rivals",
    "twin",
    "twins",
    "foresight",
    "foreseen",
    "unseen",
    "settling",
    "sure",
    "dof",
    "deaf",
    "blind",
];

/// Whole names that mean something else here, or that another program's format prescribes.
const NAMES_ALLOWED: [(&str, &str); 10] = [
    ("LineOfSight", "from the camera to a point, as everybody says"),
    ("moment_n_m", "a moment of force"),
    ("moment", "a moment of force, or of the gray values of a spot"),
    ("Moment", "a moment of force"),
    ("of_moment", "a moment of force"),
    ("moment_sign", "a moment of force"),
    ("moments", "of the gray values of a spot"),
    ("moments_px2", "of the gray values of a spot"),
    ("moments_sigma_px2", "of the gray values of a spot"),
    ("Anchor", "where a text is fixed, as drawing programs say"),
];

/// In no help text, document or changelog, in whatever case.
const NOT_IN_PROSE: [&str; 33] = [
    "sighting",
    "sightings",
    "glance",
    "glances",
    "sentry",
    "sentries",
    "rival",
    "rivals",
    "twin",
    "twins",
    "wobble",
    "wobbles",
    "foresight",
    "foreseen",
    "foresee",
    "knock",
    "knocks",
    "knocked",
    "how sure",
    "carried about",
    "lasting error",
    "lasting errors",
    "seed paper",
    "goes on",
    "turned by",
    "drifted at once",
    "drifted slowly",
    "cry wolf",
    "foretold",
    "is told",
    "are told",
    "spoils",
    "dof",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Files below a folder of the workspace with this ending: path from its root, contents.
fn below(folder: &str, ending: &str) -> Vec<(String, String)> {
    let (mut found, mut folders) = (Vec::new(), vec![root().join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name =
                path.strip_prefix(root()).expect("below the root").to_string_lossy().replace('\\', "/");
            match path.is_dir() {
                true if !name.ends_with("/target") => folders.push(path),
                false if name.ends_with(ending) => {
                    found.push((name, fs::read_to_string(&path).expect("a text")))
                }
                _ => {}
            }
        }
    }
    found
}

/// Sources of all crates without their tests.
fn sources() -> Vec<(String, String)> {
    let is_source = |name: &str| name.contains("/src/") && !name.ends_with("tests.rs");
    let all = below("crates", ".rs").into_iter().filter(|(name, _)| is_source(name));
    all.map(|(name, text)| (name, product(&text).to_string())).collect()
}

/// `turn_axis` and `TurnAxis` as turn, axis.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    for c in name.chars() {
        let starts = c.is_uppercase() && words.last().is_some_and(|w| w.chars().any(char::is_lowercase));
        if c == '_' || c == '-' || starts {
            words.push(String::new());
        }
        if let (true, Some(word)) = (c.is_alphanumeric(), words.last_mut()) {
            word.push(c);
        }
    }
    words.into_iter().map(|word| word.to_lowercase()).collect()
}

fn identifier(text: &str) -> &str {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default()
}

/// The name that a line makes public: an item, a field, a variant of a public enum.
fn public_name(line: &str, in_public_enum: bool) -> Option<&str> {
    let trimmed = line.trim();
    if let Some(item) = trimmed.strip_prefix("pub ") {
        let kinds = ["const fn ", "fn ", "struct ", "enum ", "trait ", "const ", "type ", "static "];
        let named = kinds.iter().find_map(|kind| item.strip_prefix(kind));
        return match (named, item.starts_with("use ") || item.starts_with("mod ")) {
            (Some(rest), _) => Some(identifier(rest)),
            (None, true) => None,
            (None, false) => Some(identifier(item)),
        };
    }
    let is_variant = in_public_enum && line.starts_with("    ") && !line.starts_with("     ");
    (is_variant && trimmed.starts_with(char::is_uppercase)).then(|| identifier(trimmed))
}

/// Keys on a line that makes JSON: `"key":` and `object["key"] =`.
fn json_keys(line: &str) -> Vec<&str> {
    let quoted: Vec<&str> = line.split('"').collect();
    let is_key = |i: usize| {
        let after = quoted.get(i + 1).map_or("", |text| text.trim_start());
        let is_set = quoted[i - 1].ends_with('[') && after.starts_with("] =");
        after.starts_with(':') && !after.starts_with("::") || is_set
    };
    (1..quoted.len()).step_by(2).filter(|i| is_key(*i)).map(|i| quoted[i]).collect()
}

fn check(file: &str, number: usize, name: &str, wrong: &mut Vec<String>) {
    let allowed = NAMES_ALLOWED.iter().any(|(known, _)| *known == name);
    if let (false, Some(word)) =
        (allowed, words(name).iter().find(|word| NOT_IN_NAMES.contains(&word.as_str())))
    {
        wrong.push(format!("{file}:{}: `{name}` has `{word}`", number + 1));
    }
}

#[test]
fn public_names_keys_and_flags_are_the_fields_words() {
    let (mut wrong, mut checked) = (Vec::new(), 0);
    for (file, text) in sources() {
        let (mut in_enum, mut in_fields, mut derives) = (false, false, false);
        for (number, line) in text.lines().enumerate() {
            let plain = code(line);
            if plain.starts_with('}') {
                (in_enum, in_fields) = (false, false);
            }
            derives |= plain.contains("derive(")
                && ["Serialize", "Deserialize", "Args", "Parser"].iter().any(|word| plain.contains(word));
            if plain.contains("struct ") || plain.contains("enum ") {
                in_fields = derives && plain.trim_end().ends_with('{');
                in_enum = plain.starts_with("pub enum ");
                derives = false;
            }
            let field =
                plain.trim().split_once(": ").map(|(name, _)| name.rsplit(' ').next().unwrap_or(name));
            let field = field.filter(|name| in_fields && identifier(name) == *name);
            let keys = if file.starts_with("crates/whisker") { Vec::new() } else { json_keys(line) };
            let names = public_name(plain, in_enum).into_iter().chain(field).chain(keys);
            for name in names {
                checked += 1;
                check(&file, number, name, &mut wrong);
            }
        }
    }
    assert!(2000 < checked, "only {checked} names seen");
    assert!(wrong.is_empty(), "{} names:\n{}", wrong.len(), wrong.join("\n"));
}

/// Names that a document quotes stand in backticks; those of code in other documents count.
fn without_quotes(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join(" ")
}

fn has(line: &str, phrase: &str) -> bool {
    let is_edge = |c: Option<char>| {
        c.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != '-' && c != '/' && c != '.')
    };
    line.match_indices(phrase).any(|(at, _)| {
        let mut after = line[at + phrase.len()..].chars();
        let (next, second) = (after.next(), after.next());
        let ends = is_edge(next) || next == Some('.') && second.is_none_or(|c| !c.is_alphanumeric());
        ends && is_edge(line[..at].chars().next_back())
    })
}

#[test]
fn help_texts_documents_and_the_changelog_are_in_the_fields_words() {
    let mut texts = below("docs", ".md");
    for name in ["README.md", "CHANGELOG.md", "ARCHITECTURE.md", "CONVENTIONS.md", "CONTRIBUTING.md"] {
        texts.push((name.to_string(), fs::read_to_string(root().join(name)).expect("a document")));
    }
    let is_help = |name: &str| name.starts_with("crates/cli/src/");
    for (name, text) in sources().into_iter().filter(|(name, _)| is_help(name)) {
        let help = text.lines().map(|line| if line.trim_start().starts_with("//!") { "" } else { line });
        texts.push((name, help.collect::<Vec<_>>().join("\n")));
    }
    let mut wrong = Vec::new();
    for (name, text) in texts.iter() {
        // An alias is how old names are read.
        let following = text.lines().skip(1).chain([""]);
        let lines = text.lines().zip(following).enumerate();
        for (number, (line, next)) in lines.filter(|(_, (line, _))| !line.contains("alias")) {
            // A phrase may go on in the next line.
            let beginning: Vec<&str> = next.split_whitespace().take(2).collect();
            let line = without_quotes(&format!("{line} {}", beginning.join(" "))).to_lowercase();
            let found = NOT_IN_PROSE.iter().filter(|phrase| has(&line, phrase));
            wrong.extend(found.map(|phrase| format!("{name}:{}: {phrase}", number + 1)));
        }
    }
    assert!(80 < texts.len(), "only {} texts seen", texts.len());
    assert!(wrong.is_empty(), "{} places:\n{}", wrong.len(), wrong.join("\n"));
}

/// The checks find what they are for.
#[test]
fn a_word_of_the_dialect_is_found() {
    let mut wrong = Vec::new();
    for name in ["turned_rad", "SightNoise", "n_rivals", "unseen-after-s"] {
        check("a.rs", 0, name, &mut wrong);
    }
    check("a.rs", 0, "rotation_returned_rad", &mut wrong);
    assert_eq!(wrong.len(), 4, "{wrong:?}");
    assert_eq!(public_name("    Sighting {", true), Some("Sighting"));
    assert_eq!(
        json_keys(r#"json!({"rivals": x, "b": y["c"]}); object["turned"] = z"#),
        ["rivals", "b", "turned"]
    );
    assert!(has("a rival.", "rival") && !has("an arrival", "rival") && !has("rivals.rs", "rivals"));
}
