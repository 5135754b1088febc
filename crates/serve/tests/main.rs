//! The tests of this crate in one program.

mod client;
mod feed;
#[allow(dead_code)] // Benches use the rest.
#[path = "../../watch/tests/live_support/mod.rs"]
mod live_support;

mod capture;
mod described;
mod limits;
mod load;
mod sources;
mod live;
mod results;
mod security;
mod sessions;
mod uploads;
