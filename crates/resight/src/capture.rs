//! Intrinsics from a camera that is watched while its target is moved: which images are kept, what they give, which view helps most next, and
//! whether it is enough. No I/O; frames come in one by one.
//!
//! ```text
//! frame ─► search ─► still? ─► unlike the kept views? ─► worth it? ─► keep ─► intrinsics ─► enough? next view
//! ```
//!
//! The first ten views that differ from each other are kept in any case, because the covariance of fewer says little. Then a view is worth
//! keeping if it lowers the root mean square uncertainty of the projection over the image by [`LEAST_GAIN`] or more, as the covariance of the
//! intrinsics so far predicts, or if it reaches new parts of the image. The answer is that of [`crate::intrinsics()`] for the kept images.

mod alike;
mod next;
mod words;
mod state;

use crate::answer::SchemaNumber;
use crate::answer::capture::{
    CaptureAnswer, CaptureStepObject, CaptureViewAnswer, KeptViewObject, LookObject, RefusedObject,
    SuggestionObject,
};
use crate::answer::intrinsics::{CameraIntrinsics, IntrinsicsAnswer};
use crate::core::camera::ImageSize;
use crate::core::multiview::intrinsics::{
    Coverage, IntrinsicsConfig, LEAST_POINTS, Models, Projection, SolvedIntrinsics,
};
use crate::core::{Correspondence, Target};
use crate::detect::absent::{missing, not_found};
use crate::detect::{CornerWindow, Detector};
use crate::error::Error;
use crate::image::GrayImage;
use crate::intrinsics::{self, CameraViews, NAMELESS};
use crate::report::words::{counted, found_nowhere};
use crate::rig::{Collected, FoundTargets, Orientations, search_image};
use alike::{Points, Seen};
pub use state::MATRIX;
use std::collections::BTreeMap;

/// With fewer views the scatter between views says little about what no view shows alone.
pub const LEAST_VIEWS: usize = 10;
/// A view that lowers the uncertainty of the projection by a smaller share is not kept: an average one of twenty-five lowers it by as much.
pub const LEAST_GAIN: f64 = 0.02;
/// A view with corners in as many new cells of the image is kept whatever it gains: a lens is unknown where no corner was seen.
const NEW_CELLS: usize = 2;
/// A target that moved by more than this between two frames, px, is blurred and bent by the exposure; by more than …
const STILL_PX: f64 = 0.5;
/// … this many standard deviations of a corner, if that is more.
const STILL_SIGMAS: f64 = 3.0;

/// The settings of a capture.
#[derive(Debug, Clone, Copy)]
pub struct CaptureConfig {
    /// It is enough if the projection is known to this standard deviation everywhere inside the covered part of the image, px.
    pub enough_px: f64,
    /// Largest number of views kept.
    pub most_views: usize,
    /// Whether the frames are photographs, each of a view of its own, instead of a sequence in which a moving target shows.
    pub are_photographs: bool,
    /// Lens models that are tried.
    pub models: Models,
    /// The window in which corners of chessboards and ChArUco boards are refined.
    pub corner_window: CornerWindow,
}

impl Default for CaptureConfig {
    fn default() -> Self {
        CaptureConfig {
            enough_px: 0.3,
            most_views: 40,
            are_photographs: false,
            models: Models::default(),
            corner_window: CornerWindow::default(),
        }
    }
}

/// What became of a frame.
#[derive(Debug, Clone, PartialEq)]
pub enum FrameUse {
    /// It is kept as a view of this name.
    Kept {
        /// The view.
        view: String,
        /// The share by which it was predicted to lower the uncertainty of the projection; `None` where no prediction was possible.
        gain: Option<f64>,
    },
    /// It shows no target.
    NotFound,
    /// It cannot be read, or shows several copies of the target.
    Unusable {
        /// Why.
        reason: String,
    },
    /// It shows a part of the target with too few points.
    FewPoints {
        /// Points found.
        n: usize,
    },
    /// Its size is not that of the first image.
    OtherSize {
        /// Its size.
        size: ImageSize,
        /// That of the first image.
        first: ImageSize,
    },
    /// The target moves.
    Moving {
        /// Median motion of the points since the last frame, px.
        px: f64,
        /// The largest allowed, px.
        allowed_px: f64,
    },
    /// The frame before it does not show the target, so that it is unknown whether it moves.
    First,
    /// A kept view shows the target at nearly the same place.
    Alike {
        /// That view.
        view: String,
        /// Root mean square distance of the points, px.
        px: f64,
        /// Needed, px.
        needed_px: f64,
    },
    /// A kept view shows the target with the same tilt, only moved, rotated or nearer; views that determine no camera need another tilt.
    SameTilt {
        /// That view.
        view: String,
    },
    /// A view that was taken back shows the target at nearly the same place.
    TakenBack {
        /// Root mean square distance of the points, px.
        px: f64,
        /// Needed, px.
        needed_px: f64,
    },
    /// It adds too little.
    LittleNew {
        /// The share by which it lowers the uncertainty of the projection.
        gain: f64,
    },
    /// As many views are kept as may be.
    Full {
        /// Their number.
        n: usize,
    },
}

