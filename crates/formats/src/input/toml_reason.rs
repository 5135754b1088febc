//! The fault of a TOML file, in its parser's words or with a hint for common ways of writing numbers.

/// The line (from 1) of what is wrong with a TOML text, and why; a decimal comma, a point without a digit before it and a length in another
/// unit are named with the way out.
pub fn toml_reason(text: &str, error: &toml::de::Error) -> (Option<usize>, String) {
    let message = error.message().replace('\n', "; ");
    let Some(span) = error.span() else { return (None, message) };
    let before = &text[..text.floor_char_boundary(span.start.min(text.len()))];
    let number = 1 + before.matches('\n').count();
    let line = text.lines().nth(number - 1).unwrap_or_default();
    let hint = of_value(line).or_else(|| of_key(&message, line));
    (Some(number), hint.map_or(message.clone(), |hint| format!("{message}; {hint}")))
}

/// A number as it is written in many countries, or without the zero.
fn of_value(line: &str) -> Option<String> {
    let (_, value) = line.split_once('=')?;
    let value = value.split('#').next().unwrap_or_default().trim().trim_end_matches(',');
    let (sign, digits) = match value.strip_prefix('-') {
        Some(digits) => ("-", digits),
        None => ("", value.trim_start_matches('+')),
    };
    let are_digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    if let Some(fraction) = digits.strip_prefix('.').filter(|_| digits.parse::<f64>().is_ok()) {
        return Some(format!("write a digit before the point: {sign}0.{fraction}"));
    }
    let (whole, fraction) = digits.split_once(',')?;
    (are_digits(whole) && are_digits(fraction))
        .then(|| format!("a decimal comma; write a point: {sign}{whole}.{fraction}"))
}

/// A key that is another one in another unit: the message names both, and the value in metres where the line has one.
fn of_key(message: &str, line: &str) -> Option<String> {
    let (seen, rest) = message.strip_prefix("unknown field `")?.split_once('`')?;
    let value = line.split_once('=').map(|(_, value)| value.split('#').next().unwrap_or_default().trim());
    let in_metres = in_metres(seen, value.and_then(|value| value.parse().ok()), |wanted| {
        rest.contains(&format!("`{wanted}`"))
    })?;
    Some(format!("the unit is part of the name; write {in_metres}"))
}

/// What to write instead of a length whose key states another unit than metres, where the key in metres `is_known`.
pub fn in_metres(key: &str, value: Option<f64>, is_known: impl Fn(&str) -> bool) -> Option<String> {
    const UNITS: [(&str, f64); 5] =
        [("_mm", 1e-3), ("_cm", 1e-2), ("_inch", 0.0254), ("_in", 0.0254), ("_km", 1e3)];
    let (stem, metres) = UNITS.iter().find_map(|(unit, metres)| Some((key.strip_suffix(unit)?, metres)))?;
    let wanted = format!("{stem}_m");
    is_known(&wanted).then(|| match value {
        // Rounded to twelve digits: 25 × 0.001 is 0.025.
        Some(value) => format!("`{wanted} = {}` (metres)", short(value * metres)),
        None => format!("`{wanted}`, in metres"),
    })
}

/// A number to twelve digits, without zeros at its end.
fn short(number: f64) -> String {
    format!("{number:.11e}").parse::<f64>().unwrap_or(number).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(text: &str) -> (Option<usize>, String) {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Known {
            #[allow(dead_code)]
            distance_m: f64,
        }
        toml_reason(text, &toml::from_str::<Known>(text).expect_err("wrong"))
    }

    #[test]
    fn numbers_as_people_write_them_are_named_with_the_way_out() {
        for (text, line, hint) in [
            ("# ä\ndistance_m = 6,9895\n", 2, "write a point: 6.9895"),
            ("distance_m = -0,5 # taped\n", 1, "write a point: -0.5"),
            ("\ndistance_m = .025\n", 2, "write a digit before the point: 0.025"),
            ("distance_mm = 25\n", 1, "write `distance_m = 0.025` (metres)"),
            ("distance_cm = 698.95 # taped\n", 1, "write `distance_m = 6.9895` (metres)"),
            ("distance_m = .9e3\n", 1, "write a digit before the point: 0.9e3"),
        ] {
            let (at, said) = reason(text);
            assert_eq!(at, Some(line), "{said}");
            assert!(said.ends_with(hint), "{said}");
        }
        let (_, said) = reason("distance_m = \"x\"\n");
        assert!(!said.contains("write"), "{said}");
    }
}
