//! The tests of fleets, one program.

mod cases;
mod day;
mod faults;
mod formats;
mod merge;
mod rows;
mod runs;
mod support;
