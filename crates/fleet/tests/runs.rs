//! Runs: whatever the threads, cut off or not, with damaged files among the good ones.

use crate::support::{day, folder, solved, solver, written};
use resight_fleet::{FleetError, reread};
use resight_fleet::run::{Job, Progress, run};

/// One, two and five threads write the same bytes and come to the same state, which reading the output gives too.
#[test]
fn output_and_state_do_not_depend_on_threads() {
    let folder = folder("threads");
    let fleet = day(40, 3.0, 2.0, 3);
    let (inputs, solver) = (written(&fleet, &folder), solver(&fleet));
    let out = |n: usize| folder.join(format!("poses-{n}.parquet"));
    let (first, state, _) = solved(&inputs, &solver, &out(1), 1);
    let state = state.into_cameras();
    assert!(100_000 < first.len() && state.len() == 41, "{} cameras", state.len());
    for threads in [2, 5] {
        let (bytes, other, _) = solved(&inputs, &solver, &out(threads), threads);
        assert!(bytes == first, "{threads} threads wrote other bytes");
        assert!(other.into_cameras() == state, "{threads} threads came to another state");
    }
    assert!(reread(&[out(1)], 900.0).expect("the output").into_cameras() == state);
}

/// A run that ends amid its work, at any of its parts, is continued by the next, and nobody can tell.
#[test]
fn a_run_that_is_cut_off_is_continued() {
    let folder = folder("cut-off");
    let fleet = day(30, 4.0, 4.0, 5);
    let (inputs, solver) = (written(&fleet, &folder), solver(&fleet));
    let output = folder.join("poses.parquet");
    let (whole, state, _) = solved(&inputs, &solver, &folder.join("whole.parquet"), 2);
    let state = state.into_cameras();
    for stop in [1_u64, 40_000, 80_000] {
        let _ = std::fs::remove_file(&output);
        let job = Job { inputs: &inputs, solver: &solver, output: &output, period_s: 900.0, threads: 1 };
        let stopped = run(&job, &|progress: Progress| progress.rows < stop);
        let is_stopped = stopped.is_err_and(|reason| matches!(reason, FleetError::Stopped));
        assert!(is_stopped && !output.exists(), "the run went on after {stop} rows");
        let (bytes, continued, resumed) = solved(&inputs, &solver, &output, 2);
        assert!(0 < resumed, "no part found");
        assert!(bytes == whole && continued.into_cameras() == state, "another output after {stop} rows");
        assert!(!folder.join("poses.parquet.parts").exists());
    }
}

/// Another sigma makes other answers: parts of that run are none of this one.
#[test]
fn parts_of_another_run_are_not_taken() {
    let folder = folder("another-run");
    let fleet = day(10, 2.0, 10.0, 6);
    let (inputs, mut solver) = (written(&fleet, &folder), solver(&fleet));
    let output = folder.join("poses.parquet");
    let job = Job { inputs: &inputs, solver: &solver, output: &output, period_s: 900.0, threads: 1 };
    assert!(run(&job, &|progress: Progress| progress.rows < 5000).is_err());
    solver.sigma_px *= 2.0;
    let (_, _, resumed) = solved(&inputs, &solver, &output, 1);
    assert_eq!(resumed, 0);
}

/// Bytes turned over, cut or emptied: a reason or fewer rows, never a panic, and the good file's rows are there.
#[test]
fn damaged_files_do_not_stop_the_others() {
    let folder = folder("damaged");
    let fleet = day(5, 2.0, 30.0, 9);
    let (inputs, solver) = (written(&fleet, &folder), solver(&fleet));
    let good = std::fs::read(&inputs[0]).expect("a file");
    let (bad, output) = (folder.join("bad.parquet"), folder.join("poses.parquet"));
    let mut refused = 0;
    for case in 0..60_usize {
        let mut bytes = good.clone();
        match case {
            0 => bytes.truncate(bytes.len() / 2),
            1 => bytes.truncate(4),
            _ => {
                for k in 0..1 + case % 7 {
                    let at = 4 + (case * 7919 + k * 104_729) % (bytes.len() - 8);
                    bytes[at] ^= 1 << (case % 8);
                }
            }
        }
        std::fs::write(&bad, &bytes).expect("written");
        let files = [bad.clone(), inputs[1].clone()];
        let job = Job { inputs: &files, solver: &solver, output: &output, period_s: 900.0, threads: 2 };
        match run(&job, &|_: Progress| true) {
            Ok(done) => {
                refused += usize::from(!done.failed.is_empty());
                assert!(500 < done.rows, "case {case}: {} rows", done.rows);
            }
            // Its columns are no longer those of views: said before any work.
            Err(reason) => assert!(reason.to_string().contains("bad.parquet"), "case {case}: {reason}"),
        }
    }
    assert!(2 <= refused, "only {refused} damaged files were noticed");
}
