//! The description of the interface, OpenAPI 3.1, generated from the types of its answers and requests.

mod operation;
mod schemas;

use crate::app::App;
use crate::aside::aside;
use crate::capture::routes::NamedView;
use crate::capture::{CaptureMessage, CaptureView, CapturedHeader};
use crate::error::{ErrorObject, Problem};
use crate::live::answers::{LiveMessage, LiveView, LogLine, ReferenceView, StripView};
use crate::live::asked::Asked;
use crate::live::feed::PageMessage;
use crate::live::pictures::PictureHeader;
use crate::live::routes::{HistoryEvent, Named as NamedCamera};
use crate::photograph::{Named, Numbered, NumberedView, Open, Opened};
use crate::results::GivenFiles;
use crate::socket;
use axum::Router;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use operation::Operation;
use resight::answer::RigView;
use resight::scene::around::AroundScene;
use resight_session::{CommonCamera, View};
use resight_watch::outputs::said::object::EventObject;
use resight_whisker::replay::Replay;
use schemas::Schemas;
use serde_json::{Map, Value, json};
use std::sync::OnceLock;

const ABOUT: &str = "Everything the page of `resight serve` does. Errors are {\"error\": {\"kind\", \"message\"}}. \
                     What is posted must say its type: application/json, or that of an image. \
                     With a token: Authorization: Bearer TOKEN; a WebSocket offers the protocols `resight` and `bearer.TOKEN`.";

/// The routes of the server itself.
pub fn routes() -> Router<App> {
    Router::new().route("/healthz", get(health)).route("/openapi.json", get(described))
}

/// Returns one word, for supervisors; the page explains what is wrong.
async fn health(State(app): State<App>) -> Response {
    match app.live().is_some_and(|live| live.has_failed()) {
        true => (axum::http::StatusCode::SERVICE_UNAVAILABLE, "degraded\n").into_response(),
        false => "ok\n".into_response(),
    }
}

/// The description, written once, beside the threads that answer: it takes tens of milliseconds.
async fn described() -> Result<Response, Problem> {
    static TEXT: OnceLock<String> = OnceLock::new();
    let text = match TEXT.get() {
        Some(text) => text,
        None => aside((), || TEXT.get_or_init(|| description().to_string())).await?,
    };
    Ok(([(header::CONTENT_TYPE, JSON)], text.as_str()).into_response())
}

/// Returns the whole description.
pub fn description() -> Value {
    let mut schemas = Schemas::new();
    let error = schemas.answer::<ErrorObject>();
    let operations = photographs(&mut schemas)
        .into_iter()
        .chain(live(&mut schemas))
        .chain(capture(&mut schemas))
        .chain(results(&mut schemas))
        .chain(sockets(&mut schemas))
        .chain(server());
    let mut paths = Map::new();
    for operation in operations {
        let (method, path) = (operation.method, paths.entry(operation.path).or_insert_with(|| json!({})));
        path[method] = operation.object(&error);
    }
    let components = schemas.components(&mut paths);
    json!({
        "openapi": "3.1.0",
        "info": { "title": "Resight", "version": env!("CARGO_PKG_VERSION"), "description": ABOUT },
        "security": [{}, { "token": [] }],
        "paths": paths,
        "components": { "schemas": components, "securitySchemes": { "token": { "type": "http", "scheme": "bearer" } } }
    })
}

const JSON: &str = "application/json";

fn photographs(s: &mut Schemas) -> Vec<Operation> {
    let named = |s: &mut Schemas, keys: &[&str]| s.query::<Named>(keys);
    let of_session = named(s, &["session"]);
    let of_photograph = named(s, &["session", "photo"]);
    vec![
        Operation::post("/api/session", "Opens a session: empty, saved or the example.")
            .takes(JSON, s.given::<Open>())
            .answers(JSON, s.answer::<Opened>()),
        Operation::post("/api/session/photograph", "Adds a photograph.")
            .query(named(s, &["session", "name"]))
            .takes_file(&["image/jpeg", "image/png"])
            .answers(JSON, s.answer::<View>()),
        Operation::get("/api/session/photograph", "A photograph as it came.")
            .query(of_photograph.clone())
            .answers_file(&["image/jpeg", "image/png"]),
        Operation::post("/api/session/command", "Applies a command.")
            .query(of_session.clone())
            .takes(JSON, s.given::<Numbered>())
            .answers(JSON, s.answer::<NumberedView>()),
        Operation::post("/api/session/cancel", "Gives up what is being changed, if it takes long: a search for a target. The session stays as it was.")
            .query(of_session.clone())
            .answers(JSON, s.answer::<bool>()),
        Operation::get("/api/session/view", "What is so now.")
            .query(of_photograph.clone())
            .answers(JSON, s.answer::<View>()),
        Operation::get("/api/session/save", "The session as one file, which `resight measure` reads too.")
            .query(named(s, &["session", "photographs"]))
            .answers_file(&["application/toml"]),
        Operation::get("/api/session/export", "The answer in another format; JSON where none is named.")
            .query(named(s, &["session", "photo", "format"]))
            .answers_file(&["*/*"]),
        Operation::get("/api/session/exports", "The words that /api/session/export takes as its format.")
            .answers(JSON, s.answer::<Vec<String>>()),
        Operation::get("/api/session/cameras", "Common cameras and phones, each a lens that a command can state.")
            .answers(JSON, s.answer::<Vec<CommonCamera>>()),
        Operation::get("/api/session/birdseye", "The ground from straight above.")
            .query(of_photograph)
            .answers_file(&["image/png"]),
    ]
}