/// A frame after it was looked at.
#[derive(Debug, Clone)]
pub struct Look {
    /// What became of it.
    pub outcome: FrameUse,
    /// The points of the target, column and row, px.
    pub points_px: Vec<[f64; 2]>,
}

/// A view that is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptView {
    /// Its name: those of all views sort in the order in which they were kept.
    pub view: String,
    /// The frame that it was.
    pub frame: String,
}

/// The answer so far.
#[derive(Debug, Clone)]
struct Known {
    answer: CameraIntrinsics,
    solved: Option<Box<SolvedIntrinsics>>,
    /// Largest standard deviation of the projection at the centres of the image's cells with corners, px; `None` where it is not known at one.
    worst_px: Option<f64>,
}

/// A camera that is being calibrated.
pub struct Capture {
    config: CaptureConfig,
    target: Target,
    detectors: [Detector; 1],
    size: Option<ImageSize>,
    collected: Collected,
    kept: Vec<KeptView>,
    /// The points of the last frame.
    previous: Option<Points>,
    /// The first image, while none shows the target.
    first_missed: Option<GrayImage>,
    /// Why the first image that cannot be used cannot.
    first_unusable: Option<String>,
    most_points: usize,
    n_frames: usize,
    /// Frames in a row without the target, while none has shown it; and what the last of them shows instead, as far as it was looked for.
    n_missed: usize,
    instead: Option<String>,
    last: Option<LookObject>,
    refused: BTreeMap<&'static str, usize>,
    orientations: Orientations,
    /// The points of views that were taken back.
    taken_back: Vec<Vec<(String, Correspondence)>>,
    known: Option<Known>,
    /// What was known with each kept view.
    steps: Vec<CaptureStepObject>,
}

impl Capture {
    /// Prepares a capture with one target.
    ///
    /// # Errors
    /// A target that cannot be detected in images, or has too few points; settings out of range.
    pub fn new(target: Target, config: CaptureConfig) -> Result<Self, Error> {
        if !(0.0 < config.enough_px && config.enough_px.is_finite()) {
            return Err(Error::request(format!(
                "enough_px is {}; a positive number of pixels is needed",
                config.enough_px
            )));
        }
        if config.most_views < LEAST_VIEWS {
            let seen = config.most_views;
            return Err(Error::request(format!("most_views is {seen}; {LEAST_VIEWS} or more are needed")));
        }
        let detector = Detector::with_corner_window(&target, config.corner_window)?;
        let n_points = target.features().len();
        if n_points < LEAST_POINTS {
            return Err(Error::request(intrinsics::too_few_points_of(Some(&target), n_points)));
        }
        let named = [(target.kind().to_string(), target.clone())];
        Ok(Capture {
            config,
            target,
            detectors: [detector],
            size: None,
            collected: intrinsics::nothing_observed(&[NAMELESS.to_string()], &named)?,
            kept: Vec::new(),
            previous: None,
            first_missed: None,
            first_unusable: None,
            most_points: 0,
            n_frames: 0,
            n_missed: 0,
            instead: None,
            last: None,
            refused: BTreeMap::new(),
            orientations: Orientations::default(),
            taken_back: Vec::new(),
            known: None,
            steps: Vec::new(),
        })
    }

