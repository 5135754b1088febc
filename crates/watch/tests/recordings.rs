//! Recordings that other people's libraries wrote (testdata/mcap, made by scripts/judges/_recordings.py): whole, cut off anywhere, still
//! growing, and damaged at random.

use proptest::prelude::*;
use resight::recording::{Channel, Message, Next, Recording, topics};
use resight_watch::ros::sight::{Decoder, Kind, MessageContent, decode_content};
use resight_watch::source::mcap::McapTopic;
use resight_watch::source::{self, Content, Frame, Source};
use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_millis(50);
const START_S: f64 = 1.7e9;

fn sample(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../testdata/mcap").join(name)
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(sample(name)).unwrap()
}

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("recordings");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// All frames until the end; fails when the source only waits.
fn frames(mut source: impl Source) -> Vec<Frame> {
    let (mut all, mut idle) = (Vec::new(), 0);
    loop {
        match source.next(PATIENCE) {
            source::Next::Frame(frame) => all.push(frame),
            source::Next::Nothing => idle += 1,
            source::Next::Lost(reason) => panic!("{reason}"),
            source::Next::End => return all,
        }
        assert!(idle < 1000, "nothing comes any more");
    }
}

fn decoder(channel: &Channel) -> Result<Decoder, String> {
    Decoder::new(&channel.kind, &channel.message_encoding, &channel.definition_encoding, &channel.definition)
}

/// Every message of every topic, and what was said in between.
fn messages(bytes: &[u8]) -> (Vec<Message>, Vec<String>) {
    let mut recording = Recording::new(Cursor::new(bytes), |_| true);
    let (mut found, mut reported) = (Vec::new(), Vec::new());
    loop {
        match recording.read_next() {
            Ok(Next::Message(message)) => found.push(message),
            Ok(Next::Nothing) => {}
            Ok(Next::Damaged(reason)) => reported.push(reason),
            Ok(Next::Unfinished) => reported.push(recording.close().unwrap()),
            Ok(Next::End) => return (found, reported),
            Err(reason) => reported.push(reason.0),
        }
    }
}

#[test]
fn every_writer_s_topics_and_stamps_are_read() {
    let cases = [
        ("two_cameras_zstd.mcap", "/gate/image_raw", 24, (320, 240)),
        ("two_cameras_zstd.mcap", "/yard/image_raw/compressed", 24, (320, 240)),
        ("rosbags_plain.mcap", "/shed/image_raw/compressed", 24, (256, 192)),
        ("ros1_zstd.mcap", "/gate/image_raw", 4, (320, 240)),
        ("big_endian.mcap", "/yard/image_raw", 4, (320, 240)),
        ("foxglove_json.mcap", "/gate/image", 4, (320, 240)),
    ];
    for (name, topic, n, size) in cases {
        let all = frames(McapTopic::open(sample(name), Some(topic)).unwrap().as_it_is());
        assert_eq!(all.len(), n, "{name} {topic}");
        for (i, frame) in all.iter().enumerate() {
            let Content::Image(image) = &frame.content else { panic!("{name}: {:?}", frame.content) };
            assert_eq!((image.width_px, image.height_px), size);
            let (dark, bright) = (image.data.iter().min().unwrap(), image.data.iter().max().unwrap());
            assert!(*dark <= 40 && 200 <= *bright, "{name}: {dark} to {bright}");
            // The stamp of the header; the recorder wrote 5 ms later. Doubles of today have steps of 0.24 µs.
            assert!((frame.capture_s - START_S - 0.2 * i as f64).abs() < 1e-6, "{}", frame.capture_s);
            assert_eq!(frame.name, format!("{topic} {i}"));
        }
    }
    for topic in ["/detections", "/tag_detections"] {
        let all = frames(McapTopic::open(sample("detections_lz4.mcap"), Some(topic)).unwrap().as_it_is());
        assert_eq!(all.len(), 24);
        let Content::Detections(corners) = &all[0].content else { panic!("{:?}", all[0].content) };
        assert_eq!(
            corners.iter().map(|d| (d.feature.id, d.feature.corner)).collect::<Vec<_>>(),
            [(3, 0), (3, 1), (3, 2), (3, 3)]
        );
    }
}

