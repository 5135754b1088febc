//! The page of `resight serve` and the interface behind it: HTTP and WebSocket in front of the sessions of `resight-session` and the reports of
//! a watch session. It computes nothing.
//!
//! | what | where |
//! | --- | --- |
//!  which requests are answered: address, host, origin, token | `guard` |
//! | the page's files, compiled in | `page` |
//! | photographs and four clicks | `photograph`, `socket`; the sessions kept, `sessions` |
//! | cameras that are watched | `live` |
//! | a camera that is being calibrated | `capture` |
//! | results dropped in | `results` |
//! | the description of all that | `openapi` |
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod error;
mod guard;
mod aside;
mod memory;
mod app;
mod body;
mod page;
mod sessions;
mod example;
mod photograph;
mod socket;
mod results;
mod live;
mod capture;
mod openapi;
mod server;

pub use capture::Capturing;
pub use live::Live;
pub use server::{ServeConfig, Server};
