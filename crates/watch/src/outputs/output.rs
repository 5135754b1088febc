//! The interface of an output, and what it knows of its session.

use super::outbox::Counted;
use crate::live::Event;
use crate::log::Log;
use crate::names::Names;
use anyhow::Result;
use resight::core::temporal::monitor::Reference;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// An output receives every event in order and never waits for another program: one that talks to a server has a thread and a bounded queue of
/// its own, and reports failures in the log. An error ends the session.
pub trait Output {
    /// Processes the next event.
    fn take(&mut self, event: &Event) -> Result<()>;

    /// Ends the output with the session.
    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Passes an event to every output, even after a failure: an alarm must not get lost because a terminal is closed. Returns the first error.
pub fn tell(
    outputs: &mut [Box<dyn Output>],
    mut each: impl FnMut(&mut dyn Output) -> Result<()>,
) -> Result<()> {
    outputs.iter_mut().map(|output| each(output.as_mut())).fold(Ok(()), Result::and)
}

/// The data of a session before it starts.
pub struct Session<'a> {
    /// Names of cameras and targets.
    pub names: &'a Names,
    /// The reference of each pair, where it is known already.
    pub references: Vec<Option<Reference>>,
    /// Number of false alarms allowed per day.
    pub false_alarms_per_day: f64,
    /// The log of the session.
    pub log: &'a Log,
    /// The flag that ends the session.
    pub stop: &'a Arc<AtomicBool>,
    /// Whether the session ends with its sources.
    pub is_once: bool,
}

/// The common settings of outputs that talk to servers.
pub(super) struct Common<'a> {
    pub names: &'a Names,
    pub log: &'a Log,
    pub ca: Option<Vec<u8>>,
    pub flush_s: f64,
    /// The outputs that count their deliveries, by name.
    pub counted: Vec<(&'static str, Arc<dyn Counted>)>,
}
