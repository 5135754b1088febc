//! The program: parse, call, print. No mathematics.
#![forbid(unsafe_code)]

mod args;
mod files;
mod gravity;
mod intrinsics;
mod output;
mod points;
mod robust;
mod text;
mod turned;
mod commands;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = args::Arguments::parse();
    match commands::run(arguments.command) {
        Ok(outcome) => outcome.into(),
        Err(reason) => {
            output::remark(&format!("error: {reason:#}"));
            ExitCode::from(2)
        }
    }
}
