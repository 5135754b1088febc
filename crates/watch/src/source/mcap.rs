//! Images and detections of one topic of a recording (MCAP), in the order in which they were recorded.

use super::{Content, Frame, Next, Source};
use crate::ros::sight::{Decoder, Kind, MessageContent, decode_content};
use resight::FileError;
use resight::recording::{self, Message, Recording, Topic, topics};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A topic that is being read.
pub struct McapTopic {
    path: PathBuf,
    topic: String,
    recording: Recording<File>,
    kind: Kind,
    decoder: Decoder,
    number: u64,
    times: Times,
    last_s: f64,
    is_growing: bool,
    /// The reason why the file is cut off, reported after its last message.
    cut: Option<String>,
}

/// The clock of a topic's times. The first readable message decides for all: the recorder's clock may differ from that of the stamps, and a
/// mixture would contain jumps.
enum Times {
    Undecided,
    Recorded,
    /// Time by which the last stamp was ahead of the recorder.
    Stamped {
        ahead_s: f64,
    },
}

impl Times {
    /// Returns the capture time of a message, and a remark on it.
    fn of(&mut self, stamp_s: Option<f64>, logged_s: f64, is_read: bool) -> (f64, &'static str) {
        if is_read && matches!(self, Times::Undecided) {
            *self = stamp_s.map_or(Times::Recorded, |_| Times::Stamped { ahead_s: 0.0 });
        }
        match (self, stamp_s) {
            (Times::Stamped { ahead_s }, Some(stamp_s)) => {
                *ahead_s = stamp_s - logged_s;
                (stamp_s, "")
            }
            (Times::Stamped { ahead_s }, None) => {
                (logged_s + *ahead_s, " (no stamp: time of recording by the clock of the stamps)")
            }
            (_, Some(_)) => (logged_s, " (time of recording, as the topic began)"),
            (_, None) => (logged_s, " (no stamp: time of recording)"),
        }
    }
}

impl McapTopic {
    /// Reads `topic`, or the only topic of images if none is named (of detections where there are no images). A file that was not closed counts
    /// as one that is still being written: what is added is read too.
    ///
    /// # Errors
    /// A file that is no MCAP, a missing topic, or one that is not supported; the message lists the topics.
    pub fn open(path: impl AsRef<Path>, topic: Option<&str>) -> Result<Self, FileError> {
        let path = path.as_ref();
        let reported = |reason: String| FileError::new(path, reason);
        let open = || File::open(path).map_err(|e| reported(e.to_string()));
        let all = topics(&mut open()?).map_err(|e| reported(e.0))?;
        let (kind, found) = choose(&all, topic).map_err(reported)?;
        let channel = &found.channel;
        let decoder = Decoder::new(
            &channel.kind,
            &channel.message_encoding,
            &channel.definition_encoding,
            &channel.definition,
        );
        let decoder = decoder.map_err(|reason| reported(format!("topic {}: {reason}", channel.topic)))?;
        let wanted = (channel.topic.clone(), channel.kind.clone());
        let recording =
            Recording::new(open()?, move |channel| (&channel.topic, &channel.kind) == (&wanted.0, &wanted.1));
        let (path, topic) = (path.to_path_buf(), channel.topic.clone());
        Ok(McapTopic {
            path,
            topic,
            recording,
            kind,
            decoder,
            number: 0,
            times: Times::Undecided,
            last_s: 0.0,
            is_growing: true,
            cut: None,
        })
    }

    /// Ends at the present end of the file, also where the file was not closed.
    pub fn as_it_is(self) -> Self {
        McapTopic { is_growing: false, ..self }
    }

    fn frame(&mut self, message: &Message) -> Frame {
        let logged_s = message.log_time_ns as f64 / 1e9;
        let value = self.decoder.read(&message.data);
        let is_read = value.is_ok();
        let stamp_s = value.as_ref().ok().and_then(|value| value.stamp_s());
        let content = match value.and_then(|value| decode_content(self.kind, &value)) {
            Ok(MessageContent::Image(image)) => Content::Image(image),
            Ok(MessageContent::Detections(detections)) => Content::Detections(detections),
            Err(reason) => Content::Unreadable(format!("{} {}: {reason}", self.topic, self.number)),
        };
        let (capture_s, remark) = self.times.of(stamp_s, logged_s, is_read);
        let name = format!("{} {}{remark}", self.topic, self.number);
        self.last_s = capture_s;
        self.number += 1;
        Frame { number: self.number - 1, capture_s: self.last_s, name, content }
    }

