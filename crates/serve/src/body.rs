//! The bodies of requests and of large answers: each route has its limit, and all of them together what memory is left.

use crate::app::App;
use crate::aside::aside;
use crate::error::Problem;
use crate::guard::must_be_json;
use crate::memory::{Taken, full};
use axum::body::{Body, Bytes};
use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode, header};
use futures_core::Stream;
use serde::de::DeserializeOwned;
use std::future::poll_fn;
use std::pin::pin;

/// Room is made in steps of this size at most, bytes.
const STEP_BYTES: usize = 1 << 20;

/// JSON up to this size is parsed where it is received, on one of the two threads that answer: it takes a millisecond and a few megabytes.
const SHORT_BYTES: usize = 64 << 10;
/// Most JSON besides the files that are texts in it, bytes.
const BESIDE_FILES_BYTES: usize = 1 << 20;
/// Longer texts are files.
const FILE_BYTES: usize = 1 << 10;
/// Memory that one value takes at most while its text is parsed: `[0]` in a list is an entry of it, and a list with room for four entries.
pub const VALUE_BYTES: usize = 128;

/// A body, and the memory that it has taken.
pub struct Received {
    /// The headers of the request.
    pub headers: HeaderMap,
    /// The body.
    pub bytes: Vec<u8>,
    /// Given back when the request is done with.
    pub taken: Taken,
}

impl Received {
    /// Parses the body as JSON, and returns it with the memory that its texts take. Long bodies are parsed beside the threads that answer, where
    /// there is memory for it.
    ///
    /// # Errors
    /// Another media type, other JSON than needed, or more of it besides files than is taken; no memory left.
    pub async fn json<T: DeserializeOwned + Send + 'static>(
        self,
        app: &App,
        needed: &'static str,
    ) -> Result<(T, Taken), Problem> {
        must_be_json(&self.headers)?;
        if self.bytes.len() <= SHORT_BYTES {
            return parsed(self, needed);
        }
        let extent = move || (Extent::of(&self.bytes), self);
        let (extent, body) = aside((), extent).await?;
        if BESIDE_FILES_BYTES < extent.bytes {
            let message =
                format!("This is larger than {} MB besides the files in it.", BESIDE_FILES_BYTES >> 20);
            return Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "size", message));
        }
        let parsing = app.take(body.bytes.len() + VALUE_BYTES * extent.n_values)?;
        aside(parsing, move || parsed(body, needed)).await?
    }
}

fn parsed<T: DeserializeOwned>(body: Received, needed: &str) -> Result<(T, Taken), Problem> {
    let broken = |reason| Problem::input(format!("{needed}: {reason}."));
    Ok((serde_json::from_slice(&body.bytes).map_err(broken)?, body.taken))
}

/// What a JSON text has besides files.
#[derive(Debug, Default, PartialEq)]
struct Extent {
    bytes: usize,
    n_values: usize,
}

impl Extent {
    fn of(json: &[u8]) -> Self {
        let mut all = Extent::default();
        let (mut text, mut is_escaped) = (None, false);
        for byte in json {
            match (&mut text, byte) {
                (None, b'"') => text = Some(0),
                (None, byte) => {
                    all.bytes += 1;
                    all.n_values += usize::from(b",:[{".contains(byte));
                }
                (Some(length), b'"') if !is_escaped => {
                    all.bytes += if *length <= FILE_BYTES { *length } else { 0 };
                    text = None;
                }
                (Some(length), byte) => {
                    *length += 1;
                    is_escaped = *byte == b'\\' && !is_escaped;
                }
            }
        }
        all
    }
}

/// Returns the number of values in a file of any format, or a little more: of what separates them. Parsing takes [`VALUE_BYTES`] for each.
pub fn n_values(text: &str) -> usize {
    let (mut n, mut is_after_value) = (0, false);
    for byte in text.bytes() {
        let is_separator = b",;:[{<".contains(&byte);
        let is_space = byte.is_ascii_whitespace();
        n += usize::from(is_separator || (is_space && is_after_value));
        is_after_value = !is_separator && !is_space;
    }
    n
}

/// Refuses files with more values than a route takes.
pub fn check_values(n: usize, most: usize) -> Result<(), Problem> {
    if n <= most {
        return Ok(());
    }
    let message = format!(
        "There are about {n} values in what was given; {most} are read here at most: give it in parts."
    );
    Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "size", message))
}

/// The bytes of an answer, which keep their memory until the last of them is sent or the client has left.
struct Sending<B> {
    bytes: B,
    _taken: Taken,
}

impl<B: AsRef<[u8]>> AsRef<[u8]> for Sending<B> {
    fn as_ref(&self) -> &[u8] {
        self.bytes.as_ref()
    }
}

/// Returns the body of an answer that counts for the memory `taken`, resized to its length, until it is sent. No session goes for it: clients that
/// are slow to take answers cost others nothing.
///
/// # Errors
/// No memory left.
pub fn sending(
    app: &App,
    bytes: impl AsRef<[u8]> + Send + 'static,
    mut taken: Taken,
) -> Result<Body, Problem> {
    if !app.memory.resize(&mut taken, bytes.as_ref().len()) {
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
    Ok(Received { headers: parts.headers, bytes, taken })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_without_its_files_is_short() {
        let file = "\\\"[0],".repeat(1000);
        let json = format!("{{\"a\": [0, [1]], \"text\": \"{file}\"}}");
        let beside = json.len() - file.len() - 6; // Quotes are not counted.
        assert_eq!(Extent::of(json.as_bytes()), Extent { bytes: beside, n_values: 7 });
        let broken = Extent::of(b"[\"never ended");
        assert_eq!(broken, Extent { bytes: 1, n_values: 1 });
    }

    #[test]
    fn values_are_counted_in_every_format() {
        for (text, n) in [
            ("[0,0,0]", 3),
            ("{\n  \"a\": 1,\n  \"b\": 2\n}", 5),
            ("a,b\n1,2\n", 4),
            ("- 1\n- 2\n", 4),
            ("1 2 3\n", 3),
            (",,,", 3),
            ("", 0),
        ] {
            assert_eq!(n_values(text), n, "{text}");
        }
    }
}
