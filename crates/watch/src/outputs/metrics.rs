//! What Prometheus reads: counts, states and latencies, at `/metrics`; whether all is well, at `/healthz`.

mod access;
mod exposition;
mod histogram;
mod rate;
mod server;
mod tally;
mod write;

use super::outbox::Counted;
use super::{Output, Session};
use crate::live::Event;
use access::Access;
use anyhow::{Context, Result, bail};
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use tally::Tally;

/// The metrics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MetricsConfig {
    /// `ADDRESS:PORT` to listen on.
    pub address: String,
    /// The file whose first line is the token that whoever asks must know.
    pub token_file: Option<PathBuf>,
    /// Names by which the metrics are reached, besides localhost and the address.
    pub hosts: Vec<String>,
}

/// The output.
///
/// # Errors
/// An address that cannot be listened on; one that other machines can reach without a token.
pub(super) fn open(
    config: &MetricsConfig,
    session: &Session<'_>,
    counted: Vec<(&'static str, Arc<dyn Counted>)>,
) -> Result<Box<dyn Output>> {
    let token = config.token_file.as_deref().map(access::token).transpose()?;
    let (listener, place) = listen(&config.address, token.is_some(), &config.hosts)?;
    session.log.say("metrics", &format!("http://{place}/metrics"));
    if !place.ip().is_loopback() {
        session.log.say("metrics", "the token travels unencrypted; put a proxy with TLS in front");
    }
    let tally = Arc::new(Mutex::new(Tally::new(session, counted)));
    server::start(listener, Arc::clone(&tally), Access::new(place, token, &config.hosts))?;
    Ok(Box::new(Metrics { tally }))
}

fn listen(address: &str, has_token: bool, hosts: &[String]) -> Result<(TcpListener, SocketAddr)> {
    let reported = || format!("--metrics {address}");
    let found: Vec<SocketAddr> = address.to_socket_addrs().with_context(reported)?.collect();
    let Some(place) = found.first() else { bail!("{}: there is no such address", reported()) };
    if !place.ip().is_loopback() && !has_token {
        bail!(
            "{}: other machines can reach this; give --metrics-token-file, or listen on 127.0.0.1",
            reported()
        );
    }
    if place.ip().is_unspecified() && hosts.is_empty() {
        bail!(
            "{}: listens on every address; say by which names it is reached, with --metrics-host",
            reported()
        );
    }
    let listener = TcpListener::bind(place).with_context(reported)?;
    let place = listener.local_addr().with_context(reported)?;
    Ok((listener, place))
}

struct Metrics {
    tally: Arc<Mutex<Tally>>,
}

impl Output for Metrics {
    fn take(&mut self, event: &Event) -> Result<()> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner).take(event);
        Ok(())
    }
}
