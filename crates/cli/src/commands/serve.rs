//! `serve`: the local web page and the interface behind it.

use crate::output::{Outcome, print, remark};
use anyhow::Result;
use clap::Args;
use resight_serve::{ServeConfig, Server};
use resight_watch::{Log, Request};
use std::path::{Path, PathBuf};

/// Serves photographs, points and watched cameras over HTTP and WebSocket on this machine.
///
/// The first line of stdout is the address. It works without any network, and only this machine reaches it: another address needs --token-file.
/// The interface is described at /openapi.json.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight serve")]
#[command(after_long_help = "Examples:
  resight serve
  resight serve session.toml
  resight serve --listen 127.0.0.1:0
  resight serve --listen 192.168.1.5:8600 --token-file token --allowed-host survey.local")]
pub struct Serve {
    /// Session file of `resight watch`: its cameras are shown live.
    #[arg(value_name = "SESSION.toml")]
    session: Option<PathBuf>,
    /// Where to listen; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8600")]
    listen: String,
    /// File with the token that requests must bring; needed where other machines reach the address.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Names by which it is reached, besides localhost and the address.
    #[arg(long, value_name = "NAME[:PORT]")]
    allowed_host: Vec<String>,
}

/// See `Serve`. `session_of` reads a session file.
pub fn run(args: &Serve, session_of: impl Fn(&Path) -> Result<Request>) -> Result<Outcome> {
    let mut server = Server::bind(&ServeConfig {
        flag: "--listen",
        address: args.listen.clone(),
        token_file: args.token_file.clone(),
        hosts: args.allowed_host.clone(),
        patience: ServeConfig::PATIENCE,
    })?;
    if let Some(session) = &args.session {
        server.watch(session_of(session)?, Log::new(remark))?;
    }
    let place = server.place();
    if !place.ip().is_loopback() {
        remark("warning: the token travels unencrypted; put a proxy with TLS in front");
    }
    print(&format!("http://{place}/\n"))?;
    server.run()?;
    Ok(Outcome::Answered)
}
