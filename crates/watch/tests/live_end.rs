//! How sessions end: stopped from outside nothing that was read is lost, and a thread that fails takes only its camera with it.

use crate::live_support::{camera, config, tag, tag_pose, watched};
use resight::core::Pixel;
use resight::core::correspondence::Detection;
use resight::locate::IntrinsicsCovariance;
use resight::render::Pcg;
use resight_watch::live::rig::RigConfig;
use resight_watch::live::{self, Event, LiveCamera, LiveConfig, State, StateFile};
use resight_watch::source::{Content, Frame, Next, Source};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What comes after a source's frames.
#[derive(Clone, Copy)]
enum After {
    End,
    Panic,
    /// A front end that hangs.
    Nothing,
}

/// Corners of a tag that stands still, ten times a second of capture time.
struct Corners {
    /// Of its noise.
    seed: u64,
    next: u64,
    n_frames: u64,
    takes: Duration,
    after: After,
}

impl Corners {
    fn new(seed: u64, n_frames: u64, after: After) -> Self {
        Corners { seed, next: 0, n_frames, takes: Duration::ZERO, after }
    }
}

impl Source for Corners {
    fn next(&mut self, patience: Duration) -> Next {
        std::thread::sleep(self.takes);
        if self.n_frames <= self.next {
            return match self.after {
                After::End => Next::End,
                After::Panic => panic!("a cable of wool"),
                After::Nothing => {
                    std::thread::sleep(patience);
                    Next::Nothing
                }
            };
        }
        let number = self.next;
        self.next += 1;
        let (target, cam_from_tag) = (tag(), tag_pose(150.0, 40.0, 20.0));
        let mut chance = Pcg::new(1000 * self.seed + number);
        let corner = |feature| {
            let x = cam_from_tag * target.point(feature).expect("a corner").position;
            let noise_px = Pixel::new(0.1 * chance.normal(), 0.1 * chance.normal());
            let pixel = camera().project(&x).expect("in front") + noise_px;
            Detection { feature, pixel, sigma_px: 0.1, lens_sigma_px: 0.0, covariance_px2: None }
        };
        let seen = target.features().into_iter().map(corner).collect();
        let capture_s = 0.1 * number as f64;
        Next::Frame(Frame { number, capture_s, name: number.to_string(), content: Content::Detections(seen) })
    }

    fn is_live(&self) -> bool {
        false
    }
}

fn named(name: &str, corners: Corners) -> LiveCamera {
    LiveCamera { name: name.to_string(), ..watched(&tag(), corners) }
}

fn rig() -> LiveConfig {
    let rig = RigConfig { reference: None, sync_tolerance_s: 0.02 };
    LiveConfig { rig: Some(rig), learn_readings: 20, ..config() }
}

/// A lens that is 8 % too wide contradicts its corners. Where its file says that it may be, the reference is learned all the same.
#[test]
fn a_lens_that_is_stated_uncertain_learns_its_reference() {
    let sigmas = [("fx_px", 0.08), ("fy_px", 0.08)];
    let fx_px = camera().matrix().expect("a matrix").fx_px;
    let sigmas = sigmas.into_iter().map(|(name, part)| (name.to_owned(), part * fx_px)).collect();
    let stated = IntrinsicsCovariance::independent(&sigmas, &camera()).expect("standard deviations");
    let mut values: Vec<f64> = camera().parameters().iter().map(|(_, value)| *value).collect();
    values[0] *= 1.08;
    let off = camera().with_parameters(&values).expect("a camera");
    let has_learned = |intrinsics: Option<IntrinsicsCovariance>| {
        let watched =
            LiveCamera { camera: off.clone(), intrinsics, ..named("gate", Corners::new(1, 80, After::End)) };
        let (stop, mut learned) = (Arc::new(AtomicBool::new(false)), false);
        live::run_from(vec![watched], &config(), &stop, None, |event| {
            learned |= matches!(event, Event::Learned { .. });
            true
        })
        .expect("a session");
        learned
    };
    assert!(!has_learned(None), "taken as exact, the corners contradict it");
    assert!(has_learned(Some(stated)));
}

