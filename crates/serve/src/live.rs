//! Cameras that are watched, for the page: what each shows and how it is, the events, and what an operator may do.
//!
//! The session runs on a thread of its own, as `resight watch` runs it; nothing here waits in its way. A picture is kept only while a page
//! looks on, made small on the reader's thread, and encoded on another; whoever is slow gets fewer of them.

pub mod cameras;
pub mod pictures;
pub mod routes;

use cameras::{Cameras, LiveView};
use pictures::{Pictures, Tap};
use resight_watch::outputs::said::EventText;
use resight_watch::{Event, Log, Request};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::broadcast;

/// Events that a page may be behind; beyond it misses some, and its next status is whole again.
const EVENTS: usize = 256;

/// Makes the session's request; the cameras named learn their reference anew.
pub type Start = Box<dyn Fn(&BTreeSet<String>) -> anyhow::Result<Request> + Send>;

/// What routes and the session share.
pub struct Live {
    cameras: Mutex<Cameras>,
    pub(crate) pictures: Arc<Pictures>,
    pub(crate) events: broadcast::Sender<Arc<str>>,
    /// The history that the session writes.
    pub(crate) history: Option<PathBuf>,
    /// Why references cannot be learned anew.
    fixed: Option<&'static str>,
    stop: Arc<AtomicBool>,
    anew: Mutex<BTreeSet<String>>,
    again: AtomicBool,
}

impl Live {
    /// Of a session that is about to start.
    pub fn new(request: &Request, can_restart: bool) -> Self {
        let fixed = match (can_restart, &request.state) {
            (false, _) => Some(
                "`watch --serve` shows a session and does not restart it; set references with `resight serve SESSION.toml`.",
            ),
            (true, Some(_)) => Some(
                "The session keeps its state in a file, which remembers the references; leave out its key `state` to set them here.",
            ),
            (true, None) => None,
        };
        Live {
            cameras: Mutex::new(Cameras::new(&request.names)),
            pictures: Arc::new(Pictures::new(request)),
            events: broadcast::channel(EVENTS).0,
            history: request.outputs.history.as_ref().map(|history| history.file.clone()),
            fixed,
            stop: Arc::default(),
            anew: Mutex::default(),
            again: AtomicBool::new(false),
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
        if let Event::Observed { camera, target, observation } = event {
            self.pictures.observed(*camera, *target, observation);
        } else if 0 < self.events.receiver_count() {
            let _ = self.events.send(text.object(event).to_string().into()); // Nobody may be there any more.
        }
        self.lock().take(event);
    }

    /// How everything is.
    pub fn view(&self) -> LiveView {
        self.lock().view(self.pictures.now_s())
    }

    /// Whether a camera has that name.
    pub fn number(&self, camera: &str) -> Option<usize> {
        self.lock().number(camera)
    }

    pub(crate) fn acknowledge(&self, camera: usize) -> bool {
        self.lock().acknowledge(camera)
    }

    pub(crate) fn reset(&self, camera: usize) {
        self.lock().reset(camera);
    }

    /// Starts the session again with that camera's reference learned anew; a sentence where that cannot be.
    pub(crate) fn set_reference(&self, camera: &str) -> Result<(), &'static str> {
        if let Some(reason) = self.fixed {
            return Err(reason);
        }
        self.anew.lock().unwrap_or_else(PoisonError::into_inner).insert(camera.to_owned());
        self.again.store(true, Ordering::Relaxed);
        self.stop.store(true, Ordering::Relaxed);
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Cameras> {
        self.cameras.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Runs the session on this thread, and again each time a reference is set, until its sources end.
pub fn run(live: &Arc<Live>, start: &Start, log: &Log) {
    loop {
        let anew = live.anew.lock().unwrap_or_else(PoisonError::into_inner).clone();
        live.stop.store(false, Ordering::Relaxed);
        let mut request = match start(&anew) {
            Ok(request) => request,
            Err(reason) => return live.lock().failed(format!("{reason:#}")),
        };
        live.tap(&mut request);
        let text = EventText::new(&request.names);
        let ended = resight_watch::run(request, log, &live.stop, |event| {
            live.take(&text, event);
            Ok(())
        });
        if let Err(reason) = ended {
            live.lock().failed(format!("{:#}", anyhow::Error::new(reason)));
        }
        if !live.again.swap(false, Ordering::Relaxed) {
            return;
        }
        live.lock().started_again();
    }
}
