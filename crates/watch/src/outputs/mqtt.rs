//! States kept at an MQTT broker, with one topic for each camera and target, and the availability of this session.

mod broker;
mod discovery;
mod link;

use super::courier::Courier;
use super::notice::Notices;
use super::outbox::Weight;
use super::topics::Topics;
use super::{Common, Output};
use crate::live::Event;
use anyhow::{Result, bail};
use broker::Broker;
use link::{Link, Message};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest number of waiting messages; alarms are dropped last.
const WAITING: usize = 1000;

/// The settings of the broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MqttConfig {
    /// `mqtt://HOST[:PORT][/PREFIX]`, `mqtts://` with TLS, `USER@` before HOST.
    pub url: String,
    /// The file whose first line is the password; otherwise the variable `RESIGHT_MQTT_PASSWORD` may hold it.
    pub password_file: Option<PathBuf>,
    /// Whether every frame is sent.
    pub frames: bool,
    /// The prefix under which Home Assistant listens for announcements of the cameras.
    pub discovery: Option<String>,
}

/// Opens the output.
///
/// # Errors
/// An invalid address; two cameras that would share a topic.
pub(super) fn open(config: &MqttConfig, common: &mut Common<'_>) -> Result<Box<dyn Output>> {
    let broker = Broker::read(&config.url, config.password_file.as_deref())?;
    let topics = Topics::new(&broker.prefix, common.names);
    if let Some(topic) = topics.shared() {
        bail!(
            "--mqtt: two of the names give the topic {topic}; MQTT needs them to differ in more than / + #"
        );
    }
    let mut greeting = vec![Message::kept(topics.availability(), "online".to_string())];
    if let Some(prefix) = &config.discovery {
        greeting.extend(discovery::messages(prefix, &topics, common.names));
    }
    let options = link::options(&broker, &topics, common.ca.as_deref())?;
    let connected = Arc::new(AtomicBool::new(false));
    let link = Link::new(options, greeting, topics.availability(), Arc::clone(&connected));
    let courier =
        Courier::start("mqtt", &broker.receiver(), WAITING, common, move |outbox, standing, runtime| {
            runtime.block_on(link.run(&outbox, standing));
        })?;
    let notices = Notices::new(common.names);
    let sources = vec![false; common.names.cameras.len()];
    Ok(Box::new(Mqtt { notices, courier, topics, connected, frames: config.frames, sources }))
}

struct Mqtt {
    notices: Notices,
    courier: Courier<Message>,
    topics: Topics,
    /// Whether the broker is connected; frames do not wait for it.
    connected: Arc<AtomicBool>,
    frames: bool,
    /// For each camera whether the state of its source was reported: the broker may still hold that of an earlier session.
    sources: Vec<bool>,
}

impl Output for Mqtt {
    fn take(&mut self, event: &Event) -> Result<()> {
        if let Event::Observed { camera, target, .. } = event {
            if self.sources.get(*camera) == Some(&false) {
                self.tell(&Event::Source { camera: *camera, connected: true, reason: None });
            }
            if self.frames && self.connected.load(Ordering::Relaxed) {
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
                if let Some(is_reported) = self.sources.get_mut(*camera) {
                    *is_reported = true;
                }
                Message::kept(self.topics.source(*camera), payload)
            }
            _ => Message::at_least_once(self.topics.moved(), payload),
        };
        self.courier.tell(notice.weight, message);
    }
}
