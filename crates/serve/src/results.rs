//! Results dropped in: a rig, and the sweeps of a whisker, from the files that the program writes and reads.
//!
//! Names of files serve messages; nothing is read from a disk.

use crate::app::App;
use crate::aside::{aside, turn};
use crate::body::{VALUE_BYTES, check_values, n_values, receive};
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
/// Values in all of them: as many as 32 MB have with ten digits each.
const MOST_VALUES: usize = 3 << 20;

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
    let show = |given: &GivenFiles| rig_view(&given.texts(&RIG)).map_err(|fault| sentence(&fault));
    Ok(Json(solved(&app, request, show).await?))
}

async fn whisker(State(app): State<App>, request: Request) -> Result<Json<Replay>, Problem> {
    let play = |given: &GivenFiles| replay(&given.texts(&WHISKER)).map_err(|fault| sentence(&fault));
    Ok(Json(solved(&app, request, play).await?))
}

/// Reads and solves what a request gives. One request at a time: twenty thousand readings take seconds.
async fn solved<T: Send + 'static>(
    app: &App,
    request: Request,
    solve: impl FnOnce(&GivenFiles) -> Result<T, String> + Send + 'static,
) -> Result<T, Problem> {
    let body = receive(app, request, BYTES).await?;
    let turn = turn(&app.solving).await?;
    let needed = "Give {\"files\": [{\"name\": …, \"text\": …}]} or {\"example\": true}";
    let (given, texts) = body.json::<GivenFiles>(app, needed).await?;
    if MOST_FILES < given.files.len() {
        let n = given.files.len();
        return Err(Problem::input(format!("{n} files; at most {MOST_FILES} are taken.")));
    }
    let count = move || (given.files.iter().map(|file| n_values(&file.text)).sum::<usize>(), given);
    let (n, given) = aside((), count).await?;
    check_values(n, MOST_VALUES)?;
    let reading = app.take(VALUE_BYTES * n)?;
    aside((turn, texts, reading), move || solve(&given)).await?.map_err(Problem::input)
}

/// A reason as a sentence.
fn sentence(reason: &dyn std::fmt::Display) -> String {
    let reason = reason.to_string();
    format!("{}.", reason.trim_start_matches(": ").trim_end_matches('.'))
}

impl GivenFiles {
    fn texts<'a>(&'a self, example: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
        match self.example {
            true => example.to_vec(),
            false => self.files.iter().map(|file| (file.name.as_str(), file.text.as_str())).collect(),
        }
    }
}
