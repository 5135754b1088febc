//! The routes of photographs and four clicks. Whatever computes runs on a thread where a failure loses one request.

use crate::app::App;
use crate::aside::{aside, turn};
use crate::body::{Received, VALUE_BYTES, check_values, n_values, receive, sending};
use crate::error::Problem;
use crate::guard::must_be_json;
use crate::memory::{Taken, full};
use crate::sessions::Shared;
use crate::{example, page};
use axum::body::Body;
use axum::extract::{Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use resight::image::DecodingBytes;
use resight_session::{Command, GivenLens, GivenTarget, Photograph, Refusal, SavedSession, Session, View};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// Largest photograph, bytes.
const PHOTOGRAPH_BYTES: usize = resight_session::FILES_BYTES;
/// Largest saved session; as JSON it is a little larger.
const SESSION_BYTES: usize = resight_session::SAVED_BYTES + (16 << 20);
/// Reading a session takes its text, the table that it is, and the files in it.
const READING_TIMES: usize = 3;
/// Values in a saved session, those of its lens files included.
const SESSION_VALUES: usize = 3 << 20;
/// Largest command: camera and target files are in them.
const COMMAND_BYTES: usize = 8 << 20;
/// Values in the file of a command; a session of six lens files with as many can be read again.
const COMMAND_VALUES: usize = SESSION_VALUES / 8;
/// Memory that a search for a target takes for each pixel, bytes.
const SEARCHING_BYTES_PER_PX: usize = 6;

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
    /// Of a saved session: whether its photographs are in it (true where nothing is said), or their hashes alone.
    photographs: Option<bool>,
}

/// The routes.
pub fn routes() -> Router<App> {
    Router::new()
        .route("/api/session", post(open))
        .route("/api/session/photograph", get(photograph).post(add))
        .route("/api/session/exports", get(async || Json(resight_session::exports())))
        .route("/api/session/cameras", get(async || Json(resight_session::COMMON_CAMERAS)))
        .route("/api/session/command", post(command))
        .route("/api/session/cancel", post(cancel))
        .route("/api/session/view", get(view))
        .route("/api/session/save", get(save))
        .route("/api/session/export", get(export))
        .route("/api/session/birdseye", get(birdseye))
}

fn known(app: &App, id: &str) -> Result<Arc<Shared>, Problem> {
    let gone = "There is no such session any more; open a new one, or load the saved one.";
    app.sessions.get(id).ok_or_else(|| Problem::missing(gone))
}

async fn open(State(app): State<App>, request: Request) -> Result<Json<Opened>, Problem> {
    let body = receive(&app, request, SESSION_BYTES).await?;
    let turn = turn(&app.decoding).await?;
    let (asked, text_taken) = match body.bytes.is_empty() {
        true => must_be_json(&body.headers).map(|()| (Open::default(), Taken::default()))?,
        false => body.json::<Open>(&app, "The JSON is not what is needed").await?,
    };
    let made = match asked {
        Open { load: Some(text), .. } => loaded(&app, text, (turn, text_taken)).await?,
        Open { example: true, .. } => aside(turn, || example::session().map_err(Problem::input)).await??,
        Open { .. } => Session::new(),
    };
    let (session, shared) = app.sessions.add(made)?;
    let view = aside((), move || shared.now().view(0)).await?;
    Ok(Json(Opened { session, view }))
}

/// Reads a saved session; its photographs are decoded where there is memory for all of them. `held` is the turn, and the memory of the text.
async fn loaded(app: &App, text: String, held: impl Send + 'static) -> Result<Session, Problem> {
    let input = |refusal: Refusal| Problem::input(refusal.text);
    let (n, text, held) = aside((), move || (n_values(&text), text, held)).await?;
    check_values(n, SESSION_VALUES)?;
    let reading_bytes = (READING_TIMES - 1) * text.len() + VALUE_BYTES * n; // The text counts already.
    let reading = app.take(reading_bytes)?;
    let read = move || {
        let read = SavedSession::read(&text).map(|saved| (saved.decoding_bytes(), saved));
        (read, (held, reading))
    };
    let (read, (held, mut reading)) = aside((), read).await?;
    let (decoding_bytes, saved) = read.map_err(input)?;
    app.make_room(&mut reading, reading_bytes.saturating_add(decoding_bytes))?;
    aside((held, reading), move || saved.open()).await?.map_err(input)
}

