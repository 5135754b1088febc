//! Detectors of targets in images.
//!
//! A [`Detector`] is built once per thread for one target and is given images. It reports positions and corners in the conventions of this
//! crate, whatever the library underneath uses: pixel (0, 0) is the centre of the top-left pixel, and the corners of the upright tag are
//! numbered 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left.

pub mod absent;
mod aprilgrid;
pub(crate) mod apriltag;
mod charuco;
mod chessboard;
mod circles;
pub mod corner;
pub mod dots;
pub mod every_tag;
mod family;
pub mod families;
pub mod follow;
mod found_tag;
mod homography;
mod joints;
mod light;
mod noise;
mod outlines;
mod print;
mod region;
mod saddles;
pub mod sigma;
mod smooth;
pub mod stop;
mod tag_print;
pub mod tags;
mod template;
mod tiles;
#[cfg(test)]
mod work;
pub mod job;

use crate::GrayImage;
use aprilgrid::AprilGridFinder;
use charuco::CharucoFinder;
use chessboard::ChessboardFinder;
use circles::CircleFinder;
use dots::{DotDetector, DotError};
pub use joints::CornerWindow;
use resight_core::correspondence::Detection;
use resight_core::target::{CircleGrid, Feature};
use resight_core::{Camera, Target};
use std::collections::BTreeSet;
use tags::TagFinder;
use thiserror::Error;

/// Why a detector could not be built or could not decide. A target that is not in the image is not an error.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum DetectError {
    /// An unknown family or dictionary.
    #[error("unknown tag family {name:?}; {}known are {} and OpenCV's dictionaries, e.g. DICT_4X4_50", families::meant(name), families::APRILTAG_FAMILIES.join(", "))]
    UnknownFamily {
        /// The name given.
        name: String,
    },
    /// An id the family does not have.
    #[error("{family} has ids 0 to {last}, not {id}", last = n_codes.saturating_sub(1))]
    UnknownId {
        /// Family name.
        family: String,
        /// The id given.
        id: u32,
        /// The number of ids.
        n_codes: usize,
    },
    /// Invalid dimensions.
    #[error(transparent)]
    Target(#[from] resight_core::Error),
    /// A board for which the library cannot be set up.
    #[error("this board cannot be detected: {reason}")]
    Board {
        /// The library's message.
        reason: String,
    },
    /// A target without a detector.
    #[error("a target of kind {kind} is not detected in images; {instead}")]
    NotDetectable {
        /// The target's kind.
        kind: &'static str,
        /// The remedy.
        instead: &'static str,
    },
    /// Several copies of a tag of which one is expected.
    #[error("tag {id} is seen {count} times, so its place is not known; cover or remove the copies")]
    Copies {
        /// Its id.
        id: u32,
        /// How often it was seen.
        count: usize,
    },
    /// Several copies of a board of which one is expected.
    #[error(
        "the {kind} is seen {count} times, so which one is meant is not known; cover or remove the copies"
    )]
    BoardCopies {
        /// The board's kind.
        kind: &'static str,
        /// How often it was seen.
        count: usize,
    },
    /// A pixel buffer that does not have the stated size.
    #[error("image of {width_px}×{height_px} px comes with {seen} values")]
    ImageBuffer {
        /// Columns.
        width_px: u32,
        /// Rows.
        height_px: u32,
        /// Values given.
        seen: usize,
    },
    /// A corner window for a target without corners of squares.
    #[error("a corner window is for chessboards and ChArUco boards; this target is a {kind}, leave it out")]
    CornerWindow {
        /// The target's kind.
        kind: &'static str,
    },
    /// A corner window in which no corner could be refined.
    #[error(
        "corner window of {seen} px; give the pixels it reaches to each side, {MIN_HALF_WINDOW_PX} to {MAX_HALF_WINDOW_PX}"
    )]
    CornerWindowSize {
        /// Pixels to each side.
        seen: u32,
    },
    /// The dots could not be distinguished.
    #[error(transparent)]
    Dots(#[from] DotError),
    /// The C library could not allocate.
    #[error("out of memory while building the tag detector")]
    OutOfMemory,
}

/// Largest number of squares or tags of a board: a photograph has no pixels for more, and the tables would exceed the memory.
const MAX_CELLS: u64 = 100_000;

/// Smaller windows have too few pixels for two edges.
const MIN_HALF_WINDOW_PX: u32 = 2;
/// Larger windows hold several squares of any board that fits a photograph with its margin.
const MAX_HALF_WINDOW_PX: u32 = 50;

