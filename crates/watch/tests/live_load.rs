//! A session under load: what it cannot look at is dropped and counted, what it holds does not grow.

use crate::live_support::{Pace, Replay, config, film, tag, tag_pose, trembling, watched};
use resight::GrayImage;
use resight_watch::live::{self, Event};
use resight_watch::source::{Next, Source};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Whether this process runs the one test alone, whose memory, threads and files are looked at. If not, one is started that does, and
/// what it says is what the test says.
fn is_alone(test: &str) -> bool {
    const ALONE: &str = "RESIGHT_TEST_ALONE";
    if std::env::var_os(ALONE).is_some() {
        return true;
    }
    let program = std::env::current_exe().expect("this program");
    let name = format!("{}::{test}", module_path!().rsplit("::").next().unwrap_or_default());
    let ended = Command::new(program).args(["--exact", &name, "--nocapture"]).env(ALONE, "1").output();
    let ended = ended.expect("a process");
    let said = String::from_utf8_lossy(&ended.stdout);
    assert!(
        ended.status.success() && said.contains("1 passed"),
        "{said}{}",
        String::from_utf8_lossy(&ended.stderr)
    );
    print!("{said}");
    false
}

/// Twenty seconds of two cameras, as fast as they are looked at.
#[test]
fn memory_threads_and_files_stay_as_they_are() {
    if !is_alone("memory_threads_and_files_stay_as_they_are") {
        return;
    }
    const FRAMES: u64 = 600;
    /// A leak of one image in a hundred would be 15 MB; the C library's own heap breathes by less.
    const GROWTH_BYTES: f64 = 12e6;
    let pictures = film(&tag(), &trembling(tag_pose(80.0, 150.0, -80.0), 8), 200);
    let cameras =
        (0..2).map(|_| watched(&tag(), Replay::new(&pictures, Pace::AsTaken, 30.0, FRAMES))).collect();
    let (mut seen, mut poses, mut used) = (0, 0, Vec::new());
    let before = crate::process::threads_and_files();
    live::run(cameras, &config(), &Arc::new(AtomicBool::new(false)), |event| {
        if let Event::Observed { observation, .. } = event {
            seen += 1;
            poses += u64::from(observation.tracked.is_some());
            // Once both cameras are warm, and before one of them has ended.
            if [FRAMES / 2, FRAMES, 3 * FRAMES / 2].contains(&seen) {
                used.push((crate::process::resident_bytes(), crate::process::threads_and_files()));
            }
        }
        true
    })
    .expect("a session");
    assert_eq!((seen, poses), (2 * FRAMES, 2 * FRAMES), "a recording loses no frame");
    let [(Some(first), counts), _, (Some(last), at_last)] = used[..] else {
        println!("memory is not reported on this system: skipped");
        return;
    };
    println!("{:.1} MB, then {:.1} MB; threads and files {counts:?}, {at_last:?}", first / 1e6, last / 1e6);
    assert!(last - first < GROWTH_BYTES, "{first} bytes grew to {last}");
    // Looking takes a file or two.
    let ((threads, files), (threads_at_last, files_at_last)) =
        counts.zip(at_last).expect("both are reported");
    assert!(threads_at_last <= threads && files_at_last <= files + 2, "{counts:?} grew to {at_last:?}");
    // A thread that has said its last is gone a moment later.
    let is_over = |_| {
        std::thread::sleep(Duration::from_millis(10));
        crate::process::threads_and_files() <= before
    };
    assert!((0..200).any(is_over), "{before:?} stayed {:?}", crate::process::threads_and_files());
}

/// A hundred frames a second for a while, then five.
struct Burst {
    replay: Replay,
    n_fast: u64,
    started: Option<Instant>,
}

const FAST_HZ: f64 = 100.0;
const SLOW_HZ: f64 = 5.0;
const FAST_S: f64 = 2.0;
const SLOW_S: f64 = 7.0;

impl Burst {
    fn n_frames() -> u64 {
        (FAST_S * FAST_HZ + SLOW_S * SLOW_HZ) as u64
    }
}

