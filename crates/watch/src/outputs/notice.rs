//! Notices to other programs: changes of state, what moved, sources lost and back. The same object as the JSON line, and its origin.

use super::super::names::Names;
use super::outbox::Weight;
use super::retry::random;
use super::said::EventText;
use crate::live::{Event, State};
use serde_json::{Value, json};

/// A notice.
#[derive(Debug, Clone)]
pub struct Notice {
    /// Unique among all sessions, so that a receiver recognises a repeated notice.
    pub id: String,
    /// Its weight when the queue is full.
    pub weight: Weight,
    /// The JSON line, with `id`, `host` and `text`.
    pub body: Value,
}

/// Builds notices of events.
pub struct Notices {
    said: EventText,
    host: String,
    session: u64,
    made: u64,
}

impl Notices {
    pub fn new(names: &Names) -> Self {
        Notices { said: EventText::new(names), host: host(), session: random(), made: 0 }
    }

    /// Returns the notice of an event; none for events that others do not receive: frames, counts, references, ends.
    pub fn of(&mut self, event: &Event) -> Option<Notice> {
        let weight = weight(event)?;
        self.made += 1;
        let id = format!("{:016x}-{}", self.session, self.made);
        let mut body = self.said.object(event);
        body["id"] = json!(id);
        body["host"] = json!(self.host);
        body["text"] = json!(self.said.words(event));
        Some(Notice { id, weight, body })
    }

    /// Returns the object of a frame.
    pub fn frame(&self, event: &Event) -> Value {
        self.said.object(event)
    }
}

/// Returns what an event weighs where some must be dropped; none for events that others do not receive.
pub(super) fn weight(event: &Event) -> Option<Weight> {
    match event {
        Event::StateChanged { state, .. } => Some(match state {
            State::Drifted(_) | State::Inconsistent | State::Stale { .. } => Weight::Alarm,
            _ => Weight::Routine,
        }),
        Event::Attributed { .. }
        | Event::MovedWhileLearning { .. }
        | Event::Source { connected: false, .. } => Some(Weight::Alarm),
        Event::Source { .. } => Some(Weight::Routine),
        _ => None,
    }
}

/// Returns the name of this machine.
pub fn host() -> String {
    let kernel = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let named = ["HOSTNAME", "COMPUTERNAME"].into_iter().filter_map(|name| std::env::var(name).ok());
    let name = kernel.into_iter().chain(named).map(|name| name.trim().to_string());
    name.into_iter().find(|name| !name.is_empty()).unwrap_or_else(|| "unknown".to_string())
}
