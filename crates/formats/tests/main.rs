//! The tests of this crate in one program: linking one for each file is most of the time of a clean run.

#[path = "../../core/tests/recorded.rs"]
mod recorded;
mod support;

mod formats_colmap;
mod formats_convert;
mod formats_devices;
mod formats_explain;
mod formats_files;
mod formats_fuzz;
mod formats_keys;
mod formats_printed;
mod formats_read;
mod formats_real;
mod formats_refuse;
mod formats_rigs;
mod formats_vehicles;
mod formats_write;
mod pose_lists;
