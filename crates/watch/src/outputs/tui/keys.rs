//! The effect of the keys on the view.

use ratatui::crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers};

/// The selection of the view.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct View {
    /// The selected pair.
    pub chosen: usize,
    pub has_details: bool,
    pub is_paused: bool,
    /// Number of pairs.
    pub pairs: usize,
}

/// The effect of a key on the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pressed {
    Nothing,
    Quit,
    Reset,
}

impl View {
    /// Sets the number of pairs.
    pub fn choose_among(&mut self, pairs: usize) {
        self.pairs = pairs;
        self.chosen = self.chosen.min(pairs.saturating_sub(1));
    }

    /// Processes a key or any other event of the terminal.
    pub fn press(&mut self, event: &Event) -> Pressed {
        let Event::Key(key) = event else { return Pressed::Nothing };
        if key.kind == KeyEventKind::Release {
            return Pressed::Nothing;
        }
        match key.code {
            KeyCode::Char('q' | 'Q') => return Pressed::Quit,
            // In raw mode the terminal does not convert it to a signal.
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Pressed::Quit,
            KeyCode::Char('r' | 'R') => return Pressed::Reset,
            KeyCode::Char('p' | 'P' | ' ') => self.is_paused = !self.is_paused,
            KeyCode::Up | KeyCode::Char('k') => self.chosen = self.chosen.saturating_sub(1),
            KeyCode::Down | KeyCode::Char('j') => {
                self.chosen = (self.chosen + 1).min(self.pairs.saturating_sub(1));
            }
            KeyCode::Enter => self.has_details = !self.has_details,
            KeyCode::Esc => self.has_details = false,
            _ => {}
        }
        Pressed::Nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::crossterm::event::KeyEvent;

    fn press(view: &mut View, code: KeyCode) -> Pressed {
        view.press(&Event::Key(KeyEvent::new(code, KeyModifiers::NONE)))
    }

    #[test]
    fn arrows_stay_within_the_cameras() {
        let mut view = View::default();
        view.choose_among(2);
        for (code, chosen) in [(KeyCode::Up, 0), (KeyCode::Down, 1), (KeyCode::Down, 1), (KeyCode::Up, 0)] {
            assert_eq!((press(&mut view, code), view.chosen), (Pressed::Nothing, chosen));
        }
        view.chosen = 9;
        view.choose_among(0);
        assert_eq!((press(&mut view, KeyCode::Down), view.chosen), (Pressed::Nothing, 0));
    }

    #[test]
    fn keys_do_what_the_help_says() {
        let mut view = View::default();
        assert_eq!(press(&mut view, KeyCode::Char('q')), Pressed::Quit);
        assert_eq!(press(&mut view, KeyCode::Char('r')), Pressed::Reset);
        press(&mut view, KeyCode::Char('p'));
        press(&mut view, KeyCode::Enter);
        assert!(view.is_paused && view.has_details);
        press(&mut view, KeyCode::Esc);
        press(&mut view, KeyCode::Char('p'));
        assert!(!view.is_paused && !view.has_details);
        let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(view.press(&Event::Key(interrupt)), Pressed::Quit);
        assert_eq!(press(&mut view, KeyCode::Char('c')), Pressed::Nothing);
    }
}
