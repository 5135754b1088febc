//! Watched cameras, for the page: the image and state of each, the events, and the actions of an operator.
//!
//! The session runs on a thread of its own, as with `resight watch`; nothing here makes it wait. A picture is kept only while a page shows it;
//! it is reduced on the reader's thread and encoded on another. A slow page gets fewer pictures.

pub mod answers;
pub mod asked;
mod example;
pub mod feed;
pub mod mjpeg;
pub mod pictures;
pub mod routes;
pub mod small;

use answers::{LiveMessage, LiveView, ReferenceView};
use axum::extract::ws::Utf8Bytes;
use pictures::{Pictures, Tap};
use resight::core::{Camera, Pose, Target};
use resight::locate::camera_file;
use resight::scene::around::{AroundScene, CameraAround, cameras_around};
use resight_watch::board::strip::{Stretch, StripBin};
use resight_watch::board::{Board, Instants};
use resight_watch::live::{LiveCamera, Relearn, references};
use resight_watch::outputs::said::EventText;
use resight_watch::{Event, Log, Request};
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::sync::broadcast;

/// Number of events by which a page may be behind; beyond it some are missed, and its next status is complete again.
const EVENTS: usize = 256;
/// Frames that statistics are of.
const WINDOW: usize = 300;
/// A view this young is not made again: all pages share it.
const YOUNG: Duration = Duration::from_millis(200);

/// The state shared by the routes and the session.
pub struct Live {
    board: Mutex<Board>,
    names: Vec<String>,
    /// Why the session has ended with an error.
    failed: Mutex<Option<String>>,
    shared: Mutex<Option<(Instant, Utf8Bytes)>>,
    pub(crate) pictures: Arc<Pictures>,
    pub(crate) events: broadcast::Sender<Utf8Bytes>,
    /// The history that the session writes.
    pub(crate) history: Option<PathBuf>,
    /// Why references cannot be learned again.
    fixed: Option<&'static str>,
    relearn: Relearn,
    lenses: Vec<Camera>,
    /// The lenses as camera files.
    pub(crate) lens_files: Vec<Option<String>>,
    targets: Vec<Arc<Target>>,
    began: Instant,
}

impl Live {
    /// Creates the state for a session that is about to start.
    pub fn new(request: &Request) -> Self {
        // The session itself reports what is wrong with a camera.
        let known = |camera| references(camera, &request.config, None).unwrap_or_default();
        let references: Vec<_> = request.cameras.iter().flat_map(known).collect();
        let targets = request.cameras.first().map(|camera| camera.targets.iter());
        Live {
            names: request.cameras.iter().map(|camera| camera.name.clone()).collect(),
            board: Mutex::new(Board::new(&request.names, &references, WINDOW)),
            failed: Mutex::default(),
            shared: Mutex::default(),
            pictures: Arc::new(Pictures::new(request)),
            events: broadcast::channel(EVENTS).0,
            history: request.outputs.history.as_ref().map(|history| history.file.clone()),
            fixed: request.config.without_references(),
            relearn: request.config.relearn.clone(),
            lenses: request.cameras.iter().map(|camera| camera.camera.clone()).collect(),
            lens_files: request.cameras.iter().map(lens_file).collect(),
            targets: targets.into_iter().flatten().map(|watched| Arc::clone(&watched.target)).collect(),
            began: Instant::now(),
        }
    }

    /// Puts the taps on the sources of a request, so that pages see what the session sees.
    pub fn tap(&self, request: &mut Request) {
        for (camera, one) in request.cameras.iter_mut().enumerate() {
            let source = std::mem::replace(&mut one.source, Box::new(pictures::Ended));
            one.source = Box::new(Tap::new(source, camera, Arc::clone(&self.pictures)));
        }
    }

    /// The next event of the session.
    pub fn take(&self, text: &EventText, event: &Event) {
        let now = self.now();
        self.board().take(event, now);
        if let Event::Observed { camera, target, observation } = event {
            self.pictures.observed(*camera, *target, observation);
        } else if 0 < self.events.receiver_count() {
            let mut object = text.object(event);
            object["text"] = json!(text.words(event));
            object["unix_s"] = json!(now.unix_s);
            let _ = self.events.send(object.to_string().into()); // There may be no page.
        }
    }

    /// No more events will come, and why where something failed.
    pub fn ended(&self, failed: Option<String>) {
        self.board().is_over = true;
        *self.failed.lock().unwrap_or_else(PoisonError::into_inner) = failed;
    }

    /// Returns whether the session ended because of an error.
    pub fn has_failed(&self) -> bool {
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Returns the state of everything.
    pub fn view(&self) -> LiveView {
        let failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner).clone();
        LiveView::of(&self.board(), self.now(), failed, self.fixed, self.history.is_some())
    }