    /// Looks at the next frame, and keeps it where it helps.
    ///
    /// # Errors
    /// Views that the estimation cannot take.
    pub fn push(&mut self, frame: &str, image: &GrayImage) -> Result<Look, Error> {
        if let Some(other) = self.other_size(image) {
            return Ok(self.looked(frame, other, None));
        }
        let (targets, unknown) = (std::slice::from_ref(&self.target), &self.collected.cameras[0].camera);
        match search_image(&mut self.detectors, targets, unknown, image) {
            Ok(found) => self.take(frame, image, found),
            Err(reason) => Ok(self.looked(frame, FrameUse::Unusable { reason }, None)),
        }
    }

    /// Counts a frame that could not be read.
    pub fn skip(&mut self, frame: &str, reason: impl Into<String>) -> Look {
        self.looked(frame, FrameUse::Unusable { reason: reason.into() }, None)
    }

    /// Counts an image that EXIF asks viewers to show otherwise than it is stored, which becomes a remark.
    pub fn count_orientation(&mut self, how: Option<&'static str>) {
        self.orientations.add(0, how);
    }

    /// Takes the last kept view back, and leaves out what shows the target at nearly the same place; returns it, or `None` where none is kept.
    ///
    /// # Errors
    /// Views that the estimation cannot take.
    pub fn take_back(&mut self) -> Result<Option<KeptView>, Error> {
        let Some(kept) = self.kept.pop() else { return Ok(None) };
        self.steps.pop();
        self.last = None;
        self.collected.left_out.retain(|one| one.view != kept.view);
        let frame = self.collected.frames.pop();
        self.taken_back.extend(frame.into_iter().flat_map(|frame| frame.targets).map(|(_, points)| points));
        self.estimate()?;
        Ok(Some(kept))
    }

    fn other_size(&mut self, image: &GrayImage) -> Option<FrameUse> {
        let size = ImageSize { width_px: image.width_px, height_px: image.height_px };
        let first = *self.size.get_or_insert(size);
        (size != first).then_some(FrameUse::OtherSize { size, first })
    }

    fn take(&mut self, frame: &str, image: &GrayImage, found: FoundTargets) -> Result<Look, Error> {
        let seen = found.targets.first().map(|(_, points)| Points::new(points));
        let outcome = match &seen {
            None => Err(self.missed(image, &found)),
            Some(points) => self.judge(points),
        };
        let outcome = match outcome {
            Ok(gain) => FrameUse::Kept { view: self.keep(frame, found)?, gain },
            Err(refused) => refused,
        };
        Ok(self.looked(frame, outcome, seen))
    }

    fn looked(&mut self, frame: &str, outcome: FrameUse, seen: Option<Points>) -> Look {
        self.n_frames += 1;
        if let Some(name) = outcome.refusal() {
            *self.refused.entry(name).or_default() += 1;
        }
        if let FrameUse::Unusable { reason } = &outcome {
            self.first_unusable.get_or_insert_with(|| reason.clone());
        }
        let points_px = seen.as_ref().map_or_else(Vec::new, Points::pixels);
        self.last = Some(words::look(frame, &outcome, points_px.len()));
        self.previous = seen;
        Look { outcome, points_px }
    }

    fn missed(&mut self, image: &GrayImage, found: &FoundTargets) -> FrameUse {
        if !found.failed.is_empty() {
            return FrameUse::Unusable { reason: found.failed.join("; ") };
        }
        if self.most_points == 0 {
            self.first_missed.get_or_insert_with(|| image.clone());
            self.n_missed += 1;
            // The search for what is there instead takes long: it is repeated ever more rarely.
            if self.n_missed.is_power_of_two() {
                self.instead = Some(not_found(&self.target, image));
            }
        }
        FrameUse::NotFound
    }

    /// Returns the predicted gain of a view that is worth keeping, or why it is not.
    fn judge(&mut self, points: &Points) -> Result<Option<f64>, FrameUse> {
        (self.first_missed, self.instead) = (None, None);
        self.most_points = self.most_points.max(points.len());
        if points.len() < LEAST_POINTS {
            return Err(FrameUse::FewPoints { n: points.len() });
        }
        if !self.config.are_photographs {
            self.is_still(points)?;
        }
        self.is_new(points)?;
        if self.config.most_views <= self.kept.len() {
            return Err(FrameUse::Full { n: self.kept.len() });
        }
        let is_needed = self.kept.len() < LEAST_VIEWS;
        let gain = self.solved().and_then(|solved| {
            let forecast = solved.forecast.as_ref()?;
            Some(1.0 - forecast.with_view_px(&points.correspondences())? / forecast.now_px())
        });
        match gain {
            Some(gain) if !is_needed && gain < LEAST_GAIN && self.new_cells(points) < NEW_CELLS => {
                Err(FrameUse::LittleNew { gain })
            }
            gain => Ok(gain),
        }
    }

