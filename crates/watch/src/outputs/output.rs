//! What an output is, and what it knows of its session.

use super::outbox::Counted;
use crate::live::Event;
use crate::log::Log;
use crate::names::Names;
use anyhow::Result;
use resight::core::temporal::monitor::Reference;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Takes every event, in order, and never waits for anybody else: an output that talks to a server has a thread and a bounded
/// queue of its own, and says in the log what went wrong. An error ends the session.
pub trait Output {
    /// The next event.
    fn take(&mut self, event: &Event) -> Result<()>;

    /// The session is over.
    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Tells every output, whatever becomes of the others: an alarm must not get lost because a terminal is closed. The first error is kept.
pub fn tell(
    outputs: &mut [Box<dyn Output>],
    mut each: impl FnMut(&mut dyn Output) -> Result<()>,
) -> Result<()> {
    outputs.iter_mut().map(|output| each(output.as_mut())).fold(Ok(()), Result::and)
}

/// What is known of a session before it starts.
pub struct Session<'a> {
    /// Names of cameras and targets.
    pub names: &'a Names,
    /// What each pair is compared with, where that is known already.
    pub references: Vec<Option<Reference>>,
    /// False alarms a day that are allowed.
    pub false_alarms_per_day: f64,
    /// What the session itself has to say.
    pub log: &'a Log,
    /// Ends the session.
    pub stop: &'a Arc<AtomicBool>,
    /// The session ends with its sources.
    pub is_once: bool,
}

/// What outputs that talk to servers have in common.
pub(super) struct Common<'a> {
    pub names: &'a Names,
    pub log: &'a Log,
    pub ca: Option<Vec<u8>>,
    pub flush_s: f64,
    /// What counts its deliveries, by name.
    pub counted: Vec<(&'static str, Arc<dyn Counted>)>,
}
