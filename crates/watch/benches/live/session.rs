//! A live session, measured.

use crate::cameras::{CAMERAS, RATE_HZ};
use crate::figures::{Bars, Quantiles};
use crate::live_support::config;
use crate::process;
use resight_watch::live::{self, Event, LiveCamera, Observation};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What is demanded of a session.
pub struct Demands {
    /// Half of the frames and 99 of 100, from the frame in memory to its pose, milliseconds.
    pub p50_ms: f64,
    pub p99_ms: f64,
    /// Whether a camera's frame of this number is without its target.
    pub is_away: fn(usize, u64) -> bool,
}

/// Of tags, which never leave.
pub const TAGS: Demands = Demands { p50_ms: 5.0, p99_ms: 15.0, is_away: |_, _| false };
/// Of boards: at the worst the time of a frame.
pub const BOARDS: Demands = Demands { p50_ms: 15.0, p99_ms: 33.0, is_away: crate::boards::is_away };

/// A target that comes back has a pose within this time, seconds.
const FOUND_AGAIN_S: f64 = 0.1;
/// Growth of memory once caches are warm, megabytes an hour.
const GROWTH_MB_PER_H: f64 = 1.0;
/// Seconds until caches are warm.
const WARM_S: f64 = 10.0;
/// Less time than this shows no slope of memory.
const SLOPE_NEEDS_S: f64 = 300.0;

#[derive(Default)]
struct Tally {
    frames: u64,
    poses: u64,
    /// Frames that show their target, which was not just away, and have no pose.
    without_pose: u64,
    /// First frame of a target that came back, until it is found; 0 while it is away.
    gone: [Option<u64>; CAMERAS],
    /// How often one was found again, and the longest it took, seconds.
    returns: u64,
    longest_s: f64,
    dropped: u64,
    /// Of these in the first second, in which every camera looks through whole images for the first time.
    dropped_first: u64,
    waited: Quantiles,
    detect: Quantiles,
    solve: Quantiles,
    decide: Quantiles,
    whole: Quantiles,
    /// Seconds since the start, bytes.
    memory: Vec<(f64, f64)>,
}

impl Tally {
    fn take(&mut self, event: &Event, since_s: f64, demands: &Demands) {
        match event {
            Event::Observed { camera, observation, .. } => {
                self.observe(observation);
                self.follow(*camera, observation, demands);
            }
            Event::Dropped { frames, .. } => {
                self.dropped += frames;
                self.dropped_first += if since_s < 1.0 { *frames } else { 0 };
            }
            _ => {}
        }
        let is_due = self.memory.last().is_none_or(|(last_s, _)| last_s + 1.0 <= since_s);
        if is_due && let Some(bytes) = process::resident_bytes() {
            self.memory.push((since_s, bytes));
        }
    }

    fn observe(&mut self, observation: &Observation) {
        let times = &observation.times;
        self.frames += 1;
        self.poses += u64::from(observation.tracked.is_some());
        self.waited.add(times.waited_us);
        self.detect.add(times.detect_us);
        self.solve.add(times.solve_us);
        self.decide.add(times.decide_us);
        self.whole.add(times.waited_us + times.detect_us + times.solve_us + times.decide_us);
    }

    /// Whether the target is there, and how soon it is found again.
    fn follow(&mut self, camera: usize, observation: &Observation, demands: &Demands) {
        let (number, is_found) = (observation.number, observation.estimate.is_some());
        let gone = &mut self.gone[camera];
        if (demands.is_away)(camera, number) {
            *gone = Some(0);
        } else if let Some(back) = gone {
            // The frame itself takes its time, which the quantiles hold.
            // Dropped frames count: the wait begins with the first that shows the target.
            let mut first = if *back == 0 { number } else { *back };
            while 0 < first && !(demands.is_away)(camera, first - 1) {
                first -= 1;
            }
            self.longest_s = self.longest_s.max((number - first) as f64 / RATE_HZ);
            self.returns += u64::from(is_found);
            *gone = (!is_found).then_some(first);
        } else {
            self.without_pose += u64::from(observation.tracked.is_none());
        }
    }

