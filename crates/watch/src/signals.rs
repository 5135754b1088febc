//! Signals end a session in order: what waits is delivered, files are closed, a terminal is given back.

use anyhow::Result;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The first Ctrl-C or request to end sets `stop`; a second one ends the program at once.
#[cfg(unix)]
pub fn stop_at_request(stop: &Arc<AtomicBool>) -> Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    stop_on(&[SIGINT, SIGTERM], stop)
}

/// The same when the terminal is closed. (Without a view it may be meant to go on: `nohup`.)
#[cfg(unix)]
pub fn stop_with_terminal(stop: &Arc<AtomicBool>) -> Result<()> {
    stop_on(&[signal_hook::consts::SIGHUP], stop)
}

#[cfg(unix)]
fn stop_on(signals: &[i32], stop: &Arc<AtomicBool>) -> Result<()> {
    for signal in signals {
        signal_hook::flag::register_conditional_shutdown(*signal, 1, Arc::clone(stop))?;
        signal_hook::flag::register(*signal, Arc::clone(stop))?;
    }
    Ok(())
}

/// Ctrl-C ends the program at once.
#[cfg(not(unix))]
pub fn stop_at_request(_stop: &Arc<AtomicBool>) -> Result<()> {
    Ok(())
}

/// A closed terminal ends the program at once.
#[cfg(not(unix))]
pub fn stop_with_terminal(_stop: &Arc<AtomicBool>) -> Result<()> {
    Ok(())
}
