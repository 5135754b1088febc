//! The program as a function, for every door that starts it: the binary `resight`, and the command that the Python wheel installs.
//! Parse, call, print; no mathematics.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod args;
mod camera;
mod files;
mod gravity;
mod map;
mod meant;
mod output;
mod page;
mod robust;
mod stdio;
mod text;
mod commands;
mod program;

use resight::formats::without_number;
use std::ffi::OsString;

/// Runs the program with these arguments, the first of which is its name; the exit status of docs/reference.
///
/// It answers on stdout and stderr. A reader of stdout that has gone away ends the process.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    stdio::set_arguments(arguments.into_iter().collect());
    let arguments = match program::Arguments::read(stdio::arguments()) {
        Ok(arguments) => arguments,
        Err(reason) => return refused(&reason),
    };
    if arguments.quiet {
        output::be_quiet();
    }
    match program::run(arguments.command) {
        Ok(outcome) => outcome.status(),
        Err(reason) => refused(&reason),
    }
}

/// Says what is wrong with the command line, or prints the help that was asked for.
fn refused(reason: &anyhow::Error) -> u8 {
    match reason.downcast_ref::<clap::Error>() {
        Some(usage) => {
            let _ = usage.print(); // A failure to print cannot be reported either.
            u8::try_from(usage.exit_code()).unwrap_or(2)
        }
        None => {
            output::error(&without_number(&format!("error: {reason:#}")));
            2
        }
    }
}
