//! Fleets of cameras: from a day of detections to one question, which cameras moved?
//!
//! | stage | file |
//! | --- | --- |
//! | columns of a table | `layout.rs`, `arrays.rs`, `columns.rs` |
//! | views to poses, on plain slices and on Arrow | `solve.rs`, `answers.rs`, `batch.rs`; from images: `images.rs` |
//! | files in, pieces, parts, one file out | `source.rs`, `assemble.rs`, `run.rs`, `reread.rs` |
//! | what is kept of a camera: exact sums that merge in any order | `state.rs` |
//! | which cameras moved, are dead, have wrong maps or clocks | `assess.rs` |
//! | times, durations and sizes in words | `words.rs` |
//! | a page for people, JSON for programs | `report.rs`, `answer.rs` |
//! | units that are hardly meant | `units.rs` |
//! | the jobs as doors ask for them | `job.rs` |
//! | a day of a fleet with its truth | `simulate.rs` |
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use resight_fleet::simulate::Simulation;
//! use resight_fleet::solve::{Numbers, Solver, ViewColumns};
//!
//! let fleet = Simulation { cameras: 3, ..Simulation::default() }.fleet()?;
//! let (camera, pixels) = (&fleet.cameras[1], fleet.cameras[1].row(&fleet.simulation, 0));
//! let pixels: Vec<f64> = pixels.iter().flat_map(|(_, p)| p.iter().flat_map(|p| [p.x, p.y])).collect();
//! let solver = Solver { cameras: fleet.known()?.into(), sigma_px: 0.3 };
//! let number = solver.cameras.number(&camera.name).ok_or("no such camera")?;
//! let pixels = Numbers::Rows { values: &pixels, width: 8 };
//! let answers = solver.solve(&ViewColumns { camera: &[number], pixels, points_m: None, sigma_px: None });
//! assert_eq!(answers.status[0].name(), "ok");
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod error;
mod arrays;
mod assemble;
mod csv_out;
pub mod words;
pub mod cameras;
pub mod layout;
pub mod columns;
pub mod solve;
pub mod answers;
pub mod batch;
pub mod images;
pub mod state;
pub mod source;
pub mod run;
mod reread;
pub mod assess;
pub mod answer;
pub mod report;
mod units;
pub mod job;
pub mod simulate;

pub use batch::{SolvedRows, solve_batch, solve_columns};
pub use cameras::Cameras;
pub use error::FleetError;
pub use reread::reread;
pub use solve::Solver;
pub use state::FleetState;
