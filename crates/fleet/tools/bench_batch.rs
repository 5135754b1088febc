//! What a row costs, reading, solving and writing: `cargo run --release -p resight-fleet --example bench_batch -- FOLDER`, a folder of `make_fleet`.
//!
//! Prints microseconds a row and core, wall and CPU, for one and two threads, and the kernel alone.

use resight_fleet::run::{Job, Progress, run};
use resight_fleet::source::{Source, expand};
use resight_fleet::{Cameras, Solver, batch::solve_rows};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("a folder of make_fleet is needed")?;
    let folder = Path::new(&folder);
    let inputs = expand(&[folder.join("views").display().to_string()])?;
    let solver = Solver { cameras: Cameras::read(folder.join("cameras.csv"))?.into(), sigma_px: 0.3 };
    let (output, mut walls) = (folder.join("bench.parquet"), Vec::new());
    for threads in [1, 2, 1, 2] {
        let job = Job { inputs: &inputs, solver: &solver, output: &output, period_s: 900.0, threads };
        let begun = Instant::now();
        let done = run(&job, &|_: Progress| true)?;
        let wall_s = begun.elapsed().as_secs_f64();
        println!(
            "{threads} threads: {:.3} µs a row and core, {} rows",
            1e6 * wall_s * threads as f64 / done.rows as f64,
            done.rows
        );
        walls.push(wall_s);
    }
    println!("one thread over two: {:.2}", walls[2] / walls[3]);
    let source = Source::open(&inputs[0])?;
    let (layout, mut rows) = (source.view_layout(), 0);
    let batches: Vec<_> = source.stream()?.collect::<Result<_, _>>()?;
    let begun = Instant::now();
    for batch in &batches {
        rows += solve_rows(batch, &layout, &solver).answers.len();
    }
    println!("solving alone: {:.3} µs a row", 1e6 * begun.elapsed().as_secs_f64() / rows as f64);
    std::fs::remove_file(output)?;
    Ok(())
}
