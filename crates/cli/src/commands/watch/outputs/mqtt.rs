//! States kept at an MQTT broker, one topic for each camera and target, and whether this session is there.

mod broker;
mod discovery;
mod link;
mod topics;

use super::courier::Courier;
use super::notice::Notices;
use super::outbox::Weight;
use super::{Common, Output};
use anyhow::{Result, bail};
use broker::Broker;
use clap::Args;
use link::{Link, Message};
use resight::live::Event;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use topics::Topics;

/// Messages that may wait; alarms are kept longest.
const WAITING: usize = 1000;

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

/// The output, where it was asked for.
///
/// # Errors
/// An address that is none; two cameras that would share a topic.
pub fn open(args: &MqttArgs, common: &mut Common<'_>) -> Result<Option<Box<dyn Output>>> {
    let Some(url) = &args.mqtt else { return Ok(None) };
    let broker = Broker::read(url, args.mqtt_password_file.as_deref())?;
    let topics = Topics::new(&broker.prefix, common.names);
    if let Some(topic) = topics.shared() {
        bail!(
            "--mqtt: two of the names give the topic {topic}; MQTT needs them to differ in more than / + #"
        );
    }
    let mut greeting = vec![Message::kept(topics.availability(), "online".to_string())];
    if let Some(prefix) = &args.mqtt_discovery {
        greeting.extend(discovery::messages(prefix, &topics, common.names));
    }
    let options = link::options(&broker, &topics, common.ca.as_deref())?;
    let is_there = Arc::new(AtomicBool::new(false));
    let link = Link::new(options, greeting, topics.availability(), Arc::clone(&is_there));
    let courier =
        Courier::start("mqtt", &broker.receiver(), WAITING, common, move |outbox, standing, runtime| {
            runtime.block_on(link.run(&outbox, standing));
        })?;
    let notices = Notices::new(common.names);
    let sources = vec![false; common.names.cameras.len()];
    Ok(Some(Box::new(Mqtt { notices, courier, topics, is_there, frames: args.mqtt_frames, sources })))
}

struct Mqtt {
    notices: Notices,
    courier: Courier<Message>,
    topics: Topics,
    /// Whether the broker is; frames do not wait for it.
    is_there: Arc<AtomicBool>,
    frames: bool,
    /// Of which cameras it was told whether the source is there: the broker may still hold what an earlier session said of it.
    sources: Vec<bool>,
}

impl Output for Mqtt {
    fn take(&mut self, event: &Event) -> Result<()> {
        if let Event::Observed { camera, target, .. } = event {
            if self.sources.get(*camera) == Some(&false) {
                self.tell(&Event::Source { camera: *camera, is_there: true, reason: None });
            }
            if self.frames && self.is_there.load(Ordering::Relaxed) {
                let payload = self.notices.frame(event).to_string();
                self.courier
                    .tell(Weight::Frame, Message::passing(self.topics.frame(*camera, *target), payload));
            }
            return Ok(());
        }
        self.tell(event);
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.courier.finish();
        Ok(())
    }
}

impl Mqtt {
    fn tell(&mut self, event: &Event) {
        let Some(notice) = self.notices.of(event) else { return };
        let payload = notice.body.to_string();
        let message = match event {
            Event::StateChanged { camera, target, .. } => {
                Message::kept(self.topics.state(*camera, *target), payload)
            }
            Event::Source { camera, .. } => {
                if let Some(is_told) = self.sources.get_mut(*camera) {
                    *is_told = true;
                }
                Message::kept(self.topics.source(*camera), payload)
            }
            _ => Message::sure(self.topics.moved(), payload),
        };
        self.courier.tell(notice.weight, message);
    }
}
