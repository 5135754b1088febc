//! Messages of the session itself (a broker that cannot be reached, a disk that is full), one line each. While a terminal view is open the lines
//! are held: the view shows them, and they are printed when it is closed.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Largest number of lines kept; a view shows the last of them.
const KEPT: usize = 1000;

/// The log, shared by all parts of a session, which may write from their own threads.
#[derive(Debug, Clone)]
pub struct Log {
    kept: Arc<Mutex<Kept>>,
    /// Prints a line; only programs do.
    print: fn(&str),
}

/// A log that prints nothing; its lines can be read.
impl Default for Log {
    fn default() -> Self {
        Log::new(|_| {})
    }
}

/// One line.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Time of the message, seconds since 1970.
    pub unix_s: f64,
    /// The part of the program, and its message.
    pub text: String,
}

#[derive(Debug, Default)]
struct Kept {
    lines: VecDeque<Line>,
    is_held: bool,
    /// Number of last lines that are not printed yet.
    unsaid: usize,
    /// Number of held lines that were removed for later ones.
    forgotten: u64,
}

impl Log {
    /// Builds a log whose lines `print` prints, each with its time.
    pub fn new(print: fn(&str)) -> Self {
        Log { kept: Arc::default(), print }
    }

    /// Writes one line. `part` names the part of the program: `history`, `mqtt`, ….
    pub fn say(&self, part: &str, text: &str) {
        let line = Line { unix_s: now_unix_s(), text: format!("{part}: {text}") };
        let mut kept = self.lock();
        if kept.is_held {
            kept.unsaid += 1;
        } else {
            self.print(&line);
        }
        kept.push(line);
    }

    /// Holds lines from now on, because something else is drawn where they would be printed.
    pub fn hold(&self) {
        self.lock().is_held = true;
    }

    /// Prints what was held, and continues printing.
    pub fn release(&self) {
        let mut kept = self.lock();
        kept.is_held = false;
        if 0 < kept.forgotten {
            (self.print)(&format!("{} earlier lines are not shown; {KEPT} are held at most", kept.forgotten));
        }
        let said = kept.lines.len().saturating_sub(kept.unsaid);
        kept.lines.iter().skip(said).for_each(|line| self.print(line));
        (kept.unsaid, kept.forgotten) = (0, 0);
    }

    /// Returns the last lines, oldest first, whether or not they were held.
    pub fn lines(&self) -> Vec<Line> {
        self.lock().lines.iter().cloned().collect()
    }

    fn print(&self, line: &Line) {
        (self.print)(&format!("{:.3} {}", line.unix_s, line.text));
    }

    /// A thread that panicked while it wrote left valid lines.
    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn push(&mut self, line: Line) {
        if self.lines.len() == KEPT {
            self.lines.pop_front();
            let is_unsaid = KEPT < self.unsaid;
            self.forgotten += u64::from(is_unsaid);
            self.unsaid -= usize::from(is_unsaid);
        }
        self.lines.push_back(line);
    }
}

/// Returns the seconds since 1970.
pub fn now_unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_held_and_kept_in_order() {
        let log = Log::default();
        log.hold();
        let speaker = log.clone();
        std::thread::spawn(move || speaker.say("mqtt", "the broker is gone")).join().expect("the speaker");
        log.say("history", "the disk is full");
        let texts: Vec<String> = log.lines().into_iter().map(|line| line.text).collect();
        assert_eq!(texts, ["mqtt: the broker is gone", "history: the disk is full"]);
        assert_eq!(log.lock().unsaid, 2);
        log.release();
        assert_eq!(log.lock().unsaid, 0);
        assert_eq!(log.lines().len(), 2);
    }

    #[test]
    fn held_lines_do_not_grow_without_bound() {
        let log = Log::default();
        log.hold();
        (0..KEPT + 7).for_each(|i| log.say("part", &i.to_string()));
        let kept = log.lock();
        assert_eq!((kept.lines.len(), kept.unsaid, kept.forgotten), (KEPT, KEPT, 7));
        assert_eq!(kept.lines[0].text, "part: 7");
    }
}
