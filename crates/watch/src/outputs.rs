//! The outputs of the events of a session, with one file for each kind.

mod outbox;
mod output;
mod measured;
pub mod said;
mod retry;
pub mod secret;
mod trust;
mod notice;
mod courier;
mod topics;
pub mod history;
pub mod tf;
pub mod metrics;
pub mod webhook;
pub mod mqtt;
pub mod nt4;
pub mod tui;

use anyhow::Result;
use output::Common;
pub(crate) use output::{Output, Session, tell};
use std::path::PathBuf;

/// The outputs of a session; fields that are none are off.
#[derive(Clone, Default)]
pub struct OutputsConfig {
    /// Writes every frame and event to an SQLite file.
    pub history: Option<history::HistoryConfig>,
    /// Writes poses as a recording of ROS 2 messages.
    pub tf: Option<tf::TfConfig>,
    /// Provides metrics for Prometheus.
    pub metrics: Option<metrics::MetricsConfig>,
    /// Posts notices to a web address.
    pub webhook: Option<webhook::WebhookConfig>,
    /// Keeps states at an MQTT broker.
    pub mqtt: Option<mqtt::MqttConfig>,
    /// Publishes poses and states to a NetworkTables server.
    pub nt4: Option<nt4::Nt4Config>,
    /// Draws the session in the terminal.
    pub tui: Option<tui::TuiConfig>,
    /// Certificates (PEM) to trust for https and mqtts; otherwise those of this machine.
    pub ca_file: Option<PathBuf>,
    /// Longest time for webhook, MQTT and NetworkTables each, at the end, to send what still waits, seconds.
    pub flush_s: f64,
}

/// Opens the configured outputs.
///
/// # Errors
/// An address, a file or a port that cannot be used; a view without a terminal.
pub(crate) fn open(config: &OutputsConfig, session: &Session<'_>) -> Result<Vec<Box<dyn Output>>> {
    let Session { names, log, .. } = session;
    let ca = config.ca_file.as_deref().map(trust::read).transpose()?;
    let mut common = Common { names, log, ca, flush_s: config.flush_s, counted: Vec::new() };
    let webhook = config.webhook.as_ref().map(|config| webhook::open(config, &mut common)).transpose()?;
    let mqtt = config.mqtt.as_ref().map(|config| mqtt::open(config, &mut common)).transpose()?;
    let nt4 = config.nt4.as_ref().map(|config| nt4::open(config, &mut common)).transpose()?;
    let counted = common.counted; // let counted = common.counted; // After the outputs whose deliveries it counts.
    let metrics =
        config.metrics.as_ref().map(|config| metrics::open(config, session, counted)).transpose()?;
    let tui = config.tui.map(|config| tui::open(config, session)).transpose()?;
    // Files are created after everything that may fail was accepted.
    let history = config.history.clone().map(|config| history::open(config, names, log)).transpose()?;
    let tf = config.tf.as_ref().map(|config| tf::open(config, session)).transpose()?;
    // The view is last: the others end while it is still open.
    Ok([history, tf, webhook, mqtt, nt4, metrics, tui].into_iter().flatten().collect())
}