/// Both messages tell of the same corners, in different orders; ours is one.
#[test]
fn both_detection_messages_give_the_same_corners() {
    let corners = |topic: &str| match &frames(
        McapTopic::open(sample("detections_lz4.mcap"), Some(topic)).unwrap().as_it_is(),
    )[0]
    .content
    {
        Content::Detections(all) => all.iter().map(|d| d.pixel).collect::<Vec<_>>(),
        other => panic!("{other:?}"),
    };
    let (ros, isaac) = (corners("/detections"), corners("/tag_detections"));
    assert!(ros.iter().zip(&isaac).all(|(a, b)| (a - b).norm() < 1e-12));
    assert!(ros[0].x < ros[1].x && ros[0].y < ros[3].y, "0 is top-left: {ros:?}");
}

#[test]
fn topics_are_chosen_or_listed_with_types_and_counts() {
    assert!(McapTopic::open(sample("rosbags_plain.mcap"), None).is_ok(), "the only one");
    let reported = |name: &str, topic| match McapTopic::open(sample(name), topic) {
        Ok(_) => panic!("{name} was opened"),
        Err(reason) => reason.to_string(),
    };
    let several = reported("two_cameras_zstd.mcap", None);
    assert!(several.contains("name one, e.g. FILE#/gate/image_raw"), "{several}");
    assert!(several.contains("/gate/image_raw (sensor_msgs/msg/Image, 24 messages)"), "{several}");
    assert!(reported("two_cameras_zstd.mcap", Some("/nothing")).contains("there is no topic /nothing"));
    let intrinsics = reported("two_cameras_zstd.mcap", Some("/gate/camera_info"));
    assert!(
        intrinsics.contains("holds sensor_msgs/msg/CameraInfo, which shows no camera's sight"),
        "{intrinsics}"
    );
    let no_mcap = file("no.mcap", b"not a recording at all");
    assert!(McapTopic::open(&no_mcap, None).err().unwrap().to_string().contains("no MCAP file"));
}

/// Wherever the file is cut: a prefix of the messages, then one reason, then the end.
#[test]
fn a_file_cut_anywhere_gives_its_whole_messages_and_a_reason() {
    for name in [
        "ros1_zstd.mcap",
        "big_endian.mcap",
        "foxglove_json.mcap",
        "detections_lz4.mcap",
        "rosbags_plain.mcap",
    ] {
        let whole = bytes(name);
        let (expected, reported) = messages(&whole);
        assert!(reported.is_empty() && !expected.is_empty(), "{name}: {reported:?}");
        let mut most = 0;
        for cut in (0..whole.len()).step_by(whole.len() / 97) {
            let (found, reported) = messages(&whole[..cut]);
            assert!(expected.starts_with(&found), "{name} cut at {cut}");
            assert_eq!(reported.len(), 1, "{name} cut at {cut}: {reported:?}");
            assert!(found.len() >= most, "more of the file gives no fewer messages");
            most = found.len();
        }
        assert_eq!(most, expected.len(), "{name}: all messages lie before the summary");
    }
}

/// A chunk that was not finished gives the messages that are whole in it.
#[test]
fn a_torn_chunk_gives_its_whole_messages() {
    let whole = bytes("rosbags_plain.mcap");
    let (expected, _) = messages(&whole);
    let (half, reported) = messages(&whole[..40_000]);
    assert!(8 < half.len() && half.len() < expected.len(), "{} of {}", half.len(), expected.len());
    assert!(reported[0].contains("cut off") && reported[0].contains("whole messages of it"), "{reported:?}");
}

#[test]
fn a_damaged_chunk_is_reported_and_the_others_are_read() {
    let mut damaged = bytes("two_cameras_zstd.mcap");
    let (expected, _) = messages(&damaged);
    damaged[6000] ^= 0x55;
    let (found, reported) = messages(&damaged);
    assert!(!found.is_empty() && found.len() < expected.len(), "{} of {}", found.len(), expected.len());
    assert!(reported.len() == 1 && reported[0].contains("damaged chunk"), "{reported:?}");
}

