//! The thread that writes the recording.

use super::super::super::log::Log;
use crate::ros::write::{RosWriter, Status, Transform};
use anyhow::{Context, Result, bail};
use resight::core::{Matrix6, Pose};
use resight::recording::RecordingError;
use std::fs::{File, OpenOptions};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Largest number of messages that wait for the disk; further ones are left out and counted.
const WAITING: usize = 4096;
/// Largest age of written messages that are not yet passed to the disk.
const FLUSH: Duration = Duration::from_secs(1);
/// Interval of tries to create a new file after a failure.
const RETRY: Duration = Duration::from_secs(1);
/// Shortest interval of reports about a slow disk.
const SAYING: Duration = Duration::from_secs(60);
/// Largest number of chunks in one file, a day of them: its index takes memory until it is closed, which stays below about 20 MB.
const CHUNKS: u64 = 86_400;
/// Largest number of names tried beside an existing file.
const NAMES: usize = 10_000;

/// A message to be written.
pub enum Item {
    /// Transforms for `/tf`.
    Transforms(u64, Vec<Transform>),
    /// Transforms for `/tf_static`; without a time they get that of the next message.
    Static(Option<u64>, Vec<Transform>),
    /// A camera's pose.
    Pose {
        topic: String,
        time_ns: u64,
        target_frame: String,
        cam_from_target: Pose,
        covariance: Box<Matrix6>,
    },
    /// Statuses for `/diagnostics`; without a time they get that of the next message.
    Diagnostics(Option<u64>, Vec<Status>),
}

impl Item {
    /// Returns the item's own time.
    fn time_ns(&self) -> Option<u64> {
        match self {
            Item::Transforms(time_ns, _) | Item::Pose { time_ns, .. } => Some(*time_ns),
            Item::Static(time_ns, _) | Item::Diagnostics(time_ns, _) => *time_ns,
        }
    }
}

/// Writes items in order.
pub struct Recorder {
    items: Option<SyncSender<Item>>,
    thread: Option<JoinHandle<()>>,
    log: Log,
    left_out: u64,
    /// Time of the last report.
    said: Option<Instant>,
}

impl Recorder {
    /// Creates the file.
    pub fn open(path: impl AsRef<Path>, log: &Log) -> Result<Self> {
        let path = path.as_ref();
        if path.is_dir() {
            bail!("--tf {}: this is a folder; give a file in it", path.display());
        }
        let file = create(path).with_context(|| format!("--tf {}: cannot be made", path.display()))?;
        if file.1 != path {
            log.say(
                "tf",
                &format!("{} is there already and is kept; writing {}", path.display(), file.1.display()),
            );
        }
        let (items, waiting) = sync_channel(WAITING);
        let mut disk = Disk::new(path, log);
        disk.begin(file)?;
        let thread = std::thread::spawn(move || disk.run(&waiting));
        Ok(Recorder { items: Some(items), thread: Some(thread), log: log.clone(), left_out: 0, said: None })
    }

    /// Hands an item over, without waiting.
    pub fn push(&mut self, item: Item) {
        let Some(items) = &self.items else { return };
        match items.try_send(item) {
            Ok(()) if self.left_out == 0 || self.said.is_some_and(|said| said.elapsed() < SAYING) => {}
            Ok(()) => self.say_left_out(),
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => self.left_out += 1,
        }
    }

    fn say_left_out(&mut self) {
        let n = std::mem::take(&mut self.left_out);
        self.said = Some(Instant::now());
        self.log.say("tf", &format!("{n} messages were left out: the disk is too slow"));
    }

    /// Closes the file.
    pub fn finish(&mut self) {
        self.items = None; // self.items = None; // The thread ends with the last item.
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            self.log.say("tf", "the thread that writes the recording has failed; the file is not closed");
        }
        if 0 < self.left_out {
            self.say_left_out();
        }
    }
}

/// The file. When it cannot be written the session continues, and a new file is created when that is possible again.
struct Disk {
    path: PathBuf,
    log: Log,
    writer: Option<RosWriter<BufWriter<File>>>,
    flushed: Instant,
    failed: Instant,
    /// Static transforms without a time, until there is one.
    untimed: Vec<Transform>,
    /// Diagnostics without a time, until there is one: the latest of each name.
    untimed_statuses: Vec<Status>,
    /// The latest static transform of each child, for a new file.
    latched: Vec<Transform>,
}

