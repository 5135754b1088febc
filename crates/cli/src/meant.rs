//! What somebody means who types the word of another program, or a number as it is written elsewhere.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::ffi::OsString;

/// Words for jobs that other programs have, and the command that does the job here.
const WORDS: [(&str, &str); 41] = [
    ("calibrate", "intrinsics"),
    ("calibration", "intrinsics"),
    ("calibrate-camera", "intrinsics"),
    ("camera", "intrinsics"),
    ("intrinsic", "intrinsics"),
    ("lens", "intrinsics"),
    ("cameracalibrator", "capture"),
    ("record", "capture"),
    ("extrinsic", "rig"),
    ("extrinsics", "rig"),
    ("calibrate-stereo", "rig"),
    ("stereo", "rig"),
    ("stereo-calibrate", "rig"),
    ("multicam", "rig"),
    ("bundle", "rig"),
    ("pose", "locate"),
    ("estimate", "locate"),
    ("image", "locate"),
    ("track", "watch"),
    ("monitor", "watch"),
    ("stream", "watch"),
    ("alarm", "watch"),
    ("pnp", "solve"),
    ("solvepnp", "solve"),
    ("solve-pnp", "solve"),
    ("resection", "solve"),
    ("handeye", "hand-eye"),
    ("robot", "hand-eye"),
    ("diff", "compare"),
    ("info", "explain"),
    ("show", "explain"),
    ("view", "serve"),
    ("web", "serve"),
    ("gui", "serve"),
    ("ui", "serve"),
    ("generate", "print"),
    ("board", "print"),
    ("target", "print"),
    ("marker", "print"),
    ("find", "detect"),
    ("export", "convert"),
];

/// `resight version` and `resight help [COMMAND]` as the flags that they mean.
pub fn flags(words: &[OsString]) -> Vec<OsString> {
    let text = |i: usize| words.get(i).and_then(|word| word.to_str());
    match (text(1), words.len()) {
        (Some("version"), 2) => vec![words[0].clone(), "--version".into()],
        (Some("help"), 2) => vec![words[0].clone(), "--help".into()],
        (Some("help"), 3) => vec![words[0].clone(), words[2].clone(), "--help".into()],
        _ => words.to_vec(),
    }
}

/// Adds what is meant: the command where the word is another program's, the decimal point where a number has a comma, metres where a flag is in
/// another unit, and every family where no target is given.
pub fn with_advice(error: clap::Error) -> clap::Error {
    with_family(with_metres(with_point(with_command(error))))
}

fn advised(mut error: clap::Error, advice: String) -> clap::Error {
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![advice.into()]));
    error
}

fn with_metres(error: clap::Error) -> clap::Error {
    const UNITS: [(&str, &str); 3] =
        [("-mm", "35 mm are 0.035"), ("-cm", "16 cm are 0.16"), ("-in", "4 inches are 0.1016")];
    let (unknown, near) = match (error.get(ContextKind::InvalidArg), error.get(ContextKind::SuggestedArg)) {
        (Some(ContextValue::String(unknown)), Some(ContextValue::String(near))) => (unknown, near),
        _ => return error,
    };
    let in_metres = UNITS.iter().find_map(|(unit, example)| {
        let stem = unknown.strip_suffix(unit)?;
        (*near == format!("{stem}-m")).then(|| format!("{near} is in metres: {example}"))
    });
    match in_metres {
        Some(advice) => advised(error, advice),
        None => error,
    }
}

fn with_family(error: clap::Error) -> clap::Error {
    let is_lacking = |given: &ContextValue| matches!(given, ContextValue::Strings(all) if all.iter().any(|one| one.contains("--family")));
    let is_it = error.kind() == ErrorKind::MissingRequiredArgument
        && error.get(ContextKind::InvalidArg).is_some_and(is_lacking);
    match is_it {
        true => advised(error, "--family any finds the tags of every family".to_owned()),
        false => error,
    }
}

fn with_point(error: clap::Error) -> clap::Error {
    let point = match (error.kind(), error.get(ContextKind::InvalidValue)) {
        (ErrorKind::ValueValidation, Some(ContextValue::String(text))) if text.contains(',') => {
            text.replacen(',', ".", 1)
        }
        _ => return error,
    };
    match point.parse::<f64>().is_ok_and(f64::is_finite) {
        true => advised(error, format!("numbers have a decimal point: {point}")),
        false => error,
    }
}

fn with_command(mut error: clap::Error) -> clap::Error {
    let word = match (error.kind(), error.get(ContextKind::InvalidSubcommand)) {
        (ErrorKind::InvalidSubcommand, Some(ContextValue::String(word))) => {
            word.to_lowercase().replace('_', "-")
        }
        _ => return error,
    };
    // A slip in such a word is nearer to it than to a command: `callibrate` is not `locate`.
    let near = resight::input::nearest(&word, WORDS.iter().map(|(known, _)| (*known).to_owned()));
    let is_it = |known: &str| known == word || (9 <= word.len() && near.as_deref() == Some(known));
    if let Some((_, command)) = WORDS.iter().find(|(known, _)| is_it(known)) {
        let command = ContextValue::Strings(vec![(*command).to_string()]);
        error.insert(ContextKind::SuggestedSubcommand, command);
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Arguments;
    use clap::CommandFactory;

    fn said(words: &[&str]) -> String {
        let words: Vec<OsString> =
            std::iter::once("resight").chain(words.iter().copied()).map(OsString::from).collect();
        Arguments::read(&words).expect_err("no command").to_string()
    }

    #[test]
    fn every_word_leads_to_a_command_and_is_none() {
        let command = Arguments::command();
        for (word, meant) in WORDS {
            assert!(
                command.find_subcommand(meant).is_some() && command.find_subcommand(word).is_none(),
                "{word}"
            );
            assert!(said(&[word]).contains(&format!("'{meant}'")), "{word}: {}", said(&[word]));
        }
        assert!(said(&["solve_pnp"]).contains("'solve'") && !said(&["zzzzz"]).contains("similar"));
    }

    /// Where the point is the fault: not in a number that has one and is refused for its sign.
    #[test]
    fn a_decimal_comma_is_named() {
        let solve = |value| said(&["solve", "points.csv", "--camera", "camera.toml", "--sigma-px", value]);
        assert!(solve("0,5").contains("numbers have a decimal point: 0.5"), "{}", solve("0,5"));
        for value in ["-0.5", "1,000,5", "half"] {
            assert!(!solve(value).contains("decimal point"), "{}", solve(value));
        }
    }

    #[test]
    fn a_flag_in_another_unit_leads_to_metres_and_a_search_without_a_target_to_every_family() {
        // In parts, because each flag that the sources name is one that is accepted.
        let in_millimetres = concat!("--", "size-mm");
        let print = said(&["print", "--kind", "tag", "--id", "3", in_millimetres, "35", "-o", "x.pdf"]);
        assert!(print.contains("--size-m is in metres: 35 mm are 0.035"), "{print}");
        assert!(said(&["detect", "x.jpg"]).contains("--family any finds"), "{}", said(&["detect", "x.jpg"]));
        assert!(!said(&["locate", "x.jpg"]).contains("--family any"));
    }

    #[test]
    fn version_and_help_are_flags_too() {
        assert!(said(&["version"]).starts_with("resight "));
        assert!(said(&["help", "locate"]).contains("--camera") && said(&["help"]).contains("intrinsics"));
    }
}
