//! The bodies of requests and of large answers: each route has its limit, and all of them together what memory is left.

use crate::app::App;
use crate::error::Problem;
use crate::guard::must_be_json;
use crate::memory::{Taken, full};
use axum::body::{Body, Bytes};
use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode, header};
use futures_core::Stream;
use serde::Deserialize;
use std::future::poll_fn;
use std::pin::pin;

/// Room is made in steps of this size at most, bytes.
const STEP_BYTES: usize = 1 << 20;

/// A body, and the memory that it has taken.
pub struct Received {
    /// The headers of the request.
    pub headers: HeaderMap,
    /// The body.
    pub bytes: Vec<u8>,
    /// Given back when the request is done with.
    _taken: Taken,
}

impl Received {
    /// Parses the body as JSON.
    ///
    /// # Errors
    /// Another media type, or other JSON than needed.
    pub fn json<T: for<'a> Deserialize<'a>>(&self, needed: &str) -> Result<T, Problem> {
        must_be_json(&self.headers)?;
        serde_json::from_slice(&self.bytes).map_err(|reason| Problem::input(format!("{needed}: {reason}.")))
    }
}

/// The bytes of an answer, which keep their memory until the last of them is sent or the client has left.
struct Sending {
    bytes: Vec<u8>,
    _taken: Taken,
}

impl AsRef<[u8]> for Sending {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// Returns the body of an answer that counts for the memory `taken`, resized to its length, until it is sent. No session goes for it: clients that
/// are slow to take answers cost others nothing.
///
/// # Errors
/// No memory left.
pub fn sending(app: &App, bytes: Vec<u8>, mut taken: Taken) -> Result<Body, Problem> {
    if !app.memory.resize(&mut taken, bytes.len()) {
        return Err(full());
    }
    Ok(Body::from(Bytes::from_owner(Sending { bytes, _taken: taken })))
}

/// Receives a body of at most `limit` bytes.
///
/// # Errors
/// A larger body; an interrupted request; no memory left.
pub async fn receive(app: &App, request: Request, limit: usize) -> Result<Received, Problem> {
    let (parts, body) = request.into_parts();
    let too_large = || {
        let message = format!("This is larger than {} MB, the most that is taken here.", limit >> 20);
        Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "size", message)
    };
    let stated =
        parts.headers.get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse::<usize>().ok());
    if stated.is_some_and(|bytes| limit < bytes) {
        return Err(too_large());
    }
    let (mut bytes, mut taken) = (Vec::new(), Taken::default());
    let mut parts_of_body = pin!(body.into_data_stream());
    while let Some(part) = poll_fn(|context| parts_of_body.as_mut().poll_next(context)).await {
        let broken = |_| Problem::new(StatusCode::BAD_REQUEST, "broken", "The request broke off.");
        let part: Bytes = part.map_err(broken)?;
        if limit - bytes.len() < part.len() {
            return Err(too_large());
        }
        if bytes.capacity() - bytes.len() < part.len() {
            let more = part.len().max(bytes.len().min(STEP_BYTES));
            app.make_room(&mut taken, bytes.len() + more)?;
            bytes.reserve_exact(more);
        }
        bytes.extend_from_slice(&part);
    }
    Ok(Received { headers: parts.headers, bytes, _taken: taken })
}
