//! The routes of watched cameras: how they are, and what an operator does.

use super::Live;
use super::answers::{LiveView, LogLine, ReferenceView, StripView};
use super::asked::Asked;
use crate::app::App;
use crate::aside::{aside, turn};
use crate::body::{receive, sending};
use crate::error::Problem;
use crate::guard::must_be_json;
use crate::memory::Taken;
use axum::extract::{Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use resight::scene::around::AroundScene;
use resight_watch::history::{History, HistoryError, Selection};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::timeout;

/// Events of a history sent at once.
const MOST_EVENTS: usize = 5000;
/// A body that names a camera, bytes.
const NAMING_BYTES: usize = 64 << 10;
/// Default length of a strip, seconds: a day.
const DAY_S: f64 = 86_400.0;
/// Time to wait for the next frame of a camera; slow ones have one per minute.
const FRAME_PATIENCE: Duration = Duration::from_secs(20);

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

/// The routes.
pub fn routes() -> Router<App> {
    Router::new()
        .route("/api/live", get(view))
        .route("/api/live/cameras", get(cameras))
        .route("/api/live/example", post(example))
        .route("/api/live/acknowledge", post(acknowledge))
        .route("/api/live/reset", post(reset))
        .route("/api/live/reference", get(references).post(reference))
        .route("/api/live/history", get(history))
        .route("/api/live/strip", get(strip))
        .route("/api/live/scene", get(scene))
        .route("/api/live/log", get(log))
        .route("/api/live/frame", get(frame))
        .route("/api/live/lens", get(lens))
}

pub(super) fn live(app: &App) -> Result<&Arc<Live>, Problem> {
    let none = "No cameras are watched; start with a session file: resight serve SESSION.toml.";
    app.live().ok_or_else(|| Problem::missing(none))
}

pub(super) fn number(live: &Live, camera: &str) -> Result<usize, Problem> {
    live.number(camera).ok_or_else(|| Problem::missing("No camera of this session has that name."))
}

/// The camera that a request names.
async fn named(app: &App, request: Request) -> Result<(usize, Named), Problem> {
    let live = live(app)?;
    let (asked, _) = receive(app, request, NAMING_BYTES).await?.json::<Named>(app, "Name a camera").await?;
    Ok((number(live, &asked.camera)?, asked))
}

/// Runs a request that reads or changes the board on a thread of its own, once it can lock the board.
async fn ask<T: Send + 'static>(
    app: &App,
    of: impl FnOnce(&Live) -> T + Send + 'static,
) -> Result<T, Problem> {
    let live = Arc::clone(live(app)?);
    aside((), move || of(&live)).await
}

async fn view(State(app): State<App>) -> Result<Json<LiveView>, Problem> {
    Ok(Json(ask(&app, Live::view).await?))
}

/// Names of the cameras; none where none is watched.
async fn cameras(State(app): State<App>) -> Json<Vec<String>> {
    Json(app.live().map(|live| live.names().to_vec()).unwrap_or_default())
}

/// Watches two cameras that the program draws.
async fn example(State(app): State<App>, headers: HeaderMap) -> Result<Json<LiveView>, Problem> {
    must_be_json(&headers)?;
    let turn = turn(&app.working).await?;
    let taken = || {
        let message = "Cameras are watched already; start the program without them for the example.";
        Problem::new(StatusCode::CONFLICT, "watching", message)
    };
    if app.live().is_some() {
        return Err(taken());
    }
    let made = aside(turn, super::example::start).await?.map_err(|_| Problem::failed())?;
    if app.watch(made) { view(State(app.clone())).await } else { Err(taken()) }
}

async fn acknowledge(State(app): State<App>, request: Request) -> Result<Json<LiveView>, Problem> {
    let (camera, _) = named(&app, request).await?;
    let done = ask(&app, move |live| {
        live.acknowledge(camera);
        live.view()
    });
    Ok(Json(done.await?))
}

async fn reset(State(app): State<App>, request: Request) -> Result<Json<LiveView>, Problem> {
    let (camera, _) = named(&app, request).await?;
    let done = ask(&app, move |live| {
        live.reset(camera);
        live.view()
    });
    Ok(Json(done.await?))
}

async fn references(
    State(app): State<App>,
    Query(asked): Query<Asked>,
) -> Result<Json<Vec<ReferenceView>>, Problem> {
    let camera = number(live(&app)?, &asked.camera)?;
    Ok(Json(ask(&app, move |live| live.references(camera)).await?))
}

