//! A still scene in a compressed video: its errors change at key frames, which learning spans. Without ffmpeg nothing is tested.

use crate::live_support::{HEIGHT_PX, WIDTH_PX, picture, tag, tag_pose, watched};
use resight::render::Pcg;
use resight_watch::live::{self, Event, LiveConfig, Promise, State};
use resight_watch::names::Names;
use resight_watch::outputs::said::EventText;
use resight_watch::source::video::Film;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A still scene of so many frames, each with its own noise, with a key frame every `group` of them; none without ffmpeg.
fn still(name: &str, rate_hz: u32, frames: u32, group: u32) -> Option<PathBuf> {
    if Command::new("ffmpeg").arg("-version").output().is_err() {
        println!("ffmpeg is not installed: this test is skipped");
        return None;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("live_video");
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(name);
    let (size, rate, group) = (format!("{WIDTH_PX}x{HEIGHT_PX}"), rate_hz.to_string(), group.to_string());
    let mut ffmpeg = Command::new("ffmpeg")
        .args([
            "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-s", &size, "-r", &rate, "-i", "-",
        ])
        .args(["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-crf", "28"])
        .args(["-g", &group, "-keyint_min", &group, "-sc_threshold", "0", "-pix_fmt", "yuv420p"])
        .arg(&path)
        .stdin(Stdio::piped())
        .spawn()
        .expect("ffmpeg");
    let clean = picture(&tag(), tag_pose(120.0, -60.0, 35.0), 1);
    let mut chance = Pcg::new(7);
    // Noise of one length is cut at other places: to draw a million numbers for each frame would be most of the test.
    let noise: Vec<f64> = (0..clean.data.len() + 5000).map(|_| 2.0 * chance.normal()).collect();
    let mut to_ffmpeg = ffmpeg.stdin.take().expect("a pipe");
    for frame in 0..frames as usize {
        let noise = &noise[frame * 1237 % 5000..];
        let noisy =
            clean.data.iter().zip(noise).map(|(grey, noise)| (f64::from(*grey) + noise).round() as u8);
        to_ffmpeg.write_all(&noisy.collect::<Vec<u8>>()).expect("a frame");
    }
    drop(to_ffmpeg);
    assert!(ffmpeg.wait().expect("ffmpeg").success(), "{name}");
    Some(path)
}

struct Watched {
    /// With the event in words.
    learned: Option<(Promise, String)>,
    drifts: usize,
}

fn watch(film: &Path) -> Watched {
    let camera = watched(&tag(), Film::open(film).expect("a film"));
    let text = EventText::new(&Names::new(std::slice::from_ref(&camera.name), &["target".to_string()]));
    let (mut result, stop) = (Watched { learned: None, drifts: 0 }, Arc::new(AtomicBool::new(false)));
    live::run(vec![camera], &LiveConfig::default(), &stop, |event| {
        match event {
            Event::Learned { promise: Some(promise), .. } => {
                result.learned = Some(((**promise).clone(), text.words(event)));
            }
            Event::StateChanged { state: State::Drifted(_), .. } => result.drifts += 1,
            _ => {}
        }
        true
    })
    .expect("a session");
    result
}

/// Fifty readings are one group of frames and less; two further key frames come at frames 80 and 160.
#[test]
fn learning_spans_two_key_frames_of_a_video() {
    let Some(film) = still("groups.mp4", 10, 400, 80) else { return };
    let Watched { learned, drifts } = watch(&film);
    let (promise, words) = learned.expect("a reference");
    let span_s = promise.learned_from.last().expect("readings").t_s - promise.learned_from[0].t_s;
    assert!((15.9..16.2).contains(&span_s), "learned from {span_s} s");
    assert_eq!((promise.missed_key_frames, drifts), (None, 0));
    assert!(!words.contains("key frame") && words.contains("not for those of hours"), "{words}");
}

/// After two minutes the reference is learned all the same, and what it cannot know is stated.
#[test]
fn a_video_with_one_key_frame_is_learned_with_a_reservation() {
    let Some(film) = still("one_group.mp4", 1, 135, 1000) else { return };
    let (promise, words) = watch(&film).learned.expect("a reference");
    assert_eq!((promise.missed_key_frames, promise.learned_from.len()), (Some(0), 121));
    assert!(
        words.contains("no rate of false alarms is promised now") && words.contains("0 key frames"),
        "{words}"
    );
}
