//! The session drawn in the terminal. A thread of its own draws a copy at most ten times a second, and reads the keys; processing an event only
//! changes numbers.

mod bars;
mod details;
mod keys;
mod picture;
mod panel;
mod table;
mod terminal;
mod view;

use super::super::log::{Line, Log, now_unix_s};
use super::{Output, Session};
use crate::board::{Board, Instants};
use crate::live::Event;
use anyhow::{Context, Result, anyhow};
use keys::{Pressed, View};
use picture::Picture;
use ratatui::crossterm::event;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use terminal::Screen;

/// Shortest interval between two images.
const PERIOD: Duration = Duration::from_millis(100);
/// Interval at which a session that has ended checks whether its view was closed.
const PATIENCE: Duration = Duration::from_millis(50);

/// The terminal view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TuiConfig {
    /// Number of frames over which medians, percentiles and standard deviations are taken.
    pub window: usize,
    /// Whether standard output carries JSON; the view is then drawn on the controlling terminal.
    pub has_json: bool,
}

/// The session's side of the view.
pub struct Tui {
    shared: Shared,
    thread: Option<JoinHandle<Result<()>>>,
    is_once: bool,
}

/// The state that session and view share.
#[derive(Clone)]
struct Shared {
    board: Arc<Mutex<Board>>,
    log: Log,
    /// The flag that ends the session.
    stop: Arc<AtomicBool>,
    /// The flag that ends the view.
    is_closing: Arc<AtomicBool>,
    started: Instant,
}

/// Opens the view.
///
/// # Errors
/// No terminal to draw on.
pub(super) fn open(config: TuiConfig, session: &Session<'_>) -> Result<Box<dyn Output>> {
    let screen = Screen::open(config.has_json)?;
    let shared = Shared {
        board: Arc::new(Mutex::new(Board::new(session.names, &session.references, config.window))),
        log: session.log.clone(),
        stop: Arc::clone(session.stop),
        is_closing: Arc::new(AtomicBool::new(false)),
        started: Instant::now(),
    };
    crate::signals::stop_with_terminal(session.stop)?;
    session.log.hold();
    let of_thread = shared.clone();
    let thread = thread::Builder::new().name("view".to_string()).spawn(move || show(screen, &of_thread))?;
    Ok(Box::new(Tui { shared, thread: Some(thread), is_once: session.is_once }))
}

impl Shared {
    /// A thread that panicked during an event left numbers that can still be shown.
    fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Instants {
        Instants { up_s: self.started.elapsed().as_secs_f64(), unix_s: now_unix_s() }
    }
}

impl Output for Tui {
    fn take(&mut self, event: &Event) -> Result<()> {
        self.shared.board().take(event, self.shared.now());
        if self.is_gone() { self.close() } else { Ok(()) }
    }

    /// Waits until the user closes the view of a session that has ended, except in a nightly check, which ends by itself.
    fn finish(&mut self) -> Result<()> {
        self.shared.board().is_over = true;
        while !self.is_once && !self.is_gone() && !self.shared.stop.load(Ordering::Relaxed) {
            thread::sleep(PATIENCE);
        }
        self.close()
    }
}

impl Tui {
    fn is_gone(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Restores the terminal, and returns the reason if the view ended by itself.
    fn close(&mut self) -> Result<()> {
        self.shared.is_closing.store(true, Ordering::SeqCst);
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let ended = thread.join().unwrap_or_else(|_| Err(anyhow!("the terminal view broke off")));
        self.shared.log.release();
        ended
    }
}

impl Drop for Tui {
    fn drop(&mut self) {
        if let Err(reason) = self.close() {
            self.shared.log.say("view", &reason.to_string());
        }
    }
}

/// A copy of what is drawn, so that no other thread waits for the terminal.
struct Copied {
    board: Board,
    lines: Vec<Line>,
    now: Instants,
}

/// Draws and reads keys until the view is to be closed.
fn show(mut screen: Screen, shared: &Shared) -> Result<()> {
    let has_color = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let (mut view, mut frozen) = (View::default(), None);
    while screen.is_open() && !shared.is_closing.load(Ordering::SeqCst) {
        let drawn = Instant::now();
        let copied = frozen.take().unwrap_or_else(|| {
            let board = shared.board().clone();
            Copied { board, lines: shared.log.lines(), now: shared.now() }
        });
        let Copied { board, lines, now } = &copied;
        view.choose_among(board.pairs.len());
        let picture = Picture { board, lines, now: *now, view: &view, has_color };
        screen.terminal.draw(|frame| view::draw(frame, &picture)).context("--tui: the terminal is gone")?;
        read_keys(drawn + PERIOD, &mut view, shared)?;
        frozen = view.is_paused.then_some(copied);
    }
    Ok(())
}

/// Reads keys until the next image is due.
fn read_keys(until: Instant, view: &mut View, shared: &Shared) -> Result<()> {
    while event::poll(until.saturating_duration_since(Instant::now()))
        .context("--tui: no keys can be read")?
    {
        match view.press(&event::read().context("--tui: no keys can be read")?) {
            Pressed::Quit => shared.stop.store(true, Ordering::Relaxed),
            Pressed::Reset => shared.board().reset(),
            Pressed::Nothing => {}
        }
    }
    Ok(())
}
