//! The tests of this crate in one program.

mod session;
mod work;
