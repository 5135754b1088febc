//! The flags of the outputs, and events printed on standard output.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use resight_watch::Event;
use resight_watch::history::Retention;
use resight_watch::names::Names;
use resight_watch::outputs::OutputsConfig;
use resight_watch::outputs::history::{HistoryConfig, OnStored};
use resight_watch::outputs::metrics::MetricsConfig;
use resight_watch::outputs::mqtt::MqttConfig;
use resight_watch::outputs::nt4::Nt4Config;
use resight_watch::outputs::said::EventText;
use resight_watch::outputs::tf::TfConfig;
use resight_watch::outputs::tui::TuiConfig;
use resight_watch::outputs::webhook::WebhookConfig;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The outputs.
#[derive(Debug, Args)]
#[command(next_help_heading = "Outputs")]
pub struct OutputArgs {
    /// JSON Lines on stdout, one object per event and nothing else.
    #[arg(long, help_heading = None)]
    pub json: bool,
    /// Also says what every frame showed.
    #[arg(long, hide_short_help = true)]
    frames: bool,
    #[command(flatten)]
    history: HistoryArgs,
    #[command(flatten)]
    tf: TfArgs,
    #[command(flatten)]
    metrics: MetricsArgs,
    #[command(flatten)]
    webhook: WebhookArgs,
    #[command(flatten)]
    mqtt: MqttArgs,
    /// Publishes poses with their standard deviations, states and whether each camera moved to a NetworkTables 4 server, such as the controller of an
    /// FRC robot: HOST[:PORT], or the number of a team. Topics are below /resight/CAMERA/TARGET.
    #[arg(long, hide_short_help = true, value_name = "HOST[:PORT]")]
    nt4: Option<String>,
    /// Certificates (PEM) to believe for https and mqtts [default: those of this machine].
    #[arg(long, hide_short_help = true, value_name = "FILE")]
    ca_file: Option<PathBuf>,
    /// At the end of a session, how long --webhook, --mqtt and --nt4 each may take for what still waits.
    #[arg(long, hide_short_help = true, value_name = "SECONDS", default_value_t = 10.0, value_parser = crate::args::seconds)]
    flush_s: f64,
    #[command(flatten)]
    tui: TuiArgs,
}

impl OutputArgs {
    /// Standard output is lines of text; otherwise a view is drawn there.
    pub fn is_printed(&self) -> bool {
        self.json || !self.tui.tui
    }

    /// The listener that prints events, where they are printed.
    pub fn printer(&self, names: &Names) -> Option<Printer> {
        self.is_printed().then(|| Printer {
            said: EventText::new(names),
            json: self.json,
            frames: self.frames,
        })
    }

    /// Says which session file the keys come from; secrets in it are no arguments.
    pub fn come_from(&mut self, session: Option<&Path>) {
        self.webhook.session = session.map(Path::to_path_buf);
    }

    /// What the session opens.
    ///
    /// # Errors
    /// Flags that contradict each other.
    pub fn config(&self) -> Result<OutputsConfig> {
        let tui =
            self.tui.tui.then_some(TuiConfig { window: self.tui.tui_window as usize, has_json: self.json });
        Ok(OutputsConfig {
            history: self.history.config(self.json)?,
            tf: self.tf.config()?,
            metrics: self.metrics.config(),
            webhook: self.webhook.config(),
            mqtt: self.mqtt.config(),
            nt4: self.nt4.clone().map(|server| Nt4Config { server }),
            tui,
            ca_file: self.ca_file.clone(),
            flush_s: self.flush_s,
        })
    }
}

/// Prints events on standard output.
pub struct Printer {
    said: EventText,
    json: bool,
    frames: bool,
}

impl Printer {
    /// The next event.
    ///
    /// # Errors
    /// The reader is gone.
    pub fn take(&self, event: &Event) -> std::io::Result<()> {
        if matches!(event, Event::Observed { .. }) && !self.frames {
            return Ok(());
        }
        print(&if self.json { self.said.object(event).to_string() } else { self.said.words(event) })
    }
}

/// Line by line, each flushed: another program may be waiting for it.
pub fn print(line: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()
}

