//! Images of half the size that the camera was calibrated at: poses, and the relations of a rig, are those of the whole size.

use crate::live_support::{camera, tag, tag_pose, watched};
use nalgebra::{DMatrix, Vector6};
use resight::GrayImage;
use resight::core::Pose;
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
