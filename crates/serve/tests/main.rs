//! The tests of this crate in one program.

mod client;

mod security;
mod sessions;
mod uploads;