impl Disk {
    fn new(path: &Path, log: &Log) -> Self {
        let now = Instant::now();
        let (path, log) = (path.to_path_buf(), log.clone());
        Disk {
            path,
            log,
            writer: None,
            flushed: now,
            failed: now,
            untimed: Vec::new(),
            untimed_statuses: Vec::new(),
            latched: Vec::new(),
        }
    }

    fn begin(&mut self, (file, _): (File, PathBuf)) -> Result<(), RecordingError> {
        self.writer = Some(RosWriter::new(BufWriter::new(file))?);
        self.untimed = self.latched.clone();
        Ok(())
    }

    fn run(&mut self, items: &Receiver<Item>) {
        loop {
            match items.recv_timeout(FLUSH.saturating_sub(self.flushed.elapsed())) {
                Ok(item) => self.take(&item),
                Err(RecvTimeoutError::Timeout) => self.flush(),
                Err(RecvTimeoutError::Disconnected) => return self.finish(),
            }
            if FLUSH <= self.flushed.elapsed() {
                self.flush();
            }
        }
    }

    fn take(&mut self, item: &Item) {
        self.keep(item);
        let Some(time_ns) = item.time_ns() else { return };
        if self.writer.is_none() && !self.begin_anew(time_ns) {
            return;
        }
        let written = self.write(time_ns, item);
        self.check(written);
    }

    /// Keeps a static transform, which is written again in a new file, and an item without a time, which waits for one.
    fn keep(&mut self, item: &Item) {
        match item {
            Item::Static(time_ns, transforms) => {
                for transform in transforms {
                    self.latched.retain(|known| known.child != transform.child);
                    self.latched.push(transform.clone());
                }
                if time_ns.is_none() && self.writer.is_some() {
                    self.untimed.extend(transforms.iter().cloned());
                }
            }
            Item::Diagnostics(None, statuses) => {
                for status in statuses {
                    self.untimed_statuses.retain(|known| known.name != status.name);
                    self.untimed_statuses.push(status.clone());
                }
            }
            _ => {}
        }
    }

    /// Starts a new file. A full disk may accept a name and no content: only a file with content counts, and is reported.
    fn begin_anew(&mut self, time_ns: u64) -> bool {
        if self.failed.elapsed() < RETRY {
            return false;
        }
        self.failed = Instant::now();
        let Ok(file) = create(&self.path) else { return false };
        let name = file.1.clone();
        let begun = self.begin(file).and_then(|()| self.begun(time_ns));
        match begun {
            Ok(()) => self.log.say("tf", &format!("continues in {}", name.display())),
            Err(_) => {
                self.writer = None;
                // An empty file that cannot be removed remains; the next try uses the next name.
                let _ = std::fs::remove_file(&name);
            }
        }
        begun.is_ok()
    }

    fn begun(&mut self, time_ns: u64) -> Result<(), RecordingError> {
        self.write_untimed(time_ns)?;
        self.writer.as_mut().map_or(Ok(()), RosWriter::flush)
    }

    fn write(&mut self, time_ns: u64, item: &Item) -> Result<(), RecordingError> {
        self.write_untimed(time_ns)?;
        let Some(writer) = &mut self.writer else { return Ok(()) };
        match item {
            Item::Transforms(_, transforms) => writer.transforms(time_ns, transforms),
            Item::Static(_, transforms) => writer.static_transforms(time_ns, transforms),
            Item::Pose { topic, target_frame, cam_from_target, covariance, .. } => {
                writer.camera_pose(topic, time_ns, target_frame, cam_from_target, covariance)
            }
            Item::Diagnostics(_, statuses) => writer.diagnostics(time_ns, statuses),
        }
    }

    /// Writes the items without a time, which are older than this time.
    fn write_untimed(&mut self, time_ns: u64) -> Result<(), RecordingError> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        if !self.untimed.is_empty() {
            writer.static_transforms(time_ns, &self.untimed)?;
            self.untimed.clear();
        }
        if !self.untimed_statuses.is_empty() {
            writer.diagnostics(time_ns, &self.untimed_statuses)?;
            self.untimed_statuses.clear();
        }
        Ok(())
    }

    fn flush(&mut self) {
        self.flushed = Instant::now();
        let flushed = self.writer.as_mut().map_or(Ok(()), RosWriter::flush);
        self.check(flushed);
        if self.writer.as_ref().is_some_and(|writer| CHUNKS <= writer.chunks()) {
            self.finish(); // The next item begins a new file.
        }
    }

    fn finish(&mut self) {
        let path = self.path.display();
        if let Some(Err(reason)) = self.writer.take().map(RosWriter::finish) {
            self.log.say(
                "tf",
                &format!("{path} could not be closed ({reason}); it can be read up to its last chunk"),
            );
        }
    }

    fn check(&mut self, done: Result<(), RecordingError>) {
        if let Err(reason) = done {
            self.log.say(
                "tf",
                &format!(
                    "{} cannot be written: {reason}. The session continues, and in a new file when there is room",
                    self.path.display()
                ),
            );
            self.writer = None;
            self.failed = Instant::now();
        }
    }
}