/// What is in the state file was reported, the reference that was learned too.
#[test]
fn what_was_read_before_a_stop_is_reported() {
    let folder = std::env::temp_dir().join(format!("live-end-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    for stop_at in [3, 30, 49, 50, 51] {
        let path = folder.join(format!("{stop_at}.state"));
        let state = StateFile::open(&path, |_| ()).expect("a state file");
        let stop = Arc::new(AtomicBool::new(false));
        let (mut seen, mut has_learned, mut has_ended) = (0, false, false);
        live::run_from(
            vec![named("gate", Corners::new(1, u64::MAX, After::End))],
            &config(),
            &stop,
            Some(&state),
            |event| {
                match event {
                    Event::Observed { .. } => seen += 1,
                    Event::Learned { .. } => has_learned = true,
                    Event::Ended { .. } => has_ended = true,
                    _ => {}
                }
                if seen == stop_at {
                    stop.store(true, Ordering::Relaxed);
                }
                true
            },
        )
        .expect("a session");
        drop(state);
        let text = std::fs::read_to_string(&path).expect("the state");
        let body: serde_json::Value =
            serde_json::from_str(text.lines().nth(1).expect("a body")).expect("JSON");
        let camera = &body["cameras"][0];
        let frames = (10.0 * camera["last_s"].as_f64().expect("a time")).round() as u64 + 1;
        let learned_in_file = camera["pairs"][0]["stage"]["watching"].is_object();
        assert_eq!((frames, learned_in_file, has_ended), (seen, has_learned, true), "stopped at {stop_at}");
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}

/// A camera that died yesterday, and whose images are looked through again every night: nothing is known of now.
#[test]
fn a_camera_with_no_newer_frames_is_unseen() {
    let path = std::env::temp_dir().join(format!("live-end-{}.state", std::process::id()));
    let mut config = config();
    config.monitor.stale_after_s = 1.0;
    let run = || {
        let state = StateFile::open(&path, |_| ()).expect("a state file");
        let cameras = vec![named("gate", Corners::new(1, 60, After::End))];
        let (mut states, mut poses) = (Vec::new(), 0);
        live::run_from(cameras, &config, &Arc::new(AtomicBool::new(false)), Some(&state), |event| {
            match event {
                Event::StateChanged { state, .. } => states.push(state.clone()),
                Event::Observed { observation, .. } => poses += u32::from(observation.estimate.is_some()),
                _ => {}
            }
            true
        })
        .expect("a session");
        drop(state);
        (states, poses, std::fs::read_to_string(&path).expect("the state"))
    };
    let (states, poses, kept) = run();
    assert_eq!((states.last(), poses), (Some(&State::Steady), 60));
    for _ in 0..2 {
        std::thread::sleep(Duration::from_millis(1100));
        let (states, poses, still_kept) = run();
        assert!(matches!(states[..], [State::Stale { .. }]) && poses == 0, "{states:?}");
        assert!(kept == still_kept, "nothing new is kept, and no newer time");
    }
    std::fs::remove_file(&path).expect("removed");
}

/// A source that panics: its camera is lost and unseen, the other continues to its end.
#[test]
fn a_thread_that_fails_takes_its_camera_with_it_only() {
    for config in [config(), rig()] {
        let cameras = vec![
            named("good", Corners::new(1, 90, After::End)),
            named("bad", Corners::new(2, 80, After::Panic)),
        ];
        let (mut states, mut reasons, mut ended, mut seen) = ([None, None], Vec::new(), Vec::new(), [0, 0]);
        live::run(cameras, &config, &Arc::new(AtomicBool::new(false)), |event| {
            match event {
                Event::Observed { camera, .. } => seen[*camera] += 1,
                Event::StateChanged { camera, state, .. } => states[*camera] = Some(state.clone()),
                Event::Source { camera, connected: false, reason } => reasons.push((*camera, reason.clone())),
                Event::Ended { camera } => ended.push(*camera),
                _ => {}
            }
            true
        })
        .expect("a session");
        ended.sort_unstable();
        assert_eq!((seen, ended), ([90, 80], vec![0, 1]));
        let [(1, Some(reason))] = &reasons[..] else { panic!("{reasons:?}") };
        assert!(reason.contains("a cable of wool"), "{reason}");
        assert_eq!(states[0], Some(State::Steady));
        assert!(matches!(states[1], Some(State::Stale { .. })), "{:?}", states[1]);
    }
}

/// A listener that panics ends the session: nobody waits for ever.
#[test]
fn a_listener_that_fails_ends_the_session() {
    let run = std::panic::catch_unwind(|| {
        let cameras = vec![named("gate", Corners::new(1, u64::MAX, After::End))];
        live::run(cameras, &config(), &Arc::new(AtomicBool::new(false)), |_| panic!("no ears"))
    });
    assert!(run.is_err());
}

/// Of two recordings one is read much faster: it waits, and the moments are those of both.
#[test]
fn a_fast_recording_does_not_run_away_from_a_slow_one() {
    const FRAMES: u64 = 5000;
    /// Frames that may wait to be put together, and those on their way there.
    const MOST: u64 = 2000 + 400;
    let slow = Corners { takes: Duration::from_micros(300), ..Corners::new(2, FRAMES, After::End) };
    let cameras = vec![named("fast", Corners::new(1, FRAMES, After::End)), named("slow", slow)];
    let (mut seen, mut lead) = ([0u64; 2], 0);
    live::run(cameras, &rig(), &Arc::new(AtomicBool::new(false)), |event| {
        if let Event::Observed { camera, .. } = event {
            seen[*camera] += 1;
            lead = lead.max(seen[0].saturating_sub(seen[1]));
        }
        true
    })
    .expect("a session");
    println!("the fast one was {lead} frames ahead");
    assert_eq!(seen, [FRAMES, FRAMES]);
    assert!(lead <= MOST, "{lead}");
}

/// A front end that hangs says nothing of any camera: they do not stay steady.
#[test]
fn cameras_whose_front_end_hangs_are_unseen() {
    let cameras = || (0..2).map(|i| named(&i.to_string(), Corners::new(i, 60, After::Nothing))).collect();
    let mut config = rig();
    config.monitor.stale_after_s = 1.5;
    let (began, mut states) = (Instant::now(), [None, None]);
    let (mut were_steady, mut were_unseen) = (false, false);
    let all = |states: &[Option<State>; 2], is_so: fn(&State) -> bool| {
        states.iter().all(|state| state.as_ref().is_some_and(is_so))
    };
    let stop = Arc::new(AtomicBool::new(false));
    std::thread::scope(|scope| {
        // The session says nothing more once all is reported; it is ended from here.
        scope.spawn(|| {
            while began.elapsed() < Duration::from_secs(60) && !stop.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(20));
            }
            stop.store(true, Ordering::Relaxed);
        });
        live::run(cameras(), &config, &stop, |event| {
            if let Event::StateChanged { camera, state, .. } = event {
                states[*camera] = Some(state.clone());
                were_steady |= all(&states, |state| *state == State::Steady);
                were_unseen |= were_steady && all(&states, |state| matches!(state, State::Stale { .. }));
            }
            if were_unseen {
                stop.store(true, Ordering::Relaxed);
            }
            true
        })
        .expect("a session");
    });
    assert!(were_unseen, "{states:?}");
}
