//! The tests of this crate in one program: linking one for each file is most of the time of a clean run.

mod film_support;
mod history_support;
#[allow(dead_code)] // The landmarks' own tests use all of it.
#[path = "../../resight/tests/landmarks_support/mod.rs"]
mod landmarks_support;
mod live_support;
#[allow(dead_code)] // The bench times too.
#[path = "../benches/live/process.rs"]
mod process;
#[path = "../../core/tests/recorded.rs"]
mod recorded;

mod film;
mod history;
mod history_turns;
mod history_versions;
mod landmarks_live;
mod live_alarms;
mod live_clock;
mod live_end;
mod live_load;
mod live_size;
mod live_video;
mod real_watch;
mod recordings;
mod recordings_faults;
mod sources;
mod streams;
