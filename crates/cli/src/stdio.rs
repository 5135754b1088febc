//! What reaches the program, stdout and stderr.

use anyhow::Result;
use std::ffi::OsString;
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// The command line, its first word included: not that of the process where another program runs this one.
static ARGUMENTS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Keeps the command line, once.
pub fn set_arguments(arguments: Vec<OsString>) {
    let _ = ARGUMENTS.set(arguments); // The program runs once a process.
}

/// The command line.
pub fn arguments() -> &'static [OsString] {
    ARGUMENTS.get().map_or(&[], Vec::as_slice)
}

/// Whether remarks and progress are left out.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Leaves remarks and progress out from now on.
pub fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether they are left out.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Writes a remark or a warning to stderr, unless quiet.
pub fn remark(text: &str) {
    if !is_quiet() {
        error(text);
    }
}

/// Writes a line to stderr. Where that cannot be written (its reader is gone, the disk is full) there is nobody left to read it, and the
/// work continues.
pub fn error(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Writes to stdout. A reader that has gone away (`| head`) ends the program quietly.
pub fn print(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => std::process::exit(0),
        result => Ok(result?),
    }
}