    /// Bytes an hour, least squares over all seconds since the caches were warm.
    fn growth_mb_per_h(&self) -> Option<f64> {
        let warm: Vec<(f64, f64)> = self.memory.iter().filter(|(t_s, _)| WARM_S <= *t_s).copied().collect();
        let n = warm.len() as f64;
        let (t, m) = (warm.iter().map(|p| p.0).sum::<f64>() / n, warm.iter().map(|p| p.1).sum::<f64>() / n);
        let spread: f64 = warm.iter().map(|p| (p.0 - t).powi(2)).sum();
        let slope = warm.iter().map(|p| (p.0 - t) * (p.1 - m)).sum::<f64>() / spread;
        Some(slope * 3600.0 / 1e6).filter(|slope| slope.is_finite())
    }
}

pub fn run(cameras: Vec<LiveCamera>, seconds: f64, demands: &Demands, bars: &mut Bars) {
    let mut tally = Tally::default();
    let (started, cpu_s) = (Instant::now(), process::cpu_s());
    let stop = Arc::new(AtomicBool::new(false));
    let mut inside = None;
    let ended = live::run(cameras, &config(), &stop, |event| {
        let since_s = started.elapsed().as_secs_f64();
        if inside.is_none() && 1.0 < since_s {
            inside = process::threads_and_files();
        }
        tally.take(event, since_s, demands);
        true
    });
    ended.expect("cameras that can be watched");
    let elapsed_s = started.elapsed().as_secs_f64();
    if let (Some(before), Some(after)) = (cpu_s, process::cpu_s()) {
        println!("  this process used {:.0} % of one core", 100.0 * (after - before) / elapsed_s);
    }
    if let Some((threads, files)) = inside {
        println!("  {threads} threads, {files} open files");
    }
    report(&tally);
    hold(&tally, seconds, elapsed_s, demands, bars);
}

fn report(tally: &Tally) {
    let Tally { frames, poses, dropped, dropped_first, .. } = tally;
    println!(
        "  {frames} frames, {poses} with a pose, {dropped} dropped, {dropped_first} of these in the first second"
    );
    tally.waited.row("waited");
    tally.detect.row("detect");
    tally.solve.row("solve");
    tally.decide.row("decide");
    tally.whole.row("frame to pose");
    let minutes = tally.memory.iter().step_by(60);
    let memory: Vec<String> = minutes.map(|(_, bytes)| format!("{:.1}", bytes / 1e6)).collect();
    println!("  memory each minute, MB: {}", memory.join(" "));
}

fn hold(tally: &Tally, seconds: f64, elapsed_s: f64, demands: &Demands, bars: &mut Bars) {
    let due = (CAMERAS as f64 * seconds * RATE_HZ).floor();
    bars.at_most("frames dropped", tally.dropped as f64, 0.0, "");
    bars.at_most("frames not seen", due - tally.frames as f64, 0.0, "");
    bars.at_most("frames without a pose", tally.without_pose as f64, 0.0, "");
    if 0 < tally.returns {
        println!("  {} times away and found again", tally.returns);
        bars.at_most("found again after", tally.longest_s, FOUND_AGAIN_S, "s");
    }
    bars.at_most("behind the pace", elapsed_s - seconds, 1.0, "s");
    bars.at_most("frame to pose, p50", tally.whole.at(0.5) * 1e-3, demands.p50_ms, "ms");
    bars.at_most("frame to pose, p99", tally.whole.at(0.99) * 1e-3, demands.p99_ms, "ms");
    match tally.growth_mb_per_h() {
        Some(growth) if SLOPE_NEEDS_S <= seconds => {
            bars.at_most("growth of memory", growth, GROWTH_MB_PER_H, "MB/h")
        }
        _ => println!("  growth of memory: needs --seconds {SLOPE_NEEDS_S} or more"),
    }
}
