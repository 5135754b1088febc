//! Metrics for Prometheus: counts, states and latencies at `/metrics`; the health of the session at `/healthz`.

mod exposition;
mod histogram;
mod rate;
#[cfg(test)]
mod rules;
mod server;
mod tally;
mod write;

use super::outbox::Counted;
use super::{Output, Session};
use crate::live::Event;
use crate::web::access::{self, Access};
use crate::web::{Flags, listen};
use anyhow::Result;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use tally::Tally;

/// The settings of the metrics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MetricsConfig {
    /// `ADDRESS:PORT` to listen on.
    pub address: String,
    /// The file whose first line is the token that a request must carry.
    pub token_file: Option<PathBuf>,
    /// Names by which the metrics are reached, besides localhost and the address.
    pub hosts: Vec<String>,
}

/// The flags of its settings.
const FLAGS: Flags =
    Flags { address: "--metrics", token_file: "--metrics-token-file", host: "--metrics-host" };

/// Opens the output.
///
/// # Errors
/// An address that cannot be listened on; one that other machines can reach without a token.
pub(super) fn open(
    config: &MetricsConfig,
    session: &Session<'_>,
    counted: Vec<(&'static str, Arc<dyn Counted>)>,
) -> Result<Box<dyn Output>> {
    let token = config.token_file.as_deref().map(|path| access::token(FLAGS.token_file, path)).transpose()?;
    let (listener, place) = listen(&config.address, token.is_some(), &config.hosts, FLAGS)?;
    session.log.say("metrics", &format!("http://{place}/metrics"));
    if !place.ip().is_loopback() {
        session.log.say("metrics", "the token travels unencrypted; put a proxy with TLS in front");
    }
    let tally = Arc::new(Mutex::new(Tally::new(session, counted)));
    server::start(listener, Arc::clone(&tally), Access::new(place, token, &config.hosts))?;
    Ok(Box::new(Metrics { tally }))
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
