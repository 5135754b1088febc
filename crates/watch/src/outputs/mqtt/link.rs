//! The connection: it is made again after each loss, and each message is sent until the broker acknowledges it, in order.

use super::broker::Broker;
use crate::outputs::outbox::{Outbox, Weight};
use crate::outputs::retry::{Backoff, Standing, random};
use crate::outputs::topics::Topics;
use crate::outputs::trust;
use anyhow::Result;
use rumqttc::{
    AsyncClient, ConnectionError, Event, EventLoop, Incoming, LastWill, MqttOptions, PublishOptions, QoS,
};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// A broker that is silent for one and a half times this is lost, seconds.
const KEEP_ALIVE_S: u16 = 15;
/// Longest wait for the acknowledgement of one message.
const PATIENCE: Duration = Duration::from_secs(10);
/// The largest message, bytes: a frame's object has a few thousand.
const LARGEST_BYTES: usize = 256 << 10;

/// One message.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    pub topic: String,
    pub payload: String,
    qos: QoS,
    is_kept: bool,
}

impl Message {
    /// Builds a message that the broker retains for later subscribers and acknowledges.
    pub fn kept(topic: String, payload: String) -> Self {
        Message { topic, payload, qos: QoS::AtLeastOnce, is_kept: true }
    }

    /// Builds a message that the broker acknowledges.
    pub fn at_least_once(topic: String, payload: String) -> Self {
        Message { topic, payload, qos: QoS::AtLeastOnce, is_kept: false }
    }

    /// Builds a message that is sent once, whether or not it arrives.
    pub fn passing(topic: String, payload: String) -> Self {
        Message { topic, payload, qos: QoS::AtMostOnce, is_kept: false }
    }
}

/// Returns the options of the connection: a session that ends without a farewell becomes `offline`.
///
/// # Errors
/// Certificates that cannot be read.
pub fn options(broker: &Broker, topics: &Topics, ca: Option<&[u8]>) -> Result<MqttOptions> {
    // MQTT 3.1.1 guarantees 23 letters.
    let client_id = format!("resight-{:012x}", random() >> 16);
    let mut options = MqttOptions::new(client_id, (broker.host.as_str(), broker.port));
    options.set_keep_alive(KEEP_ALIVE_S);
    options.set_max_packet_size(LARGEST_BYTES, LARGEST_BYTES);
    options.set_last_will(LastWill::new(topics.availability(), "offline", QoS::AtLeastOnce, true));
    if let Some(user) = &broker.user {
        match &broker.password {
            Some(password) => options.set_credentials(user, password.clone()),
            None => options.set_username(user),
        };
    }
    if broker.is_tls {
        options.set_transport(trust::of_mqtt(ca)?);
    }
    Ok(options)
}

/// A broker and the messages for it.
pub struct Link {
    options: MqttOptions,
    /// Messages sent first on every connection.
    greeting: Vec<Message>,
    availability: String,
    is_up: Arc<AtomicBool>,
    /// Retained messages, sent again after each new connection, because the broker may have lost them.
    kept: BTreeMap<String, Message>,
    /// A message that is sent, but not acknowledged.
    on_its_way: Option<(Weight, Message)>,
}

/// The reason why a connection ended.
struct Lost(String);

impl Link {
    pub fn new(
        options: MqttOptions,
        greeting: Vec<Message>,
        availability: String,
        is_up: Arc<AtomicBool>,
    ) -> Self {
        Link { options, greeting, availability, is_up, kept: BTreeMap::new(), on_its_way: None }
    }

    /// Runs until the outbox is closed and empty and the farewell is sent.
    pub async fn run(mut self, outbox: &Outbox<Message>, mut standing: Standing) {
        let mut backoff = Backoff::new();
        while let Err(Lost(reason)) = self.connection(outbox, &mut standing).await {
            if self.is_up.swap(false, Ordering::Relaxed) {
                backoff.reset();
            }
            if let Some((weight, message)) = self.on_its_way.take() {
                outbox.put_back(weight, message);
            }
            standing.failed(&reason);
            backoff.rest(outbox, None).await;
        }
    }