async fn reference(State(app): State<App>, request: Request) -> Result<Json<LiveView>, Problem> {
    let (camera, asked) = named(&app, request).await?;
    if !asked.confirm {
        let message = "The camera learns where it is from its next frames, and is compared with that from then on: confirm it.";
        return Err(Problem::new(StatusCode::CONFLICT, "confirm", message));
    }
    let done = ask(&app, move |live| live.set_reference(camera).map(|()| live.view()));
    let view = done.await?.map_err(|reason| Problem::new(StatusCode::CONFLICT, "fixed", reason))?;
    Ok(Json(view))
}

async fn scene(State(app): State<App>) -> Result<Json<Vec<AroundScene>>, Problem> {
    Ok(Json(ask(&app, Live::scenes).await?))
}

async fn log(State(app): State<App>) -> Result<Json<Vec<LogLine>>, Problem> {
    Ok(Json(ask(&app, |live| LogLine::all(&live.board())).await?))
}

/// The next frame as a PNG: the Photograph tab takes it.
async fn frame(State(app): State<App>, Query(asked): Query<Asked>) -> Result<Response, Problem> {
    let live = live(&app)?;
    let none = || {
        let message =
            "The camera gave no picture within 20 s; its source may be detections without pictures.";
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, "frame", message)
    };
    let next = live.pictures.frame(number(live, &asked.camera)?).ok_or_else(none)?;
    let Ok(Ok(image)) = timeout(FRAME_PATIENCE, next).await else { return Err(none()) };
    let png = aside((), move || image.png()).await?.map_err(|_| Problem::failed())?;
    let body = sending(&app, png, Taken::default())?;
    Ok(([(header::CONTENT_TYPE, "image/png")], body).into_response())
}

/// The lens of a camera as a camera file: the Photograph tab takes it with a frame.
async fn lens(State(app): State<App>, Query(asked): Query<Asked>) -> Result<Response, Problem> {
    let live = live(&app)?;
    let none = || Problem::missing("The lens of this camera has no place in a camera file.");
    let text = live.lens_files[number(live, &asked.camera)?].clone().ok_or_else(none)?;
    Ok(([(header::CONTENT_TYPE, "application/toml; charset=utf-8")], text).into_response())
}

/// A stretch of time in few parts: from the history file, or from what the session remembers.
async fn strip(State(app): State<App>, Query(asked): Query<Asked>) -> Result<Json<StripView>, Problem> {
    let live = live(&app)?;
    let camera = number(live, &asked.camera)?;
    asked.check()?;
    let none = || Problem::missing("Nothing has been seen of this camera yet.");
    let Some(path) = live.history.clone() else {
        let (stretch, bins) =
            ask(&app, move |live| live.remembered(camera, &asked)).await?.ok_or_else(none)?;
        return Ok(Json(StripView::new(&stretch, bins, false)));
    };
    let (last_s, references) = ask(&app, move |live| live.compared(camera)).await?;
    let last_s = asked.to_s.or(last_s).ok_or_else(none)?;
    let stretch = asked.stretch(last_s - DAY_S, last_s);
    let read = aside(turn(&app.working).await?, move || {
        History::open(&path)?.strip(&asked.camera, &stretch, &references)
    });
    Ok(Json(StripView::new(&stretch, read.await?.map_err(unreadable)?, true)))
}

async fn history(
    State(app): State<App>,
    Query(asked): Query<Asked>,
) -> Result<Json<Vec<HistoryEvent>>, Problem> {
    let live = live(&app)?;
    number(live, &asked.camera)?;
    asked.check()?;
    let none = "This session writes no history; give it the key `history`.";
    let path = live.history.clone().ok_or_else(|| Problem::missing(none))?;
    let selection = Selection { cameras: vec![asked.camera], from_s: asked.from_s, to_s: asked.to_s };
    let read = aside(turn(&app.working).await?, move || {
        let mut all = Vec::new();
        History::open(&path)?.events(&selection, &[], |event| {
            let detail = serde_json::from_str(&event.row.detail).unwrap_or_default();
            let (unix_s, t_s, kind) = (event.unix_s, event.row.t_s, event.row.kind);
            all.push(HistoryEvent { unix_s, t_s, kind, state: event.state, detail });
            all.len() < MOST_EVENTS
        })?;
        Ok::<_, HistoryError>(all)
    });
    Ok(Json(read.await?.map_err(unreadable)?))
}

/// Reports an unreadable history; its own message names the file, which pages need not know.
fn unreadable(_: HistoryError) -> Problem {
    Problem::new(StatusCode::SERVICE_UNAVAILABLE, "history", "The history cannot be read now.")
}
