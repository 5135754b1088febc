//! Numbers and strings as text that every reader of YAML, TOML and JSON takes for the same value.

use crate::core::camera::CameraMatrix;

/// Shortest decimal that reads back to the same bits; always with a point and a signed exponent, because YAML 1.1
/// readers (PyYAML in Kalibr and ROS) take `1e-5` for text.
pub(super) fn number(x: f64) -> String {
    let shortest = format!("{x:?}");
    match shortest.split_once('e') {
        None => shortest,
        Some((mantissa, exponent)) => {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{mantissa}{point}e{sign}{exponent}")
        }
    }
}

/// `[1.0, 2.0]`.
pub(super) fn list(numbers: &[f64]) -> String {
    let parts: Vec<String> = numbers.iter().map(|x| number(*x)).collect();
    format!("[{}]", parts.join(", "))
}

/// A string in double quotes. JSON's escapes are also YAML's and TOML's; those two forbid more control characters bare.
pub(super) fn quoted(text: &str) -> String {
    let json = serde_json::Value::from(text).to_string();
    let bare = |c: char| {
        c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}')
    };
    json.chars().map(|c| if bare(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() }).collect()
}

/// A camera's name as a file or folder name: what could leave the folder, or is no name on some system, becomes `_`.
pub(super) fn file_stem(name: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '+');
    let stem: String = name.chars().take(60).map(|c| if plain(c) { c } else { '_' }).collect();
    match stem.trim_start_matches(['.', '-']).trim_end_matches('.') {
        "" => "camera".to_owned(),
        trimmed => trimmed.to_owned(),
    }
}

/// [fx 0 cx; 0 fy cy; 0 0 1], row by row.
pub(super) fn matrix_rows(k: &CameraMatrix) -> [f64; 9] {
    [k.fx_px, 0.0, k.cx_px, 0.0, k.fy_px, k.cy_px, 0.0, 0.0, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_leaves_the_folder() {
        for (name, stem) in [
            ("narrow_stereo/left", "narrow_stereo_left"),
            ("../../etc/x", "_.._etc_x"),
            ("..", "camera"),
            ("a b\n", "a_b_"),
            ("left", "left"),
        ] {
            assert_eq!(file_stem(name), stem);
        }
    }

    #[test]
    fn every_number_has_a_point_and_reads_back() {
        for x in [0.0, -0.0, 1.0, 1e-5, -2.5e-7, 1e16, 1e300, f64::MIN_POSITIVE, 0.1, 1.0 / 3.0] {
            let text = number(x);
            assert!(text.contains('.'), "{text}");
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), x.to_bits(), "{text}");
        }
        assert_eq!(number(1e-5), "1.0e-5");
        assert_eq!(number(1e16), "1.0e+16");
    }
}
