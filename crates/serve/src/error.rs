//! Errors of requests, as JSON: `{"error": {"kind", "message"}}`.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use schemars::JsonSchema;
use serde::Serialize;

/// A refusal.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Problem {
    #[serde(skip)]
    #[schemars(skip)]
    status: u16,
    /// A word that programs can rely on.
    kind: &'static str,
    /// A sentence with the way out.
    message: String,
}

/// The object around it.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ErrorObject {
    error: Problem,
}

impl Problem {
    /// Creates an error with its status code.
    pub fn new(status: StatusCode, kind: &'static str, message: impl Into<String>) -> Self {
        Problem { status: status.as_u16(), kind, message: message.into() }
    }

    /// The word.
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// The sentence.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Creates an error for input that cannot be used.
    pub fn input(message: impl Into<String>) -> Self {
        Problem::new(StatusCode::UNPROCESSABLE_ENTITY, "input", message)
    }

    /// Creates an error for something that does not exist.
    pub fn missing(message: impl Into<String>) -> Self {
        Problem::new(StatusCode::NOT_FOUND, "not_found", message)
    }

    /// A thread that failed: the request is lost, nothing else.
    pub fn failed() -> Self {
        Problem::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            "failed",
            "This could not be done; nothing else was lost.",
        )
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        (status, Json(ErrorObject { error: self })).into_response()
    }
}
