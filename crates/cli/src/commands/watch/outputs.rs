//! Where the events of a session go. One file for each kind of output, with its arguments.

mod history;
pub mod said;

use super::log::Log;
use super::names::Names;
use anyhow::Result;
use clap::Args;
use history::HistoryArgs;
use resight::live::Event;
use said::Said;

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
    history: HistoryArgs,
}

/// Opens what was asked for.
pub fn open(args: &OutputArgs, names: &Names, log: &Log) -> Result<Vec<Box<dyn Output>>> {
    let mut outputs: Vec<Box<dyn Output>> = vec![Box::new(Said::new(names, args.json, args.frames))];
    outputs.extend(history::open(&args.history, names, args.json, log)?);
    Ok(outputs)
}
