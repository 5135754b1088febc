//! The program: parse, call, print. No mathematics.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod args;
mod files;
mod gravity;
mod intrinsics;
mod output;
mod points;
mod robust;
mod text;
mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    match args::Arguments::read().and_then(|arguments| commands::run(arguments.command)) {
        Ok(outcome) => outcome.into(),
        Err(reason) => {
            output::remark(&format!("error: {reason:#}"));
            ExitCode::from(2)
        }
    }
}
