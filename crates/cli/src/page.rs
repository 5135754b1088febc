//! The page that a running command shows: its flags, and the server behind it.

use crate::output::remark;
use anyhow::Result;
use clap::Args;
use resight_serve::{ServeConfig, Server};
use std::path::PathBuf;

/// Where the page of a running command is; the command that flattens it states what is shown.
#[derive(Debug, Clone, Args)]
pub struct PageArgs {
    /// Shows the command at work on a page at this address, as `resight serve` does.
    #[arg(long, hide_short_help = true, value_name = "ADDRESS:PORT")]
    pub serve: Option<String>,
    /// File with the token that requests of the page must bring; needed where other machines reach the address.
    #[arg(long, hide_short_help = true, value_name = "FILE", requires = "serve")]
    serve_token_file: Option<PathBuf>,
    /// Names by which the page is reached, besides localhost and the address.
    #[arg(long, hide_short_help = true, value_name = "NAME[:PORT]", requires = "serve")]
    serve_host: Vec<String>,
}

impl PageArgs {
    /// Returns the server of the page where one is asked for, with its address taken.
    ///
    /// # Errors
    /// An address that cannot be taken, or one that others reach without a token.
    pub fn server(&self) -> Result<Option<Server>> {
        let bind = |address: &String| {
            Server::bind(&ServeConfig {
                flag: "--serve",
                address: address.clone(),
                token_file: self.serve_token_file.clone(),
                hosts: self.serve_host.clone(),
                patience: ServeConfig::PATIENCE,
            })
        };
        self.serve.as_ref().map(bind).transpose()
    }
}

/// Runs a server on a thread of its own, beside the command.
///
/// # Errors
/// A thread that cannot be started.
pub fn run_beside(server: Server) -> Result<()> {
    std::thread::Builder::new().name("serve".to_owned()).spawn(move || {
        if let Err(reason) = server.run() {
            remark(&format!("--serve: {reason:#}"));
        }
    })?;
    Ok(())
}