async fn add(
    State(app): State<App>,
    Query(named): Query<Named>,
    request: Request,
) -> Result<Json<View>, Problem> {
    let session = known(&app, &named.session)?;
    let given = request.headers().get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    if !matches!(given, "image/jpeg" | "image/png") {
        let message = "Send a photograph as image/jpeg or image/png.";
        return Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "media_type", message));
    }
    let body = receive(&app, request, PHOTOGRAPH_BYTES).await?;
    let turn = turn(&app.decoding).await?;
    let decoding_bytes = DecodingBytes::of(&body.bytes).map_or(0, DecodingBytes::sum);
    let decoding = app.take(usize::try_from(decoding_bytes).unwrap_or(usize::MAX))?;
    let name = named.name.unwrap_or_else(|| "photograph".to_owned());
    let decoded = aside((), move || {
        let Received { bytes, taken, .. } = body;
        let photograph = Photograph::decode(&name, bytes);
        drop(turn);
        (photograph, (taken, decoding))
    });
    let (photograph, held) = decoded.await?;
    let photograph = photograph.map_err(|reason| Problem::input(sentence(&reason)))?;
    let add = move |session: &mut Session| session.add_photograph(photograph);
    let view = session.change(&app.sessions, &app.changing, || Ok(held), add).await?;
    session.measure();
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
    let now = session.now();
    let photograph = now.photograph(named.photo);
    let photograph = photograph.ok_or_else(|| Problem::missing("There is no such photograph."))?;
    let tag = format!("\"{}\"", photograph.sha256);
    if let Some(known) = page::is_known(&request, &tag) {
        return Ok(known);
    }
    let taken = app.memory.take(photograph.bytes.len()).ok_or_else(full)?;
    let body = sending(&app, FileOf(Arc::clone(photograph)), taken)?;
    Ok(page::file(&tag, photograph.media_type(), body))
}

/// The file of a photograph, which is sent from where it is.
struct FileOf(Arc<Photograph>);

impl AsRef<[u8]> for FileOf {
    fn as_ref(&self) -> &[u8] {
        &self.0.bytes
    }
}

/// The file that a command carries.
fn file_in(command: &Command) -> Option<&str> {
    match command {
        Command::SetLens { lens: GivenLens::File { text, .. } }
        | Command::FindTarget { target: GivenTarget::File { text, .. } } => Some(text),
        _ => None,
    }
}

/// Applies a command and returns what `then` makes of the present view, on the same thread; its measurements may still be the earlier ones.
/// With the view comes how often the session had been measured then. `text_taken` is the memory of the command's texts.
pub async fn applied<T: Send + 'static>(
    app: &App,
    session: &Arc<Shared>,
    photo: usize,
    command: Command,
    text_taken: Taken,
    then: impl FnOnce(View, u64) -> T + Send + 'static,
) -> Result<T, Problem> {
    let is_search = matches!(command, Command::FindTarget { .. });
    let (n, command) = match file_in(&command) {
        Some(_) => aside((), move || (file_in(&command).map_or(0, n_values), command)).await?,
        None => (0, command),
    };
    check_values(n, COMMAND_VALUES)?;
    let n_pixels = |photograph: &Arc<Photograph>| photograph.image.data.len();
    let searched = if is_search { session.now().photograph(photo).map_or(0, n_pixels) } else { 0 };
    let change = move |session: &mut Session| {
        let view = session.change(photo, command);
        then(view, session.n_measured())
    };
    let turns = if is_search { &app.working } else { &app.changing };
    let take = || Ok((text_taken, app.take(SEARCHING_BYTES_PER_PX * searched + VALUE_BYTES * n)?));
    let changed = session.change(&app.sessions, turns, take, change).await?;
    session.measure();
    Ok(changed)
}

