//! The connection to the server: it is made again after each loss, topics are then announced again, and the last states repeated.

use super::wire::{PROTOCOLS, Topic, Value, announcement, clock_answer, clock_question, sample};
use crate::outputs::outbox::{Outbox, Weight};
use crate::outputs::retry::{Backoff, Standing};
use futures_util::{SinkExt, StreamExt};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::net::TcpStream;
use tokio::time::{interval, timeout};
use tokio_tungstenite::tungstenite::client::ClientRequestBuilder;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async_with_config};

/// Longest wait for an answer of the server.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often the server's clock is read; without an answer until the next time it is lost.
const CLOCK_EVERY: Duration = Duration::from_secs(3);
/// The largest message of the server, bytes: those about its clock have less than thirty.
const LARGEST_BYTES: usize = 64 << 10;

/// Where the server is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Server {
    pub host: String,
    pub port: u16,
}

/// Values of some topics since one moment.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The moment, µs since the link began.
    pub time_us: i64,
    /// Values by the numbers of their topics.
    pub values: Vec<(usize, Value)>,
    /// Whether they are repeated on a new connection.
    pub is_kept: bool,
}

/// A server and what is published there.
pub struct Link {
    pub server: Server,
    pub topics: Vec<Topic>,
    /// The beginning of its time.
    pub began: Instant,
    pub is_up: Arc<AtomicBool>,
    /// Values that are repeated on each new connection, by the numbers of their topics.
    pub kept: BTreeMap<usize, (i64, Value)>,
}

/// The reason why a connection ended.
struct Lost(String);

type Socket = WebSocketStream<TcpStream>;

/// The server's time less that of this link, from the answer that came fastest.
#[derive(Default)]
struct ServerClock {
    best: Option<(i64, i64)>,
}

impl ServerClock {
    /// Takes an answer that came at a time of the link, µs.
    fn take(&mut self, (server_us, asked_us): (i64, i64), now_us: i64) {
        let took_us = now_us.saturating_sub(asked_us).max(0);
        let ahead_us = server_us.saturating_add(took_us / 2).saturating_sub(now_us);
        if self.best.is_none_or(|(least_us, _)| took_us <= least_us) {
            self.best = Some((took_us, ahead_us));
        }
    }

    fn ahead_us(&self) -> i64 {
        self.best.map_or(0, |(_, ahead_us)| ahead_us)
    }
}

impl Link {
    /// Runs until the outbox is closed and empty.
    pub async fn run(mut self, outbox: &Outbox<Sample>, mut standing: Standing) {
        let mut backoff = Backoff::new();
        while let Err(Lost(reason)) = self.connection(outbox, &mut standing).await {
            if self.is_up.swap(false, Ordering::Relaxed) {
                backoff.reset();
            }
            standing.failed(&reason);
            backoff.rest(outbox, None).await;
        }
    }

    fn now_us(&self) -> i64 {
        self.began.elapsed().as_micros() as i64
    }

    async fn connection(&mut self, outbox: &Outbox<Sample>, standing: &mut Standing) -> Result<(), Lost> {
        let mut socket = connected(&self.server).await?;
        let mut clock = ServerClock::default();
        self.begin(&mut socket, &mut clock).await?;
        standing.reached();
        self.is_up.store(true, Ordering::Relaxed);
        let (mut ticks, mut is_answered) = (interval(CLOCK_EVERY), true);
        loop {
            tokio::select! {
                next = outbox.next() => match next {
                    Some(item) => {
                        self.send(&mut socket, &clock, outbox, item).await?;
                        standing.delivered(outbox.delivered());
                    }
                    None => return farewell(socket).await,
                },
                heard = heard(&mut socket) => if let Some(answer) = heard? {
                    is_answered = true;
                    clock.take(answer, self.now_us());
                },
                _ = ticks.tick() => {
                    if !std::mem::take(&mut is_answered) {
                        return Err(silent());
                    }
                    said(&mut socket, Message::binary(clock_question(self.now_us()))).await?;
                }
            }
        }
    }

