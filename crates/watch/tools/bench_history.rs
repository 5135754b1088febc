//! What a history costs: on the thread of the session, on the disk, and in bytes.
//!
//! `cargo run --release -p resight-watch --example bench_history [FOLDER]`

use nalgebra::{Matrix6, Vector6};
use resight::core::Pose;
use resight_watch::history::{FrameRow, Measured, Recording, Reported, Retention, Store, recorder};
use std::path::PathBuf;
use std::time::Instant;

const ROWS: usize = 200_000;

fn row(i: usize) -> FrameRow {
    let small = (i as f64 * 0.7).sin() * 1e-3;
    let measured = Measured {
        cam_from_target: Pose::exp(&Vector6::new(0.2, small, 0.1, small, -0.2, 2.5)),
        covariance: Matrix6::identity() * 1e-6,
        rms_px: 0.2 + small,
    };
    FrameRow {
        pair: i % 4,
        t_s: 1.79e9 + (i / 4) as f64 / 30.0,
        number: (i / 4) as u64,
        state: "steady",
        n_points: 36,
        measured: Some(measured),
        rotated: None,
        reason: None,
    }
}

fn main() {
    let folder = std::env::args().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let path = folder.join(format!("bench-history-{}.sqlite", std::process::id()));
    let pairs: Vec<(String, String)> = (0..4).map(|i| (format!("cam{i}"), "board".to_string())).collect();
    let recording = Recording {
        path: path.clone(),
        pairs: pairs.clone(),
        commit_s: 0.5,
        waiting: 2 * ROWS,
        retry_s: 1.0,
        retention: Retention::default(),
    };
    let store = Store::open(&path, &pairs).expect("a history").store;
    let (recorder, writer) = recorder(recording, Some(store));
    let rows: Vec<FrameRow> = (0..ROWS).map(row).collect();
    let started = Instant::now();
    let mut slowest_us = 0.0_f64;
    let thread = std::thread::spawn(move || {
        let mut commits = 0;
        writer.run(|reported| commits += u32::from(matches!(reported, Reported::Stored(_))));
        commits
    });
    for row in rows {
        let before = Instant::now();
        recorder.frame(row);
        slowest_us = slowest_us.max(before.elapsed().as_secs_f64() * 1e6);
    }
    let taken_s = started.elapsed().as_secs_f64();
    recorder.close();
    let commits = thread.join().expect("the writer");
    let stored_s = started.elapsed().as_secs_f64();
    let bytes = std::fs::metadata(&path).expect("the file").len();
    println!("rows                     {ROWS}");
    println!(
        "on the session's thread  {:.2} µs a row on average, {slowest_us:.0} µs at most",
        1e6 * taken_s / ROWS as f64
    );
    println!("stored                   {:.0} rows/s in {commits} commits", ROWS as f64 / stored_s);
    println!("on the disk              {:.0} bytes a row", bytes as f64 / ROWS as f64);
    ["", "-wal", "-shm"].iter().for_each(|part| {
        let _ = std::fs::remove_file(format!("{}{part}", path.display()));
    });
}
