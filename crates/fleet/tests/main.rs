//! The tests of fleets, one program.

mod day;
mod formats;
mod merge;
mod rows;
mod runs;
mod support;
