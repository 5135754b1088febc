//! The tests of the library for C, in one program: the header, and programs in C and C++ that are built with the library and run.

mod build;
mod exact;
mod examples;
mod header;
mod hostile;
