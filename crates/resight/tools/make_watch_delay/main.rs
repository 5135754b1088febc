//! Draws how late the drift change detector is, for which rate of false alarms: docs/images/watch-delay.svg and .png, with the numbers in
//! watch-delay.csv.
//!
//! `cargo run --release -p resight --example make_watch_delay` from the repository's root; some minutes. With `--draw` the numbers are
//! read, not simulated.

#[path = "../../../core/tests/common/mod.rs"]
mod common;
mod plot;

use common::delay::{
    FEW_RATES, HEADER, LARGE, RATES, Row, SIZES, SLOPES_DEG_PER_H, TAG_QUIET_S, TAG_STEPS_DEG, TAG_TIMES_S,
    TAG_TRIALS, alternatives, alternatives_false, slow, step, tag,
};
use nalgebra::Vector2;
use plot::{Axes, Pen};
use resight::drawing::{Anchor, Drawing};
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;
type Color = [u8; 3];

const INK: Color = [25, 28, 33];
const SENTRY: Color = [29, 92, 196];
const CUSUM: Color = [30, 140, 90];
const THREE: Color = [205, 92, 20];
const BOUND: Color = [120, 126, 136];
/// Of three sizes of a step, or three rates.
const FAMILY: [Color; 3] = [[126, 60, 170], [29, 92, 196], [205, 92, 20]];

fn main() -> Result<()> {
    let folder = Path::new("docs/images");
    let file = folder.join("watch-delay.csv");
    if !std::env::args().any(|argument| argument == "--draw") {
        let mut text = format!("{HEADER}\n");
        simulated(|row| {
            println!("{}", row.line());
            text += &format!("{}\n", row.line());
        });
        std::fs::write(&file, text)?;
    }
    let rows: Vec<Row> = std::fs::read_to_string(&file)?.lines().filter_map(Row::parse).collect();
    let drawing = drawn(&rows);
    std::fs::write(folder.join("watch-delay.svg"), drawing.svg())?;
    std::fs::write(folder.join("watch-delay.png"), drawing.png()?)?;
    Ok(())
}

/// Every row of the file; more trials where each costs less.
fn simulated(mut take: impl FnMut(Row)) {
    for (size, trials) in SIZES.into_iter().zip([100, 150, 300, 300]) {
        for per_day in RATES {
            take(step("white", size, per_day, 0..trials));
            alternatives(size, per_day, 4000).into_iter().for_each(&mut take);
        }
    }
    SIZES
        .into_iter()
        .for_each(|size| alternatives_false(size, 1.0 / 30.0, 10).into_iter().for_each(&mut take));
    // The smallest at one a year would take hours.
    for (size, (trials, rates)) in LARGE.into_iter().zip([(40, 3), (80, 4), (80, 4)]) {
        FEW_RATES[..rates].iter().for_each(|per_day| take(step("lasting", size, *per_day, 0..trials)));
    }
    tags(&mut take);
    for slope in SLOPES_DEG_PER_H {
        FEW_RATES[1..].iter().for_each(|per_day| take(slow(slope, *per_day, 0..20)));
    }
}

/// Steps of a tag under correlated errors that nobody stated, and as found by one who knows them.
fn tags(take: &mut impl FnMut(Row)) {
    for time_s in TAG_TIMES_S {
        for quiet_s in TAG_QUIET_S {
            for degrees in TAG_STEPS_DEG {
                for is_known in [false, true] {
                    take(tag(time_s, degrees, quiet_s, is_known, 0..TAG_TRIALS));
                }
            }
        }
    }
}

/// A sheet of six panels.
fn drawn(rows: &[Row]) -> Drawing {
    let mut drawing = Drawing::new(1180, 800);
    legend(&mut drawing);
    let corner = |i: usize| Vector2::new(70.0 + 385.0 * (i % 3) as f64, 90.0 + 370.0 * (i / 3) as f64);
    for (i, size) in SIZES.into_iter().enumerate() {
        against_others(&mut drawing, corner(i), rows, size);
    }
    correlated(&mut drawing, corner(4), rows);
    slow_drifts(&mut drawing, corner(5), rows);
    drawing
}

const LINES: [(&str, Pen); 5] = [
    ("this test, mean", Pen { color: SENTRY, width: 2.6, opacity: 1.0, has_dots: true }),
    ("this test, 90 %", Pen { color: SENTRY, width: 1.2, opacity: 0.6, has_dots: false }),
    ("ln A/I, all known (Lorden)", Pen { color: BOUND, width: 1.6, opacity: 0.9, has_dots: false }),
    ("CUSUM told the size, mean", Pen { color: CUSUM, width: 1.4, opacity: 1.0, has_dots: true }),
    ("three in a row, mean", Pen { color: THREE, width: 1.4, opacity: 1.0, has_dots: true }),
];

