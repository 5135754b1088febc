//! The common parts of every server of this program: access, address and time limits.

pub mod access;
mod patient;
mod places;

use access::Access;
use anyhow::{Context, Result, bail};
use axum::Router;
use axum::extract::Request;
use axum::middleware::{self, Next};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use patient::Patient;
use places::{Place, Places};
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};

/// Largest number of open connections; beyond it the slowest are closed.
const CONNECTIONS: usize = 512;
/// Longest wait for the head of a request, and for the next request on a connection that is kept open.
const HEAD_PATIENCE: Duration = Duration::from_secs(5);
/// Longest wait for the other side to accept some of an answer.
const WRITE_PATIENCE: Duration = Duration::from_secs(20);
/// Pause after a temporary failure to accept (no more file descriptors).
const PAUSE: Duration = Duration::from_millis(100);
/// A head larger than this is refused, bytes.
const HEAD_BYTES: usize = 16 << 10;

/// The lifetime of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Patience {
    /// One request within this time.
    OneRequest(Duration),
    /// Any number of requests; a WebSocket lasts as long as both sides want.
    Kept,
}

/// The flags of an address, its token and its names, for messages.
#[derive(Debug, Clone, Copy)]
pub struct Flags {
    /// Flag of the address.
    pub address: &'static str,
    /// Flag of the token's file.
    pub token_file: &'static str,
    /// Flag of the names.
    pub host: &'static str,
}

/// Listens on `ADDRESS:PORT`.
///
/// # Errors
/// An address that cannot be listened on; one that other machines can reach without a token, or without a name to reach it by.
pub fn listen(
    address: &str,
    has_token: bool,
    hosts: &[String],
    flags: Flags,
) -> Result<(TcpListener, SocketAddr)> {
    let reported = || format!("{} {address}", flags.address);
    let found: Vec<SocketAddr> = address.to_socket_addrs().with_context(reported)?.collect();
    let Some(place) = found.first() else { bail!("{}: there is no such address", reported()) };
    if !place.ip().is_loopback() && !has_token {
        bail!(
            "{}: other machines can reach this; give {}, or listen on 127.0.0.1",
            reported(),
            flags.token_file
        );
    }
    if place.ip().is_unspecified() && hosts.is_empty() {
        bail!(
            "{}: listens on every address; say by which names it is reached, with {}",
            reported(),
            flags.host
        );
    }
    let listener = TcpListener::bind(place).with_context(reported)?;
    let place = listener.local_addr().with_context(reported)?;
    Ok((listener, place))
}

/// Accepts connections until the program ends.
///
/// # Errors
/// A listener that cannot be handed over.
pub async fn accept(listener: TcpListener, routes: Router, patience: Patience) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let (turns, places) = (Arc::new(Semaphore::new(CONNECTIONS)), Arc::new(Places::default()));
    loop {
        let (stream, _) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(_) => {
                sleep(PAUSE).await;
                continue;
            }
        };
        let Some(turn) = free_place(&turns, &places).await else { return Ok(()) };
        let (routes, place) = (routes.clone(), places.take());
        tokio::spawn(async move {
            serve(stream, routes, patience, place).await;
            drop(turn);
        });
    }
}

/// Returns a permit for one more connection; closes the slowest one for it.
async fn free_place(turns: &Arc<Semaphore>, places: &Places) -> Option<OwnedSemaphorePermit> {
    loop {
        let turn = Arc::clone(turns).acquire_owned();
        let is_full = turns.available_permits() == 0;
        if is_full && !places.leave_one() {
            // All connections are being answered, or have just been made.
            sleep(PAUSE / 4).await;
        }
        match timeout(PAUSE, turn).await {
            Ok(turn) => return turn.ok(),
            Err(_) => continue,
        }
    }
}

async fn serve(stream: TcpStream, routes: Router, patience: Patience, place: Place) {
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(HEAD_PATIENCE).max_buf_size(HEAD_BYTES);
    let (leave, place) = (Arc::clone(&place.leave), Arc::new(place));
    let of_place = Arc::clone(&place);
    let routes = routes.layer(middleware::from_fn(move |request: Request, next: Next| {
        let place = Arc::clone(&of_place);
        async move { place.answered(next.run(place.asked(request)).await) }
    }));
    let service = TowerToHyperService::new(routes);
    // Small answers are sent at once.
    let _ = stream.set_nodelay(true);
    let stream = Patient::new(TokioIo::new(stream), WRITE_PATIENCE);
    // A connection that breaks or is too slow needs no message.
    let connection = async {
        match patience {
            Patience::OneRequest(limit) => {
                let connection = builder.keep_alive(false).serve_connection(stream, service);
                let _ = timeout(limit, connection).await;
            }
            Patience::Kept => {
                let _ = builder.serve_connection(stream, service).with_upgrades().await;
            }
        }
    };
    tokio::select! {
        () = connection => {}
        () = leave.notified() => {}
    }
}

/// Returns the access rules of a server at this address.
pub fn access(place: SocketAddr, token: Option<String>, hosts: &[String]) -> Access {
    Access::new(place, token, hosts)
}