/// A recorder that is at work: what it adds is read, and a half-written record waits until it is whole.
#[test]
fn a_growing_file_is_followed() {
    let whole = bytes("ros1_zstd.mcap");
    let path = file("growing.mcap", &whole[..9000]);
    let mut source = McapTopic::open(&path, Some("/gate/image_raw")).unwrap();
    let count = |source: &mut McapTopic| {
        let (mut n, mut quiet) = (0, 0);
        while quiet < 3 {
            match source.next(PATIENCE) {
                source::Next::Frame(frame) => {
                    assert!(matches!(frame.content, Content::Image(_)), "{:?}", frame.content);
                    n += 1;
                }
                source::Next::End => return (n, true),
                _ => quiet += 1,
            }
        }
        (n, false)
    };
    let (before, ended) = count(&mut source);
    assert!(before < 4 && !ended, "{before}");
    std::fs::OpenOptions::new().append(true).open(&path).unwrap().write_all(&whole[9000..]).unwrap();
    assert_eq!(count(&mut source), (4 - before, true));
}

#[test]
fn a_stamp_of_zero_is_replaced_by_the_time_of_recording_and_said() {
    let mut out = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    let (message, _) = messages(&bytes("ros1_zstd.mcap"));
    let image = message.iter().find(|m| m.channel.topic == "/gate/image_raw").unwrap();
    let channel = &image.channel;
    let schema = out.add_schema(&channel.kind, &channel.definition_encoding, &channel.definition).unwrap();
    let id = out.add_channel(schema, &channel.topic, &channel.message_encoding, &BTreeMap::new()).unwrap();
    let mut data = image.data.clone();
    data[4..12].fill(0); // Behind the sequence number.
    let header = mcap::records::MessageHeader {
        channel_id: id,
        sequence: 0,
        log_time: 7_500_000_000,
        publish_time: 0,
    };
    out.write_to_known_channel(&header, &data).unwrap();
    out.finish().unwrap();
    let path = file("no_stamp.mcap", out.into_inner().get_ref());
    let all = frames(McapTopic::open(&path, None).unwrap().as_it_is());
    assert_eq!(
        (all[0].capture_s, all[0].name.as_str()),
        (7.5, "/gate/image_raw 0 (no stamp: time of recording)")
    );
}

#[test]
fn intrinsics_are_those_of_the_topic_asked_for() {
    let read = |spec: &str| {
        resight::formats::read_camera(format!("{}{spec}", sample("two_cameras_zstd.mcap").display()))
    };
    let gate = read("#/gate/camera_info").unwrap();
    assert_eq!((gate.name.as_str(), gate.camera.model_name()), ("/gate/camera_info", "brown_conrady"));
    assert_eq!(gate.camera.matrix().unwrap().cx_px, 156.5);
    assert_eq!(read("#/yard/camera_info").unwrap().camera.model_name(), "kannala_brandt");
    let rectified = read("#/gate/camera_info/rectified").unwrap().camera;
    assert_eq!((rectified.model_name(), rectified.matrix()), ("pinhole", gate.camera.matrix()));
    let several = read("").unwrap_err().to_string();
    assert!(several.contains("/gate/camera_info, /yard/camera_info"), "{several}");
    assert!(read("#/shed").unwrap_err().to_string().contains("no camera `/shed`"));
    let said = resight::formats::explain(sample("two_cameras_zstd.mcap")).unwrap();
    assert!(said.contains("MCAP recording, 2 cameras") && said.contains("rectified"), "{said}");
    let json = resight::formats::read_camera(sample("foxglove_json.mcap").display().to_string()).unwrap();
    assert_eq!(json.camera, gate.camera);
    let ros1 = resight::formats::read_camera(sample("ros1_zstd.mcap").display().to_string()).unwrap();
    assert_eq!(ros1.camera, gate.camera);
}

/// The same messages in chunks without compression and checksum, so that damage reaches what is inside.
fn unprotected(name: &str) -> Vec<u8> {
    let options =
        mcap::WriteOptions::new().compression(None).calculate_chunk_crcs(false).chunk_size(Some(8 << 10));
    let mut out = options.create(Cursor::new(Vec::new())).unwrap();
    for message in messages(&bytes(name)).0.iter().filter(|m| m.data.len() < 100_000).take(12) {
        let channel = &message.channel;
        let schema =
            out.add_schema(&channel.kind, &channel.definition_encoding, &channel.definition).unwrap();
        let id =
            out.add_channel(schema, &channel.topic, &channel.message_encoding, &BTreeMap::new()).unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: id,
            sequence: 0,
            log_time: message.log_time_ns,
            publish_time: 0,
        };
        out.write_to_known_channel(&header, &message.data).unwrap();
    }
    out.finish().unwrap();
    out.into_inner().into_inner()
}

