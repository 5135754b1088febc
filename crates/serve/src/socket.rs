//! The WebSocket of a session: commands in, views out. It is the fast way while a point is dragged.
//!
//! The view after a command is sent at once, with the number of the command; measurements follow when they are ready, and changes by another
//! page as views with the number 0. A slow page gets only the newest of these. A page that asks for changes is sent those fields alone that differ
//! from what it was sent before on its connection: of a session with fifty measurements the view has 38 kB, which browsers read in pieces of 1 kB,
//! and of these a dragged point changes less than half.

use crate::app::App;
use crate::aside::aside;
use crate::error::Problem;
use crate::memory::Taken;
use crate::photograph::{Numbered, NumberedView, applied};
use crate::sessions::Shared;
use axum::Router;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade, close_code};
use axum::extract::{Query, State};
use axum::response::Response;
use axum::routing::any;
use resight_session::View;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, timeout};

/// Largest command by WebSocket, for every connection may hold one that is not complete; larger ones are posted.
const SOCKET_BYTES: usize = 64 << 10;
/// A page that sends nothing for this long is considered closed; it can open another connection.
const SILENCE: Duration = Duration::from_secs(3600);
/// For a client to take an answer.
const PATIENCE: Duration = Duration::from_secs(20);

/// Names a session.
#[derive(Deserialize, JsonSchema)]
pub struct Named {
    session: String,
    /// Whether views are sent as their changes: only with the fields that differ from the view before.
    #[serde(default)]
    changes: bool,
}

/// Those fields of a view that differ from the view before on the connection; all of them in the first.
#[derive(Debug, Serialize, JsonSchema)]
pub struct NumberedChanges {
    /// Of the command.
    pub seq: u64,
    /// By name.
    pub changes: BTreeMap<String, Value>,
}

/// Returns its route.
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
    let upgrade = upgrade.max_message_size(SOCKET_BYTES).max_frame_size(SOCKET_BYTES).protocols(["resight"]);
    let sent = named.changes.then(Sent::default);
    let page = Page { app, session, id: named.session, photo: 0, shown: None, sent };
    Ok(upgrade.on_upgrade(move |socket| page.talk(socket)))
}

/// A page that shows a session.
struct Page {
    app: App,
    session: Arc<Shared>,
    id: String,
    /// The photograph that it shows.
    photo: usize,
    /// What it was sent last: the version of the session, and the number of its measurements.
    shown: Option<(u64, u64)>,
    /// What it was sent of a view, where it asked for changes.
    sent: Option<Sent>,
}

impl Page {
    async fn talk(mut self, mut socket: WebSocket) {
        let mut news = self.session.news();
        let mut last_said = Instant::now();
        loop {
            let answer = tokio::select! {
                said = socket.recv() => {
                    last_said = Instant::now();
                    match said {
                        Some(Ok(Message::Text(text))) => self.answer(text.as_str()).await,
                        Some(Ok(Message::Binary(_))) => {
                            let message = "A command is a text, not binary.";
                            return left(socket, close_code::UNSUPPORTED, refused(0, "input", message)).await;
                        }
                        // What is too large is an error of the connection, as is what breaks it; the answer then goes nowhere.
                        Some(Err(_)) => {
                            let message = format!(
                                "A command by WebSocket has at most {} kB; post a longer one to /api/session/command.",
                                SOCKET_BYTES >> 10
                            );
                            return left(socket, close_code::SIZE, refused(0, "size", &message)).await;
                        }
                        Some(Ok(Message::Close(_))) | None => return,
                        Some(Ok(_)) => continue,
                    }
                }
                changed = news.changed() => {
                    let is_kept = changed.is_ok() && *news.borrow_and_update();
                    if !is_kept {
                        return;
                    }
                    match self.news().await {
                        Some(text) => text,
                        None => continue,
                    }
                }
                () = tokio::time::sleep_until(last_said + SILENCE) => return,
            };
            match timeout(PATIENCE, socket.send(Message::Text(answer.into()))).await {
                Ok(Ok(())) => {}
                _ => return,
            }
        }
    }

    /// The view after a command.
    async fn answer(&mut self, text: &str) -> String {
        let Numbered { seq, photo, command } = match serde_json::from_str(text) {
            Ok(numbered) => numbered,
            Err(reason) => {
                return refused(
                    seq_of(text),
                    "input",
                    &format!("The command is not what is needed: {reason}."),
                );
            }
        };
        // It counts as used.
        self.app.sessions.get(&self.id);
        self.photo = photo;
        let sent = self.sent_before();
        let then = move |view: View, n_measured| ((view.version, n_measured), written(seq, view, sent));
        match applied(&self.app, &self.session, photo, command, Taken::default(), then).await {
            Ok((shown, (text, sent))) => {
                (self.shown, self.sent) = (Some(shown), sent);
                text
            }
            Err(problem) => refused(seq, problem.kind(), problem.message()),
        }
    }

