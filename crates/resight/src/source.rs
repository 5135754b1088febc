//! Where pictures come from, besides single files.

pub mod video;
