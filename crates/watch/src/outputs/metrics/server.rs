//! The server: one thread, few connections, short time limits. A slow or frequent client delays other clients, never the cameras.

use super::exposition;
use super::tally::Tally;
use crate::web::access::Access;
use crate::web::{Patience, accept};
use anyhow::{Context, Result};
use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::net::TcpListener;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Longest time of a whole connection, which serves one request.
const PATIENCE: Duration = Duration::from_secs(10);
#[derive(Clone)]
struct Shared {
    tally: Arc<Mutex<Tally>>,
    access: Access,
}

/// Serves until the program ends.
///
/// # Errors
/// The operating system provides no thread.
pub fn start(listener: TcpListener, tally: Arc<Mutex<Tally>>, access: Access) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let routes = routes(Shared { tally, access });
    let serve = move || {
        // Binding has succeeded before; there is no receiver for an error here.
        let _ = runtime.block_on(accept(listener, routes, Patience::OneRequest(PATIENCE)));
    };
    std::thread::Builder::new().name("metrics".to_string()).spawn(serve).context("a thread for --metrics")?;
    Ok(())
}

fn routes(shared: Shared) -> Router {
    Router::new()
        .route("/metrics", get(metrics))
        .route("/healthz", get(health))
        .fallback(async || (StatusCode::NOT_FOUND, "not found\n"))
        .layer(middleware::from_fn_with_state(shared.clone(), check_host))
        .with_state(shared)
}

/// Refuses an unknown host name before anything else: such a name belongs to a page that had its name point to this machine.
async fn check_host(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    if !text(request.headers(), &header::HOST).is_some_and(|host| shared.access.knows_host(host)) {
        return (StatusCode::FORBIDDEN, "this host name is not allowed; see --metrics-host\n")
            .into_response();
    }
    next.run(request).await
}

async fn metrics(State(shared): State<Shared>, headers: HeaderMap) -> Response {
    if !shared.access.admits(text(&headers, &header::AUTHORIZATION)) {
        let asked = [(header::WWW_AUTHENTICATE, "Bearer")];
        return (StatusCode::UNAUTHORIZED, asked, "a token is needed\n").into_response();
    }
    // The page is written from a copy, so that the next event does not wait for it.
    let tally = shared.tally.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let page = exposition::page(&tally);
    ([(header::CONTENT_TYPE, exposition::CONTENT_TYPE)], page).into_response()
}

/// Returns an answer without details, for clients that may not read the metrics.
async fn health(State(shared): State<Shared>) -> Response {
    let is_well = shared.tally.lock().unwrap_or_else(PoisonError::into_inner).is_well();
    match is_well {
        true => (StatusCode::OK, "ok\n").into_response(),
        false => (StatusCode::SERVICE_UNAVAILABLE, "degraded\n").into_response(),
    }
}

fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}
