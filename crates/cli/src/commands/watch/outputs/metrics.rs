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
use access::Access;
use anyhow::{Context, Result, bail};
use clap::Args;
use resight::live::Event;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use tally::Tally;

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

/// The output, where it was asked for.
///
/// # Errors
/// An address that cannot be listened on; one that other machines can reach without a token.
pub fn open(
    args: &MetricsArgs,
    session: &Session<'_>,
    counted: Vec<(&'static str, Arc<dyn Counted>)>,
) -> Result<Option<Box<dyn Output>>> {
    let Some(address) = &args.metrics else { return Ok(None) };
    let token = args.metrics_token_file.as_deref().map(access::token).transpose()?;
    let (listener, place) = listen(address, token.is_some(), &args.metrics_host)?;
    session.log.say("metrics", &format!("http://{place}/metrics"));
    if !place.ip().is_loopback() {
        session.log.say("metrics", "the token travels unencrypted; put a proxy with TLS in front");
    }
    let tally = Arc::new(Mutex::new(Tally::new(session, counted)));
    server::start(listener, Arc::clone(&tally), Access::new(place, token, &args.metrics_host))?;
    Ok(Some(Box::new(Metrics { tally })))
}

fn listen(address: &str, has_token: bool, hosts: &[String]) -> Result<(TcpListener, SocketAddr)> {
    let told = || format!("--metrics {address}");
    let found: Vec<SocketAddr> = address.to_socket_addrs().with_context(told)?.collect();
    let Some(place) = found.first() else { bail!("{}: there is no such address", told()) };
    if !place.ip().is_loopback() && !has_token {
        bail!("{}: other machines can reach this; give --metrics-token-file, or listen on 127.0.0.1", told());
    }
    if place.ip().is_unspecified() && hosts.is_empty() {
        bail!("{}: listens on every address; say by which names it is reached, with --metrics-host", told());
    }
    let listener = TcpListener::bind(place).with_context(told)?;
    let place = listener.local_addr().with_context(told)?;
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
