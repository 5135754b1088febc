//! The WebSocket of watched cameras: states four times a second, events as they occur, and one picture after each acknowledgement.
//!
//! Each page has a task of its own, which waits for its page alone. Pictures that a page does not take in time are not kept for it: it gets the
//! newest one when it is ready, and is disconnected when it takes nothing for long.

use super::Live;
use super::pictures::{Message as Picture, Size};
use super::routes::live;
use crate::app::App;
use crate::aside::aside;
use crate::error::Problem;
use axum::Router;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use axum::routing::any;
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval, timeout};

/// Interval between states.
const STATES: Duration = Duration::from_millis(250);
/// For a client to take a message.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);
/// A message of a page.
pub(crate) const MESSAGE_BYTES: usize = 4096;
/// Size of a single write; a page's picture is larger.
pub(crate) const WRITE_BYTES: usize = 8 << 10;

/// Returns its route.
pub fn routes() -> Router<App> {
    Router::new().route("/ws/live", any(open))
}

async fn open(State(app): State<App>, upgrade: WebSocketUpgrade) -> Result<Response, Problem> {
    let live = Arc::clone(live(&app)?);
    let upgrade =
        upgrade.max_message_size(MESSAGE_BYTES).write_buffer_size(WRITE_BYTES).protocols(["resight"]);
    Ok(upgrade.on_upgrade(move |socket| show(socket, live)))
}

/// What a page says.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PageMessage {
    /// It has taken a picture and is ready for the next.
    #[serde(default)]
    pub(crate) ack: Option<u64>,
    /// The one camera that it shows at full size; null: all of them, small.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "Option<String>")]
    show: Option<Option<String>>,
}

/// `null` is something else than nothing.
fn given<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Option<String>>, D::Error> {
    Option::deserialize(deserializer).map(Some)
}

/// The pictures that a page looks at; counted, however it leaves.
pub struct Looker {
    live: Arc<Live>,
    shown: Vec<(usize, Size, watch::Receiver<Option<Picture>>)>,
    next: usize,
}

impl Looker {
    /// Creates a feed of all cameras, small.
    pub fn all(live: &Arc<Live>) -> Self {
        let mut looker = Looker { live: Arc::clone(live), shown: Vec::new(), next: 0 };
        looker.show(None);
        looker
    }

    /// Creates a feed of one camera.
    pub fn one(live: &Arc<Live>, camera: usize, size: Size) -> Self {
        let mut looker = Looker { live: Arc::clone(live), shown: Vec::new(), next: 0 };
        looker.look([(camera, size)]);
        looker
    }

    fn show(&mut self, camera: Option<usize>) {
        match camera {
            Some(camera) => self.look([(camera, Size::Large)]),
            None => self.look((0..self.live.pictures.n_cameras()).map(|camera| (camera, Size::Small))),
        }
    }

    fn look(&mut self, wanted: impl IntoIterator<Item = (usize, Size)>) {
        self.leave();
        for (camera, size) in wanted {
            if let Some(newest) = self.live.pictures.newest(camera, size) {
                self.live.pictures.look(camera, size, true);
                self.shown.push((camera, size, newest));
            }
        }
    }

    fn leave(&mut self) {
        for (camera, size, _) in self.shown.drain(..) {
            self.live.pictures.look(camera, size, false);
        }
    }

    /// The newest picture that was not taken yet, cameras in turn.
    pub fn take(&mut self) -> Option<Picture> {
        let n = self.shown.len();
        for at in (0..n).map(|i| (self.next + i) % n) {
            let (_, _, newest) = &mut self.shown[at];
            if newest.has_changed().unwrap_or(false)
                && let Some(picture) = newest.borrow_and_update().clone()
            {
                self.next = at + 1;
                return Some(picture);
            }
        }
        None
    }
}

impl Drop for Looker {
    fn drop(&mut self) {
        self.leave();
    }
}

/// Until the page leaves.
async fn show(mut socket: WebSocket, live: Arc<Live>) {
    let (mut events, mut news) = (live.events.subscribe(), live.pictures.news());
    let (mut looker, mut is_ready) = (Looker::all(&live), true);
    let mut tick = interval(STATES);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let message = tokio::select! {
            said = socket.recv() => {
                match said {
                    Some(Ok(Message::Text(text))) => is_ready |= heard(&text, &live, &mut looker),
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                    Some(Ok(_)) => {}
                }
                picture(&mut looker, &mut is_ready)
            }
            event = events.recv() => match event {
                Ok(text) => Some(Message::Text(text)),
                Err(RecvError::Lagged(_)) => None,
                Err(RecvError::Closed) => return,
            },
            _ = tick.tick() => {
                let live = Arc::clone(&live);
                aside((), move || live.view_text()).await.ok().map(Message::Text)
            }
            changed = news.changed(), if is_ready => match changed {
                Ok(()) => picture(&mut looker, &mut is_ready),
                Err(_) => return,
            },
        };
        let Some(message) = message else { continue };
        if !matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(()))) {
            return;
        }
    }
}

/// The next picture, if the page is ready for one.
fn picture(looker: &mut Looker, is_ready: &mut bool) -> Option<Message> {
    let picture = is_ready.then(|| looker.take()).flatten()?;
    *is_ready = false;
    Some(Message::Binary(picture))
}

/// Returns whether a message acknowledged a picture.
fn heard(text: &str, live: &Live, looker: &mut Looker) -> bool {
    let Ok(PageMessage { ack, show }) = serde_json::from_str(text) else { return false };
    if let Some(camera) = show {
        looker.show(camera.and_then(|name| live.number(&name)));
    }
    ack.is_some()
}