    /// Announces the topics, reads the server's clock, and repeats what is kept.
    async fn begin(&mut self, socket: &mut Socket, clock: &mut ServerClock) -> Result<(), Lost> {
        said(socket, Message::text(announcement(&self.topics))).await?;
        said(socket, Message::binary(clock_question(self.now_us()))).await?;
        let answer = async {
            loop {
                if let Some(answer) = heard(socket).await? {
                    return Ok(answer);
                }
            }
        };
        let answer = timeout(PATIENCE, answer).await.unwrap_or_else(|_| Err(silent()))?;
        clock.take(answer, self.now_us());
        for (topic, (time_us, value)) in &self.kept {
            said(socket, Message::binary(sample(*topic, time_us + clock.ahead_us(), value))).await?;
        }
        Ok(())
    }

    async fn send(
        &mut self,
        socket: &mut Socket,
        clock: &ServerClock,
        outbox: &Outbox<Sample>,
        (weight, item): (Weight, Sample),
    ) -> Result<(), Lost> {
        let time_us = item.time_us + clock.ahead_us();
        let bytes = item.values.iter().flat_map(|(topic, value)| sample(*topic, time_us, value)).collect();
        if let Err(lost) = said(socket, Message::Binary(bytes)).await {
            outbox.put_back(weight, item);
            return Err(lost);
        }
        if item.is_kept {
            self.kept.extend(item.values.into_iter().map(|(topic, value)| (topic, (item.time_us, value))));
        }
        Ok(())
    }
}

async fn connected(Server { host, port }: &Server) -> Result<Socket, Lost> {
    let stream = timeout(PATIENCE, TcpStream::connect((host.as_str(), *port)))
        .await
        .map_err(|_| silent())?
        .map_err(|e| Lost(format!("cannot be reached: {}", e.kind())))?;
    let place = if host.contains(':') { format!("[{host}]:{port}") } else { format!("{host}:{port}") };
    let uri = format!("ws://{place}/nt/resight").parse().map_err(|e| Lost(format!("is no address: {e}")))?;
    let request = PROTOCOLS.iter().fold(ClientRequestBuilder::new(uri), |r, p| r.with_sub_protocol(*p));
    let limits =
        WebSocketConfig::default().max_message_size(Some(LARGEST_BYTES)).max_frame_size(Some(LARGEST_BYTES));
    match timeout(PATIENCE, client_async_with_config(request, stream, Some(limits))).await {
        Ok(Ok((socket, _))) => Ok(socket),
        Ok(Err(reason)) => Err(Lost(format!("is no NetworkTables server of version 4: {reason}"))),
        Err(_) => Err(silent()),
    }
}

fn silent() -> Lost {
    Lost("gives no answer".to_string())
}

fn broken(reason: &Error) -> Lost {
    Lost(format!("broke off: {reason}"))
}

async fn said(socket: &mut Socket, message: Message) -> Result<(), Lost> {
    match timeout(PATIENCE, socket.send(message)).await {
        Ok(sent) => sent.map_err(|e| broken(&e)),
        Err(_) => Err(silent()),
    }
}

/// Waits for the next message; returns what it says about the server's clock.
async fn heard(socket: &mut Socket) -> Result<Option<(i64, i64)>, Lost> {
    match socket.next().await {
        Some(Ok(Message::Binary(bytes))) => Ok(clock_answer(&bytes)),
        Some(Ok(Message::Close(_))) | None => Err(Lost("closed the connection".to_string())),
        Some(Ok(_)) => Ok(None),
        Some(Err(reason)) => Err(broken(&reason)),
    }
}

/// Closes the connection: what was sent has arrived once the server has closed it, too. A server that says nothing has what it took.
async fn farewell(mut socket: Socket) -> Result<(), Lost> {
    let closed = async {
        socket.close(None).await.map_err(|e| broken(&e))?;
        loop {
            match socket.next().await {
                Some(Ok(Message::Close(_)) | Err(Error::ConnectionClosed)) | None => return Ok(()),
                Some(Ok(_)) => {}
                Some(Err(reason)) => return Err(broken(&reason)),
            }
        }
    };
    timeout(PATIENCE, closed).await.unwrap_or(Ok(()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_answer_says_what_time_the_server_has() {
        let mut clock = ServerClock::default();
        clock.take((5_000, 100), 1_100);
        assert_eq!(clock.ahead_us(), 5_000 + 500 - 1_100);
        clock.take((9_000, 2_000), 5_000);
        assert_eq!(clock.ahead_us(), 4_400);
        clock.take((9_100, 6_000), 6_010);
        assert_eq!(clock.ahead_us(), 9_105 - 6_010);
        clock.take((i64::MAX, i64::MIN), i64::MAX);
    }
}
