//! The routes of photographs and four clicks. Whatever computes runs on a thread where a failure loses one request.

use crate::app::App;
use crate::error::Problem;
use crate::guard::must_be_json;
use crate::sessions::Shared;
use crate::{example, page};
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use resight_session::{Command, Photograph, Session, View};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::{MutexGuard, PoisonError};
use tokio::task::spawn_blocking;

/// Largest photograph and largest saved session, bytes: base64 takes a third more, and a session holds several.
const PHOTOGRAPH_BYTES: usize = 96 << 20;
const SESSION_BYTES: usize = crate::guard::LARGEST;
/// Largest command: camera and target files are in them.
pub const COMMAND_BYTES: usize = 8 << 20;

/// Opens a session: empty, saved, or the example.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Open {
    load: Option<String>,
    example: bool,
}

/// A session and its view.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Opened {
    session: String,
    view: View,
}

/// A command with its number.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Numbered {
    /// Comes back with the view.
    #[serde(default)]
    pub seq: u64,
    /// Number of the photograph.
    #[serde(default)]
    pub photo: usize,
    /// The command.
    pub command: Command,
}

/// The view after a command.
#[derive(Debug, Serialize, JsonSchema)]
pub struct NumberedView {
    /// Of the command.
    pub seq: u64,
    /// The current state.
    pub view: View,
}

/// What the queries name.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct Named {
    session: String,
    #[serde(default)]
    photo: usize,
    name: Option<String>,
    format: Option<String>,
}

/// The routes.
pub fn routes() -> Router<App> {
    let large = DefaultBodyLimit::max;
    Router::new()
        .route("/api/session", post(open).layer(large(SESSION_BYTES)))
        .route("/api/session/photograph", get(photograph).post(add).layer(large(PHOTOGRAPH_BYTES)))
        .route("/api/session/exports", get(async || Json(resight_session::exports())))
        .route("/api/session/command", post(command).layer(large(COMMAND_BYTES)))
        .route("/api/session/view", get(view))
        .route("/api/session/save", get(save))
        .route("/api/session/export", get(export))
        .route("/api/session/birdseye", get(birdseye))
}

/// A thread that failed while it held a session left it whole, because a command changes its state at its end.
pub fn locked(session: &Shared) -> MutexGuard<'_, Session> {
    session.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs on a thread of its own.
pub async fn aside<T: Send + 'static>(job: impl FnOnce() -> T + Send + 'static) -> Result<T, Problem> {
    spawn_blocking(job).await.map_err(|_| Problem::failed())
}

fn known(app: &App, id: &str) -> Result<Shared, Problem> {
    let gone = "There is no such session any more; open a new one, or load the saved one.";
    app.sessions.get(id).ok_or_else(|| Problem::missing(gone))
}

fn json<T: for<'a> Deserialize<'a>>(headers: &HeaderMap, body: &[u8]) -> Result<T, Problem> {
    must_be_json(headers)?;
    serde_json::from_slice(body)
        .map_err(|reason| Problem::input(format!("The JSON is not what is needed: {reason}.")))
}

async fn open(State(app): State<App>, headers: HeaderMap, body: Bytes) -> Result<Json<Opened>, Problem> {
    let asked: Open = if body.is_empty() {
        must_be_json(&headers).map(|()| Open::default())?
    } else {
        json(&headers, &body)?
    };
    let _turn = app.decoding.acquire().await.map_err(|_| Problem::failed())?;
    let made = aside(move || match asked {
        Open { load: Some(text), .. } => Session::load(&text).map_err(|refusal| Problem::input(refusal.text)),
        Open { example: true, .. } => example::session().map_err(Problem::input),
        Open { .. } => Ok(Session::new()),
    });
    let (session, shared) = app.sessions.add(made.await??);
    let view = aside(move || locked(&shared).view(0)).await?;
    Ok(Json(Opened { session, view }))
}