impl Source for Burst {
    fn next(&mut self, patience: Duration) -> Next {
        let n_slow = self.replay.next.saturating_sub(self.n_fast);
        let capture_s = (self.replay.next - n_slow) as f64 / FAST_HZ + n_slow as f64 / SLOW_HZ;
        let due = *self.started.get_or_insert_with(Instant::now) + Duration::from_secs_f64(capture_s);
        let wait = due.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(patience));
        if patience < wait {
            return Next::Nothing;
        }
        match self.replay.next(patience) {
            Next::Frame(frame) => Next::Frame(resight_watch::source::Frame { capture_s, ..frame }),
            other => other,
        }
    }

    fn is_live(&self) -> bool {
        true
    }

    fn reuse(&mut self, spent: GrayImage) {
        self.replay.reuse(spent);
    }
}

/// Four cameras give four times as many frames as are taken: all are accounted for, those looked at are fresh, and when the load ends
/// nothing is left of it.
#[test]
fn overload_drops_the_oldest_counts_them_and_passes() {
    if !is_alone("overload_drops_the_oldest_counts_them_and_passes") {
        return;
    }
    const CAMERAS: usize = 4;
    /// A hundred events a second, of four hundred.
    const TAKES: Duration = Duration::from_millis(10);
    /// Two frames wait and one is looked at, each while the listener takes one of every camera (40 ms); the rest is for a busy machine.
    const STALE_US: f64 = 2e6;
    const RECOVERS_S: f64 = 5.0;
    const BOUND_BYTES: f64 = 100e6;
    let pictures = film(&tag(), &trembling(tag_pose(80.0, 150.0, -80.0), 4), 300);
    let burst = |_| {
        let replay = Replay::new(&pictures, Pace::AsTaken, FAST_HZ, Burst::n_frames());
        watched(&tag(), Burst { replay, n_fast: (FAST_S * FAST_HZ) as u64, started: None })
    };
    let cameras = (0..CAMERAS).map(burst).collect();
    let before = crate::process::resident_bytes();
    let (mut seen, mut dropped, mut reported, mut stalest_us, mut most) = (0, 0, 0, 0.0f64, 0.0f64);
    let mut last = [0; CAMERAS];
    let mut last_gap_s = 0.0f64;
    live::run(cameras, &config(), &Arc::new(AtomicBool::new(false)), |event| {
        match event {
            Event::Observed { camera, observation, .. } => {
                seen += 1;
                // Numbers that are missing were dropped.
                if last[*camera] + 1 < observation.number {
                    last_gap_s = last_gap_s.max(observation.capture_s);
                }
                last[*camera] = observation.number;
                stalest_us = stalest_us.max(observation.times.waited_us);
                if observation.capture_s < FAST_S {
                    std::thread::sleep(TAKES);
                }
            }
            Event::Dropped { frames, .. } => {
                dropped += frames;
                reported += 1;
            }
            _ => {}
        }
        most = most.max(crate::process::resident_bytes().unwrap_or(0.0));
        true
    })
    .expect("a session");
    println!(
        "{seen} looked at, {dropped} dropped, stalest {stalest_us:.0} µs, last drop before {last_gap_s:.2} s"
    );
    assert_eq!(seen + dropped, CAMERAS as u64 * Burst::n_frames(), "every frame is looked at or counted");
    assert!((CAMERAS as f64 * FAST_S * FAST_HZ * 0.2) as u64 <= dropped, "this was no overload: {dropped}");
    assert!(stalest_us < STALE_US, "{stalest_us} µs");
    assert!(last_gap_s < FAST_S + RECOVERS_S, "the last frame was dropped before {last_gap_s} s");
    assert!(reported <= 2 * CAMERAS, "told {reported} times: at once, and the rest together");
    assert!(before.is_none_or(|before| most - before < BOUND_BYTES), "{before:?} grew to {most}");
}

/// A listener that says stop is the last to hear anything, and every thread ends.
#[test]
fn a_session_that_is_stopped_ends() {
    let pictures = film(&tag(), &trembling(tag_pose(80.0, 150.0, -80.0), 2), 400);
    let cameras = vec![watched(&tag(), Replay::new(&pictures, Pace::Live, 30.0, u64::MAX))];
    let stop = Arc::new(AtomicBool::new(false));
    let mut heard = 0;
    live::run(cameras, &config(), &stop, |_| {
        heard += 1;
        heard < 10
    })
    .expect("a session");
    assert_eq!((heard, stop.load(Ordering::Relaxed)), (10, true));
}