    fn is_still(&self, points: &Points) -> Result<(), FrameUse> {
        let motion = self.previous.as_ref().and_then(|previous| points.median_motion_px(previous));
        let Some(px) = motion else { return Err(FrameUse::First) };
        let allowed_px = STILL_PX.max(STILL_SIGMAS * points.median_sigma_px());
        if allowed_px < px { Err(FrameUse::Moving { px, allowed_px }) } else { Ok(()) }
    }

    /// Compares a view with those that are kept. Where these determine no camera, more of the same tilt do not either.
    fn is_new(&self, points: &Points) -> Result<(), FrameUse> {
        let views: Vec<Seen> = self.views().collect();
        let name = |i: usize| self.kept[i].view.clone();
        let longer_px = self.size.map_or(0.0, |size| f64::from(size.width_px.max(size.height_px)));
        let needed_px = alike::APART * longer_px;
        match alike::nearest(points, &views) {
            Some((i, px)) if px < needed_px => {
                return Err(FrameUse::Alike { view: name(i), px, needed_px });
            }
            _ => {}
        }
        let taken_back: Vec<Seen> = self.taken_back.iter().map(|points| &points[..]).collect();
        match alike::nearest(points, &taken_back) {
            Some((_, px)) if px < needed_px => return Err(FrameUse::TakenBack { px, needed_px }),
            _ => {}
        }
        if self.solved().is_some() || views.len() < LEAST_VIEWS {
            return Ok(());
        }
        match alike::same_tilt(points, &views) {
            Some((i, px)) if px < alike::TILTED * longer_px => Err(FrameUse::SameTilt { view: name(i) }),
            _ => Ok(()),
        }
    }