fn legend(drawing: &mut Drawing) {
    let title = "How late an alarm is, for how rarely it may be false";
    drawing.text(title, Vector2::new(24.0, 26.0), 13.0, INK, Anchor::Start);
    for (i, (name, pen)) in LINES.iter().enumerate() {
        let at = Vector2::new(24.0 + 230.0 * i as f64, 50.0);
        pen.draw(drawing, vec![at, at + Vector2::new(26.0, 0.0)]);
        drawing.text(name, at + Vector2::new(34.0, 4.0), 8.0, INK, Anchor::Start);
    }
}

/// Marks of the mean time between false alarms, days.
const BETWEEN: [(f64, &str); 6] =
    [(1.0 / 24.0, "hour"), (0.25, "6 h"), (1.0, "day"), (7.0, "week"), (30.0, "month"), (365.0, "year")];
const READINGS: [(f64, &str); 6] =
    [(1.0, "1"), (10.0, "10"), (100.0, "100"), (1e3, "1000"), (1e4, "10 000"), (1e5, "100 000")];

fn curve(rows: &[Row], noise: &str, size: f64, test: &str, of: fn(&Row) -> f64) -> Vec<Vector2<f64>> {
    let is_it = |row: &&Row| row.noise == noise && row.size == size && row.test == test;
    rows.iter().filter(is_it).map(|row| Vector2::new(1.0 / row.per_day, of(row))).collect()
}

fn mean(row: &Row) -> f64 {
    row.mean
}

fn p90(row: &Row) -> f64 {
    row.p90
}

fn against_others(drawing: &mut Drawing, corner: Vector2<f64>, rows: &[Row], size: f64) {
    let most = if size < 1.5 { 5e4 } else { 400.0 };
    let axes = Axes { corner, x: (1.0 / 30.0, 450.0), y: (1.0, most) };
    axes.frame(drawing, &format!("step of {size}σ, white noise"), &BETWEEN, &READINGS);
    axes.names(drawing, "mean time between false alarms", "delay, readings");
    let curves = [
        ("sentry", mean as fn(&Row) -> f64),
        ("sentry", p90),
        ("lorden", mean),
        ("cusum", mean),
        ("three", mean),
    ];
    for ((test, of), (_, pen)) in curves.into_iter().zip(&LINES).rev() {
        axes.curve(drawing, &curve(rows, "white", size, test, of), pen);
    }
}

fn correlated(drawing: &mut Drawing, corner: Vector2<f64>, rows: &[Row]) {
    let axes = Axes { corner, x: (1.0 / 30.0, 450.0), y: (1.0, 1e5) };
    axes.frame(drawing, "steps, errors of 1σ that last two minutes", &BETWEEN, &READINGS);
    axes.names(drawing, "mean time between false alarms", "delay, readings");
    for (size, color) in LARGE.into_iter().zip(FAMILY) {
        let pen = Pen { color, ..LINES[0].1 };
        let means = curve(rows, "lasting", size, "sentry", mean);
        axes.curve(drawing, &curve(rows, "lasting", size, "sentry", p90), &Pen { color, ..LINES[1].1 });
        axes.curve(drawing, &means, &pen);
        if let Some(last) = means.last() {
            let at = axes.at(last) + Vector2::new(-2.0, -9.0);
            drawing.text(&format!("{size}σ"), at, 8.0, color, Anchor::End);
        }
    }
}

fn slow_drifts(drawing: &mut Drawing, corner: Vector2<f64>, rows: &[Row]) {
    const SLOPES: [(f64, &str); 5] =
        [(0.005, "0.005"), (0.01, "0.01"), (0.02, "0.02"), (0.05, "0.05"), (0.1, "0.1")];
    const GONE: [(f64, &str); 4] = [(0.02, "0.02"), (0.05, "0.05"), (0.1, "0.1"), (0.2, "0.2")];
    let axes = Axes { corner, x: (0.004, 0.17), y: (0.02, 0.25) };
    axes.frame(drawing, "slow drifts, found at", &SLOPES, &GONE);
    axes.names(drawing, "drift, degrees an hour", "turn at the alarm, degrees");
    for ((per_day, color), name) in FEW_RATES[1..].iter().zip(FAMILY).zip(["day", "month", "year"]) {
        let of = |row: &&Row| row.noise == "slow" && (row.per_day / per_day - 1.0).abs() < 1e-3;
        let points: Vec<_> = rows.iter().filter(of).map(|row| Vector2::new(row.size, row.mean)).collect();
        axes.curve(drawing, &points, &Pen { color, ..LINES[0].1 });
        if let Some(last) = points.last() {
            let at = axes.at(last) + Vector2::new(6.0, 3.0);
            drawing.text(name, at, 8.0, color, Anchor::Start);
        }
    }
}
