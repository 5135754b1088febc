//! What the session itself has to say (a broker that cannot be reached, a disk that is full): one line each, on stderr.

use std::time::{SystemTime, UNIX_EPOCH};

/// Shared by all parts of a session; they may speak from threads of their own.
#[derive(Debug, Clone, Default)]
pub struct Log;

impl Log {
    /// Says one line. `part` is who speaks: `history`, `mqtt`, ….
    pub fn say(&self, part: &str, text: &str) {
        let now_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
        eprintln!("{now_s:.3} {part}: {text}");
    }
}
