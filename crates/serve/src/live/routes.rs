//! The routes of watched cameras: their states, events and pictures over a WebSocket, and what an operator does.

use super::Live;
use super::cameras::LiveView;
use super::pictures::{Message as Picture, jpeg};
use crate::app::App;
use crate::error::Problem;
use crate::guard::must_be_json;
use crate::photograph::aside;
use axum::body::{Body, Bytes};
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get, post};
use axum::{Json, Router};
use resight_watch::history::{History, Selection};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::watch;
use tokio::time::{interval, timeout};

/// How often states are sent.
const STATES: Duration = Duration::from_millis(250);
/// For a client to take a message.
const PATIENCE: Duration = Duration::from_secs(20);
/// Events of a history sent at once.
const MOST_EVENTS: usize = 5000;
/// A message of a page.
const MESSAGE_BYTES: usize = 4096;

/// Names a camera.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Named {
    camera: String,
    /// Setting a reference asks for it.
    #[serde(default)]
    confirm: bool,
}

/// One event of a history.
#[derive(Debug, Serialize, JsonSchema)]
pub struct HistoryEvent {
    unix_s: f64,
    t_s: Option<f64>,
    kind: String,
    state: Option<String>,
    detail: serde_json::Value,
}

#[derive(Deserialize)]
struct Selected {
    camera: String,
    from_s: Option<f64>,
    to_s: Option<f64>,
}

/// The routes.
pub fn routes() -> Router<App> {
    Router::new()
        .route("/api/live", get(view))
        .route("/api/live/acknowledge", post(acknowledge))
        .route("/api/live/reset", post(reset))
        .route("/api/live/reference", post(reference))
        .route("/api/live/history", get(history))
        .route("/cameras.mjpg", get(stream))
        .route("/ws/live", any(open))
}

fn live(app: &App) -> Result<&Arc<Live>, Problem> {
    let none = "No cameras are watched; start with a session file: resight serve SESSION.toml.";
    app.live.as_ref().ok_or_else(|| Problem::missing(none))
}

fn number(live: &Live, camera: &str) -> Result<usize, Problem> {
    live.number(camera).ok_or_else(|| Problem::missing("No camera of this session has that name."))
}

fn named(headers: &HeaderMap, body: &[u8]) -> Result<Named, Problem> {
    must_be_json(headers)?;
    serde_json::from_slice(body).map_err(|reason| Problem::input(format!("Name a camera: {reason}.")))
}

fn now(live: &Live) -> LiveView {
    LiveView { has_history: live.history.is_some(), ..live.view() }
}

async fn view(State(app): State<App>) -> Result<Json<LiveView>, Problem> {
    Ok(Json(now(live(&app)?)))
}

async fn acknowledge(
    State(app): State<App>,
    headers: HeaderMap,
    body: Bytes,
) -> Result<Json<LiveView>, Problem> {
    let (live, asked) = (live(&app)?, named(&headers, &body)?);
    live.acknowledge(number(live, &asked.camera)?);
    Ok(Json(now(live)))
}

async fn reset(State(app): State<App>, headers: HeaderMap, body: Bytes) -> Result<Json<LiveView>, Problem> {
    let (live, asked) = (live(&app)?, named(&headers, &body)?);
    live.reset(number(live, &asked.camera)?);
    Ok(Json(now(live)))
}

async fn reference(
    State(app): State<App>,
    headers: HeaderMap,
    body: Bytes,
) -> Result<Json<LiveView>, Problem> {
    let (live, asked) = (live(&app)?, named(&headers, &body)?);
    number(live, &asked.camera)?;
    if !asked.confirm {
        let message = "The reference is learned anew from the frames to come, and the session starts again: confirm it.";
        return Err(Problem::new(StatusCode::CONFLICT, "confirm", message));
    }
    live.set_reference(&asked.camera)
        .map_err(|reason| Problem::new(StatusCode::CONFLICT, "fixed", reason))?;
    Ok(Json(now(live)))
}

async fn history(
    State(app): State<App>,
    Query(asked): Query<Selected>,
) -> Result<Json<Vec<HistoryEvent>>, Problem> {
    let live = live(&app)?;
    number(live, &asked.camera)?;
    let none = "This session writes no history; give it the key `history`.";
    let path = live.history.clone().ok_or_else(|| Problem::missing(none))?;
    let selection = Selection { cameras: vec![asked.camera], from_s: asked.from_s, to_s: asked.to_s };
    let read = aside(move || {
        let mut all = Vec::new();
        History::open(&path)?.events(&selection, &[], |event| {
            let detail = serde_json::from_str(&event.row.detail).unwrap_or_default();
            let (unix_s, t_s, kind) = (event.unix_s, event.row.t_s, event.row.kind);
            all.push(HistoryEvent { unix_s, t_s, kind, state: event.state, detail });
            all.len() < MOST_EVENTS
        })?;
        Ok::<_, resight_watch::history::HistoryError>(all)
    });
    // Its message names the file, which pages need not know.
    let unreadable =
        |_| Problem::new(StatusCode::SERVICE_UNAVAILABLE, "history", "The history cannot be read now.");
    Ok(Json(read.await?.map_err(unreadable)?))
}

/// Counts a page that looks on, however it leaves.
struct Looker(Arc<Live>, Option<usize>);

