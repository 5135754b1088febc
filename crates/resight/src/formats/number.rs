//! Numbers as text that every reader of YAML, TOML and JSON takes for the same number.

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

#[cfg(test)]
mod tests {
    use super::*;

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
