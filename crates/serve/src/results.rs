//! Results dropped in: a rig's answer and a whisker's sweep, as the page draws them.

use crate::app::App;
use crate::error::Problem;
use crate::guard::must_be_json;
use axum::body::Bytes;
use axum::extract::DefaultBodyLimit;
use axum::http::HeaderMap;
use axum::routing::post;
use axum::{Json, Router};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

/// Largest result, bytes.
const BYTES: usize = 32 << 20;

/// A camera of a rig.
#[derive(Debug, Serialize, JsonSchema)]
pub struct RigCamera {
    name: String,
    /// Where it is in the rig's frame.
    position_m: Option<[f64; 3]>,
    /// Row by row: axes of the camera are its columns.
    rotation: Option<[[f64; 3]; 3]>,
    /// Covariance of the position, rig's frame.
    covariance_m2: Option<[[f64; 3]; 3]>,
    /// The camera's own object in the answer.
    details: Value,
}

/// What the page needs of a rig.
#[derive(Debug, Serialize, JsonSchema)]
pub struct RigView {
    status: String,
    message: String,
    reference: Option<String>,
    cameras: Vec<RigCamera>,
    /// The whole answer: tables are shown from it.
    answer: Value,
}

/// The routes.
pub fn routes() -> Router<App> {
    Router::new().route("/api/rig", post(rig).layer(DefaultBodyLimit::max(BYTES)))
}

async fn rig(headers: HeaderMap, body: Bytes) -> Result<Json<RigView>, Problem> {
    must_be_json(&headers)?;
    let fault =
        |reason: String| Problem::input(format!("This is no answer of `resight rig --json`: {reason}."));
    let answer: Value = serde_json::from_slice(&body).map_err(|reason| fault(reason.to_string()))?;
    let text = |key: &str| answer.get(key).and_then(Value::as_str).map(str::to_owned);
    let status = text("status").ok_or_else(|| fault("it has no status".to_owned()))?;
    let Some(cameras) = answer.get("cameras") else { return Err(fault("it has no cameras".to_owned())) };
    let cameras = match cameras {
        Value::Object(by_name) => by_name.iter().map(|(name, one)| camera(name.clone(), one)).collect(),
        Value::Array(all) => all
            .iter()
            .map(|one| camera(one.get("name").and_then(Value::as_str).unwrap_or("camera").to_owned(), one))
            .collect(),
        _ => return Err(fault("its cameras are no list".to_owned())),
    };
    let (message, reference) = (text("message").unwrap_or_default(), text("reference"));
    Ok(Json(RigView { status, message, reference, cameras, answer }))
}

/// cam_from_rig of an answer, turned round: where the camera is.
fn camera(name: String, one: &Value) -> RigCamera {
    let numbers = |v: &Value| -> Option<Vec<f64>> { v.as_array()?.iter().map(Value::as_f64).collect() };
    let rows = |v: &Value| -> Option<Vec<Vec<f64>>> { v.as_array()?.iter().map(numbers).collect() };
    let matrix = one.get("cam_from_rig").and_then(|pose| rows(pose.get("matrix")?));
    let matrix = matrix.filter(|m| m.len() == 4 && m.iter().all(|row| row.len() == 4));
    let rotation = matrix.as_ref().map(|m| std::array::from_fn(|i| std::array::from_fn(|j| m[j][i])));
    let position_m =
        matrix.as_ref().map(|m| std::array::from_fn(|i| -(0..3).map(|k| m[k][i] * m[k][3]).sum::<f64>()));
    let covariance =
        one.get("covariance").and_then(rows).filter(|c| c.len() == 6 && c.iter().all(|row| row.len() == 6));
    let covariance_m2 = matrix.zip(covariance).map(|(m, c)| {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                (0..9).map(|k| m[k / 3][i] * c[3 + k / 3][3 + k % 3] * m[k % 3][j]).sum::<f64>()
            })
        })
    });
    RigCamera { name, position_m, rotation, covariance_m2, details: one.clone() }
}
