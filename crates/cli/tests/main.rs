//! The tests of this crate in one program: linking one for each file is most of the time of a clean run.

mod book_support;
mod carried_support;
#[allow(dead_code)] // Its main reads and writes folders.
#[path = "../../whisker/examples/touch_meets_sight.rs"]
mod example;
mod film_support;
#[allow(dead_code)] // `resight` spoils folders too.
#[path = "../../resight/tests/fuzz_support/mod.rs"]
mod fuzz_support;
#[allow(dead_code)] // Another crate's tests use the rest.
#[path = "../../resight/tests/landmarks_support/mod.rs"]
mod landmarks_support;
mod receivers;
#[path = "../../core/tests/recorded.rs"]
mod recorded;
mod rig_support;
mod support;
#[path = "../../resight/tests/vehicle_support/mod.rs"]
mod vehicle_support;
mod watch_support;

mod advise;
mod book;
mod budget;
mod capture;
mod compare;
mod completions;
mod convert;
mod estimate_focal;
mod examples;
mod films;
mod first_pose;
mod flags;
mod fuzz;
mod georeference;
mod history_faults;
mod hostile_files;
mod images;
mod inputs;
mod intrinsics;
mod licences;
mod marked_lines;
mod map;
mod measure;
mod nominal;
mod print;
mod rig;
mod rig_faults;
mod rig_known_poses;
mod rig_pose;
mod rig_real;
mod robust;
mod solve;
mod solve_lines;
mod stranger;
mod streams;
mod streams_unconnected;
mod table_two;
mod tag_maps;
mod touch_meets_sight;
mod uncertain;
mod upright;
mod vehicle;
mod watch;
mod watch_gap;
mod watch_landmarks;
mod watch_learn;
mod watch_mcap;
mod watch_metrics;
mod watch_outputs;
mod watch_rig;
mod watch_rig_real;
mod watch_rig_state;
mod watch_session;
mod watch_state;
mod watch_tui;
mod whisker;
mod written_is_read;
mod zones;
