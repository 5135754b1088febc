//! Times: seconds, or dates in UTC.

/// Earlier times are those of recordings without a date.
const A_DATE_S: f64 = 1e8;
const DAY_S: f64 = 86_400.0;

/// Seconds, `2026-11-22`, `2026-11-22T06:30` or `2026-11-22T06:30:15.5`, with or without a Z: seconds since 1970.
pub fn parse(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| seconds.is_finite());
    seconds
        .or_else(|| date(text))
        .ok_or_else(|| "seconds, or a time in UTC such as 2026-11-22T06:30:00, are needed".to_string())
}

fn date(text: &str) -> Option<f64> {
    let (day, time) = text.split_once(['T', ' ']).unwrap_or((text, "00:00"));
    let mut day = day.splitn(3, '-').map(|part| part.parse::<i64>().ok());
    let (year, month, day) = (day.next()??, day.next()??, day.next()??);
    let mut time = time.trim_end_matches('Z').splitn(3, ':');
    let (hour, minute): (f64, f64) = (time.next()?.parse().ok()?, time.next()?.parse().ok()?);
    let second: f64 = time.next().map_or(Some(0.0), |s| s.parse().ok())?;
    let is_time =
        (0.0..24.0).contains(&hour) && (0.0..60.0).contains(&minute) && (0.0..61.0).contains(&second);
    let is_date =
        (1..=9999).contains(&year) && (1..=12).contains(&month) && (1..=length(year, month)).contains(&day);
    (is_time && is_date)
        .then(|| days(year, month, day) as f64 * DAY_S + 3600.0 * hour + 60.0 * minute + second)
}

fn length(year: i64, month: i64) -> i64 {
    days(year + month / 12, month % 12 + 1, 1) - days(year, month, 1)
}

/// Days since 1970 in the Gregorian calendar; years begin in March, so that the odd day comes last.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month <= 2 { (year - 1, month + 9) } else { (year, month - 3) };
    365 * year + year.div_euclid(4) - year.div_euclid(100)
        + year.div_euclid(400)
        + (153 * month + 2) / 5
        + day
        - 719_469
}

/// As a date where it is one, as seconds otherwise.
pub fn words(t_s: f64) -> String {
    if !(A_DATE_S..2e11).contains(&t_s) {
        return format!("{t_s:.3} s");
    }
    let whole_days = (t_s / DAY_S).floor();
    let of_day_s = t_s - whole_days * DAY_S;
    let (year, month, day) = civil(whole_days as i64);
    let (hour, minute) = ((of_day_s / 3600.0).floor(), (of_day_s / 60.0).floor() % 60.0);
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{:02} UTC", (of_day_s % 60.0).floor())
}

/// Year, month and day of a day since 1970.
fn civil(since_1970: i64) -> (i64, i64, i64) {
    let guess = 1970 + since_1970.div_euclid(366);
    let year = (guess..).take_while(|year| days(*year, 1, 1) <= since_1970).last().unwrap_or(1970);
    let month = (1..=12).take_while(|month| days(year, *month, 1) <= since_1970).last().unwrap_or(1);
    (year, month, since_1970 - days(year, month, 1) + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_seconds_since_1970() {
        let table = [
            ("1970-01-01", 0.0),
            ("2000-02-29", 951_782_400.0),
            ("2026-11-22T06:30:15.5", 1_795_329_015.5),
            ("2026-11-22T06:30Z", 1_795_329_000.0),
            ("-12.5", -12.5),
        ];
        for (text, seconds) in table {
            assert_eq!(parse(text), Ok(seconds), "{text}");
        }
        for wrong in ["2026-13-01", "2026-02-29", "2026-11-22T25:00", "yesterday", "nan", "2026-11"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn words_are_the_date_that_was_parsed() {
        for date in ["1999-12-31", "2000-02-29", "2026-01-01", "2100-03-01", "2024-12-31"] {
            let t_s = parse(date).expect("a date");
            assert_eq!(words(t_s), format!("{date} 00:00:00 UTC"));
        }
        assert_eq!(words(12.5), "12.500 s");
    }
}
