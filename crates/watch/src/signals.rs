//! Signals end a session in order: what waits is delivered, files are closed, the terminal is restored.

use anyhow::Result;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Sets `stop` at the first Ctrl-C or request to end; a second one ends the program at once.
#[cfg(unix)]
pub fn stop_at_request(stop: &Arc<AtomicBool>) -> Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    stop_on(&[SIGINT, SIGTERM], stop)
}

/// Sets `stop` also when the terminal is closed. (A session without a view may be meant to continue: `nohup`.)
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

/// Does nothing here: Ctrl-C ends the program at once.
#[cfg(not(unix))]
pub fn stop_at_request(_stop: &Arc<AtomicBool>) -> Result<()> {
    Ok(())
}

/// Does nothing here: a closed terminal ends the program at once.
#[cfg(not(unix))]
pub fn stop_with_terminal(_stop: &Arc<AtomicBool>) -> Result<()> {
    Ok(())
}
