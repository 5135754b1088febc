//! `explain`: a camera or target file in sentences.

use crate::output::{Outcome, print};
use anyhow::Result;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Says in sentences what a camera or target file means: frames, directions, units, quaternion order, camera centre.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  resight explain camchain.yaml")]
pub struct Explain {
    /// A file in any format that Resight reads.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// JSON Lines: {"file", "text", "remarks"}; remarks only where there are any.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Explanation {
    file: String,
    text: String,
    /// What is unusual about the file, such as lengths that are hardly metres.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    remarks: Vec<String>,
}

/// See `Explain`.
pub fn run(args: &Explain) -> Result<Outcome> {
    for (i, path) in args.files.iter().enumerate() {
        crate::files::must_exist(path)?;
        let text = resight::formats::explain(path)?;
        let text = text.trim_end();
        let remarks = resight::formats::remarks(path);
        remarks
            .iter()
            .for_each(|text| crate::output::remark(&format!("warning: {}: {text}", path.display())));
        match args.json {
            true => {
                let line = serde_json::to_string(&Explanation {
                    file: path.display().to_string(),
                    text: text.to_string(),
                    remarks,
                })?;
                print(&format!("{line}\n"))?;
            }
            false => print(&format!("{}{text}\n", if i == 0 { "" } else { "\n" }))?,
        }
    }
    Ok(Outcome::Answered)
}
