//! Reads a source for a capture of intrinsics: the newest frames of a live one, every frame of any other.

use crate::source::{Content, Frame, Next, Source};
use anyhow::{Result, bail};
use resight::GrayImage;
use resight::capture::{Capture, KeptView, Look};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// The wait for a frame, after which a request to stop is noticed.
const PATIENCE: Duration = Duration::from_millis(100);
/// Largest number of frames of a live source that are passed over for a newer one: a source that is faster than its decoder must end some time.
const PASSED_OVER: usize = 64;

/// Why a capture ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CaptureEnd {
    /// It is enough, or as many views are kept as may be.
    Over,
    /// The source has ended.
    Source,
    /// It was asked to stop.
    Stopped,
}

/// A frame that a capture has looked at; the image is missing where it could not be read.
pub struct Shown<'a> {
    /// Its name.
    pub name: &'a str,
    /// The image.
    pub image: Option<&'a GrayImage>,
    /// What became of it.
    pub look: &'a Look,
}

/// What a capture reports.
pub enum News<'a> {
    /// It has looked at a frame.
    Frame(Shown<'a>),
    /// It has taken a view back.
    TakenBack(KeptView),
    /// The source has ended, or is lost for a reason, and the capture waits for its operator.
    SourceEnded(Option<String>),
}

/// What an operator asks of a capture. A capture with an operator ends when it is asked to, and not by itself.
#[derive(Debug, Default)]
pub struct Operator {
    /// Whether it is to end.
    pub stop: Arc<AtomicBool>,
    /// The name of a view to take back; nothing happens where it is not the last one any more.
    take_back: Mutex<Option<String>>,
}

impl Operator {
    /// Asks for a view to be taken back.
    pub fn ask_back(&self, view: String) {
        *self.take_back.lock().unwrap_or_else(PoisonError::into_inner) = Some(view);
    }

    fn wants_back(&self, job: &Capture) -> bool {
        let asked = self.take_back.lock().unwrap_or_else(PoisonError::into_inner).take();
        asked.is_some_and(|view| job.kept().last().is_some_and(|last| last.view == view))
    }
}

/// Gives a capture the frames of a source, until it is over; `listener` receives every frame. With an operator it continues until that asks for its
/// end.
///
/// # Errors
/// A source without images, that is lost before its first frame, or that gives detections; an error of the listener or of the estimation.
pub fn capture(
    source: Box<dyn Source>,
    job: &mut Capture,
    (operator, is_attended): (&Operator, bool),
    mut listener: impl FnMut(&Capture, News) -> Result<()>,
) -> Result<CaptureEnd> {
    let mut reader = Reader { source, pending: None, has_given: false, has_ended: false };
    while is_attended || !job.is_over() {
        if operator.stop.load(Ordering::Relaxed) {
            return Ok(CaptureEnd::Stopped);
        }
        if operator.wants_back(job)
            && let Some(view) = job.take_back()?
        {
            listener(job, News::TakenBack(view))?;
        }
        match reader.frame()? {
            Got::Frame(frame) => reader.look(job, frame, &mut listener)?,
            Got::Nothing => {}
            Got::End(_) if !is_attended => return Ok(CaptureEnd::Source),
            Got::End(reason) => {
                listener(job, News::SourceEnded(reason))?;
                reader.has_ended = true;
            }
        }
    }
    Ok(CaptureEnd::Over)
}

/// What a reader gets.
enum Got {
    Frame(Frame),
    Nothing,
    End(Option<String>),
}

/// A source, and what was read of it beyond the newest frame.
struct Reader {
    source: Box<dyn Source>,
    pending: Option<Next>,
    has_given: bool,
    has_ended: bool,
}

impl Reader {
    /// Returns the next frame; the source ends once.
    fn frame(&mut self) -> Result<Got> {
        if self.has_ended {
            std::thread::sleep(PATIENCE);
            return Ok(Got::Nothing);
        }
        match self.next() {
            Next::Frame(frame) => {
                self.has_given = true;
                Ok(Got::Frame(frame))
            }
            Next::Nothing => Ok(Got::Nothing),
            Next::Lost(reason) if !self.has_given => Err(reason.into()),
            Next::Lost(reason) => Ok(Got::End(Some(reason.to_string()))),
            Next::End => Ok(Got::End(None)),
        }
    }

    /// Gives a frame to the capture.
    fn look(
        &mut self,
        job: &mut Capture,
        Frame { name, content, .. }: Frame,
        listener: &mut impl FnMut(&Capture, News) -> Result<()>,
    ) -> Result<()> {
        match content {
            Content::Image(image) => {
                job.count_orientation(self.source.orientation());
                let look = job.push(&name, &image)?;
                listener(job, News::Frame(Shown { name: &name, image: Some(&image), look: &look }))?;
                self.source.reuse(image);
                Ok(())
            }
            Content::Unreadable(reason) => {
                let look = job.skip(&name, reason);
                listener(job, News::Frame(Shown { name: &name, image: None, look: &look }))
            }
            Content::Detections(_) => bail!(
                "{name} holds detections, not images; `resight intrinsics --detections` estimates a camera from them"
            ),
        }
    }

    /// Returns the next frame; of a live source the newest one.
    fn next(&mut self) -> Next {
        let mut newest = self.pending.take().unwrap_or_else(|| self.source.next(PATIENCE));
        if !self.source.is_live() {
            return newest;
        }
        for _ in 0..PASSED_OVER {
            if !matches!(newest, Next::Frame(_)) {
                break;
            }
            match self.source.next(Duration::ZERO) {
                Next::Nothing => break,
                Next::Frame(frame) => {
                    if let Next::Frame(Frame { content: Content::Image(spent), .. }) =
                        std::mem::replace(&mut newest, Next::Frame(frame))
                    {
                        self.source.reuse(spent);
                    }
                }
                end => {
                    self.pending = Some(end);
                    break;
                }
            }
        }
        newest
    }
}
