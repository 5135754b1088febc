//! Images of half the size that the camera was calibrated at: poses, and the relations of a rig, are those of the whole size.

use crate::live_support::{camera, tag, tag_pose, watched};
use nalgebra::{DMatrix, Vector6};
use resight::GrayImage;
use resight::core::correspondence::Detection;
use resight::core::target::Feature;
use resight::core::temporal::monitor::{DriftNoise, Reference};
use resight::core::{Matrix6, Pixel, Pose};
use resight::render::{Finish, Scene, Style, render};
use resight_watch::live::rig::RigConfig;
use resight_watch::live::{self, CameraWatcher, Event, LiveCamera, LiveConfig, State};
use resight_watch::source::{Content, Frame, Next, Source};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

fn half_size(cam_from_target: Pose, seed: u64) -> GrayImage {
    let lens = camera().scaled_to(640, 480).expect("the same aspect");
    let finish = Finish { seed, samples_per_axis: 3, ..Finish::default() };
    render(&Scene::of(tag(), cam_from_target, Style::default()), &lens, &finish).expect("an image")
}

fn frame(number: u64, picture: GrayImage) -> Frame {
    let name = number.to_string();
    Frame { number, capture_s: 0.1 * number as f64, name, content: Content::Image(picture) }
}

/// Frames from a list.
struct Film(std::vec::IntoIter<Frame>);

impl Source for Film {
    fn next(&mut self, _: Duration) -> Next {
        self.0.next().map_or(Next::End, Next::Frame)
    }

    fn is_live(&self) -> bool {
        false
    }
}

#[test]
fn the_pose_is_that_of_the_whole_size() {
    let truth = tag_pose(240.0, 100.0, -60.0);
    let mut look = CameraWatcher::new(&watched(&tag(), Film(Vec::new().into_iter())), &LiveConfig::default())
        .expect("something to look for");
    let seen = look.take(&frame(0, half_size(truth, 1)), 0.0).remove(0).observation;
    let pose = seen.estimate.expect("the tag is seen").cam_from_target;
    let off_m = (pose.translation - truth.translation).norm();
    assert!(off_m < 0.005 && pose.angle_to_rad(&truth) < 0.01, "{off_m} m, {pose:?}");
}

/// Two cameras half a metre apart before which a tag is carried.
#[test]
fn a_rig_stands_where_its_file_says() {
    const MOMENTS: u64 = 30;
    let cam_from_rig = [
        Pose::identity(),
        Pose::exp(&Vector6::new(0.0, 0.3, 0.0, 0.0, 0.0, 0.0))
            * Pose::exp(&Vector6::new(0.0, 0.0, 0.0, -0.3, 0.0, 0.0)),
    ];
    let rig_from_tag = |moment: u64| {
        let phase = 0.3 * moment as f64;
        let (u_px, v_px) = (60.0 * phase.sin(), 60.0 * (0.7 * phase).cos());
        tag_pose(220.0, u_px, v_px)
            * Pose::exp(&Vector6::new(0.2 * phase.cos(), 0.2 * phase.sin(), 0.0, 0.0, 0.0, 0.0))
    };
    let watched = |(i, place): (usize, &Pose)| {
        let picture = |moment| half_size(*place * rig_from_tag(moment), 50 * i as u64 + moment);
        let frames: Vec<Frame> = (0..MOMENTS).map(|moment| frame(moment, picture(moment))).collect();
        LiveCamera { name: i.to_string(), ..watched(&tag(), Film(frames.into_iter())) }
    };
    let cameras = cam_from_rig.iter().enumerate().map(watched).collect();
    let covariance = DMatrix::identity(12, 12) * 1e-7;
    let rig = RigConfig { reference: Some((cam_from_rig.to_vec(), covariance)), sync_tolerance_s: 0.02 };
    let config = LiveConfig { rig: Some(rig), learn_readings: 20, ..crate::live_support::config() };
    let mut states = [None, None];
    live::run(cameras, &config, &Arc::new(AtomicBool::new(false)), |event| {
        match event {
            Event::StateChanged { camera, state, .. } => states[*camera] = Some(state.clone()),
            Event::Attributed { moved, .. } => panic!("nothing moved: {moved:?}"),
            _ => {}
        }
        true
    })
    .expect("a session");
    assert_eq!(states, [Some(State::Steady), Some(State::Steady)]);
}

/// Images of another aspect are no lack of light or cable: the state says what is wrong with them, and that none comes where none does.
#[test]
fn a_wrong_image_size_is_named() {
    let mut look = CameraWatcher::new(&watched(&tag(), Film(Vec::new().into_iter())), &LiveConfig::default())
        .expect("something to look for");
    let square = |i: u64| GrayImage { width_px: 64, height_px: 64, data: vec![i as u8; 64 * 64] };
    let last = (0..80).map(|i| look.take(&frame(i, square(i)), 0.0).remove(0).state).last();
    let Some(State::Stale { reason: Some(reason), .. }) = &last else { panic!("{last:?}") };
    assert!(reason.contains("1280×960") && reason.contains("64×64"), "{reason}");
    let State::Stale { reason: Some(reason), .. } = look.states(60.0).remove(0) else { panic!("no frame") };
    assert_eq!(reason, "no frame comes");
}

/// Corners that do not fit their stated sigma, in every frame from the first on: the target is seen, so that is no lack of readings.
#[test]
fn readings_that_contradict_their_noise_are_not_called_missing() {
    let (target, truth) = (tag(), tag_pose(240.0, 100.0, -60.0));
    let mut camera = watched(&target, Film(Vec::new().into_iter()));
    let spread = |sigma: f64| Matrix6::identity() * sigma * sigma;
    let (reference, reading, none) = (spread(1e-4), spread(1e-3), Matrix6::zeros());
    let noise = DriftNoise { reference, reading, bias: none, bias_time_s: 60.0, diurnal: none };
    camera.targets[0].reference = Some(Reference { a_from_b: truth, noise });
    let mut look = CameraWatcher::new(&camera, &LiveConfig::default()).expect("something to look for");
    let detection = |(k, feature): (usize, Feature)| {
        let x = target.point(feature).expect("a known point").position;
        let pixel = camera.camera.project(&(truth.rotation * x + truth.translation)).expect("in the image");
        let off_px = if k % 2 == 0 { 3.0 } else { -3.0 };
        Detection {
            feature,
            pixel: Pixel::new(pixel.x + off_px, pixel.y),
            sigma_px: 0.1,
            lens_sigma_px: 0.0,
            covariance_px2: None,
        }
    };
    let detections: Vec<Detection> = target.features().into_iter().enumerate().map(detection).collect();
    let mut states = Vec::new();
    for i in 0..200 {
        let content = Content::Detections(detections.clone());
        let frame = Frame { number: i, capture_s: 0.5 * i as f64, name: i.to_string(), content };
        states.push(look.take(&frame, 0.0).remove(0).state);
    }
    assert!(states.contains(&State::Inconsistent), "{:?}", states.last());
    assert!(!states.iter().any(|state| matches!(state, State::Stale { .. })), "it is seen in every frame");
}
