//! The server: its address, its routes, and how it ends.

use crate::app::{self, App};
use crate::capture::{self, Capturing};
use crate::error::Problem;
use crate::live::{self, Live};
use crate::{guard, openapi, page, photograph, results, socket};
use anyhow::{Context, Result};
use axum::http::StatusCode;
use axum::{Router, middleware};
use resight_watch::web::access::{self, Access};
use resight_watch::web::{Flags, Patience, accept, listen};
use resight_watch::{Log, Request};
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Threads that answer; what computes has others.
const THREADS: usize = 2;
/// Threads that compute: more than there are turns of long work, so that what takes milliseconds finds one.
const WORKERS: usize = 12;
const _: () = assert!(app::PERMITS + 2 <= WORKERS);

const FLAGS: Flags = Flags { address: "--listen", token_file: "--token-file", host: "--allowed-host" };

/// The address to serve, and the restrictions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServeConfig {
    /// The flag that the address comes from, for messages.
    pub flag: &'static str,
    /// `ADDRESS:PORT`; port 0 takes a free one.
    pub address: String,
    /// The file whose first line is the token that requests must bring; needed on addresses that other machines can reach.
    pub token_file: Option<PathBuf>,
    /// Names by which the page is reached, besides localhost and the address.
    pub hosts: Vec<String>,
    /// For a request, its body included; one that takes longer is given up. What streams its answer, or becomes a WebSocket, has its own
    /// patience after that.
    pub patience: Duration,
}

impl ServeConfig {
    /// Time enough for the largest body over a slow network.
    pub const PATIENCE: Duration = Duration::from_secs(120);
}

/// A server that has its address.
pub struct Server {
    listener: TcpListener,
    place: SocketAddr,
    access: Access,
    patience: Duration,
    live: Option<Arc<Live>>,
    captured: Option<Arc<Capturing>>,
}

impl Server {
    /// Takes the address.
    ///
    /// # Errors
    /// An address that cannot be listened on, or that other machines can reach without a token; a token that could be guessed.
    pub fn bind(config: &ServeConfig) -> Result<Self> {
        let token =
            config.token_file.as_deref().map(|path| access::token(FLAGS.token_file, path)).transpose()?;
        let (listener, place) =
            listen(&config.address, token.is_some(), &config.hosts, Flags { address: config.flag, ..FLAGS })?;
        let access = Access::new(place, token, &config.hosts);
        Ok(Server { listener, place, access, patience: config.patience, live: None, captured: None })
    }

    /// Returns its address.
    pub fn place(&self) -> SocketAddr {
        self.place
    }

    /// Shows a session that runs elsewhere.
    pub fn show(&mut self, live: Arc<Live>) {
        self.live = Some(live);
    }

    /// Shows a capture of intrinsics that runs elsewhere.
    pub fn show_capture(&mut self, capture: Arc<Capturing>) {
        self.captured = Some(capture);
    }

    /// Runs a session beside the server, on a thread of its own.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn watch(&mut self, request: Request, log: Log) -> Result<()> {
        let live = Arc::new(Live::new(&request));
        self.live = Some(Arc::clone(&live));
        let run = move || live::run(&live, request, &log);
        std::thread::Builder::new()
            .name("watch".to_owned())
            .spawn(run)
            .context("a thread for the session")?;
        Ok(())
    }

    /// Serves until the program ends.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn run(self) -> Result<()> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(THREADS)
            .max_blocking_threads(WORKERS)
            .thread_name("serve")
            .enable_all()
            .build()
            .context("threads for --listen")?;
        let app = App::new(self.live, self.captured);
        let routes = routes(app, self.access, self.patience);
        Ok(runtime.block_on(accept(self.listener, routes, Patience::Kept))?)
    }
}

fn routes(app: App, access: Access, patience: Duration) -> Router {
    let routes = Router::new()
        .merge(page::routes())
        .merge(photograph::routes())
        .merge(socket::routes())
        .merge(results::routes())
        .merge(live::routes::routes())
        .merge(live::mjpeg::routes())
        .merge(live::feed::routes())
        .merge(capture::routes::routes())
        .merge(capture::feed::routes())
        .merge(openapi::routes())
        .fallback(async || Problem::missing("There is nothing here; see /openapi.json."))
        .method_not_allowed_fallback(async || {
            let message = "This address takes other methods; see /openapi.json.";
            Problem::new(StatusCode::METHOD_NOT_ALLOWED, "method", message)
        })
        .layer(middleware::from_fn(guard::in_one_form))
        .layer(middleware::from_fn_with_state(patience, guard::in_time))
        .with_state(app);
    // The guard surrounds everything: no request is routed before it was checked.
    Router::new()
        .fallback_service(routes)
        .layer(middleware::from_fn_with_state(Arc::new(access), guard::guard))
}
