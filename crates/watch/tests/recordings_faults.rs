//! Recordings as other writers leave them in trouble: chunks whose length is not there yet, intrinsics that cannot be read or do not fit,
//! frames without a stamp.

use mcap::records::MessageHeader;
use resight::recording::{Next, Recording};
use resight_watch::source::mcap::McapTopic;
use resight_watch::source::{self, Content, Source};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Cursor, Seek, Write};
use std::path::PathBuf;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_millis(20);
const TAGS: &str = "apriltag_msgs/msg/AprilTagDetectionArray";
const INTRINSICS: &str = "sensor_msgs/msg/CameraInfo";

fn path(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("recordings-faults");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// Messages as JSON: topic, type, time of recording, text.
struct Json<W: Write + Seek>(mcap::Writer<W>);

impl<W: Write + Seek> Json<W> {
    fn add(&mut self, topic: &str, kind: &str, log_time_s: f64, text: &str) {
        self.add_encoded(topic, kind, "json", log_time_s, text);
    }

    fn add_encoded(&mut self, topic: &str, kind: &str, encoding: &str, log_time_s: f64, text: &str) {
        let schema = self.0.add_schema(kind, "jsonschema", b"{}").unwrap();
        let channel_id = self.0.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap();
        let log_time = (1e9 * log_time_s) as u64;
        let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        self.0.write_to_known_channel(&header, text.as_bytes()).unwrap();
    }
}

/// No tag, seen at a stamp.
fn nothing_seen(stamp_s: f64) -> String {
    let (sec, nanosec) = (stamp_s.trunc(), (1e9 * stamp_s.fract()).round());
    format!(
        r#"{{"header":{{"stamp":{{"sec":{sec},"nanosec":{nanosec}}},"frame_id":"cam"}},"detections":[]}}"#
    )
}

/// All messages of a file that nobody writes any more, and how it was cut.
fn saved(path: &PathBuf) -> (usize, String) {
    let mut recording = Recording::new(File::open(path).unwrap(), |_| true);
    let (mut n, mut cut) = (0, String::new());
    loop {
        match recording.read_next().unwrap() {
            Next::Message(_) => n += 1,
            Next::Nothing => {}
            Next::Damaged(reason) => panic!("{reason}"),
            Next::Unfinished => cut = recording.close().unwrap(),
            Next::End => return (n, cut),
        }
    }
}

fn frames_now(source: &mut impl Source) -> usize {
    let (mut n, mut quiet) = (0, 0);
    while quiet < 3 {
        match source.next(PATIENCE) {
            source::Next::Frame(frame) => {
                assert!(matches!(frame.content, Content::Detections(_)), "{:?}", frame.content);
                n += 1;
            }
            source::Next::Nothing => quiet += 1,
            other => panic!("{other:?}"),
        }
    }
    n
}

/// The crate `mcap`, unless told otherwise, fills in length and sizes of a chunk when it ends: such a file is followed as it grows.
#[test]
fn a_chunk_whose_length_comes_later_is_waited_for() {
    for compression in [None, Some(mcap::Compression::Zstd)] {
        let path = path(&format!("growing-{}.mcap", compression.is_some()));
        let options = mcap::WriteOptions::default().compression(compression);
        let mut out = Json(options.create(File::create(&path).unwrap()).unwrap());
        out.add("/tags", TAGS, 1.0, &nothing_seen(1.0));
        out.0.flush().unwrap();
        let mut source = McapTopic::open(&path, None).unwrap();
        assert_eq!(frames_now(&mut source), 1);
        for chunk in 1..4 {
            for i in 0..5 {
                let t_s = f64::from(5 * chunk + i);
                out.add("/tags", TAGS, t_s, &nothing_seen(t_s));
            }
            assert_eq!(frames_now(&mut source), 0, "chunk {chunk} is open");
            out.0.flush().unwrap();
            assert_eq!(frames_now(&mut source), 5, "chunk {chunk} has ended");
        }
        out.0.finish().unwrap();
        assert!((0..10).any(|_| matches!(source.next(PATIENCE), source::Next::End)));
    }
}

/// A writer that died in such a chunk: what is whole of it is read.
#[test]
fn a_chunk_that_never_got_its_length_is_saved() {
    let path = path("died.mcap");
    let options = mcap::WriteOptions::default().compression(None);
    let mut out = Json(options.create(Cursor::new(Vec::new())).unwrap());
    for i in 0..4 {
        out.add("/tags", TAGS, f64::from(i), &nothing_seen(f64::from(i)));
        if i == 1 {
            out.0.flush().unwrap();
        }
    }
    // The writer's memory as the disk would hold it: without the last ten bytes, and never finished.
    let bytes = out.0.into_inner().into_inner();
    std::fs::write(&path, &bytes[..bytes.len() - 10]).unwrap();
    let (n, cut) = saved(&path);
    assert_eq!(n, 3, "{cut}");
    assert!(cut.contains("cut off") && cut.contains("1 whole messages of it"), "{cut}");
    let mut source = McapTopic::open(&path, None).unwrap().as_it_is();
    let mut reported = Vec::new();
    loop {
        match source.next(PATIENCE) {
            source::Next::Frame(frame) => reported.push(frame.name),
            source::Next::Lost(reason) => reported.push(reason.to_string()),
            source::Next::End => break,
            source::Next::Nothing => {}
        }
    }
    assert!(reported.len() == 4 && reported[3].contains("cut off"), "{reported:?}");
}

/// Sizes that are not there yet let nothing through that is larger than what is read otherwise.
#[test]
fn a_bomb_in_a_torn_chunk_is_defused() {
    let path = path("bomb.mcap");
    let mut out = Json(mcap::WriteOptions::default().create(Cursor::new(Vec::new())).unwrap());
    let long = " ".repeat(30_000_000);
    for i in 0..12 {
        out.add("/tags", TAGS, f64::from(i), &long);
    }
    out.0.flush().unwrap();
    let mut bytes = out.0.into_inner().into_inner();
    // The first chunk behind magic and header: its length and sizes as they were before.
    let header = 9 + u64::from_le_bytes(bytes[9..17].try_into().unwrap()) as usize;
    let chunk = 8 + header;
    assert_eq!(bytes[chunk], 6, "a chunk");
    for at in [chunk + 1, chunk + 9 + 16, chunk + 9 + 16 + 8 + 4 + 4 + 4] {
        bytes[at..at + 8].fill(0xff);
    }
    std::fs::write(&path, &bytes).unwrap();
    let (n, cut) = saved(&path);
    assert!(n < 9 && cut.contains("cut off"), "{n} messages of 30 MB: {cut}");
}

fn info(extra: &str) -> String {
    let k = "[300,0,159.5,0,300,119.5,0,0,1]";
    let p = "[280,0,160.5,0,0,280,120.5,0,0,0,1,0]";
    format!(
        r#"{{"width":320,"height":240,"distortion_model":"plumb_bob","d":[0.1,0,0,0,0],"k":{k},"p":{p}{extra}}}"#
    )
}

/// P of a part of the image, or of a binned one, belongs to other pixels than those that come.
#[test]
fn rectified_pictures_are_whole_ones() {
    let path = path("crops.mcap");
    let mut out = Json(mcap::Writer::new(File::create(&path).unwrap()).unwrap());
    let roi = |width: u32, x: u32| {
        format!(r#","roi":{{"x_offset":{x},"y_offset":0,"width":{width},"height":{width}}}"#)
    };
    for (topic, extra) in [
        ("/whole", roi(0, 0)),
        ("/binned", r#","binning_x":2,"binning_y":2"#.into()),
        ("/part", roi(100, 40)),
    ] {
        out.add(topic, INTRINSICS, 1.0, &info(&extra));
    }
    out.0.finish().unwrap();
    let read = |topic: &str| resight::formats::read_camera(format!("{}#{topic}", path.display()));
    let whole = read("/whole/rectified").unwrap().camera;
    assert_eq!(whole.matrix().unwrap().cx_px, 160.5);
    for (topic, word) in [("/binned", "binning_x: is 2"), ("/part", "roi: is a part of the image")] {
        for name in [topic.to_string(), format!("{topic}/rectified")] {
            let reported = read(&name).unwrap_err().to_string();
            assert!(reported.contains(word), "{name}: {reported}");
        }
    }
}

/// What one topic lacks is reported when it is asked for; the others are read.
#[test]
fn a_camera_that_cannot_be_read_does_not_harm_the_others() {
    let path = path("one_bad.mcap");
    let mut out = Json(mcap::Writer::new(File::create(&path).unwrap()).unwrap());
    out.add("/torn", INTRINSICS, 1.0, "{\"width\":");
    out.add_encoded("/strange", INTRINSICS, "protobuf", 1.0, "x");
    out.add("/text", INTRINSICS, 1.0, "\"nothing\"");
    out.add("/good", INTRINSICS, 2.0, &info(""));
    out.0.finish().unwrap();
    let read = |topic: &str| resight::formats::read_camera(format!("{}{topic}", path.display()));
    assert_eq!(read("#/good").unwrap().name, "/good");
    assert_eq!(read("").unwrap().name, "/good", "the only one");
    assert!(read("#/good/rectified").is_ok());
    for (topic, word) in [
        ("#/torn", "/torn: not JSON"),
        ("#/torn/rectified", "/torn: not JSON"),
        ("#/strange", "/strange: messages are encoded as `protobuf`"),
        ("#/text", "/text: the message has no fields"),
    ] {
        let reported = read(topic).unwrap_err().to_string();
        assert!(reported.contains(word), "{topic}: {reported}");
    }
}

/// The recorder's clock is a year ahead of the camera's: a frame without a stamp stays among the camera's times, and a topic that begins
/// without stamps keeps the recorder's.
#[test]
fn one_topic_has_the_times_of_one_clock() {
    let path = path("stamps.mcap");
    let mut out = Json(mcap::Writer::new(File::create(&path).unwrap()).unwrap());
    let recorded_s = |i: u32| 1.73e9 + 0.25 * f64::from(i);
    let taken_s = |i: u32| 1.7e9 + 0.25 * f64::from(i);
    for i in 0..4 {
        let stamp_s = |without: u32| if i == without { 0.0 } else { taken_s(i) };
        out.add("/stamped", TAGS, recorded_s(i), &nothing_seen(stamp_s(2)));
        out.add("/late", TAGS, recorded_s(i), &nothing_seen(stamp_s(0)));
    }
    out.0.finish().unwrap();
    for (topic, expected_s) in [("/stamped", taken_s as fn(u32) -> f64), ("/late", recorded_s)] {
        let mut source = McapTopic::open(&path, Some(topic)).unwrap().as_it_is();
        for i in 0..4 {
            let frame = loop {
                match source.next(PATIENCE) {
                    source::Next::Frame(frame) => break frame,
                    source::Next::Nothing => {}
                    other => panic!("{other:?}"),
                }
            };
            assert!((frame.capture_s - expected_s(i)).abs() < 1e-6, "{topic} {i}: {}", frame.capture_s);
            assert_eq!(frame.name == format!("{topic} {i}"), topic == "/stamped" && i != 2, "{}", frame.name);
        }
    }
}
