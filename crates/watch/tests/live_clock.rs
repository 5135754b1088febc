//! A session whose frames have clocks that are set: it says so, and continues watching.

use resight::render::Pcg;
use resight_core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight_core::correspondence::Detection;
use resight_core::target::Tag;
use resight_core::{Camera, Lens, Pixel, Pose, Target, Vector6};
use resight_watch::live::{Event, LiveCamera, LiveConfig, State, StateFile, Watched, run_from};
use resight_watch::source::{Content, Frame, Next, Source};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

const SIGMA_PX: f64 = 0.1;

/// Frames from a list; one that lives gives them at its own pace.
struct Script {
    frames: VecDeque<Frame>,
    pace: Option<Duration>,
}

impl Source for Script {
    fn next(&mut self, _: Duration) -> Next {
        std::thread::sleep(self.pace.unwrap_or_default());
        self.frames.pop_front().map_or(Next::End, Next::Frame)
    }

    fn is_live(&self) -> bool {
        self.pace.is_some()
    }
}

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 639.5, cy_px: 479.5 };
    let size = Some(ImageSize { width_px: 1280, height_px: 960 });
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size }
}

fn target() -> Target {
    Target::Tag(Tag { family: "tag36h11".to_string(), id: 3, size_m: 0.3 })
}

/// Frame `i` at a time, of a camera that turned to the right by so much.
fn frame(i: u64, capture_s: f64, pan_deg: f64) -> Frame {
    let mut chance = Pcg::new(77 + i);
    let cam_from_target = Pose::exp(&Vector6::new(0.35, -0.3, 0.1, 0.02, -0.01, 0.8));
    let old_from_new = Pose::exp(&Vector6::new(0.0, pan_deg.to_radians(), 0.0, 0.0, 0.0, 0.0));
    let now = old_from_new.inverse() * cam_from_target;
    let (camera, target) = (camera(), target());
    let seen = target.features().into_iter().map(|feature| {
        let known = target.point(feature).expect("a known point");
        let pixel = camera.project(&(now.rotation * known.position + now.translation)).expect("in the image");
        let noise = Pixel::new(SIGMA_PX * chance.normal(), SIGMA_PX * chance.normal());
        Detection {
            feature,
            pixel: pixel + noise,
            sigma_px: SIGMA_PX,
            lens_sigma_px: 0.0,
            covariance_px2: None,
        }
    });
    Frame { number: i, capture_s, name: format!("frame {i}"), content: Content::Detections(seen.collect()) }
}

fn watch(frames: Vec<Frame>, pace: Option<Duration>) -> Vec<Event> {
    watch_from(frames, pace, None)
}

fn watch_from(frames: Vec<Frame>, pace: Option<Duration>, state: Option<&StateFile>) -> Vec<Event> {
    let source = Box::new(Script { frames: frames.into(), pace });
    let targets = vec![Watched { name: "tag".to_string(), target: Arc::new(target()), reference: None }];
    let cameras = vec![LiveCamera {
        name: "gate".to_string(),
        camera: camera(),
        targets,
        intrinsics: None,
        landmarks: None,
        source,
    }];
    let config = LiveConfig { queue_frames: 1000, retry_s: 0.1, ..LiveConfig::default() };
    let mut events = Vec::new();
    run_from(cameras, &config, &Arc::new(AtomicBool::new(false)), state, |event| {
        events.push(event.clone());
        true
    })
    .expect("it runs");
    events
}

fn steps_s(events: &[Event]) -> Vec<f64> {
    let step = |event: &Event| match event {
        Event::Clock { step_s, .. } => Some(*step_s),
        _ => None,
    };
    events.iter().filter_map(step).collect()
}

fn times_s(events: &[Event]) -> Vec<f64> {
    let time = |event: &Event| match event {
        Event::Observed { observation, .. } => Some(observation.capture_s),
        _ => None,
    };
    events.iter().filter_map(time).collect()
}

fn left_out(events: &[Event]) -> u64 {
    let frames = |event: &Event| match event {
        Event::LeftOut { frames, .. } => *frames,
        _ => 0,
    };
    events.iter().map(frames).sum()
}

fn began_s(events: &[Event]) -> Option<f64> {
    events.iter().rev().find_map(|event| match event {
        Event::StateChanged { state: State::Drifted(drift), .. } => Some(drift.began_s),
        _ => None,
    })
}

/// The clock goes back by an hour after 100 s; the sudden motion at 150 s is found all the same, at the time that went on.
#[test]
fn an_hour_back_does_not_make_the_monitor_deaf() {
    let frames = (0..200).map(|i| {
        let t_s = 5000.0 + i as f64 - if i < 100 { 0.0 } else { 3600.0 };
        frame(i, t_s, if i < 150 { 0.0 } else { 0.5 })
    });
    let events = watch(frames.collect(), None);
    let [step_s] = steps_s(&events)[..] else { panic!("{:?}", steps_s(&events)) };
    assert!((step_s + 3600.0).abs() < 1e-9, "{step_s}");
    let began_s = began_s(&events).expect("a drift");
    assert!((began_s - 5150.0).abs() <= 3.0, "{began_s}");
    assert_eq!(times_s(&events), (0..200).map(|i| 5000.0 + i as f64).collect::<Vec<_>>());
}

