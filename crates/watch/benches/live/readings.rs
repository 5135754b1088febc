//! From detections to pose and decision: location with all minima, filter, drift test.
#![allow(unsafe_code)] // An allocator is `unsafe` by its trait; nothing else here is.

use crate::cameras::target;
use crate::figures::{Bars, Quantiles};
use crate::live_support::{Pace, Replay, camera, config, tag_pose, trembling, watched};
use resight::core::correspondence::Detection;
use resight::core::{Pixel, Pose, Target};
use resight::render::Pcg;
use resight_watch::live::CameraWatcher;
use resight_watch::source::{Content, Frame};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

const READINGS: usize = 1_000_000;
const P99_US: f64 = 20.0;
const SIGMA_PX: f64 = 0.15;

/// The system's allocator, counting.
struct Counting;

static CALLS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every method hands its arguments unchanged to `System`, whose contract is therefore kept.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.fetch_add(1, Relaxed);
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: `block` came from `System` through `alloc` with this layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

pub fn run(bars: &mut Bars) {
    println!("from detections to pose and decision, {READINGS} readings of one tag");
    let target = target(0);
    let poses = trembling(tag_pose(120.0, 150.0, -80.0), 512);
    let mut chance = Pcg::new(17);
    let frames: Vec<Frame> = poses.iter().map(|pose| frame(&target, pose, &mut chance)).collect();
    let nothing = Replay::new(&Arc::new(Vec::new()), Pace::AsTaken, 30.0, 0);
    let mut look =
        CameraWatcher::new(&watched(&target, nothing), &config()).expect("a camera that can be watched");
    let (mut solve, mut decide, mut both) =
        (Quantiles::default(), Quantiles::default(), Quantiles::default());
    let calls = CALLS.load(Relaxed);
    let mut without_pose = 0;
    for i in 0..READINGS {
        // The frames are changed in place: copying them is the source's work.
        let mut frame = frames[i % frames.len()].clone();
        frame.capture_s = i as f64 / 30.0;
        for looked in look.take(&frame, 0.0) {
            let times = looked.observation.times;
            without_pose += usize::from(looked.observation.tracked.is_none());
            solve.add(times.solve_us);
            decide.add(times.decide_us);
            both.add(times.solve_us + times.decide_us);
        }
    }
    // One for the copy of the detections above.
    let allocations = (CALLS.load(Relaxed) - calls) as f64 / READINGS as f64 - 1.0;
    solve.row("solve");
    decide.row("decide");
    both.row("both");
    println!("  {allocations:.2} allocations a reading");
    bars.at_most("readings without a pose", without_pose as f64, 0.0, "");
    bars.at_most("detections to decision, p99", both.at(0.99), P99_US, "µs");
}

/// The corners as a detector gives them, with its noise.
fn frame(target: &Target, cam_from_target: &Pose, chance: &mut Pcg) -> Frame {
    let mut normal = || (0..12).map(|_| chance.uniform()).sum::<f64>() - 6.0;
    let detection = |feature| {
        let x_in_target = target.point(feature).expect("a corner").position;
        let pixel = camera().project(&(*cam_from_target * x_in_target)).expect("in the image");
        let noise = Pixel::new(normal(), normal()) * SIGMA_PX;
        Detection {
            feature,
            pixel: pixel + noise,
            sigma_px: SIGMA_PX,
            lens_sigma_px: 0.0,
            covariance_px2: None,
        }
    };
    let detections = target.features().into_iter().map(detection).collect();
    Frame { number: 0, capture_s: 0.0, name: String::new(), content: Content::Detections(detections) }
}