    /// Returns the points of the kept views, in order.
    fn views(&self) -> impl Iterator<Item = Seen<'_>> {
        self.collected.frames.iter().filter_map(|frame| frame.targets.first()).map(|(_, points)| &points[..])
    }

    fn new_cells(&self, points: &Points) -> usize {
        let (Some(before), Some(size)) = (self.coverage(), self.size) else { return 0 };
        let own = Coverage::of(points.correspondences().iter().map(|c| c.pixel), size);
        own.counts.iter().zip(&before.counts).filter(|(own, before)| 0 < **own && **before == 0).count()
    }

    /// Keeps a view, and estimates the camera from all views.
    fn keep(&mut self, frame: &str, found: FoundTargets) -> Result<String, Error> {
        let view = format!("view-{:03}", self.kept.len() + 1);
        self.collected.cameras[0].camera = found.lens.clone();
        self.collected.add_found(0, view.clone(), found);
        self.kept.push(KeptView { view: view.clone(), frame: frame.to_string() });
        self.estimate()?;
        self.steps.extend(self.step());
        Ok(view)
    }

    fn estimate(&mut self) -> Result<(), Error> {
        self.known = None;
        let views = intrinsics::of_camera(0, &self.collected, None);
        if let (Some(size), false) = (views.size, views.views.is_empty()) {
            let config = IntrinsicsConfig { models: self.config.models, ..IntrinsicsConfig::default() };
            let (answer, solved) = intrinsics::solved_views(&views, size, &config)?;
            let worst_px = solved.as_deref().and_then(|solved| worst_px(solved, size));
            self.known = Some(Known { answer, solved, worst_px });
        }
        Ok(())
    }

    fn solved(&self) -> Option<&SolvedIntrinsics> {
        self.known.as_ref()?.solved.as_deref()
    }

    /// Returns the views that are kept, in order.
    pub fn kept(&self) -> &[KeptView] {
        &self.kept
    }

    /// Returns the number of frames that were looked at.
    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// Returns the size of the images; `None` before the first one.
    pub fn size(&self) -> Option<ImageSize> {
        self.size
    }

    /// Returns the corners of the kept views by cell of the image; `None` before the first image.
    pub fn coverage(&self) -> Option<Coverage> {
        let pixels = self.views().flat_map(|points| points.iter().map(|(_, c)| c.pixel));
        Some(Coverage::of(pixels, self.size?))
    }

    /// Returns the intrinsics so far; `None` before the first kept view.
    pub fn camera(&self) -> Option<&CameraIntrinsics> {
        self.known.as_ref().map(|known| &known.answer)
    }

    /// Returns the view that helps most next; `None` before the first image.
    pub fn next_view(&self) -> Option<SuggestionObject> {
        next::suggestion(self.solved(), self.kept.len(), &self.target, self.size?)
    }

    /// Returns whether nothing is left to do: it is enough, or no more views may be kept.
    pub fn is_over(&self) -> bool {
        self.progress().is_enough || self.config.most_views <= self.kept.len()
    }

    /// Returns the answer for a view that has just been kept.
    pub fn view_answer(&self) -> Option<CaptureViewAnswer> {
        let (kept, known) = (self.kept.last()?, self.known.as_ref()?);
        Some(CaptureViewAnswer {
            schema: SchemaNumber,
            kind: "capture_view",
            status: known.answer.status,
            message: known.answer.message.clone(),
            view: kept.view.clone(),
            frame: kept.frame.clone(),
            n_points: self.views().last().map_or(0, <[_]>::len),
            n_frames: self.n_frames,
            parameters: known.answer.intrinsics.as_ref().map(|found| found.parameters.clone()),
            progress: self.progress(),
            next_view: self.next_view(),
        })
    }

    /// Returns the intrinsics from the kept images: the answer of [`crate::intrinsics()`] for them.
    pub fn finish(&self) -> IntrinsicsAnswer {
        let camera = self.camera().cloned().unwrap_or_else(|| self.nothing());
        IntrinsicsAnswer::new(vec![camera], self.remarks())
    }

    /// Returns remarks on the images.
    fn remarks(&self) -> Vec<String> {
        self.orientations.remarks(|_| NAMELESS.to_string())
    }

    fn refused(&self) -> Vec<RefusedObject> {
        self.refused.iter().map(|(reason, n)| RefusedObject { reason, n: *n }).collect()
    }

    /// Returns the answer without a view.
    fn nothing(&self) -> CameraIntrinsics {
        let views: CameraViews = intrinsics::of_camera(0, &self.collected, None);
        let answer = intrinsics::not_found(&views, self.n_frames);
        let message = match (&self.first_missed, self.most_points) {
            (Some(image), _) => found_nowhere(self.n_frames, &not_found(&self.target, image)),
            (None, 0) if self.n_frames == 0 => "no image came; check the source".to_string(),
            (None, 0) => format!(
                "none of {} could be used; the first one: {}",
                counted(self.n_frames, "image"),
                self.first_unusable.clone().unwrap_or_else(|| missing(&self.target))
            ),
            (None, _) => {
                let why = words::most_refused(&self.refused).unwrap_or_default();
                format!("none of {} could be kept; {why}", counted(self.n_frames, "image"))
            }
        };
        CameraIntrinsics { message, ..answer }
    }

    /// Returns the answer: the intrinsics, and whether they are good enough.
    pub fn answer(&self) -> CaptureAnswer {
        let camera = self.camera().cloned().unwrap_or_else(|| self.nothing());
        let progress = self.progress();
        CaptureAnswer {
            schema: SchemaNumber,
            kind: "capture",
            status: words::status(&camera, &progress),
            message: words::verdict(&camera, &progress, &self.refused, self.config.most_views),
            n_frames: self.n_frames,
            refused: self.refused(),
            remarks: self.remarks(),
            views: self
                .kept
                .iter()
                .map(|kept| KeptViewObject { view: kept.view.clone(), frame: kept.frame.clone() })
                .collect(),
            next_view: self.next_view().filter(|_| !progress.is_enough),
            progress,
            camera,
        }
    }
}

fn worst_px(solved: &SolvedIntrinsics, size: ImageSize) -> Option<f64> {
    let corners = solved.views.iter().flat_map(|view| view.residuals.iter().map(|(pixel, _)| *pixel));
    let projection = Projection::new(&solved.camera, &solved.covariance, corners);
    let sigmas: Option<Vec<f64>> =
        solved.coverage.covered(size).map(|pixel| projection.sigma_px(&pixel)).collect();
    sigmas?.into_iter().reduce(f64::max)
}
