//! The session behind the page of `resight serve`: photographs, lens, points and distances in; pose, overlay and measurements out.
//!
//! A pure state machine: a [`Command`] changes the state, and a [`View`] contains everything to be shown. It has no access to disk, sockets or
//! clock; commands and views are transported elsewhere (HTTP, a WebSocket, a test). It computes nothing itself: every answer
//! is that of a job of the crate `resight`.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/demo/");
//! use resight_session::{Command, GivenLens, GivenTarget, Photograph, Session};
//! let mut session = Session::new();
//! session.add_photograph(Photograph::decode("left.png", std::fs::read(format!("{folder}left.png"))?)?)?;
//! let text = std::fs::read_to_string(format!("{folder}left.toml"))?;
//! session.apply(0, Command::SetLens { lens: GivenLens::File { name: "left.toml".into(), text } });
//! let text = std::fs::read_to_string(format!("{folder}grid.toml"))?;
//! let target = GivenTarget::File { name: "grid.toml".into(), text };
//! let view = session.apply(0, Command::FindTarget { target });
//! assert_eq!(view.status(), Some("ok"));
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod cameras;
mod texts;
mod command;
mod limits;
mod state;
mod history;
mod photograph;
mod lens;
mod places;
mod pose;
mod solving;
mod figures;
mod lines;
mod advice;
mod network;
mod measuring;
mod target;
mod snap;
mod view;
mod refusal;
mod parts;
mod edit;
mod session;
mod save;
mod export;
mod report;

pub use cameras::{COMMON_CAMERAS, CommonCamera};
pub use command::{
    Command, GivenLens, GivenLine, GivenTarget, LineDirection, MeasuredKind, SnapTo, Template,
};
pub use export::{Export, exports};
pub use limits::{FILES_BYTES, MOST_PHOTOS, SAVED_BYTES};
pub use measuring::{Measured, Measuring};
pub use photograph::Photograph;
pub use refusal::{Refusal, Step};
pub use save::SavedSession;
pub use session::Session;
pub use view::View;
