//! What all routes share.

use crate::live::Live;
use crate::sessions::Sessions;
use std::sync::Arc;
use tokio::sync::Semaphore;

/// What all routes share.
#[derive(Clone)]
pub struct App {
    /// Sessions of pages.
    pub sessions: Arc<Sessions>,
    /// Cameras that are watched.
    pub live: Option<Arc<Live>>,
    /// Turns of decoding.
    pub decoding: Arc<Semaphore>,
    /// Turns of solving results that were dropped in.
    pub solving: Arc<Semaphore>,
}