/// A file cut off in a chunk whose size was damaged too: never more than it claims is read, whole messages only.
#[test]
fn a_torn_chunk_that_claims_too_little_gives_what_it_claims() {
    let whole = unprotected("ros1_zstd.mcap");
    let word = |at: usize| u64::from_le_bytes(whole[at..at + 8].try_into().unwrap()) as usize;
    let mut chunk = 8;
    while whole[chunk] != mcap::records::op::CHUNK {
        chunk += 9 + word(chunk + 1);
    }
    // Behind opcode and length: two times, a size, a checksum, and the empty name of no compression.
    let size = chunk + 9 + 8 + 8 + 8 + 4 + 4;
    let torn = size + 8 + word(size) - 1;
    let all = messages(&whole[..torn]).0.len();
    let mut least = all;
    for claimed in (0..word(size)).step_by(97) {
        let mut bytes = whole[..torn].to_vec();
        bytes[size..size + 8].copy_from_slice(&(claimed as u64).to_le_bytes());
        let (found, reported) = messages(&bytes);
        assert!(
            found.len() <= all && reported.iter().any(|t| t.contains("cut off")),
            "{claimed}: {reported:?}"
        );
        least = least.min(found.len());
    }
    assert!(0 < all && least == 0, "{least} of {all}");
}

fn look(message: &Message) {
    if let (Some(kind), Ok(decoder)) = (Kind::of(&message.channel.kind), decoder(&message.channel))
        && let Ok(value) = decoder.read(&message.data)
        && let Ok(MessageContent::Image(image)) = decode_content(kind, &value)
    {
        assert_eq!(image.data.len(), image.width_px as usize * image.height_px as usize);
    }
}

/// Most memory this process ever took, bytes; none where the system does not say.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().trim_end_matches(" kB").parse::<u64>().ok()?)
}

/// Bytes changed here and there, among them lengths that cannot be; or the file cut off.
fn damage() -> impl Strategy<Value = (usize, Vec<(f64, u8)>, f64)> {
    let cut = prop_oneof![3 => Just(1.0), 1 => 0.0..1.0];
    (0..4usize, prop::collection::vec((0.0..1.0, any::<u8>()), 0..12), cut)
}

const SAMPLES: [&str; 4] = ["ros1_zstd.mcap", "big_endian.mcap", "foxglove_json.mcap", "detections_lz4.mcap"];

fn damaged(mut bytes: Vec<u8>, edits: &[(f64, u8)], cut: f64) -> Vec<u8> {
    for (place, value) in edits {
        let at = (place * bytes.len() as f64) as usize;
        if let Some(byte) = bytes.get_mut(at) {
            *byte = *value; // A message cut off before its first byte has none to change.
        }
    }
    bytes.truncate((cut * bytes.len() as f64) as usize);
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// No panic, and no more memory than two of the largest records (257 MB each) beside what the test itself holds.
    #[test]
    fn damaged_files_are_never_fatal((which, edits, cut) in damage(), is_protected: bool) {
        let whole = if is_protected { bytes(SAMPLES[which]) } else { unprotected(SAMPLES[which]) };
        let bytes = damaged(whole, &edits, cut);
        let _ = topics(&mut Cursor::new(&bytes));
        let _ = resight::formats::read_cameras_from_bytes("damaged.mcap", bytes.clone());
        messages(&bytes).0.iter().for_each(look);
        prop_assert!(peak_bytes().is_none_or(|peak| peak < 800_000_000), "{:?}", peak_bytes());
    }

    #[test]
    fn damaged_messages_are_never_fatal((which, edits, cut) in damage(), first in 0..8usize) {
        let all = messages(&bytes(SAMPLES[which])).0;
        let mut message = all[first % all.len()].clone();
        message.data = damaged(message.data, &edits, cut);
        look(&message);
        // Lengths lie in the first bytes.
        let near: Vec<(f64, u8)> = edits.iter().map(|(place, value)| (place * 0.002, *value)).collect();
        message.data = damaged(message.data, &near, 1.0);
        look(&message);
        prop_assert!(peak_bytes().is_none_or(|peak| peak < 800_000_000), "{:?}", peak_bytes());
    }
}
