//! A capture of intrinsics, for the page: its state, the newest image with the points found, and what the operator asks.
//!
//! The capture runs on a thread of its own, as without a page; nothing here makes it wait. Images are reduced on its thread and encoded where a page
//! takes them, once for all pages.

pub mod feed;
pub mod routes;

use crate::live::small::{message, reduced};
use axum::body::Bytes;
use resight::GrayImage;
use resight::answer::capture::CaptureStateObject;
use resight::capture::{Capture, FrameUse};
use resight_watch::capture::{News, Operator, Shown};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// Longer side of an image on the page, px.
const LARGE_PX: u32 = 1920;
const QUALITY: u8 = 75;
/// For the pages to take the end of a capture, before the program ends.
const FAREWELL: Duration = Duration::from_secs(3);
/// For the answer of the request that asked for the end.
const LAST_ANSWER: Duration = Duration::from_millis(300);

/// How a capture is.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CaptureView {
    /// The source, as it was given.
    pub source: String,
    /// The file that the camera is written to at the end.
    pub output: String,
    /// Why the source gives no more images; the capture continues until it is ended.
    pub source_ended: Option<String>,
    /// Whether the capture has ended.
    pub is_over: bool,
    /// Whether the camera was written at the end.
    pub is_written: bool,
    /// What failed.
    pub failed: Option<String>,
    /// The capture itself.
    pub state: CaptureStateObject,
}

/// The message of the WebSocket that comes when something has changed.
#[derive(Serialize, JsonSchema)]
pub struct CaptureMessage<'a> {
    /// How the capture is.
    capture: &'a CaptureView,
}

/// What an image is of: it goes before its JPEG.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CapturedHeader {
    /// Number of the frame.
    frame: usize,
    /// Its name.
    name: String,
    /// Of the frame itself; the JPEG may be smaller.
    width_px: u32,
    height_px: u32,
    /// The points found, in pixels of the frame.
    points_px: Vec<[f64; 2]>,
    /// Whether it is kept.
    is_kept: bool,
}

/// An image, encoded when the first page takes it.
struct Captured {
    header: CapturedHeader,
    image: GrayImage,
    message: OnceLock<Option<Bytes>>,
}

impl Captured {
    fn message(&self) -> Option<Bytes> {
        let encode = || message(&self.header, &self.image, QUALITY).map(Bytes::from);
        self.message.get_or_init(encode).clone()
    }
}

/// The state shared by the routes and the capture.
pub struct Capturing {
    operator: Operator,
    view: watch::Sender<Arc<CaptureView>>,
    image: watch::Sender<Option<Arc<Captured>>>,
    pages: AtomicUsize,
}

impl Capturing {
    /// Prepares the page of a capture.
    pub fn new(source: String, output: &Path, job: &Capture) -> Self {
        let view = CaptureView {
            source,
            output: output.display().to_string(),
            source_ended: None,
            is_over: false,
            is_written: false,
            failed: None,
            state: job.state(),
        };
        Capturing {
            operator: Operator::default(),
            view: watch::Sender::new(Arc::new(view)),
            image: watch::Sender::new(None),
            pages: AtomicUsize::new(0),
        }
    }

    /// Returns what the operator asks of the capture.
    pub fn operator(&self) -> &Operator {
        &self.operator
    }

    /// The next news of the capture.
    pub fn take(&self, job: &Capture, news: &News) {
        match news {
            News::Frame(shown) => self.show(job, shown),
            News::TakenBack(_) | News::SourceEnded(_) => {}
        }
        let state = job.state();
        self.change(|view| {
            view.state = state;
            if let News::SourceEnded(reason) = news {
                view.source_ended = Some(reason.clone().unwrap_or_else(|| "it has ended".to_owned()));
            }
        });
    }

    fn show(&self, job: &Capture, shown: &Shown) {
        let Some(image) = shown.image else { return };
        let header = CapturedHeader {
            frame: job.n_frames(),
            name: shown.name.to_owned(),
            width_px: image.width_px,
            height_px: image.height_px,
            points_px: shown.look.points_px.iter().map(|point| point.map(tenth)).collect(),
            is_kept: matches!(shown.look.outcome, FrameUse::Kept { .. }),
        };
        let image = reduced(image, LARGE_PX);
        self.image.send_replace(Some(Arc::new(Captured { header, image, message: OnceLock::new() })));
    }

    /// The capture has ended, and whether its camera was written, or why something failed; returns when the pages know it, or have had time to.
    pub fn ended(&self, job: &Capture, written: Result<bool, String>) {
        let state = job.state();
        self.change(|view| {
            view.state = state;
            view.is_over = true;
            match written {
                Ok(is_written) => view.is_written = is_written,
                Err(reason) => view.failed = Some(reason),
            }
        });
        let until = Instant::now() + FAREWELL;
        std::thread::sleep(LAST_ANSWER);
        while 0 < self.pages.load(Ordering::Relaxed) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Returns how the capture is.
    fn now(&self) -> Arc<CaptureView> {
        self.view.borrow().clone()
    }

    fn change(&self, change: impl FnOnce(&mut CaptureView)) {
        self.view.send_modify(|view| change(Arc::make_mut(view)));
    }
}

fn tenth(x: f64) -> f64 {
    (10.0 * x).round() / 10.0
}
