//! The tests of this crate in one program: linking one for each file is most of the time of a clean run.

mod calibrate_support;
mod identify_support;
mod noise;
mod real_support;
#[path = "../../core/tests/recorded.rs"]
mod recorded;
#[path = "../../core/tests/tidy_rules/mod.rs"]
mod tidy_rules;

mod calibrate;
mod calibrate_sets;
mod clean;
mod constrained;
mod contact_properties;
mod derivatives;
mod drift;
mod events;
mod files;
mod golden;
mod hostile;
mod identify;
mod identify_sweeps;
mod identify_trials;
mod integrate;
mod projection;
mod raw;
mod several;
mod shape;
mod simulate;
mod simulate_laws;
mod spatial;
mod sweep;
mod sweep_simulated;
mod tidy;