/// The history.
#[derive(Debug, Args)]
#[command(next_help_heading = "History")]
pub struct HistoryArgs {
    /// Keeps every frame and event in this SQLite file, which `resight history` reads.
    ///
    /// Pose (or rotation by landmarks), covariance, residual and state of every frame.
    /// With --json an object {"event": "stored"} says what is on the disk for good.
    #[arg(long, help_heading = None, value_name = "FILE")]
    history: Option<PathBuf>,
    /// Every frame is kept this long, then one row a minute.
    #[arg(long, hide_short_help = true, value_name = "DAYS", default_value_t = 7.0, value_parser = crate::args::positive, requires = "history")]
    history_full_days: f64,
    /// Rows of a minute are kept until they are this old, then one an hour [default: 90, or as long as all is kept].
    #[arg(long, hide_short_help = true, value_name = "DAYS", value_parser = crate::args::positive, requires = "history")]
    history_minute_days: Option<f64>,
    /// Rows of an hour are kept until they are this old; events for good.
    #[arg(long, hide_short_help = true, value_name = "DAYS", default_value_t = 1100.0, value_parser = crate::args::positive, requires = "history")]
    history_keep_days: f64,
    /// Beyond this size of the file the oldest rows are joined, and then removed, before their time.
    #[arg(long, hide_short_help = true, value_name = "MB", value_parser = crate::args::positive, requires = "history")]
    history_max_mb: Option<f64>,
    /// Longest time until a frame is on the disk, as far as that keeps up.
    #[arg(long, hide_short_help = true, value_name = "SECONDS", default_value_t = 0.5, value_parser = crate::args::seconds, requires = "history")]
    history_commit_s: f64,
}

impl HistoryArgs {
    fn config(&self, json: bool) -> Result<Option<HistoryConfig>> {
        let Some(file) = self.history.clone() else { return Ok(None) };
        // The session itself notices a reader that is gone.
        let on_stored: OnStored = Arc::new(|stored| drop(print(&stored.to_string())));
        Ok(Some(HistoryConfig {
            file,
            retention: self.retention()?,
            commit_s: self.history_commit_s,
            on_stored: json.then_some(on_stored),
        }))
    }

    fn retention(&self) -> Result<Retention> {
        let (full, keep) = (self.history_full_days, self.history_keep_days);
        let minute = self.history_minute_days.unwrap_or(90.0_f64.max(full).min(keep));
        if !(full <= minute && minute <= keep) {
            bail!(
                "--history-full-days {full}, --history-minute-days {minute} and --history-keep-days {keep} must not fall: rows grow coarser with age"
            );
        }
        const DAY_S: f64 = 86_400.0;
        Ok(Retention {
            full_s: full * DAY_S,
            minutes_s: minute * DAY_S,
            keep_s: keep * DAY_S,
            largest_bytes: self.history_max_mb.map(|mb| (mb * 1e6) as u64),
        })
    }
}

/// Where poses go.
#[derive(Debug, Args)]
#[command(next_help_heading = "ROS transforms")]
pub struct TfArgs {
    /// Writes poses as ROS 2 messages to FILE.mcap: /tf, /tf_static (references and drift corrections), CAMERA/pose with covariance,
    /// /diagnostics.
    #[arg(long, hide_short_help = true, value_name = "FILE.mcap")]
    tf: Option<PathBuf>,
    /// Which frame is the parent on /tf: the target (the camera's pose in the target's frame), or the camera (the target's pose in
    /// the camera's frame, as tag detectors publish it).
    #[arg(long, hide_short_help = true, value_name = "FRAME", value_enum, default_value_t = Parent::Target)]
    tf_parent: Parent,
    /// Frame id of a camera or target on /tf [default: its name].
    #[arg(long, hide_short_help = true, value_name = "NAME=FRAME_ID")]
    tf_frame: Vec<String>,
}

/// The parent on `/tf`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Parent {
    /// The target.
    Target,
    /// The camera.
    Camera,
}

impl TfArgs {
    fn config(&self) -> Result<Option<TfConfig>> {
        let Some(file) = self.tf.clone() else {
            if !self.tf_frame.is_empty() {
                bail!("--tf-frame names frames of the file of --tf; give --tf FILE.mcap too");
            }
            return Ok(None);
        };
        let target_is_parent = self.tf_parent == Parent::Target;
        Ok(Some(TfConfig { file, target_is_parent, frames: self.tf_frame.clone() }))
    }
}

