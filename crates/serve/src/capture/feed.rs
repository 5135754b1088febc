//! The WebSocket of a capture: its state when it has changed, and the newest image after each acknowledgement.

use super::routes::capturing;
use super::{CaptureMessage, CaptureView, Capturing};
use crate::app::App;
use crate::aside::aside;
use crate::error::Problem;
use crate::live::feed::{MESSAGE_BYTES, PATIENCE, PageMessage, WRITE_BYTES};
use axum::Router;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use axum::routing::any;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tokio::time::timeout;

/// Returns its route.
pub fn routes() -> Router<App> {
    Router::new().route("/ws/capture", any(open))
}

async fn open(State(app): State<App>, upgrade: WebSocketUpgrade) -> Result<Response, Problem> {
    let capture = Arc::clone(capturing(&app)?);
    let upgrade =
        upgrade.max_message_size(MESSAGE_BYTES).write_buffer_size(WRITE_BYTES).protocols(["resight"]);
    Ok(upgrade.on_upgrade(move |socket| show(socket, capture)))
}

/// A page that looks; counted, however it leaves.
struct Page(Arc<Capturing>);

impl Page {
    fn of(capture: &Arc<Capturing>) -> Self {
        capture.pages.fetch_add(1, Ordering::Relaxed);
        Page(Arc::clone(capture))
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.0.pages.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Until the page leaves, or has taken the end.
async fn show(mut socket: WebSocket, capture: Arc<Capturing>) {
    let _page = Page::of(&capture);
    let (mut views, mut images) = (capture.view.subscribe(), capture.image.subscribe());
    views.mark_changed();
    images.mark_changed();
    let mut is_ready = true;
    loop {
        let mut is_over = false;
        let message = tokio::select! {
            said = socket.recv() => {
                match said {
                    Some(Ok(Message::Text(text))) => is_ready |= is_acknowledgement(&text),
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                    Some(Ok(_)) => {}
                }
                continue;
            }
            Ok(()) = views.changed() => {
                let view = views.borrow_and_update().clone();
                is_over = view.is_over;
                Some(text(&view))
            }
            Ok(()) = images.changed(), if is_ready => {
                let newest = images.borrow_and_update().clone();
                let encoded = aside((), move || newest.and_then(|image| image.message())).await.ok().flatten();
                is_ready = encoded.is_none();
                encoded.map(Message::Binary)
            }
        };
        let Some(message) = message else { continue };
        if !matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(()))) || is_over {
            break;
        }
    }
    let _ = timeout(PATIENCE, socket.send(Message::Close(None))).await;
}

fn text(view: &CaptureView) -> Message {
    Message::Text(json!(CaptureMessage { capture: view }).to_string().into())
}

fn is_acknowledgement(text: &str) -> bool {
    serde_json::from_str::<PageMessage>(text).is_ok_and(|message| message.ack.is_some())
}
