//! The file itself: read once, written by a thread that never makes a camera wait.

use super::record::CameraRecord;
use super::rig_record::RigRecord;
use resight::FileError;
use resight::formats::write_atomically;
use resight::rig::digest::sha256;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

const FORMAT: &str = "resight watch state";
const VERSION: u32 = 1;
/// Interval at which a camera hands over its state, and largest delay until it is written: together less than a second.
pub(in crate::live) const EVERY: Duration = Duration::from_millis(450);

#[derive(Debug, Serialize, Deserialize)]
struct Head {
    format: String,
    version: u32,
    sha256: String,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Body {
    cameras: Vec<CameraRecord>,
    /// The state of cameras whose relative poses are monitored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rig: Option<RigRecord>,
}

type Say = Box<dyn Fn(&str) + Send + Sync>;

/// A file that holds the state of a session. One session at a time may use it.
pub struct StateFile {
    path: PathBuf,
    say: Say,
    inner: Mutex<Inner>,
    changed: Condvar,
    /// Held for the lifetime of this value.
    _claim: File,
}

#[derive(Default)]
struct Inner {
    /// The state as read at the start, then as handed over last.
    body: Body,
    /// Cameras and targets that could not be handed over; each is reported once.
    left_out: BTreeSet<(String, String)>,
    is_new: bool,
    is_closed: bool,
}

impl StateFile {
    /// Reads the file if there is one; `say` receives the reasons why something could not be used, now and later.
    ///
    /// # Errors
    /// A folder that does not exist, a file of another kind, a file that another session uses, or one that cannot be read or renamed.
    pub fn open(
        path: impl AsRef<Path>,
        say: impl Fn(&str) + Send + Sync + 'static,
    ) -> Result<Self, FileError> {
        let path = path.as_ref();
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return Err(FileError::new(
                path,
                format!("there is no folder {}; make it first", folder.display()),
            ));
        }
        read(path)?; // read(path)?; // A file of another kind is not changed, even by the lock.
        let claim = claim(path)?;
        let parsed = read(path)?.map(|bytes| parse(&bytes)).transpose();
        let body = match parsed {
            Ok(body) => body.unwrap_or_default(),
            Err(reason) => {
                let aside = put_aside(path)?;
                say(&format!(
                    "{}: {reason}; it is now {} and the session begins anew",
                    path.display(),
                    aside.display()
                ));
                Body::default()
            }
        };
        let inner = Mutex::new(Inner { body, ..Inner::default() });
        Ok(StateFile {
            path: path.to_path_buf(),
            say: Box::new(say),
            inner,
            changed: Condvar::new(),
            _claim: claim,
        })
    }

    /// A thread that panicked while it held the lock left valid records.
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(in crate::live) fn say(&self, text: &str) {
        (self.say)(text);
    }

    /// Returns the record of a camera.
    pub(in crate::live) fn of(&self, camera: &str) -> Option<CameraRecord> {
        self.lock().body.cameras.iter().find(|record| record.name == camera).cloned()
    }

    /// Hands over the state of a camera.
    pub(in crate::live) fn put(&self, record: CameraRecord) {
        let (record, left_out) = record.without_holes();
        let mut inner = self.lock();
        for target in left_out {
            let words = format!("{} with {target} is left out: its numbers are not finite", record.name);
            if inner.left_out.insert((record.name.clone(), target)) {
                self.say(&words);
            }
        }
        match inner.body.cameras.iter_mut().find(|known| known.name == record.name) {
            Some(known) => *known = record,
            None => inner.body.cameras.push(record),
        }
        inner.is_new = true;
        drop(inner);
        self.changed.notify_all();
    }

    /// Returns the record of cameras whose relative poses are monitored.
    pub(in crate::live) fn rig(&self) -> Option<RigRecord> {
        self.lock().body.rig.clone()
    }

    /// Hands over the state of those cameras.
    pub(in crate::live) fn put_rig(&self, record: RigRecord) {
        let mut inner = self.lock();
        if !record.is_finite() {
            if inner.left_out.insert(("rig".to_string(), String::new())) {
                self.say("the rig is left out: its numbers are not finite");
            }
            return;
        }
        inner.body.rig = Some(record);
        inner.is_new = true;
        drop(inner);
        self.changed.notify_all();
    }

