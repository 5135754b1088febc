//! The terminal: it is restored at the end, also after a panic or a signal.

use anyhow::{Context, Result, bail};
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::cursor::Show;
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use std::fs::OpenOptions;
use std::io::{BufWriter, IsTerminal, Write, stdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The terminal of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Stdout,
    /// The controlling terminal, where standard output carries something else.
    ControllingTerminal,
}

type Writer = BufWriter<Box<dyn Write + Send>>;

/// A terminal for drawing, restored when dropped.
pub struct Screen {
    /// The drawing interface.
    pub terminal: Terminal<CrosstermBackend<Writer>>,
    place: Place,
    is_open: Arc<AtomicBool>,
}

impl Screen {
    /// Opens the terminal; with JSON on standard output, the controlling one.
    ///
    /// # Errors
    /// No terminal, or one to which JSON is written.
    pub fn open(has_json: bool) -> Result<Self> {
        let place = place(has_json, stdout().is_terminal())?;
        let writer = writer(place)?;
        enable_raw_mode().context("--tui: the terminal does not give single keys")?;
        let is_open = Arc::new(AtomicBool::new(true));
        restore_before_a_panic_is_reported(place, &is_open);
        let opened = enter(writer);
        if opened.is_err() {
            give_back(place, &is_open);
        }
        Ok(Screen { terminal: opened?, place, is_open })
    }

    /// Returns false once a panic has restored the terminal: nothing may be drawn any more.
    pub fn is_open(&self) -> bool {
        self.is_open.load(Ordering::SeqCst)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        give_back(self.place, &self.is_open);
    }
}

fn place(has_json: bool, is_stdout_terminal: bool) -> Result<Place> {
    match (has_json, is_stdout_terminal) {
        (false, true) => Ok(Place::Stdout),
        (true, false) => Ok(Place::ControllingTerminal),
        (true, true) => bail!(
            "--tui and --json would both write to the terminal; send the JSON to a file (--json > events.jsonl) or leave one of them out"
        ),
        (false, false) => bail!(
            "--tui needs a terminal, and standard output is none; run it in one (ssh -t, tmux), or leave --tui out"
        ),
    }
}

fn writer(place: Place) -> Result<Writer> {
    let inner: Box<dyn Write + Send> = match place {
        Place::Stdout => Box::new(stdout()),
        Place::ControllingTerminal => Box::new(
            OpenOptions::new()
                .write(true)
                .open("/dev/tty")
                .context("--tui with --json draws on /dev/tty, which cannot be opened; run it in a terminal, or leave --tui out")?,
        ),
    };
    Ok(BufWriter::with_capacity(1 << 16, inner))
}

fn enter(mut writer: Writer) -> Result<Terminal<CrosstermBackend<Writer>>> {
    execute!(writer, EnterAlternateScreen).context("--tui: the terminal cannot be written to")?;
    Terminal::new(CrosstermBackend::new(writer)).context("--tui: the terminal does not tell its size")
}

/// Restores the terminal before the message of a panic, which would otherwise be drawn over and have no line ends.
fn restore_before_a_panic_is_reported(place: Place, is_open: &Arc<AtomicBool>) {
    let (is_open, before) = (Arc::clone(is_open), std::panic::take_hook());
    std::panic::set_hook(Box::new(move |panic| {
        give_back(place, &is_open);
        before(panic);
    }));
}

/// Restores the terminal once. A terminal that is gone needs nothing.
fn give_back(place: Place, is_open: &AtomicBool) {
    if is_open.swap(false, Ordering::SeqCst) {
        if let Ok(mut writer) = writer(place) {
            let _ = execute!(writer, LeaveAlternateScreen, Show);
        }
        let _ = disable_raw_mode();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_and_json_do_not_share_a_terminal() {
        assert_eq!(place(false, true).expect("a terminal"), Place::Stdout);
        assert_eq!(place(true, false).expect("JSON in a file"), Place::ControllingTerminal);
        let message = |has_json, is_terminal| place(has_json, is_terminal).expect_err("refused").to_string();
        assert!(message(true, true).contains("--tui and --json"));
        assert!(message(false, false).contains("--tui needs a terminal"));
    }
}
