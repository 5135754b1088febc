//! The images of a sweep over conditions, and what the detectors find in them, for `benches/peers`.
//!
//! `bench_detect draw FOLDER COUNT [TARGET [CONDITION]]` draws `COUNT` images of each target and condition, or of those whose names start so,
//! and writes `truth.json` beside them;
//! `bench_detect find FOLDER ROUNDS [TARGET]` prints what is found, and the mean time of each image, as JSON;
//! `bench_detect absent ROUNDS [TARGET]` prints how long images of each cell take with their target and without it.

mod sweep;

use resight::GrayImage;
use resight::detect::Detector;
use serde::{Deserialize, Serialize};
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// One image: where every feature truly is.
#[derive(Serialize, Deserialize)]
struct Row {
    target: String,
    condition: String,
    image: String,
    /// Id, corner, u, v.
    truth: Vec<(u32, u8, f64, f64)>,
}

/// What was found in it.
#[derive(Serialize)]
struct Found {
    image: String,
    milliseconds: f64,
    /// Id, corner, u, v, sigma.
    found: Vec<(u32, u8, f64, f64, f64)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["draw", folder, count] => draw(Path::new(folder), count.parse()?, "", ""),
        ["draw", folder, count, target] => draw(Path::new(folder), count.parse()?, target, ""),
        ["draw", folder, count, target, condition] => {
            draw(Path::new(folder), count.parse()?, target, condition)
        }
        ["absent", rounds] => absent(rounds.parse()?, ""),
        ["absent", rounds, target] => absent(rounds.parse()?, target),
        ["find", folder, rounds] => find(Path::new(folder), rounds.parse()?, None),
        ["find", folder, rounds, target] => find(Path::new(folder), rounds.parse()?, Some(target)),
        _ => {
            Err("usage: bench_detect draw FOLDER COUNT [TARGET [CONDITION]] | find FOLDER ROUNDS [TARGET] | \
                  absent ROUNDS [TARGET]"
                .into())
        }
    }
}

fn draw(folder: &Path, count: u64, only_target: &str, only_condition: &str) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let mut rows = Vec::new();
    for (name, target, size_m) in sweep::targets().into_iter().filter(|t| t.0.starts_with(only_target)) {
        let conditions = sweep::conditions();
        let drawn = conditions.iter().enumerate().filter(|(_, c)| c.name.starts_with(only_condition));
        for (k, condition) in drawn {
            for index in 0..count {
                let picture = sweep::draw(&target, size_m, condition, index)?;
                let image = format!("{name}_{k:02}_{index}.png");
                let bytes = picture.image.png()?;
                std::fs::write(folder.join(&image), bytes)?;
                let truth = picture.truth.iter().map(|(f, p)| (f.id, f.corner, p.x, p.y)).collect();
                rows.push(Row { target: name.into(), condition: condition.name.into(), image, truth });
            }
        }
    }
    std::fs::write(folder.join("truth.json"), serde_json::to_vec(&rows)?)?;
    Ok(())
}

fn find(folder: &Path, rounds: usize, only: Option<&str>) -> Result<(), Box<dyn Error>> {
    let rows: Vec<Row> = serde_json::from_slice(&std::fs::read(folder.join("truth.json"))?)?;
    let mut all = Vec::new();
    for (name, target, _) in
        sweep::targets().iter().filter(|(name, ..)| only.is_none_or(|only| only == *name))
    {
        let mut detector = Detector::new(target)?;
        for row in rows.iter().filter(|row| row.target == *name) {
            let image = GrayImage::read(folder.join(&row.image))?;
            all.push(timed(&mut detector, &image, &row.image, rounds)?);
        }
    }
    println!("{}", serde_json::to_string(&all)?);
    Ok(())
}

/// Three images of each cell: the mean times of those in which the target is found, and of the same without it.
fn absent(rounds: usize, only: &str) -> Result<(), Box<dyn Error>> {
    println!(
        "{:10} {:14} {:>5} {:>9} {:>9} {:>6}",
        "target", "cell", "found", "found ms", "absent ms", "ratio"
    );
    for (name, target, size_m) in sweep::targets().into_iter().filter(|t| t.0.starts_with(only)) {
        let mut detector = Detector::new(&target)?;
        for condition in sweep::conditions() {
            let (mut n, mut found_ms, mut absent_ms) = (0, 0.0, 0.0);
            for index in 0..3 {
                let with = sweep::draw(&target, size_m, &condition, index)?.image;
                let without = sweep::draw_absent(&target, size_m, &condition, index)?;
                let found = timed(&mut detector, &with, "", rounds)?;
                absent_ms += timed(&mut detector, &without, "", rounds)?.milliseconds / 3.0;
                if !found.found.is_empty() {
                    n += 1;
                    found_ms += found.milliseconds;
                }
            }
            let mean_ms = found_ms / f64::from(n);
            println!(
                "{name:10} {:14} {n:>3}/3 {mean_ms:9.1} {absent_ms:9.1} {:6.2}",
                condition.name,
                absent_ms / mean_ms
            );
        }
    }
    Ok(())
}

fn timed(
    detector: &mut Detector,
    image: &GrayImage,
    name: &str,
    rounds: usize,
) -> Result<Found, Box<dyn Error>> {
    // The first search pays for memory the others use again.
    let mut found = detector.detect(image)?;
    let (start, cpu_start_s) = (Instant::now(), cpu_s());
    for _ in 0..rounds.max(1) {
        found = detector.detect(image)?;
    }
    let elapsed_s = start.elapsed().as_secs_f64();
    let spent_s = cpu_s().zip(cpu_start_s).map_or(elapsed_s, |(end, start)| end - start);
    let found =
        found.iter().map(|d| (d.feature.id, d.feature.corner, d.pixel.x, d.pixel.y, d.sigma_px)).collect();
    Ok(Found { image: name.into(), milliseconds: 1e3 * spent_s / rounds.max(1) as f64, found })
}

/// Seconds this thread has had of a processor, where the system tells (on Linux to the nearest tick, some milliseconds, so take rounds
/// enough): whatever else the machine does is not counted.
fn cpu_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}
