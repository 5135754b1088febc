//! The files that a session writes once: learned references and images of landmarks. A failing disk does not end the session, which may be the
//! only one of the night: what could not be written is kept, and tried again at intervals and at the end.

use super::log::Log;
use super::names::Names;
use crate::live::{Event, State, reference};
use resight::FileError;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval between tries to write failed files.
const AGAIN: Duration = Duration::from_secs(10);

/// The files for what is learned, by the indices of pairs and of cameras.
pub struct Saved {
    names: Names,
    references: Vec<Option<String>>,
    pictures: Vec<Option<String>>,
    /// Pairs that were compared with a reference: what they learn now replaces it, and its file is kept.
    compared: Vec<bool>,
    waiting: Vec<(Unwritten, FileError)>,
    tried: Instant,
    log: Log,
}

/// A file that is not written yet.
struct Unwritten {
    /// The name of this part in the log.
    part: &'static str,
    file: String,
    bytes: Vec<u8>,
    /// The message after it is written.
    words: String,
}

impl Saved {
    /// Builds the files for these names.
    pub fn new(
        names: &Names,
        references: Vec<Option<String>>,
        pictures: Vec<Option<String>>,
        log: &Log,
    ) -> Self {
        let (names, log) = (names.clone(), log.clone());
        let compared = vec![false; names.pairs().len()];
        Saved { names, references, pictures, compared, waiting: Vec::new(), tried: Instant::now(), log }
    }

    /// Processes the next event; tries failed files again when due.
    pub fn take(&mut self, event: &Event) {
        match event {
            Event::Learned { camera, target, reference, .. } => {
                let pair = self.names.pair_index(*camera, *target);
                let file = self.references.get(pair).cloned().flatten();
                if let Some(file) = file.as_ref().filter(|_| self.compared.get(pair) == Some(&true)) {
                    self.keep(file);
                }
                let words = format!("{} is saved", self.names.pair(*camera, *target));
                self.save("reference", file, words, || reference::to_text(reference).map(String::into_bytes));
            }
            Event::StateChanged { camera, target, state, .. } => {
                let pair = self.names.pair_index(*camera, *target);
                let is_compared = matches!(state, State::Steady | State::Checking(_) | State::Drifted(_));
                if let Some(compared) = self.compared.get_mut(pair) {
                    *compared |= is_compared;
                }
            }
            Event::Observed { camera, target: 0, observation } => {
                if let Some(picture) = &observation.reference_image {
                    let file = self.pictures.get(*camera).cloned().flatten();
                    let (name, of) = (self.names.camera(*camera), &observation.name);
                    let words = format!("the reference image of {name} is {of}, saved");
                    self.save("landmarks", file, words, || picture.png());
                }
            }
            _ => {}
        }
        if !self.waiting.is_empty() && AGAIN <= self.tried.elapsed() {
            self.again();
        }
    }

    fn save(
        &mut self,
        part: &'static str,
        file: Option<String>,
        words: String,
        bytes: impl FnOnce() -> Result<Vec<u8>, String>,
    ) {
        let Some(file) = file else { return };
        let bytes = match bytes() {
            Ok(bytes) => bytes,
            Err(reason) => return self.log.say(part, &format!("{file} cannot be written: {reason}")),
        };
        // A later reference replaces one that still waits.
        self.waiting.retain(|(known, _)| known.file != file);
        let unwritten = Unwritten { part, file, bytes, words };
        if let Err(reason) = self.write(&unwritten) {
            let again_s = AGAIN.as_secs();
            let words = format!("{reason}; it is kept, and tried again every {again_s} s and at the end");
            self.log.say(part, &words);
            self.tried = Instant::now();
            self.waiting.push((unwritten, reason));
        }
    }

    /// Copies a file to one of a free name beside it, if there is one already.
    fn keep(&self, file: &str) {
        let Ok(bytes) = std::fs::read(file) else { return };
        let free = (1..10_000).map(|i| PathBuf::from(format!("{file}.old{i}"))).find(|to| !to.exists());
        let kept = free.map(|to| (resight::formats::write_atomically(Path::new(&to), &bytes), to));
        match kept {
            Some((Ok(()), to)) => {
                self.log.say("reference", &format!("the one before is kept in {}", to.display()))
            }
            Some((Err(reason), _)) => {
                self.log.say("reference", &format!("the one before cannot be kept: {reason}"))
            }
            None => self
                .log
                .say("reference", &format!("the one before cannot be kept: {file}.old1 to .old9999 exist")),
        }
    }

    fn write(&self, unwritten: &Unwritten) -> Result<(), FileError> {
        resight::formats::write_atomically(&unwritten.file, &unwritten.bytes)?;
        self.log.say(unwritten.part, &format!("{} in {}", unwritten.words, unwritten.file));
        Ok(())
    }

    fn again(&mut self) {
        let waiting = std::mem::take(&mut self.waiting).into_iter();
        self.waiting =
            waiting.filter_map(|(file, _)| self.write(&file).err().map(|reason| (file, reason))).collect();
        self.tried = Instant::now();
    }

    /// Tries failed files once more at the end of the session.
    ///
    /// # Errors
    /// A file that could not be written even then.
    pub fn finish(&mut self) -> Result<(), FileError> {
        self.again();
        self.waiting.pop().map_or(Ok(()), |(_, reason)| Err(reason))
    }
}