impl Looker {
    fn new(live: Arc<Live>) -> Self {
        live.pictures.look(true);
        Looker(live, None)
    }

    fn show(&mut self, camera: Option<usize>) {
        if let Some(old) = std::mem::replace(&mut self.1, camera) {
            self.0.pictures.enlarge(old, false);
        }
        if let Some(new) = camera {
            self.0.pictures.enlarge(new, true);
        }
    }
}

impl Drop for Looker {
    fn drop(&mut self) {
        self.show(None);
        self.0.pictures.look(false);
    }
}

/// A camera as motion JPEG, for dashboards.
async fn stream(State(app): State<App>, Query(asked): Query<Selected>) -> Result<Response, Problem> {
    let live = Arc::clone(live(&app)?);
    let camera = number(&live, &asked.camera)?;
    let newest = live.pictures.newest().swap_remove(camera);
    let looker = Looker::new(live);
    let parts = parts(newest, looker);
    let media_type = "multipart/x-mixed-replace; boundary=frame";
    Ok(([(header::CONTENT_TYPE, media_type)], Body::from_stream(parts)).into_response())
}

/// Part after part; a slow reader gets the newest when it is ready.
fn parts(newest: watch::Receiver<Option<Picture>>, looker: Looker) -> Parts {
    let (sender, receiver) = tokio::sync::mpsc::channel::<Bytes>(1);
    tokio::spawn(async move {
        let (mut newest, _looker) = (newest, looker);
        loop {
            tokio::select! {
                changed = newest.changed() => if changed.is_err() { return },
                () = sender.closed() => return,
            }
            let picture = newest.borrow_and_update().clone();
            let Some(jpeg) = picture.as_deref().and_then(|p| jpeg(p)) else { continue };
            let mut part =
                format!("--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len())
                    .into_bytes();
            part.extend(jpeg);
            part.extend(b"\r\n");
            if !matches!(timeout(PATIENCE, sender.send(part.into())).await, Ok(Ok(()))) {
                return;
            }
        }
    });
    Parts(receiver)
}

struct Parts(tokio::sync::mpsc::Receiver<Bytes>);

impl futures_core::Stream for Parts {
    type Item = std::io::Result<Bytes>;

    fn poll_next(
        mut self: std::pin::Pin<&mut Self>,
        context: &mut std::task::Context<'_>,
    ) -> std::task::Poll<Option<Self::Item>> {
        self.0.poll_recv(context).map(|part| part.map(Ok))
    }
}

async fn open(State(app): State<App>, upgrade: WebSocketUpgrade) -> Result<Response, Problem> {
    let live = Arc::clone(live(&app)?);
    let upgrade = upgrade.max_message_size(MESSAGE_BYTES).protocols(["resight"]);
    Ok(upgrade.on_upgrade(move |socket| show(socket, live)))
}

/// What a page says.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Said {
    #[serde(default)]
    ack: Option<u64>,
    #[serde(default, deserialize_with = "given")]
    show: Option<Option<String>>,
}

/// `null` is something else than nothing.
fn given<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Option<String>>, D::Error> {
    Option::deserialize(deserializer).map(Some)
}

/// Until the page leaves: states four times a second, events as they come, and one picture after each acknowledgement.
async fn show(mut socket: WebSocket, live: Arc<Live>) {
    let mut looker = Looker::new(Arc::clone(&live));
    let (mut events, mut newest) = (live.events.subscribe(), live.pictures.newest());
    let (mut tick, mut next, mut free) = (interval(STATES), 0, true);
    loop {
        let message = tokio::select! {
            said = socket.recv() => {
                let Some(Ok(said)) = said else { return };
                match said {
                    Message::Close(_) => return,
                    Message::Text(text) => heard(&text, &live, &mut looker, &mut free),
                    _ => {}
                }
                continue;
            }
            event = events.recv() => match event {
                Ok(text) => Message::Text(text.to_string().into()),
                Err(RecvError::Lagged(_)) => continue,
                Err(RecvError::Closed) => return,
            },
            _ = tick.tick() => match serde_json::to_string(&serde_json::json!({ "live": now(&live) })) {
                Ok(text) => Message::Text(text.into()),
                Err(_) => return,
            },
            picture = any_new(&mut newest, next), if free => {
                let (camera, picture) = picture;
                (next, free) = (camera + 1, false);
                Message::Binary(picture.to_vec().into())
            }
        };
        if !matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(()))) {
            return;
        }
    }
}

fn heard(text: &str, live: &Live, looker: &mut Looker, free: &mut bool) {
    let Ok(Said { ack, show }) = serde_json::from_str(text) else { return };
    *free |= ack.is_some();
    if let Some(camera) = show {
        looker.show(camera.and_then(|name| live.number(&name)));
    }
}

/// The newest picture that was not sent yet, cameras in turn.
async fn any_new(newest: &mut [watch::Receiver<Option<Picture>>], first: usize) -> (usize, Picture) {
    let n = newest.len();
    loop {
        for camera in (0..n).map(|i| (first + i) % n) {
            if newest[camera].has_changed().unwrap_or(false)
                && let Some(picture) = newest[camera].borrow_and_update().clone()
            {
                return (camera, picture);
            }
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}
