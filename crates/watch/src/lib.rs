//! Watches cameras over time: a pose for every frame, an alarm with a stated rate of false alarms when a camera moves, and outputs of both.
//!
//! A camera whose frames are known already, watched until they end:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/demo"))?;
//! use resight_watch::live::{LiveCamera, LiveConfig, Watched};
//! use resight_watch::source::pictures::{Clock, ImageFiles};
//! use resight_watch::{Log, Request, run};
//!
//! let target = Watched { name: "grid".into(), target: resight::read_target("grid.toml")?.into(), reference: None };
//! let frames = vec!["left.png".into(); 60]; // A still camera at one frame a second.
//! let source = Box::new(ImageFiles::new(frames, Clock::Every(1.0)));
//! let camera = resight::read_camera("left.toml")?;
//! let camera = LiveCamera { targets: vec![target], ..LiveCamera::new("gate", camera, source) };
//! let request = Request::new(vec![camera], LiveConfig { learn_readings: 20, ..LiveConfig::default() });
//! let mut n_events = 0;
//! let ended = run(request, &Log::default(), &Default::default(), |_event| {
//!     n_events += 1; // An alarm is a `StateChanged` to `Drifted`.
//!     Ok(())
//! })?;
//! assert!(60 <= n_events && ended.states[0].is_some());
//! # Ok(())
//! # }
//! ```
//!
//! | what | where |
//! | --- | --- |
//!  a whole session with its outputs | [`run()`], with a [`Request`] |
//! | the session alone: threads, tracking, alarms | [`live`] |
//! | a source read for a capture of intrinsics | [`mod@capture`] |
//! | where frames come from | [`source`]: images, folders, videos, streams, recordings, JSON Lines |
//! | the state of a session for the terminal view and the page | [`board`] |
//! | every frame kept, and read again | [`mod@history`] |
//! | metrics, webhook, MQTT, ROS transforms, the view in a terminal | [`outputs`] |
//! | what its servers have in common | [`web`] |
//!  observations of a camera from the messages of a recording | [`ros`] |
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod ros;
pub mod source;
pub mod live;
pub mod capture;
pub mod history;
mod error;
mod log;
pub mod names;
pub mod signals;
pub mod web;
pub mod board;
pub mod outputs;
mod saved;
mod run;

pub use error::Error;
pub use live::Event;
pub use log::{Line, Log};
pub use run::{Ended, Request, run};