    /// Returns what is new; `None` where the page has it already.
    async fn news(&mut self) -> Option<String> {
        let now = self.session.now();
        let state = (now.version(), now.n_measured());
        if self.shown.is_some_and(|shown| state <= shown) {
            return None;
        }
        self.shown = Some(state);
        let (photo, sent) = (self.photo, self.sent_before());
        Some(match aside((), move || written(0, now.view(photo), sent)).await {
            Ok((text, sent)) => {
                self.sent = sent;
                text
            }
            Err(problem) => refused(0, problem.kind(), problem.message()),
        })
    }

    /// Takes what the page was sent; where no view follows, the next one has all its fields.
    fn sent_before(&mut self) -> Option<Sent> {
        self.sent.as_mut().map(std::mem::take)
    }
}

/// The view that a page was sent last.
#[derive(Default)]
struct Sent(Map<String, Value>);

impl Sent {
    /// Returns the fields that differ from those that were sent, and keeps all of them as sent.
    fn changes(&mut self, view: Map<String, Value>) -> Map<String, Value> {
        let is_new = |(name, field): &(&String, &Value)| self.0.get(*name) != Some(*field);
        let changes = view.iter().filter(is_new).map(|(name, field)| (name.clone(), field.clone()));
        let changes = changes.collect();
        self.0 = view;
        changes
    }
}

/// Writes a view, or what of it differs from what was sent before, which is returned as it is now.
fn written(seq: u64, view: View, sent: Option<Sent>) -> (String, Option<Sent>) {
    let failed = || refused(seq, "failed", "This could not be done; nothing else was lost.");
    let Some(mut sent) = sent else {
        return (serde_json::to_string(&NumberedView { seq, view }).unwrap_or_else(|_| failed()), None);
    };
    let text = match serde_json::to_value(&view) {
        Ok(Value::Object(view)) => json!({ "seq": seq, "changes": sent.changes(view) }).to_string(),
        _ => failed(),
    };
    (text, Some(sent))
}

/// Says why a connection ends, and ends it.
async fn left(mut socket: WebSocket, code: u16, why: String) {
    let end = Message::Close(Some(CloseFrame { code, reason: "".into() }));
    for message in [Message::Text(why.into()), end] {
        match timeout(PATIENCE, socket.send(message)).await {
            Ok(Ok(())) => {}
            _ => return,
        }
    }
}

/// The number of a command that is none, where it has one: also of JSON that breaks off. The first `"seq"` with a number behind it counts.
fn seq_of(text: &str) -> u64 {
    let number = |behind: &str| {
        let digits = behind.trim_start().strip_prefix(':')?.trim_start();
        let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        digits[..end].parse().ok()
    };
    text.split("\"seq\"").skip(1).find_map(number).unwrap_or(0)
}

fn refused(seq: u64, kind: &str, message: &str) -> String {
    json!({ "seq": seq, "error": { "kind": kind, "message": message } }).to_string()
}

#[cfg(test)]
mod tests {
    use super::{Sent, seq_of};
    use serde_json::{Value, json};

    #[test]
    fn only_what_differs_is_sent_again() {
        let mut sent = Sent::default();
        let mut changes =
            |view: Value| Value::Object(sent.changes(view.as_object().expect("an object").clone()));
        assert_eq!(changes(json!({ "a": 1, "b": [2] })), json!({ "a": 1, "b": [2] }));
        assert_eq!(changes(json!({ "a": 1, "b": [3] })), json!({ "b": [3] }));
        assert_eq!(changes(json!({ "a": 1, "b": [3] })), json!({}));
        assert_eq!(changes(json!({ "a": null, "b": [2] })), json!({ "a": null, "b": [2] }));
    }

    #[test]
    fn a_broken_command_keeps_its_number() {
        for (text, seq) in [
            (r#"{"seq":7,"command":{"kind":"nothing"}}"#, 7),
            (r#"{"photo":0, "seq" : 12, "command":{"kind":"#, 12),
            (r#"{"name":"\"seq\":3","seq":4"#, 4),
            (r#"{"seq":"5"}"#, 0),
            (r#"{"seq":99999999999999999999}"#, 0),
            ("nothing", 0),
        ] {
            assert_eq!(seq_of(text), seq, "{text}");
        }
    }
}
