//! Results dropped in: a rig, and the sweeps of a whisker, from the files that the program writes and reads.
//!
//! Names of files serve messages; nothing is read from a disk.

use crate::app::App;
use crate::aside::aside;
use crate::body::receive;
use crate::error::Problem;
use axum::extract::{Request, State};
use axum::routing::post;
use axum::{Json, Router};
use resight::answer::{RigView, rig_view};
use resight_whisker::replay::{Replay, replay};
use schemars::JsonSchema;
use serde::Deserialize;

/// Largest request, bytes.
const BYTES: usize = 32 << 20;
/// Files of a request.
const MOST_FILES: usize = 16;

/// The example of a rig: four simulated cameras around a board; `examples/rig` describes it.
const RIG: [(&str, &str); 2] = [
    ("answer.json", include_str!("../../../examples/rig/answer.json")),
    ("rig.toml", include_str!("../../../examples/rig/rig.toml")),
];
/// The example of a whisker: a square, swept three times, simulated with a load cell's noise.
const WHISKER: [(&str, &str); 3] = [
    ("whisker.json", include_str!("../../../testdata/whisker/whisker.json")),
    ("hub.csv", include_str!("../../../testdata/whisker/hub.csv")),
    ("square.json", include_str!("../../../testdata/whisker/square.json")),
];

/// Files that belong together, or the example that comes with the program.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GivenFiles {
    files: Vec<GivenFile>,
    example: bool,
}

/// A file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GivenFile {
    /// Its name, for messages; nothing of that name is opened.
    name: String,
    /// Its contents.
    text: String,
}

/// The routes.
pub fn routes() -> Router<App> {
    Router::new().route("/api/rig", post(rig)).route("/api/whisker", post(whisker))
}

async fn rig(State(app): State<App>, request: Request) -> Result<Json<RigView>, Problem> {
    let given = given(&app, request).await?;
    let _turn = app.solving.acquire().await.map_err(|_| Problem::failed())?;
    let shown = aside(move || rig_view(&given.texts(&RIG)).map_err(|fault| sentence(&fault)));
    Ok(Json(shown.await?.map_err(Problem::input)?))
}

async fn whisker(State(app): State<App>, request: Request) -> Result<Json<Replay>, Problem> {
    let given = given(&app, request).await?;
    // One request at a time: twenty thousand readings take seconds.
    let _turn = app.solving.acquire().await.map_err(|_| Problem::failed())?;
    let played = aside(move || replay(&given.texts(&WHISKER)).map_err(|fault| sentence(&fault)));
    Ok(Json(played.await?.map_err(Problem::input)?))
}

/// A reason as a sentence.
fn sentence(reason: &dyn std::fmt::Display) -> String {
    let reason = reason.to_string();
    format!("{}.", reason.trim_start_matches(": ").trim_end_matches('.'))
}

async fn given(app: &App, request: Request) -> Result<GivenFiles, Problem> {
    let body = receive(app, request, BYTES).await?;
    let needed = "Give {\"files\": [{\"name\": …, \"text\": …}]} or {\"example\": true}";
    let given: GivenFiles = body.json(needed)?;
    match given.files.len() {
        n if MOST_FILES < n => Err(Problem::input(format!("{n} files; at most {MOST_FILES} are taken."))),
        _ => Ok(given),
    }
}

impl GivenFiles {
    fn texts<'a>(&'a self, example: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
        match self.example {
            true => example.to_vec(),
            false => self.files.iter().map(|file| (file.name.as_str(), file.text.as_str())).collect(),
        }
    }
}