/// A live camera whose clock is set two hours forward, and back again.
#[test]
fn a_live_clock_set_forward_and_back_is_said_twice() {
    let frames = (0..150).map(|i| {
        let set_s = if (60..110).contains(&i) { 7200.0 } else { 0.0 };
        frame(i, 1e9 + 0.005 * i as f64 + set_s, 0.0)
    });
    let events = watch(frames.collect(), Some(Duration::from_millis(5)));
    let [forward_s, back_s] = steps_s(&events)[..] else { panic!("{:?}", steps_s(&events)) };
    // The machine that plays the camera may be slow.
    assert!((forward_s - 7200.0).abs() < 30.0 && (back_s + 7200.0).abs() < 30.0, "{forward_s} {back_s}");
    assert_eq!(began_s(&events), None);
}

/// One frame in ten comes after its successor: it is left out and counted, and no clock was set.
#[test]
fn small_disorder_is_counted() {
    let mut frames: Vec<Frame> = (0..200).map(|i| frame(i, 0.1 * i as f64, 0.0)).collect();
    (5..200).step_by(10).for_each(|i| frames.swap(i, i - 1));
    let events = watch(frames, None);
    assert!(steps_s(&events).is_empty());
    assert_eq!(left_out(&events), 20);
    assert_eq!(began_s(&events), None);
}

/// A recording in which one frame has a time of the year 55000: it alone is left out, and the sudden motion is found when it came.
#[test]
fn one_wrong_time_does_not_spoil_a_recording() {
    let at = |i: u64| if i == 40 { 1.7e12 } else { 5000.0 + i as f64 };
    let frames = (0..200).map(|i| frame(i, at(i), if i < 150 { 0.0 } else { 0.5 }));
    let events = watch(frames.collect(), None);
    assert_eq!((steps_s(&events), left_out(&events)), (vec![], 1));
    assert!(times_s(&events).iter().all(|t_s| (5000.0..5200.0).contains(t_s)));
    let began_s = began_s(&events).expect("a drift");
    assert!((began_s - 5150.0).abs() <= 3.0, "{began_s}");
}

/// Images that cannot be read have the date of their file, hours off; what comes after them is not shifted. While there is nothing
/// else the camera is stale, whatever their dates.
#[test]
fn a_frame_that_cannot_be_read_does_not_set_the_clock() {
    for off_s in [-7200.0, 7200.0, 1e9] {
        let torn = |i: u64| i.is_multiple_of(10) || (100..130).contains(&i);
        let frames = (0..200).map(|i| match torn(i) {
            true => Frame {
                content: Content::Unreadable("torn".to_string()),
                ..frame(i, 5000.0 + off_s + i as f64, 0.0)
            },
            false => frame(i, 5000.0 + i as f64, if i < 150 { 0.0 } else { 0.5 }),
        });
        let events = watch(frames.collect(), None);
        assert_eq!(steps_s(&events), Vec::<f64>::new(), "{off_s}");
        let readable =
            |event: &&Event| matches!(event, Event::Observed { observation, .. } if observation.is_readable);
        let good: Vec<Event> = events.iter().filter(readable).cloned().collect();
        let wanted = (0..200).filter(|i| !torn(*i)).map(|i| 5000.0 + i as f64);
        assert_eq!(times_s(&good), wanted.collect::<Vec<_>>(), "{off_s}");
        assert!((began_s(&events).expect("a drift") - 5150.0).abs() <= 3.0, "{off_s}");
        let unseen = |event: &Event| match event {
            Event::StateChanged { t_s, state: State::Stale { .. }, .. } => Some(*t_s),
            _ => None,
        };
        let stale_s: Vec<f64> = events.iter().filter_map(unseen).collect();
        assert!(stale_s.iter().any(|t_s| (5104.0..5110.0).contains(t_s)), "{off_s}: {stale_s:?}");
    }
}

/// A live camera whose clock was set back by an hour while nothing watched it, or that does not know the time yet: every frame is older
/// than the last one of the session before, and is looked at all the same.
#[test]
fn a_restart_is_not_deaf_to_a_clock_that_was_set_back() {
    let folder = std::env::temp_dir().join(format!("live-clock-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let pace = Some(Duration::from_millis(5));
    let frames = |from: u64, start_s: f64, pan_deg: f64| {
        let frames = (from..from + 80).map(|i| frame(i, start_s + 0.005 * i as f64, pan_deg));
        frames.collect::<Vec<_>>()
    };
    for start_s in [1e9 - 3600.0, 0.0] {
        let path = folder.join(format!("{start_s}.state"));
        let open = || StateFile::open(&path, |_| ()).expect("a state file");
        let first = watch_from(frames(0, 1e9, 0.0), pace, Some(&open()));
        assert!(steps_s(&first).is_empty());
        let second = watch_from(frames(80, start_s, 0.5), pace, Some(&open()));
        let [step_s] = steps_s(&second)[..] else { panic!("{:?}", steps_s(&second)) };
        assert!((step_s + 1e9 - start_s).abs() < 60.0, "{step_s}");
        assert!(began_s(&second).is_some(), "the sudden motion in between is found");
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}
