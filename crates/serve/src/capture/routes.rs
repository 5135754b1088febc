//! The routes of a capture: how it is, and what the operator asks.

use super::{CaptureView, Capturing};
use crate::app::App;
use crate::body::receive;
use crate::error::Problem;
use crate::guard::must_be_json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::routing::{get, post};
use axum::{Json, Router};
use resight_watch::capture::Operator;
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::time::timeout;

/// A body that names a view, bytes.
const NAMING_BYTES: usize = 64 << 10;
/// For the capture to do what it is asked: the estimation that runs ends before.
const PATIENCE: Duration = Duration::from_secs(60);

/// Names a view.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NamedView {
    view: String,
}

/// The routes.
pub fn routes() -> Router<App> {
    Router::new()
        .route("/api/capture", get(view))
        .route("/api/capture/take-back", post(take_back))
        .route("/api/capture/finish", post(finish))
}

pub(super) fn capturing(app: &App) -> Result<&Arc<Capturing>, Problem> {
    let none = "No camera is being calibrated; start with resight capture SOURCE --target FILE -o camera.toml --serve ADDRESS:PORT.";
    app.capture().ok_or_else(|| Problem::missing(none))
}

/// How the capture is; null where none runs.
async fn view(State(app): State<App>) -> Json<Option<CaptureView>> {
    Json(app.capture().map(|capture| CaptureView::clone(&capture.now())))
}

/// Takes the last kept view back.
async fn take_back(State(app): State<App>, request: Request) -> Result<Json<CaptureView>, Problem> {
    let capture = Arc::clone(capturing(&app)?);
    let body = receive(&app, request, NAMING_BYTES).await?;
    let (NamedView { view }, _) = body.json(&app, "Name a view").await?;
    let has = |now: &CaptureView| now.state.views.last().is_some_and(|last| last.view == view);
    let now = capture.now();
    if now.is_over {
        return Err(over());
    }
    if !has(&now) {
        let message = format!("{view} is not the last view kept; look again.");
        return Err(Problem::new(StatusCode::CONFLICT, "view", message));
    }
    let n = now.state.views.len();
    capture.operator.ask_back(view);
    reached(&capture, |now| now.is_over || now.state.views.len() != n).await
}

/// Ends the capture, and writes the camera.
async fn finish(State(app): State<App>, headers: HeaderMap) -> Result<Json<CaptureView>, Problem> {
    must_be_json(&headers)?;
    let capture = Arc::clone(capturing(&app)?);
    let now = capture.now();
    if !now.is_over && !now.state.is_usable {
        let message = format!("There is no camera to write yet: {}.", now.state.message);
        return Err(Problem::new(StatusCode::CONFLICT, "no_camera", message));
    }
    let Operator { stop, .. } = &capture.operator;
    stop.store(true, Ordering::Relaxed);
    reached(&capture, |now| now.is_over).await
}

fn over() -> Problem {
    Problem::new(StatusCode::CONFLICT, "over", "The capture has ended; start it again.")
}

/// Waits until the capture has come so far.
async fn reached(
    capture: &Capturing,
    is_so: impl Fn(&CaptureView) -> bool,
) -> Result<Json<CaptureView>, Problem> {
    let mut views = capture.view.subscribe();
    match timeout(PATIENCE, views.wait_for(|view| is_so(view))).await {
        Ok(Ok(view)) => Ok(Json(CaptureView::clone(&view))),
        _ => Err(Problem::failed()),
    }
}
