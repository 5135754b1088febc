//! Times, durations and sizes as people read them.

/// UTC where it can be one of our days, else seconds.
pub fn utc(t_s: f64) -> String {
    resight::report::words::moment(t_s, 0)
}

/// In the largest unit of which there is one.
pub fn duration(s: f64) -> String {
    match s {
        s if 172_800.0 <= s => format!("{:.1} days", s / 86_400.0),
        s if 7200.0 <= s => format!("{:.1} h", s / 3600.0),
        s if 120.0 <= s => format!("{:.0} min", s / 60.0),
        s => format!("{s:.0} s"),
    }
}

/// An expected number of events, however small it is.
pub fn expected(count: f64) -> String {
    if 0.01 <= count { format!("{count:.2}") } else { format!("{count:.0e}") }
}

/// `0.5012 ± 0.0031`: as many digits of both as the two figures of the standard deviation warrant.
pub fn with_sigma([value, sigma]: [f64; 2]) -> String {
    let decimals = if 0.0 < sigma { (1.0 - sigma.log10().floor()).clamp(0.0, 6.0) as usize } else { 4 };
    format!("{value:.decimals$} ± {sigma:.decimals$}")
}

/// A remark on a column of points in another unit, which is not read.
pub(crate) fn of_other_unit(name: &str) -> Option<String> {
    let is_axis = |stem: &str| {
        let number = stem.strip_prefix(['x', 'y', 'z']);
        number.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let (stem, divisor) = name
        .strip_suffix("_mm")
        .map(|stem| (stem, 1000))
        .or_else(|| Some((name.strip_suffix("_cm")?, 100)))?;
    (is_axis(stem) || stem == "points").then(|| {
        format!(
            "column `{name}` is not read: points are in metres; divide by {divisor} and name it `{stem}_m`"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_dates() {
        assert_eq!(utc(1_780_000_000.0), "2026-05-28 20:26:40 UTC");
        assert_eq!(utc(951_782_400.0), "2000-02-29 00:00:00 UTC");
        assert_eq!(utc(12.3), "12 s");
    }

    #[test]
    fn digits_follow_the_standard_deviation() {
        assert_eq!(with_sigma([0.50123, 0.0031]), "0.5012 ± 0.0031");
        assert_eq!(with_sigma([12.34, 2.0]), "12.3 ± 2.0");
    }
}