fn check_window(target: &Target, window: CornerWindow) -> Result<(), DetectError> {
    match (target.design(), window) {
        (_, CornerWindow::Clear) => Ok(()),
        (Target::Chessboard(_) | Target::Charuco(_), CornerWindow::Half(seen)) => {
            let possible = (MIN_HALF_WINDOW_PX..=MAX_HALF_WINDOW_PX).contains(&seen);
            if possible { Ok(()) } else { Err(DetectError::CornerWindowSize { seen }) }
        }
        _ => Err(DetectError::CornerWindow { kind: target.kind() }),
    }
}

fn check_extent(target: &Target) -> Result<(), DetectError> {
    let (rows, columns) = match target.design() {
        Target::AprilGrid(t) => (t.rows, t.columns),
        Target::Chessboard(t) => (t.rows, t.columns),
        Target::Charuco(t) => (t.rows, t.columns),
        Target::CircleGrid(t) => return check_circles(t),
        _ => return Ok(()),
    };
    if MAX_CELLS < rows as u64 * columns as u64 {
        let reason = format!("{rows} rows × {columns} columns, at most {MAX_CELLS} cells are possible");
        return Err(DetectError::Board { reason });
    }
    Ok(())
}

/// Largest number of circles: of more dots in an image, only the most conspicuous are measured.
const MAX_CIRCLES: u64 = 1000;

fn check_circles(grid: &CircleGrid) -> Result<(), DetectError> {
    let (rows, columns) = (grid.rows, grid.columns);
    match u64::from(rows) * u64::from(columns) {
        n if n <= MAX_CIRCLES => Ok(()),
        n => {
            let reason = format!(
                "{rows} rows × {columns} columns are {n} circles, at most {MAX_CIRCLES} are possible"
            );
            Err(DetectError::Board { reason })
        }
    }
}

fn check_buffer(image: &GrayImage) -> Result<(), DetectError> {
    let GrayImage { width_px, height_px, .. } = *image;
    let seen = image.data.len();
    match width_px as usize * height_px as usize == seen {
        true => Ok(()),
        false => Err(DetectError::ImageBuffer { width_px, height_px, seen }),
    }
}

/// Grey levels of the faintest target differ by more than this.
const LEAST_RANGE_GRAY: u8 = 5;

/// Checks for an image without any contrast, such as one from a covered lens, which is not searched.
fn is_blank(image: &GrayImage) -> bool {
    let (mut low, mut high) = (u8::MAX, 0);
    // The check runs by rows, as most images have contrast in the first ones.
    image.data.chunks(image.width_px.max(1) as usize).all(|row| {
        low = row.iter().fold(low, |low, gray| low.min(*gray));
        high = row.iter().fold(high, |high, gray| high.max(*gray));
        high <= low.saturating_add(LEAST_RANGE_GRAY)
    })
}

/// Finds one target in images; built once per thread.
pub struct Detector {
    finder: Finder,
    grid: Option<smooth::Grid>,
    copies: tags::Copies,
}

enum Finder {
    Tag(TagFinder),
    TagMap(TagFinder),
    AprilGrid(AprilGridFinder),
    Chessboard(ChessboardFinder),
    Charuco(Box<CharucoFinder>),
    CircleGrid(Box<CircleFinder>),
    Dots(Box<DotDetector>),
}

impl Detector {
    /// Builds a detector for a target. Fails on invalid dimensions, families or ids, and on targets that are not detected in images (`points`).
    pub fn new(target: &Target) -> Result<Self, DetectError> {
        Detector::with_corner_window(target, CornerWindow::Clear)
    }

    /// Builds a detector with the window in which the corners of a chessboard or ChArUco board are refined; fails for other targets.
    pub fn with_corner_window(target: &Target, window: CornerWindow) -> Result<Self, DetectError> {
        target.check()?;
        check_extent(target)?;
        check_window(target, window)?;
        // To a detector, a print that is slightly longer along one axis is only another view of the same plane.
        let finder = match target.design() {
            Target::Tag(tag) => Finder::Tag(TagFinder::with_ids(&tag.family, &[tag.id])?),
            Target::TagMap(map) => {
                let mut ids: Vec<u32> = map.tags.iter().map(|tag| tag.id).collect();
                ids.sort_unstable();
                ids.dedup();
                Finder::TagMap(TagFinder::with_ids(&map.family, &ids)?)
            }
            Target::AprilGrid(grid) => Finder::AprilGrid(AprilGridFinder::new(grid)?),
            Target::Chessboard(board) => Finder::Chessboard(ChessboardFinder::new(board, window)?),
            Target::Charuco(board) => Finder::Charuco(Box::new(CharucoFinder::new(board, window)?)),
            Target::CircleGrid(grid) => Finder::CircleGrid(Box::new(CircleFinder::new(grid))),
            Target::LinePlusOne(dots) => Finder::Dots(Box::new(DotDetector::new(dots)?)),
            Target::Points(_) => {
                let instead = "give their pixels in a points file";
                return Err(DetectError::NotDetectable { kind: target.kind(), instead });
            }
            _ => {
                let instead = "this build has no detector for it";
                return Err(DetectError::NotDetectable { kind: target.kind(), instead });
            }
        };
        // In a fixed window, other edges displace corners on purpose.
        let grid = (window == CornerWindow::Clear).then(|| smooth::Grid::of(target)).flatten();
        Ok(Detector { finder, grid, copies: Vec::new() })
    }

