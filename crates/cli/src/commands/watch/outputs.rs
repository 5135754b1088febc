//! Where the events of a session go. One file for each kind of output, with its arguments.

mod history;
mod measured;
pub mod said;
mod tf;
mod outbox;
mod retry;
mod courier;
pub mod secret;
mod trust;
mod notice;
mod metrics;
mod webhook;
mod mqtt;
mod tui;

use super::log::Log;
use super::names::Names;
use anyhow::Result;
use clap::Args;
use history::HistoryArgs;
use outbox::Counted;
use resight::core::temporal::monitor::Reference;
use resight::live::Event;
use said::Said;
use std::path::PathBuf;
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

/// The outputs.
#[derive(Debug, Args)]
#[command(next_help_heading = "Outputs")]
pub struct OutputArgs {
    /// JSON Lines on stdout, one object per event and nothing else.
    #[arg(long)]
    pub json: bool,
    /// Also says what every frame showed.
    #[arg(long, hide_short_help = true)]
    frames: bool,
    #[command(flatten)]
    history: HistoryArgs,
    #[command(flatten)]
    tf: tf::TfArgs,
    #[command(flatten)]
    metrics: metrics::MetricsArgs,
    #[command(flatten)]
    webhook: webhook::WebhookArgs,
    #[command(flatten)]
    mqtt: mqtt::MqttArgs,
    /// Certificates (PEM) to believe for https and mqtts [default: those of this machine].
    #[arg(long, hide_short_help = true, value_name = "FILE")]
    ca_file: Option<PathBuf>,
    /// At the end of a session, how long --webhook and --mqtt each may take for what still waits.
    #[arg(long, hide_short_help = true, value_name = "SECONDS", default_value_t = 10.0, value_parser = crate::args::seconds)]
    flush_s: f64,
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
struct Common<'a> {
    names: &'a Names,
    log: &'a Log,
    ca: Option<Vec<u8>>,
    flush_s: f64,
    /// What counts its deliveries, by name.
    counted: Vec<(&'static str, Arc<dyn Counted>)>,
}

/// Opens what was asked for.
///
/// # Errors
/// An address, a file or a port that cannot be used; a view without a terminal.
pub fn open(args: &OutputArgs, session: &Session<'_>) -> Result<Vec<Box<dyn Output>>> {
    let Session { names, log, .. } = session;
    let ca = args.ca_file.as_deref().map(trust::read).transpose()?;
    let mut common = Common { names, log, ca, flush_s: args.flush_s, counted: Vec::new() };
    let said = args.is_printed().then(|| Said::new(names, args.json, args.frames));
    let webhook = webhook::open(&args.webhook, &mut common)?;
    let mqtt = mqtt::open(&args.mqtt, &mut common)?;
    let metrics = metrics::open(&args.metrics, session, common.counted)?; // After those whose deliveries it counts.
    let tui = tui::open(&args.tui, args.json, session)?;
    // Files are begun when all that may be refused was accepted.
    let history = history::open(&args.history, names, args.json, log)?;
    let tf = tf::open(&args.tf, session)?;
    let said = said.map(|said| Box::new(said) as Box<dyn Output>);
    // The view is last: the others end while it is still there.
    Ok([said, history, tf, webhook, mqtt, metrics, tui].into_iter().flatten().collect())
}