fn live(s: &mut Schemas) -> Vec<Operation> {
    let of_camera = s.query::<Asked>(&["camera"]);
    let action = |s: &mut Schemas, path, summary| {
        Operation::post(path, summary)
            .takes(JSON, s.given::<NamedCamera>())
            .answers(JSON, s.answer::<LiveView>())
    };
    vec![
        Operation::get("/api/live", "How every watched camera is.").answers(JSON, s.answer::<LiveView>()),
        Operation::get("/api/live/cameras", "Names of the watched cameras; none where none is watched.")
            .answers(JSON, s.answer::<Vec<String>>()),
        Operation::post(
            "/api/live/example",
            "Watches two drawn cameras, where none are watched; after some seconds one of them is moved.",
        )
        .answers(JSON, s.answer::<LiveView>()),
        action(s, "/api/live/acknowledge", "Acknowledges an alarm."),
        action(s, "/api/live/reset", "Begins the standard deviations anew."),
        action(
            s,
            "/api/live/reference",
            "Learns a camera's reference anew; the old one is kept. Asks for `confirm`.",
        ),
        Operation::get("/api/live/reference", "What a camera is compared with, by target.")
            .query(of_camera.clone())
            .answers(JSON, s.answer::<Vec<ReferenceView>>()),
        Operation::get(
            "/api/live/strip",
            "States and rotations of a camera: of the last day, or of a stretch.",
        )
        .query(s.query::<Asked>(&["camera", "from_s", "to_s", "bins"]))
        .answers(JSON, s.answer::<StripView>()),
        Operation::get("/api/live/scene", "The cameras around each target.")
            .answers(JSON, s.answer::<Vec<AroundScene>>()),
        Operation::get("/api/live/log", "What happened: the last 200 lines, oldest first.")
            .answers(JSON, s.answer::<Vec<LogLine>>()),
        Operation::get("/api/live/frame", "The next frame of a camera.")
            .query(of_camera.clone())
            .answers_file(&["image/png"]),
        Operation::get("/api/live/lens", "The lens of a camera, as a camera file.")
            .query(of_camera.clone())
            .answers_file(&["application/toml"]),
        Operation::get("/api/live/history", "Events of a camera from the history file, oldest first.")
            .query(s.query::<Asked>(&["camera", "from_s", "to_s"]))
            .answers(JSON, s.answer::<Vec<HistoryEvent>>()),
        Operation::get("/cameras.mjpg", "A camera as motion JPEG.")
            .query(of_camera)
            .answers_file(&["multipart/x-mixed-replace"]),
    ]
}

fn capture(s: &mut Schemas) -> Vec<Operation> {
    vec![
        Operation::get("/api/capture", "How the capture of intrinsics is; null where none runs.")
            .answers(JSON, s.answer::<Option<CaptureView>>()),
        Operation::post(
            "/api/capture/take-back",
            "Takes the last kept view back; what shows the target at nearly the same place is left out from then on.",
        )
        .takes(JSON, s.given::<NamedView>())
        .answers(JSON, s.answer::<CaptureView>()),
        Operation::post("/api/capture/finish", "Ends the capture, and writes the camera.")
            .answers(JSON, s.answer::<CaptureView>()),
    ]
}

fn results(s: &mut Schemas) -> Vec<Operation> {
    vec![
        Operation::post(
            "/api/rig",
            "A rig as a viewer needs it: from the answer of `resight rig --json`, rig and camera files, or both.",
        )
        .takes(JSON, s.given::<GivenFiles>())
        .answers(JSON, s.answer::<RigView>()),
        Operation::post(
            "/api/whisker",
            "Sweeps as a viewer plays them, and the object behind them: from a whisker file and hub readings, or from contacts.",
        )
        .takes(JSON, s.given::<GivenFiles>())
        .answers(JSON, s.answer::<Replay>()),
    ]
}

fn sockets(s: &mut Schemas) -> Vec<Operation> {
    vec![
        Operation::get("/ws/session", "WebSocket: commands in, views out.")
            .query(s.query::<socket::Named>(&["session", "changes"]))
            .upgrades(
                s.given::<Numbered>(),
                vec![
                    s.answer::<NumberedView>(),
                    s.answer::<socket::NumberedChanges>(),
                    s.answer::<ErrorObject>(),
                ],
            ),
        Operation::get(
            "/ws/live",
            "WebSocket: states four times a second, events as they come, a picture after each acknowledgement.",
        )
        .upgrades(s.given::<PageMessage>(), vec![s.answer::<LiveMessage>(), s.answer::<EventObject>()])
        .sends_binary(
            "A picture: the length of its header (4 bytes, the least significant first), the header (JSON), a JPEG.",
            s.answer::<PictureHeader>(),
        ),
        Operation::get(
            "/ws/capture",
            "WebSocket: the state of the capture as it changes, an image after each acknowledgement. It closes after the end.",
        )
        .upgrades(s.given::<PageMessage>(), vec![s.answer::<CaptureMessage>()])
        .sends_binary(
            "An image: the length of its header (4 bytes, the least significant first), the header (JSON), a JPEG.",
            s.answer::<CapturedHeader>(),
        ),
    ]
}

fn server() -> Vec<Operation> {
    let text = || json!({ "type": "string" });
    vec![
        Operation::get("/", "The page.").answers("text/html", text()),
        Operation::get("/app.js", "The page's script.").answers("text/javascript", text()),
        Operation::get("/app.css", "The page's style.").answers("text/css", text()),
        Operation::get("/openapi.json", "This description.").answers(JSON, json!({ "type": "object" })),
        Operation::get("/healthz", "`ok`; with status 503 `degraded` where the watch session has failed.")
            .answers("text/plain", json!({ "enum": ["ok\n", "degraded\n"] })),
    ]
}