    async fn connection(&mut self, outbox: &Outbox<Message>, standing: &mut Standing) -> Result<(), Lost> {
        let built = AsyncClient::builder(self.options.clone()).try_build();
        let (client, events) = built.map_err(|e| Lost(format!("cannot be spoken to: {e}")))?;
        let (connected, is_connected) = oneshot::channel();
        let mut polling = tokio::spawn(poll(events, connected));
        if is_connected.await.is_err() {
            return Err(end(&mut polling).await);
        }
        let reported = tokio::select! {
            reported = self.tell(&client, outbox, standing) => reported,
            lost = end(&mut polling) => return Err(lost),
        };
        match reported {
            Ok(()) => {
                // The farewell is queued; the event loop ends once it is sent.
                let _ = client.disconnect().await;
                end(&mut polling).await;
                Ok(())
            }
            Err(lost) => {
                polling.abort();
                Err(lost)
            }
        }
    }

    async fn tell(
        &mut self,
        client: &AsyncClient,
        outbox: &Outbox<Message>,
        standing: &mut Standing,
    ) -> Result<(), Lost> {
        for message in self.greeting.iter().chain(self.kept.values()) {
            send(client, message).await?;
        }
        standing.reached();
        self.is_up.store(true, Ordering::Relaxed);
        while let Some((weight, message)) = outbox.next().await {
            self.on_its_way = Some((weight, message.clone()));
            send(client, &message).await?;
            self.on_its_way = None;
            standing.delivered(outbox.delivered());
            if message.is_kept {
                self.kept.insert(message.topic.clone(), message);
            }
        }
        send(client, &Message::kept(self.availability.clone(), "offline".to_string())).await
    }
}

/// Sends a message and waits until it is acknowledged, or sent where no acknowledgement is required.
async fn send(client: &AsyncClient, message: &Message) -> Result<(), Lost> {
    let options = PublishOptions::new(message.qos).retain(message.is_kept);
    let (topic, payload) = (message.topic.clone(), message.payload.clone());
    let sent = async {
        let notice =
            client.publish_tracked(topic, payload, options).await.map_err(|e| Lost(e.to_string()))?;
        notice.wait_async().await.map_err(|e| Lost(e.to_string()))
    };
    match timeout(PATIENCE, sent).await {
        Ok(sent) => sent.map(drop),
        Err(_) => Err(Lost(format!("acknowledged nothing for {} s", PATIENCE.as_secs()))),
    }
}

/// Drives the connection until it breaks.
async fn poll(mut events: EventLoop, connected: oneshot::Sender<()>) -> Lost {
    let mut connected = Some(connected);
    loop {
        match events.poll().await {
            Ok(Event::Incoming(Incoming::ConnAck(_))) => {
                if let Some(connected) = connected.take() {
                    // The receiver of this answer is gone together with the connection.
                    let _ = connected.send(());
                }
            }
            Ok(_) => {}
            Err(reason) => return Lost(words(&reason)),
        }
    }
}

async fn end(polling: &mut JoinHandle<Lost>) -> Lost {
    polling.await.unwrap_or_else(|_| Lost("broke off".to_string()))
}

fn words(reason: &ConnectionError) -> String {
    match reason {
        ConnectionError::Io(e) if e.get_ref().is_some() => format!("cannot be reached: {e}"), // TLS has its say
        ConnectionError::Io(e) => format!("cannot be reached: {}", e.kind()),
        ConnectionError::NetworkTimeout | ConnectionError::FlushTimeout => "gives no answer".to_string(),
        ConnectionError::ConnectionRefused(code) => format!("refuses the connection: {code:?}"),
        ConnectionError::Tls(e) => format!("cannot be trusted: {e}"),
        other => format!("broke off: {other}"),
    }
}