    /// Ends the handing over.
    pub(in crate::live) fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_all();
    }

    /// Writes what is handed over until `close`. A failing disk is reported once, and so is its recovery.
    pub(in crate::live) fn keep(&self) {
        let mut is_failing = false;
        loop {
            let (body, is_closed) = self.next();
            if let Some(body) = body {
                let written = write(&self.path, &body);
                match (&written, is_failing) {
                    (Err(reason), false) => self.say(&format!(
                        "degraded: {reason}; a restart would go on from the last state written"
                    )),
                    (Ok(()), true) => self.say("the state is written again"),
                    _ => {}
                }
                is_failing = written.is_err();
            }
            if is_closed {
                return;
            }
            self.rest();
        }
    }

    /// Waits for a new state or the end.
    fn next(&self) -> (Option<Body>, bool) {
        let nothing = |inner: &mut Inner| !inner.is_new && !inner.is_closed;
        let mut inner = self.changed.wait_while(self.lock(), nothing).unwrap_or_else(PoisonError::into_inner);
        let is_new = std::mem::take(&mut inner.is_new);
        (is_new.then(|| inner.body.clone()), inner.is_closed)
    }

    fn rest(&self) {
        let until = Instant::now() + EVERY;
        let mut inner = self.lock();
        while !inner.is_closed && Instant::now() < until {
            let left = until.saturating_duration_since(Instant::now());
            inner = self.changed.wait_timeout(inner, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

/// Locks a file beside the state, because the state itself is replaced whenever it is written. The file remains; the lock ends with the process.
fn claim(path: &Path) -> Result<File, FileError> {
    let mut name = path.as_os_str().to_os_string();
    name.push(".lock");
    let reported = |reason: String| FileError::new(path, reason);
    // A file of this name of another kind is not changed.
    let file = OpenOptions::new().create(true).write(true).truncate(false).open(PathBuf::from(name));
    let file = file.map_err(|e| reported(format!("cannot be locked: {e}")))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            Err(reported("is used by another session; give each a state file of its own".to_string()))
        }
        // On file systems without locks the user must ensure that one session runs at a time.
        Err(TryLockError::Error(e)) if e.kind() == ErrorKind::Unsupported => Ok(file),
        Err(TryLockError::Error(e)) => Err(reported(format!("cannot be locked: {e}"))),
    }
}

/// Returns the bytes, where there is a file.
fn read(path: &Path) -> Result<Option<Vec<u8>>, FileError> {
    match std::fs::metadata(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(FileError::new(path, format!("cannot be read: {e}"))),
        Ok(_) => {}
    }
    match resight::input::read(path, resight::input::Kind::State) {
        Err(fault) => Err(FileError::new(path, format!("cannot be read: {}", fault.reason))),
        Ok(bytes) if is_ours(&bytes) => Ok(Some(bytes)),
        Ok(_) => Err(FileError::new(
            path,
            "is no state of a session, and is left as it is; give the state a file of its own".to_string(),
        )),
    }
}

/// Returns whether a file begins as a state does, as far as it is long; an empty one, or zeros after a power failure, may be replaced.
fn is_ours(bytes: &[u8]) -> bool {
    let head = format!("{{\"format\":\"{FORMAT}\"");
    let n = head.len().min(bytes.len());
    bytes.iter().all(|byte| *byte == 0 || byte.is_ascii_whitespace()) || bytes[..n] == head.as_bytes()[..n]
}

fn parse(bytes: &[u8]) -> Result<Body, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "is damaged: no text".to_string())?;
    let (head, body) = text.split_once('\n').ok_or("is damaged: its second line is missing")?;
    let body = body.trim_end_matches('\n');
    let head: Head = serde_json::from_str(head).map_err(|e| format!("is no state of a session: {e}"))?;
    if head.format != FORMAT {
        return Err(format!("is no state of a session but {:?}", head.format));
    }
    if head.version != VERSION {
        return Err(format!("was written in version {}, this program knows {VERSION}", head.version));
    }
    if head.sha256 != sha256(body.as_bytes()) {
        return Err("is damaged: its SHA-256 is not the one it states".to_string());
    }
    serde_json::from_str(body).map_err(|e| format!("is damaged: {e}"))
}

fn write(path: &Path, body: &Body) -> Result<(), FileError> {
    let reported = |e: serde_json::Error| FileError::new(path, e.to_string());
    let body = serde_json::to_string(body).map_err(reported)?;
    let head = Head { format: FORMAT.to_string(), version: VERSION, sha256: sha256(body.as_bytes()) };
    let head = serde_json::to_string(&head).map_err(reported)?;
    write_atomically(path, format!("{head}\n{body}\n").as_bytes())
}

fn put_aside(path: &Path) -> Result<PathBuf, FileError> {
    let mut name = path.as_os_str().to_os_string();
    name.push(format!(".corrupt-{}", unix_s() as u64));
    let aside = PathBuf::from(name);
    let reported = |e| FileError::new(path, format!("cannot be used and cannot be put aside: {e}"));
    std::fs::rename(path, &aside).map_err(reported)?;
    Ok(aside)
}

/// Returns the seconds since 1970.
pub(in crate::live) fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}