async fn command(
    State(app): State<App>,
    Query(named): Query<Named>,
    request: Request,
) -> Result<Json<NumberedView>, Problem> {
    let session = known(&app, &named.session)?;
    let body = receive(&app, request, COMMAND_BYTES).await?;
    let (numbered, text_taken) = body.json(&app, "The JSON is not what is needed").await?;
    let Numbered { seq, photo, command } = numbered;
    let mut view = applied(&app, &session, photo, command, text_taken, |view, _| view).await?;
    if view.is_measuring {
        let (snap, error) = (view.snap.take(), view.error.take());
        let now = session.measured().await?;
        view = View { snap, error, ..aside((), move || now.view(photo)).await? };
    }
    Ok(Json(NumberedView { seq, view }))
}

async fn cancel(
    State(app): State<App>,
    Query(named): Query<Named>,
    headers: HeaderMap,
) -> Result<Json<bool>, Problem> {
    must_be_json(&headers)?;
    known(&app, &named.session)?.cancel();
    Ok(Json(true))
}

async fn view(State(app): State<App>, Query(named): Query<Named>) -> Result<Json<View>, Problem> {
    let now = known(&app, &named.session)?.measured().await?;
    Ok(Json(aside((), move || now.view(named.photo)).await?))
}

async fn save(State(app): State<App>, Query(named): Query<Named>) -> Result<Response, Problem> {
    let now = known(&app, &named.session)?.now();
    let is_whole = named.photographs.unwrap_or(true);
    let turn = turn(&app.working).await?;
    // The text, and the pieces that it is put together from.
    let writing = app.take(if is_whole { 4 * now.files_bytes() } else { 0 })?;
    let save = move || {
        let saved = if is_whole { now.save() } else { now.save_without_photographs() };
        (saved, writing)
    };
    let (saved, writing) = aside(turn, save).await?;
    let saved = saved.map_err(|refusal| Problem::input(refusal.text))?;
    let body = sending(&app, saved.into_bytes(), writing)?;
    Ok(download("session.toml", "application/toml; charset=utf-8", body))
}

async fn export(State(app): State<App>, Query(named): Query<Named>) -> Result<Response, Problem> {
    let now = known(&app, &named.session)?.measured().await?;
    let format = named.format.unwrap_or_else(|| "json".to_owned());
    let turn = turn(&app.working).await?;
    // A report holds all photographs.
    let photograph_bytes = match format.as_str() {
        "report" => now.files_bytes(),
        _ => now.photograph(named.photo).map_or(0, |p| p.bytes.len()),
    };
    let writing = app.take(4 * photograph_bytes)?;
    let today_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
    let make = move || (now.export(named.photo, &format, today_s), writing);
    let (made, writing) = aside(turn, make).await?;
    let export = made.map_err(|refusal| Problem::input(refusal.text))?;
    let body = sending(&app, export.text.into_bytes(), writing)?;
    Ok(download(&export.name, export.media_type, body))
}

/// Returns a file to be saved, not shown: a report is a page of its own and must not run as a page of this server.
fn download(name: &str, media_type: &str, body: Body) -> Response {
    let plain: String = name.chars().filter(|c| c.is_ascii_alphanumeric() || "-_.".contains(*c)).collect();
    let headers = [
        (header::CONTENT_TYPE, media_type.to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{plain}\"")),
    ];
    (headers, body).into_response()
}

async fn birdseye(State(app): State<App>, Query(named): Query<Named>) -> Result<Response, Problem> {
    let now = known(&app, &named.session)?.now();
    let turn = turn(&app.working).await?;
    let png = aside(turn, move || now.birdseye_png(named.photo));
    let png = png.await?.ok_or_else(|| {
        Problem::missing(
            "There is no bird's-eye view yet: the camera needs a pose, and three points on the ground.",
        )
    })?;
    let body = sending(&app, png, Taken::default())?;
    Ok(([(header::CONTENT_TYPE, "image/png")], body).into_response())
}