/// The metrics.
#[derive(Debug, Args)]
#[command(next_help_heading = "Metrics")]
pub struct MetricsArgs {
    /// Serves Prometheus metrics at http://ADDRESS:PORT/metrics, and /healthz. Other machines are let in only with
    /// --metrics-token-file.
    #[arg(long, hide_short_help = true, value_name = "ADDRESS:PORT")]
    metrics: Option<String>,
    /// /metrics asks for the token on the first line of this file: 'Authorization: Bearer TOKEN'.
    #[arg(long, hide_short_help = true, value_name = "FILE", requires = "metrics")]
    metrics_token_file: Option<PathBuf>,
    /// A name by which the metrics are reached, as NAME or NAME:PORT, besides localhost and the address. May be given again.
    #[arg(long, hide_short_help = true, value_name = "NAME", requires = "metrics")]
    metrics_host: Vec<String>,
}

impl MetricsArgs {
    fn config(&self) -> Option<MetricsConfig> {
        let (token_file, hosts) = (self.metrics_token_file.clone(), self.metrics_host.clone());
        self.metrics.clone().map(|address| MetricsConfig { address, token_file, hosts })
    }
}

/// The webhook.
#[derive(Debug, Args)]
#[command(next_help_heading = "Webhook")]
pub struct WebhookArgs {
    /// Posts a JSON object to this http or https address when a state changes, when it is known who moved, and when a source is lost
    /// or back; tried again until it is acknowledged (status 2xx). An address with a token comes from @FILE or env:VARIABLE.
    #[arg(long, hide_short_help = true, value_name = "URL")]
    webhook: Option<String>,
    /// A header for --webhook, 'Name: value', or @FILE with one a line: secrets belong in a file. May be given again.
    #[arg(long, hide_short_help = true, value_name = "HEADER", requires = "webhook")]
    webhook_header: Vec<String>,
    /// The session file that `webhook` comes from; none where it is an argument.
    #[arg(skip)]
    session: Option<PathBuf>,
}

impl WebhookArgs {
    fn config(&self) -> Option<WebhookConfig> {
        let headers = self.webhook_header.clone();
        let session = self.session.clone();
        self.webhook.clone().map(|url| WebhookConfig { url, session, headers })
    }
}

/// The broker.
#[derive(Debug, Args)]
#[command(next_help_heading = "MQTT")]
pub struct MqttArgs {
    /// Keeps states at an MQTT broker: mqtt://HOST[:PORT][/PREFIX], mqtts:// with TLS, USER@ before HOST. Topics are
    /// PREFIX/CAMERA/TARGET/state (retained) and PREFIX/availability (online, offline).
    #[arg(long, hide_short_help = true, value_name = "URL")]
    mqtt: Option<String>,
    /// The password is on the first line of this file [default: the variable RESIGHT_MQTT_PASSWORD].
    #[arg(long, hide_short_help = true, value_name = "FILE", requires = "mqtt")]
    mqtt_password_file: Option<PathBuf>,
    /// Also sends what every frame showed, to PREFIX/CAMERA/TARGET/frame, while the broker is there.
    #[arg(long, hide_short_help = true, requires = "mqtt")]
    mqtt_frames: bool,
    /// Also announces each camera to Home Assistant, which listens below this prefix.
    #[arg(long, hide_short_help = true, requires = "mqtt", value_name = "PREFIX", num_args = 0..=1, default_missing_value = "homeassistant")]
    mqtt_discovery: Option<String>,
}

impl MqttArgs {
    fn config(&self) -> Option<MqttConfig> {
        let (password_file, discovery) = (self.mqtt_password_file.clone(), self.mqtt_discovery.clone());
        self.mqtt.clone().map(|url| MqttConfig { url, password_file, frames: self.mqtt_frames, discovery })
    }
}

/// The terminal view.
#[derive(Debug, Args)]
#[command(next_help_heading = "Terminal view")]
pub struct TuiArgs {
    /// Draws the session in the terminal instead of printing it.
    ///
    /// State, motion, times and scatter of every camera. q quits, r resets the statistics, the arrows choose a camera, Enter shows its details, p pauses the view. With --json, send that to a file.
    #[arg(long, help_heading = None)]
    pub tui: bool,
    /// Frames over which --tui takes medians, percentiles and standard deviations.
    #[arg(long, hide_short_help = true, value_name = "N", requires = "tui", default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=1000))]
    tui_window: u32,
}
