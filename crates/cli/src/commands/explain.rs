//! `explain`: a camera or target file in sentences.

use crate::output::{Outcome, print};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Says in sentences what a camera or target file means: frames, directions, units, quaternion order, camera centre.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  resight explain camchain.yaml")]
pub struct Explain {
    /// A file in any format that Resight reads.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Prints JSON Lines on stdout: {"file", "text", "remarks"}; remarks only where there are any.
    #[arg(long)]
    json: bool,
}

/// See `Explain`.
pub fn run(args: &Explain) -> Result<Outcome> {
    for (i, path) in args.files.iter().enumerate() {
        crate::files::must_exist(path)?;
        let found = resight::explain(path)?;
        match args.json {
            true => {
                let warn =
                    |text: &String| crate::output::remark(&format!("warning: {}: {text}", path.display()));
                found.remarks.iter().for_each(warn);
                print(&format!("{}\n", serde_json::to_string(&found)?))?;
            }
            false => print(&format!("{}{}\n", if i == 0 { "" } else { "\n" }, found.text))?,
        }
    }
    Ok(Outcome::Answered)
}
