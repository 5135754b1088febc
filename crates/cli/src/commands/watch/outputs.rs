//! Where the events of a session go. One file for each kind of output, with its arguments.

pub mod said;
mod tui;

use super::log::Log;
use super::names::Names;
use anyhow::Result;
use clap::Args;
use resight::core::monitor::Reference;
use resight::live::Event;
use said::Said;
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

/// The outputs.
#[derive(Debug, Args)]
pub struct OutputArgs {
    /// JSON Lines on stdout, one object per event and nothing else.
    #[arg(long)]
    pub json: bool,
    /// Also says what every frame showed.
    #[arg(long)]
    frames: bool,
    #[command(flatten)]
    tui: tui::TuiArgs,
}

impl OutputArgs {
    /// Standard output is lines of text; otherwise a view is drawn there.
    pub fn is_printed(&self) -> bool {
        self.json || !self.tui.tui
    }
}

/// What is known of a session before it starts.
pub struct Session<'a> {
    /// Names of cameras and targets.
    pub names: &'a Names,
    /// What each pair is compared with, where that is known already.
    pub references: Vec<Option<Reference>>,
    /// What the session itself has to say.
    pub log: &'a Log,
    /// Ends the session.
    pub stop: &'a Arc<AtomicBool>,
    /// The session ends with its sources.
    pub is_once: bool,
}

/// Opens what was asked for.
///
/// # Errors
/// A view without a terminal.
pub fn open(args: &OutputArgs, session: &Session<'_>) -> Result<Vec<Box<dyn Output>>> {
    let mut outputs: Vec<Box<dyn Output>> = Vec::new();
    if args.is_printed() {
        outputs.push(Box::new(Said::new(session.names, args.json, args.frames)));
    }
    outputs.extend(tui::open(&args.tui, args.json, session)?); // last: the others end while it is still there
    Ok(outputs)
}