    /// Finds the features of the target, sorted by id, then corner; empty when the target is not in the image. Fails when a single tag, or every
    /// visible tag of a map, is in view more than once, or when the buffer does not have the stated size.
    pub fn detect(&mut self, image: &GrayImage) -> Result<Vec<Detection>, DetectError> {
        self.find(image, None)
    }

    /// Finds the features with known intrinsics; dot targets use the lens, under which their lines are straight and their discs elliptic.
    pub fn detect_with_camera(
        &mut self,
        image: &GrayImage,
        camera: &Camera,
    ) -> Result<Vec<Detection>, DetectError> {
        self.find(image, Some(camera))
    }

    /// Returns the ids of a tag map that the last image showed more than once, with their numbers. They are left out, because it is not known
    /// which copy is the tag of the map.
    pub fn copies(&self) -> &[(u32, usize)] {
        &self.copies
    }

    /// Describes the copies in sentences.
    pub fn remarks(&self) -> impl Iterator<Item = String> + '_ {
        let copies = self.copies.iter();
        copies.map(|(id, n)| {
            format!("tag {id} is seen {n} times and left out, for which of them the map means is not known")
        })
    }

    /// Returns whether all corners of a board are among the detections.
    fn is_whole_board(&self, seen: &[Detection]) -> bool {
        match &self.finder {
            Finder::AprilGrid(finder) => finder.is_whole(seen),
            Finder::Chessboard(finder) => finder.is_whole(seen),
            Finder::Charuco(finder) => finder.is_whole(seen),
            Finder::Tag(_) | Finder::TagMap(_) | Finder::CircleGrid(_) | Finder::Dots(_) => false,
        }
    }

    /// Measures the corners of a whole board that `picked` selects, each by the print around its position in `places`. A corner is found
    /// within a pixel or two, or not at all. Also returns the blur.
    fn measured_near(
        &self,
        image: &GrayImage,
        common: print::Common,
        places: &[Detection],
        picked: &BTreeSet<Feature>,
    ) -> (Vec<Detection>, f64) {
        match &self.finder {
            Finder::AprilGrid(finder) => finder.measured_near(image, common, places, picked),
            Finder::Chessboard(finder) => finder.measured_near(image, common, places, picked),
            Finder::Charuco(finder) => finder.measured_near(image, common, places, picked),
            Finder::Tag(_) | Finder::TagMap(_) | Finder::CircleGrid(_) | Finder::Dots(_) => (Vec::new(), 0.0),
        }
    }

    fn find(&mut self, image: &GrayImage, camera: Option<&Camera>) -> Result<Vec<Detection>, DetectError> {
        check_buffer(image)?;
        self.copies.clear();
        if is_blank(image) || stop::is_stopped() {
            return Ok(Vec::new());
        }
        let mut found = match &mut self.finder {
            Finder::Tag(finder) => tags::single_or_unique(&finder.find(image), false)?.0,
            Finder::TagMap(finder) => {
                let (detections, copies) = tags::single_or_unique(&finder.find(image), true)?;
                self.copies = copies;
                detections
            }
            Finder::AprilGrid(finder) => finder.detect(image)?,
            Finder::Chessboard(finder) => finder.detect(image)?,
            Finder::Charuco(finder) => finder.detect(image)?,
            Finder::CircleGrid(finder) => finder.detect(image)?,
            Finder::Dots(finder) => match camera {
                Some(camera) => finder.detect_with_camera(image, camera)?,
                None => finder.detect(image)?,
            },
        };
        if let Some(grid) = &self.grid {
            grid.widen(&mut found);
        }
        Ok(found)
    }
}
