//! The content of the view: the numbers, the words and the colours of the states.

use super::super::super::log::Line as EventText;
use super::keys::View;
use crate::board::{Board, Instants};
use crate::live::State;
use ratatui::style::{Color, Style};

/// The content of the view.
pub struct Picture<'a> {
    pub board: &'a Board,
    /// The messages of the session itself.
    pub lines: &'a [EventText],
    pub now: Instants,
    pub view: &'a View,
    /// Whether the terminal's user wants colours.
    pub has_color: bool,
}

impl Picture<'_> {
    /// Returns a style, plain where colours are not wanted.
    pub fn color(&self, color: Color) -> Style {
        if self.has_color { Style::new().fg(color) } else { Style::new() }
    }

    /// Returns sign, word and colour of the state of a pair; those of a lost source take precedence.
    pub fn sign(&self, pair: usize) -> (&'static str, &'static str, Color) {
        let camera = self.board.camera_of(pair);
        match self.board.pairs.get(pair).and_then(|pair| pair.state.as_ref()) {
            Some(State::Drifted(_)) => ("▲", "drifted", Color::Red),
            _ if camera.is_some_and(|camera| camera.lost.is_some()) => ("✗", "lost", Color::Magenta),
            Some(State::Steady) => ("●", "steady", Color::Green),
            Some(State::Tracking) => ("●", "tracking", Color::Green),
            Some(State::Checking(_)) => ("◐", "checking", Color::Yellow),
            Some(State::Inconsistent) => ("≠", "inconsistent", Color::Magenta),
            Some(State::Learning { .. }) => ("…", "learning", Color::Cyan),
            Some(State::Stale { .. }) => ("○", "stale", Color::Magenta),
            None => ("○", "waiting", Color::Magenta),
        }
    }

    /// Returns the number of pairs in each state, with its word and colour; the worst first.
    pub fn counts(&self) -> Vec<(usize, &'static str, Color)> {
        const ORDER: [&str; 9] = [
            "drifted",
            "lost",
            "inconsistent",
            "stale",
            "waiting",
            "checking",
            "learning",
            "tracking",
            "steady",
        ];
        let signs: Vec<_> = (0..self.board.pairs.len()).map(|pair| self.sign(pair)).collect();
        let count = |word: &&'static str| {
            let same: Vec<_> = signs.iter().filter(|sign| sign.1 == *word).collect();
            same.first().map(|sign| (same.len(), sign.1, sign.2))
        };
        ORDER.iter().filter_map(count).collect()
    }

    /// Returns the name of the selected pair.
    pub fn title(&self) -> String {
        self.board.names.pairs().get(self.view.chosen).cloned().unwrap_or_default()
    }
}

/// Returns hours, minutes, seconds.
pub fn duration(seconds: f64) -> String {
    let seconds = seconds.max(0.0) as u64;
    format!("{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}
