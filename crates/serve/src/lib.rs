//! The page of `resight serve` and the interface behind it: HTTP and WebSocket in, the sessions of `resight-session` and what a watch session
//! reports out. It computes nothing.
//!
//! | what | where |
//! | --- | --- |
//! | whom it answers: address, host, origin, token | `guard` |
//! | the page's files, compiled in | `page` |
//! | photographs and four clicks | `photograph`, `socket`; the sessions kept, `sessions` |
//! | cameras that are watched | `live` |
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
mod openapi;
mod server;

pub use live::Live;
pub use server::{ServeConfig, Server};
