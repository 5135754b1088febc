//! A map of tags as a WPILib field layout.

use super::{Convert, paths, spare_inputs};
use crate::output::{Outcome, print};
use anyhow::{Result, bail};
use resight::formats::{self, Conversion, Field};

/// Which spelling of the keys: `Some(true)` since 2027, none for a word that means no layout.
pub fn keys_of_2027(word: &str) -> Option<bool> {
    match word {
        "wpilib" => Some(false),
        "wpilib-2027" => Some(true),
        _ => None,
    }
}

/// Length and width of the field, `16.541x8.069`.
pub fn parse_field_size(text: &str) -> Result<(f64, f64), String> {
    let side = |x: &str| x.parse::<f64>().ok().filter(|x| 0.0 < *x && x.is_finite());
    let pair = text.split_once(['x', 'X']).and_then(|(length, width)| Some((side(length)?, side(width)?)));
    pair.ok_or_else(|| "length and width of the field in metres are needed, e.g. 16.541x8.069".to_owned())
}

/// Reads one tag map and writes it; the field's size comes from the flag, else from the layout that was read.
pub fn run(args: &Convert, keys_of_2027: bool) -> Result<Outcome> {
    let [input] = args.files.as_slice() else {
        bail!("--to wpilib takes one target file, a tag map; {} given", args.files.len());
    };
    crate::files::must_exist(input)?;
    let read = formats::read_target(input)?;
    let size = match (args.field_size_m, formats::read_field(input)) {
        (Some(size), _) => size,
        (None, Ok(field)) => (field.length_m, field.width_m),
        (None, Err(_)) => {
            bail!("{} states no field; give --field-size-m LENGTHxWIDTH, e.g. 16.541x8.069", input.display())
        }
    };
    let field = Field { length_m: size.0, width_m: size.1, keys_of_2027 };
    let file = match formats::write_field_layout(&read.target, &field) {
        Ok(file) => file,
        Err(reason) => return super::refused(args, &reason.to_string()),
    };
    let conversion = Conversion { files: vec![file], lost: Vec::new(), checked: false };
    let paths = paths(&args.output, &conversion)?;
    spare_inputs(args, &paths)?;
    formats::write_atomically(&paths[0], conversion.files[0].text.as_bytes())?;
    let path = paths[0].display().to_string();
    print(&match args.json {
        true => format!("{}\n", serde_json::json!({ "files": [path], "warnings": read.warnings })),
        false => format!("WPILib field layout, {} m by {} m:\n  {path}\n", size.0, size.1),
    })?;
    Ok(Outcome::Answered)
}