/// Creates a file of that name, or of the next free one beside it.
fn create(path: &Path) -> std::io::Result<(File, PathBuf)> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    let beside = (2..NAMES).map(|n| path.with_file_name(format!("{stem}-{n}{ending}")));
    for name in std::iter::once(path.to_path_buf()).chain(beside) {
        match OpenOptions::new().write(true).create_new(true).open(&name) {
            Err(reason) if reason.kind() == std::io::ErrorKind::AlreadyExists => {}
            opened => return opened.map(|file| (file, name)),
        }
    }
    Err(std::io::Error::other("10000 files of this name lie beside it; remove some"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::write::Level;
    use resight::recording::{Next, Recording};

    /// Returns topics and times, ns, of a recording.
    fn reported(path: &Path) -> Vec<(String, u64)> {
        let mut recording = Recording::new(File::open(path).expect("the file"), |_| true);
        let mut all = Vec::new();
        loop {
            match recording.read_next().expect("a recording") {
                Next::Message(message) => all.push((message.channel.topic.clone(), message.log_time_ns)),
                Next::Nothing | Next::Unfinished => {}
                Next::Damaged(reason) => panic!("{reason}"),
                Next::End => return all,
            }
        }
    }

    /// For a source that is lost before its first frame, and a reference that is known before it, there is no message of 1970.
    #[test]
    fn what_has_no_time_waits_for_one() {
        let path = std::env::temp_dir().join(format!("resight-untimed-{}.mcap", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let status = |message: &str| Status {
            level: Level::Stale,
            name: "resight: gate".to_string(),
            message: message.to_string(),
            hardware_id: "gate".to_string(),
            values: Vec::new(),
        };
        let fixed = Transform {
            parent: "door".to_string(),
            child: "gate/reference".to_string(),
            parent_from_child: Pose::identity(),
        };
        let seen = Transform { child: "gate".to_string(), ..fixed.clone() };
        let time_ns = 1_700_000_000_000_000_000;
        let mut recorder = Recorder::open(&path, &Log::default()).expect("a file");
        recorder.push(Item::Diagnostics(None, vec![status("lost")]));
        recorder.push(Item::Static(None, vec![fixed]));
        recorder.push(Item::Diagnostics(None, vec![status("lost again")]));
        recorder.push(Item::Transforms(time_ns, vec![seen]));
        recorder.finish();
        let all = reported(&path);
        std::fs::remove_file(&path).expect("removed");
        let topics: Vec<&str> = all.iter().map(|(topic, _)| topic.as_str()).collect();
        assert_eq!(topics, ["/tf_static", "/diagnostics", "/tf"]);
        assert!(all.iter().all(|(_, at_ns)| *at_ns == time_ns), "{all:?}");
    }

    /// After a day the file is closed, so that its index need not be kept, and the next item starts another.
    #[test]
    fn a_long_session_begins_a_new_file() {
        let folder = std::env::temp_dir().join(format!("resight-long-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("poses.mcap");
        let mut disk = Disk::new(&path, &Log::default());
        disk.begin(create(&path).expect("a file")).expect("begun");
        let item = |i| Item::Diagnostics(Some(i), Vec::new());
        for i in 0..CHUNKS {
            assert!(disk.writer.is_some(), "{i}");
            disk.take(&item(i));
            disk.flush();
        }
        assert!(disk.writer.is_none());
        let bytes = std::fs::read(&path).expect("the first file");
        assert!(bytes.ends_with(b"\x89MCAP0\r\n"), "it is closed");
        disk.failed = Instant::now().checked_sub(RETRY).unwrap_or(disk.failed);
        disk.take(&item(CHUNKS));
        assert!(disk.writer.is_some() && folder.join("poses-2.mcap").exists());
        drop(disk);
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