    /// Returns a frame for a part that is no message, at the time of the last one.
    fn unreadable(&mut self, reason: &str) -> Frame {
        let content = Content::Unreadable(format!("{}: {reason}", self.path.display()));
        let name = format!("{} {}", self.topic, self.number);
        self.number += 1;
        Frame { number: self.number - 1, capture_s: self.last_s, name, content }
    }

    fn lost(&self, reason: impl Into<String>) -> Next {
        Next::Lost(FileError::new(&self.path, reason))
    }

    fn look(&mut self, patience: Duration) -> Result<Next, recording::RecordingError> {
        let until = Instant::now() + patience;
        while Instant::now() < until {
            match self.recording.read_next()? {
                recording::Next::Message(message) => return Ok(Next::Frame(self.frame(&message))),
                recording::Next::Nothing => {}
                recording::Next::Damaged(reason) => return Ok(Next::Frame(self.unreadable(&reason))),
                recording::Next::End => return Ok(self.cut.take().map_or(Next::End, |cut| self.lost(cut))),
                recording::Next::Unfinished if self.is_growing => {
                    std::thread::sleep(until.saturating_duration_since(Instant::now()));
                }
                recording::Next::Unfinished => self.cut = Some(self.recording.close()?),
            }
        }
        Ok(Next::Nothing)
    }
}

impl Source for McapTopic {
    fn next(&mut self, patience: Duration) -> Next {
        self.look(patience).unwrap_or_else(|reason| self.lost(reason.0))
    }

    /// Returns false: the messages wait in the file.
    fn is_live(&self) -> bool {
        false
    }
}

/// Returns the topic of that name, or the only one with images or detections.
fn choose<'a>(all: &'a [Topic], name: Option<&str>) -> Result<(Kind, &'a Topic), String> {
    let kinds = || {
        all.iter().filter_map(|t| Kind::of(&t.channel.kind).filter(|k| k.is_camera_message()).map(|k| (k, t)))
    };
    if let Some(name) = name {
        let named = |(_, topic): &(Kind, &Topic)| topic.channel.topic == name;
        return kinds().find(named).ok_or_else(|| match all.iter().find(|t| t.channel.topic == name) {
            Some(topic) => format!(
                "topic {name} holds {}, which shows no camera's sight; there are {}",
                topic.channel.kind,
                listed(all)
            ),
            None => format!("there is no topic {name}; there are {}", listed(all)),
        });
    }
    let images: Vec<_> = kinds().filter(|(kind, _)| kind.is_image()).collect();
    let others: Vec<_> = kinds().filter(|(kind, _)| !kind.is_image()).collect();
    match (images.as_slice(), others.as_slice()) {
        ([one], _) | ([], [one]) => Ok(*one),
        ([], []) => Err(format!(
            "no topic of images or tag detections (sensor_msgs Image and CompressedImage, apriltag_msgs, \
             isaac_ros_apriltag_interfaces, Foxglove's images as JSON); there are {}",
            listed(all)
        )),
        _ => {
            let first = &images.first().or(others.first()).map_or("", |(_, t)| t.channel.topic.as_str());
            Err(format!(
                "several topics could be meant; name one, e.g. FILE#{first}: there are {}",
                listed(all)
            ))
        }
    }
}

fn listed(all: &[Topic]) -> String {
    let word = |t: &Topic| {
        let kind = if t.channel.kind.is_empty() { "no type" } else { &t.channel.kind };
        format!("{} ({kind}, {} messages)", t.channel.topic, t.messages)
    };
    let words: Vec<String> = all.iter().map(word).collect();
    if words.is_empty() { "none".to_string() } else { words.join(", ") }
}
