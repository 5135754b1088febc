//! The curves in the documents are what the code gives: docs/images/watch-delay.csv, made by the example `make_watch_delay`.

use crate::common::delay::{HEADER, Row, alternatives, slow, step, tag};
use crate::common::rivals::{between_alarms_of_cusum, cusum_between_alarms};

const DRAWN: &str = include_str!("../../../docs/images/watch-delay.csv");

fn drawn(noise: &str, size: f64, per_day: f64, test: &str) -> Row {
    let is_it = |row: &Row| {
        row.noise == noise
            && row.size == size
            && (row.per_day / per_day - 1.0).abs() < 1e-3
            && row.test == test
    };
    DRAWN.lines().filter_map(Row::parse).find(is_it).expect("a row")
}

/// A mean of chance, beside that of another sample: one in 15,000 differs by more than four standard deviations.
fn agrees(seen: &Row) {
    let drawn = drawn(&seen.noise, seen.size, seen.per_day, &seen.test);
    let sigma = drawn.sigma * (1.0 / seen.trials as f64 + 1.0 / drawn.trials as f64).sqrt();
    assert!((seen.mean - drawn.mean).abs() < 4.0 * sigma, "seen {seen:?}\ndrawn {drawn:?}");
}

/// With other chance than the drawn ones.
#[test]
fn drawn_delays_are_those_of_the_code() {
    assert!(DRAWN.starts_with(HEADER));
    for (size, per_day) in [(1.0, 1.0), (2.0, 1.0), (2.0, 1.0 / 30.0), (4.0, 1.0 / 365.0)] {
        agrees(&step("white", size, per_day, 50_000..50_120));
    }
    agrees(&step("lasting", 4.0, 1.0 / 30.0, 50_000..50_060));
    for (time_s, is_known) in [(10.0, false), (10.0, true), (60.0, false)] {
        agrees(&tag(time_s, 0.02, 3600.0, is_known, 50_000..50_012));
    }
    agrees(&slow(0.1, 1.0 / 30.0, 50_000..50_010));
}

#[test]
fn what_others_are_late_is_drawn_as_computed() {
    for (size, per_day) in [(0.5, 1.0 / 365.0), (2.0, 1.0)] {
        for seen in alternatives(size, per_day, 300) {
            let drawn = drawn("white", size, per_day, &seen.test);
            match seen.test.as_str() {
                "cusum" => agrees(&seen),
                _ => assert!((seen.mean / drawn.mean - 1.0).abs() < 1e-3, "seen {seen:?}\ndrawn {drawn:?}"),
            }
        }
    }
}

/// The formula for the CUSUM's false alarms, beside alarms of noise alone: mean of 2000 known to 2 %.
#[test]
fn the_alternative_keeps_its_rate() {
    for (delta, threshold) in [(1.0, 4.0), (2.0, 4.0)] {
        let ratio = cusum_between_alarms(delta, threshold, 2000) / between_alarms_of_cusum(delta, threshold);
        assert!((0.9..1.1).contains(&ratio), "δ {delta}: {ratio}");
    }
}