async fn add(
    State(app): State<App>,
    Query(named): Query<Named>,
    headers: HeaderMap,
    body: Bytes,
) -> Result<Json<View>, Problem> {
    let session = known(&app, &named.session)?;
    let given = headers.get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    if !matches!(given, "image/jpeg" | "image/png") {
        let message = "Send a photograph as image/jpeg or image/png.";
        return Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "media_type", message));
    }
    // Few at a time: a photograph of 64 Mpx takes 200 MB while it is decoded.
    let _turn = app.decoding.acquire().await.map_err(|_| Problem::failed())?;
    let name = named.name.unwrap_or_else(|| "photograph".to_owned());
    let decoded = aside(move || Photograph::decode(&name, body.to_vec())).await?;
    let photograph = decoded.map_err(|reason| Problem::input(sentence(&reason)))?;
    let view = aside(move || locked(&session).add_photograph(photograph)).await?;
    app.sessions.make_room(&named.session);
    Ok(Json(view.map_err(|refusal| Problem::input(refusal.text))?))
}

fn sentence(reason: &str) -> String {
    format!("This is no photograph that can be used: {reason}.")
}

async fn photograph(
    State(app): State<App>,
    Query(named): Query<Named>,
    request: Request,
) -> Result<Response, Problem> {
    let session = known(&app, &named.session)?;
    let photograph = locked(&session).photograph(named.photo).cloned();
    let photograph = photograph.ok_or_else(|| Problem::missing("There is no such photograph."))?;
    let tag = format!("\"{}-{}-{}\"", named.session, named.photo, photograph.bytes.len());
    Ok(page::file(&request, &tag, photograph.media_type(), &photograph.bytes))
}

async fn command(
    State(app): State<App>,
    Query(named): Query<Named>,
    headers: HeaderMap,
    body: Bytes,
) -> Result<Json<NumberedView>, Problem> {
    let session = known(&app, &named.session)?;
    let Numbered { seq, photo, command } = json(&headers, &body)?;
    let view = aside(move || locked(&session).apply(photo, command)).await?;
    Ok(Json(NumberedView { seq, view }))
}

async fn view(State(app): State<App>, Query(named): Query<Named>) -> Result<Json<View>, Problem> {
    let session = known(&app, &named.session)?;
    Ok(Json(aside(move || locked(&session).view(named.photo)).await?))
}

async fn save(State(app): State<App>, Query(named): Query<Named>) -> Result<Response, Problem> {
    let session = known(&app, &named.session)?;
    let saved =
        aside(move || locked(&session).save()).await?.map_err(|refusal| Problem::input(refusal.text))?;
    Ok(download("session.toml", "application/toml; charset=utf-8", saved.into_bytes()))
}

async fn export(State(app): State<App>, Query(named): Query<Named>) -> Result<Response, Problem> {
    let session = known(&app, &named.session)?;
    let format = named.format.unwrap_or_else(|| "json".to_owned());
    let made = aside(move || locked(&session).export(named.photo, &format)).await?;
    let export = made.map_err(|refusal| Problem::input(refusal.text))?;
    Ok(download(&export.name, export.media_type, export.text.into_bytes()))
}

/// To be saved, not shown: a report is a page of its own and must not run as one of this server's.
fn download(name: &str, media_type: &str, bytes: Vec<u8>) -> Response {
    let plain: String = name.chars().filter(|c| c.is_ascii_alphanumeric() || "-_.".contains(*c)).collect();
    let headers = [
        (header::CONTENT_TYPE, media_type.to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{plain}\"")),
    ];
    (headers, bytes).into_response()
}

async fn birdseye(State(app): State<App>, Query(named): Query<Named>) -> Result<Response, Problem> {
    let session = known(&app, &named.session)?;
    let png = aside(move || {
        // The session is not held while the image is drawn.
        let mut copy = locked(&session).clone();
        copy.birdseye_png(named.photo)
    });
    let png = png.await?.ok_or_else(|| {
        Problem::missing(
            "There is no bird's-eye view yet: the camera needs a pose, and three points on the ground.",
        )
    })?;
    Ok(([(header::CONTENT_TYPE, "image/png")], png).into_response())
}
