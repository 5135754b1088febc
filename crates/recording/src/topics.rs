//! Lists the topics of a recording, from its summary, or by counting where there is none.

use super::records::{Channel, Contents};
use super::summary::summary;
use super::{Next, Recording, RecordingError};
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::sync::Arc;

/// A topic with the number of its messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Name, type, encodings.
    pub channel: Arc<Channel>,
    /// Messages.
    pub messages: u64,
}

/// Returns all topics by name. A recording without a summary (truncated, or still being written) is read once completely.
///
/// # Errors
/// An error of the medium, and files that are not MCAP files. For a file that is damaged later on, the topics before the damage are returned.
pub fn topics<R: Read + Seek>(from: &mut R) -> Result<Vec<Topic>, RecordingError> {
    let mut contents = Contents::new(Box::new(|_| false));
    if summary(from, &mut contents) && !contents.counts.is_empty() && contents.channels().next().is_some() {
        return Ok(listed(&contents));
    }
    from.seek(SeekFrom::Start(0)).map_err(|e| RecordingError(format!("cannot be read: {e}")))?;
    let mut recording = Recording::new(from, |_| false);
    loop {
        match recording.read_next() {
            Ok(Next::Message(_) | Next::Nothing | Next::Damaged(_)) => {}
            Ok(Next::Unfinished) => {
                recording.close()?;
                break;
            }
            Ok(Next::End) => break,
            Err(_) if recording.contents().channels().next().is_some() => break,
            Err(reason) => return Err(reason),
        }
    }
    Ok(listed(recording.contents()))
}

fn listed(contents: &Contents) -> Vec<Topic> {
    let mut by_name: BTreeMap<&str, Topic> = BTreeMap::new();
    for (id, channel) in contents.channels() {
        let messages = contents.counts.get(&id).copied().unwrap_or_default();
        let topic = Topic { channel: Arc::clone(channel), messages: 0 };
        by_name.entry(&channel.topic).or_insert(topic).messages += messages;
    }
    by_name.into_values().collect()
}
