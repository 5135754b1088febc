//! The program: parse, call, print. No mathematics.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod args;
mod camera;
mod files;
mod gravity;
mod output;
mod robust;
mod stdio;
mod text;
mod commands;
mod program;

use std::process::ExitCode;

fn main() -> ExitCode {
    let run = |arguments: program::Arguments| {
        if arguments.quiet {
            output::be_quiet();
        }
        program::run(arguments.command)
    };
    match program::Arguments::read().and_then(run) {
        Ok(outcome) => outcome.into(),
        Err(reason) => {
            output::error(&format!("error: {reason:#}"));
            ExitCode::from(2)
        }
    }
}
