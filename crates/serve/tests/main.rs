//! The tests of this crate in one program.

mod client;

mod described;
mod limits;
mod results;
mod security;
mod sessions;
mod uploads;
