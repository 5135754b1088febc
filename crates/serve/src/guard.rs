//! Before anything is routed: the name the request came by, the page it came from, the token it brings; and the headers of every answer.

use crate::error::Problem;
use axum::body::to_bytes;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use resight_watch::web::access::Access;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::timeout;

/// The page's own files hold no data, and a page must be there to ask for the token.
const OPEN: [&str; 5] = ["/", "/app.js", "/app.css", "/healthz", "/openapi.json"];

/// No route takes a larger body, bytes; each has a limit of its own besides.
const LARGEST: usize = 192 << 20;

/// Largest part of a plain-text refusal that is kept, bytes.
const MOST_SAID: usize = 4096;

const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; script-src 'self'; connect-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The outermost layer.
pub async fn guard(State(access): State<Arc<Access>>, request: Request, next: Next) -> Response {
    let mut response = match admitted(&access, &request) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}

/// A request that takes longer is given up.
pub async fn in_time(State(patience): State<Duration>, request: Request, next: Next) -> Response {
    let late = || Problem::new(StatusCode::REQUEST_TIMEOUT, "time", "This took too long; send it again.");
    timeout(patience, next.run(request)).await.unwrap_or_else(|_| late().into_response())
}

/// Converts plain-text refusals that precede a route (a query that lacks a key, a body that is too large) to the form of all other refusals.
pub async fn in_one_form(request: Request, next: Next) -> Response {
    let response = next.run(request).await;
    let is_plain =
        text(response.headers(), &header::CONTENT_TYPE).is_some_and(|kind| kind.starts_with("text/plain"));
    let status = response.status();
    if !status.is_client_error() || !is_plain {
        return response;
    }
    let said = to_bytes(response.into_body(), MOST_SAID).await.unwrap_or_default();
    let said = String::from_utf8_lossy(&said);
    let kind = if status == StatusCode::PAYLOAD_TOO_LARGE { "size" } else { "request" };
    Problem::new(status, kind, format!("{}.", said.trim().trim_end_matches('.'))).into_response()
}

fn admitted(access: &Access, request: &Request) -> Result<(), Problem> {
    let headers = request.headers();
    // A request that names the host in its target names it there too.
    let host = request.uri().authority().map(|a| a.as_str()).or_else(|| text(headers, &header::HOST));
    let is_named_twice = 1 < headers.get_all(header::HOST).iter().count();
    if is_named_twice || !host.is_some_and(|host| access.knows_host(host)) {
        let message = "This host name is not allowed; see --allowed-host.";
        return Err(Problem::new(StatusCode::MISDIRECTED_REQUEST, "host", message));
    }
    let length = text(headers, &header::CONTENT_LENGTH).and_then(|length| length.parse::<usize>().ok());
    if length.is_some_and(|length| LARGEST < length) {
        let message = format!("This is larger than {} MB, the most that is taken.", LARGEST >> 20);
        return Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "size", message));
    }
    let is_plain_page = request.method() == Method::GET && OPEN.contains(&request.uri().path());
    let origin = text(headers, &header::ORIGIN);
    let is_foreign =
        headers.contains_key(header::ORIGIN) && (origin.is_none() || !access.knows_origin(origin));
    let is_cross = matches!(
        headers.get("sec-fetch-site").map(HeaderValue::as_bytes),
        Some(b"cross-site" | b"same-site")
    );
    if is_foreign || (is_cross && !is_plain_page) {
        return Err(Problem::new(StatusCode::FORBIDDEN, "origin", "Pages of other addresses get no answer."));
    }
    if is_plain_page || access.admits(token(headers).as_deref()) {
        return Ok(());
    }
    Err(Problem::new(StatusCode::UNAUTHORIZED, "token", "A token is needed: Authorization: Bearer TOKEN."))
}

/// `Authorization`; browsers cannot set it for a WebSocket, which brings `bearer.TOKEN` among its protocols.
fn token(headers: &HeaderMap) -> Option<String> {
    if let Some(given) = text(headers, &header::AUTHORIZATION) {
        return Some(given.to_owned());
    }
    let offered = text(headers, &header::SEC_WEBSOCKET_PROTOCOL)?;
    let token = offered.split(',').find_map(|word| word.trim().strip_prefix("bearer."))?;
    Some(format!("Bearer {token}"))
}

fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}

/// Refuses requests that do not declare JSON, which a form of another page cannot do.
pub fn must_be_json(headers: &HeaderMap) -> Result<(), Problem> {
    let given = text(headers, &header::CONTENT_TYPE).unwrap_or_default();
    match given.split(';').next().unwrap_or_default().trim().eq_ignore_ascii_case("application/json") {
        true => Ok(()),
        false => Err(Problem::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "media_type",
            "Send Content-Type: application/json.",
        )),
    }
}
