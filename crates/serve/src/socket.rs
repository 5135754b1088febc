//! The WebSocket of a session: commands up, views down. The fast way while a point is dragged.

use crate::app::App;
use crate::error::Problem;
use crate::photograph::{COMMAND_BYTES, Numbered, NumberedView, aside, locked};
use crate::sessions::Shared;
use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, State};
use axum::response::Response;
use axum::routing::any;
use schemars::JsonSchema;
use serde::Deserialize;
use std::time::Duration;
use tokio::time::timeout;

/// A page that says nothing for so long is gone; it opens another.
const SILENCE: Duration = Duration::from_secs(3600);
/// For a client to take an answer.
const PATIENCE: Duration = Duration::from_secs(20);

/// Names a session.
#[derive(Deserialize, JsonSchema)]
pub struct Named {
    session: String,
}

/// Its route.
pub fn routes() -> Router<App> {
    Router::new().route("/ws/session", any(open))
}

async fn open(
    State(app): State<App>,
    Query(named): Query<Named>,
    upgrade: WebSocketUpgrade,
) -> Result<Response, Problem> {
    let gone = || Problem::missing("There is no such session any more.");
    let session = app.sessions.get(&named.session).ok_or_else(gone)?;
    let upgrade =
        upgrade.max_message_size(COMMAND_BYTES).max_frame_size(COMMAND_BYTES).protocols(["resight"]);
    Ok(upgrade.on_upgrade(move |socket| talk(socket, session)))
}

async fn talk(mut socket: WebSocket, session: Shared) {
    while let Ok(Some(Ok(message))) = timeout(SILENCE, socket.recv()).await {
        let text = match message {
            Message::Text(text) => text,
            Message::Close(_) => return,
            _ => continue,
        };
        let answer = answer(&session, text.as_str()).await;
        match timeout(PATIENCE, socket.send(Message::Text(answer.into()))).await {
            Ok(Ok(())) => {}
            _ => return,
        }
    }
}

async fn answer(session: &Shared, text: &str) -> String {
    let Numbered { seq, photo, command } = match serde_json::from_str(text) {
        Ok(numbered) => numbered,
        Err(reason) => return refused(&format!("The command is not what is needed: {reason}.")),
    };
    let session = Shared::clone(session);
    let done = aside(move || {
        let view = locked(&session).apply(photo, command);
        serde_json::to_string(&NumberedView { seq, view })
    });
    match done.await {
        Ok(Ok(text)) => text,
        _ => refused("This could not be done; nothing else was lost."),
    }
}

fn refused(message: &str) -> String {
    serde_json::json!({ "error": { "kind": "input", "message": message } }).to_string()
}