    /// Returns the state as text, computed at most five times a second.
    fn view_text(&self) -> Utf8Bytes {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        match &*shared {
            Some((at, text)) if at.elapsed() < YOUNG => text.clone(),
            _ => {
                let text: Utf8Bytes = json!(LiveMessage { live: self.view() }).to_string().into();
                *shared = Some((Instant::now(), text.clone()));
                text
            }
        }
    }

    /// Names of the cameras.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the index of the camera with this name.
    fn number(&self, camera: &str) -> Option<usize> {
        self.names.iter().position(|name| name == camera)
    }

    /// References of a camera: what it is compared with, what it was compared with before, and where it is.
    fn references(&self, camera: usize) -> Vec<ReferenceView> {
        ReferenceView::all(&self.board(), camera)
    }

    /// The cameras around each target, where they are and where they were.
    fn scenes(&self) -> Vec<AroundScene> {
        let (board, now) = (self.board(), self.now());
        let of_target = |(t, target): (usize, &Arc<Target>)| {
            let mut cameras = Vec::new();
            for (c, lens) in self.lenses.iter().enumerate() {
                let Some(pair) = board.pairs.get(board.names.pair_index(c, t)) else { continue };
                let around = |pose: Pose, covariance, is_reference| CameraAround {
                    name: board.names.camera(c).to_owned(),
                    camera: lens,
                    cam_from_target: pose,
                    covariance,
                    is_reference,
                };
                let is_fresh = board.is_fresh(c, now);
                let seen = pair.last.as_ref().and_then(|last| last.estimate.as_ref()).filter(|_| is_fresh);
                cameras.extend(
                    pair.reference.map(|learnt| {
                        around(learnt.reference.a_from_b, learnt.reference.noise.reference, true)
                    }),
                );
                cameras.extend(seen.map(|e| around(e.cam_from_target, e.covariance, false)));
            }
            (!cameras.is_empty()).then(|| cameras_around(board.names.target(t), target, &cameras))
        };
        self.targets.iter().enumerate().filter_map(of_target).collect()
    }

    /// Returns a period of a camera's recorded states and its limits: by default all of it.
    fn remembered(&self, camera: usize, asked: &asked::Asked) -> Option<(Stretch, Vec<StripBin>)> {
        let board = self.board();
        let (first_s, last_s) = board.span_s(camera, self.now())?;
        let stretch = asked.stretch(first_s, last_s);
        let bins = board.strip(camera, &stretch);
        Some((stretch, bins))
    }

    /// Newest capture time of a camera, and its references by target.
    fn compared(&self, camera: usize) -> (Option<f64>, Vec<(String, Pose)>) {
        let board = self.board();
        let last_s = board.span_s(camera, self.now()).map(|(_, last_s)| last_s);
        let of = |pair: usize| {
            let (_, target) = board.names.of_pair(pair);
            let reference = board.pairs[pair].reference?.reference;
            Some((board.names.target(target).to_owned(), reference.a_from_b))
        };
        (last_s, board.pairs_of(camera).filter_map(of).collect())
    }

    pub(crate) fn acknowledge(&self, camera: usize) -> bool {
        self.changed(|board| board.acknowledge(camera))
    }

    pub(crate) fn reset(&self, camera: usize) {
        self.changed(|board| board.reset_camera(camera));
    }

    /// The camera learns where it is; a sentence where that cannot be.
    pub(crate) fn set_reference(&self, camera: usize) -> Result<(), &'static str> {
        if let Some(reason) = self.fixed {
            return Err(reason);
        }
        if self.board().is_over {
            return Err("The session has ended; start it again.");
        }
        self.relearn.ask(camera);
        self.acknowledge(camera); // Setting a new reference acknowledges the motion.
        Ok(())
    }

    /// Applies an operator's action, and makes its effect visible at once.
    fn changed<T>(&self, change: impl FnOnce(&mut Board) -> T) -> T {
        let done = change(&mut self.board());
        *self.shared.lock().unwrap_or_else(PoisonError::into_inner) = None;
        done
    }

    fn now(&self) -> Instants {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Instants { up_s: self.began.elapsed().as_secs_f64(), unix_s: unix.as_secs_f64() }
    }

    fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns `None` where the file format cannot hold the model.
fn lens_file(camera: &LiveCamera) -> Option<String> {
    camera_file(&camera.name, &camera.camera, camera.intrinsics.as_ref()).ok()
}

/// Runs a session on this thread until its sources end.
pub fn run(live: &Live, mut request: Request, log: &Log) {
    live.tap(&mut request);
    let text = EventText::new(&request.names);
    let stop = Arc::new(AtomicBool::new(false));
    let ended = resight_watch::run(request, log, &stop, |event| {
        live.take(&text, event);
        Ok(())
    });
    live.ended(ended.err().map(|reason| format!("{:#}", anyhow::Error::new(reason))));
}
