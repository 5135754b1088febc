//! Finds landmarks again anywhere in the image, by FAST corners and BRIEF descriptors of the `imageproc` crate.
//!
//! The search uses an image reduced to about 640 columns and determines the rotation to about a pixel of it; `patch` refines it.

use super::pyramid::Reduced;
use crate::GrayImage;
use crate::render::Pcg;
use imageproc::binary_descriptors::BinaryDescriptor;
use imageproc::binary_descriptors::brief::{BriefDescriptor, TestPair, brief};
use imageproc::corners::{Corner, corners_fast9};
use imageproc::point::Point;
use imageproc::suppress::local_maxima;
use nalgebra::Vector2;

/// Largest number of corners described in each image.
const MOST: usize = 500;
/// Contrasts at which corners are searched for, until there are enough: 8-bit grey levels.
const CONTRASTS: [u8; 3] = [20, 10, 5];
/// Number of corners that is enough.
const ENOUGH: usize = 350;
/// Smallest distance between corners, px.
const APART_PX: u32 = 3;
/// Radius of BRIEF; corners closer to the border cannot be described.
const BORDER_PX: u32 = 18;
/// Number of bits of a descriptor.
const BITS: usize = 256;
/// Largest number of differing bits for the same point: by chance it is 128 ± 8.
const MOST_BITS_OFF: u32 = 72;
/// Number of cells along each side: corners are taken evenly from all of them.
const CELLS: u32 = 8;
/// The pattern of BRIEF: standard deviation of its test points, px, as in its paper.
const PATTERN_SIGMA_PX: f64 = 6.6;
/// Side of its window, px.
const WINDOW_PX: f64 = 31.0;

/// Corners of an image with their descriptors.
pub(super) struct Features {
    described: Vec<BriefDescriptor>,
}

/// The same point in two images, full-size pixels.
pub(super) struct Match {
    /// Index in the reference.
    pub reference: usize,
    /// Its current position.
    pub pixel: Vector2<f64>,
}

/// The test points of a descriptor; the same in every run, so that images can be compared.
pub(super) struct Pattern(Vec<TestPair>);

impl Pattern {
    pub fn new() -> Self {
        let mut chance = Pcg::new(0x1b71ef);
        let mut place = || {
            loop {
                let x = 0.5 * WINDOW_PX + PATTERN_SIGMA_PX * chance.normal();
                if (0.0..WINDOW_PX).contains(&x) {
                    return x as u32;
                }
            }
        };
        let mut point = || Point::new(place(), place());
        Pattern((0..BITS).map(|_| TestPair { p0: point(), p1: point() }).collect())
    }
}

impl Features {
    /// Computes the features of a reduced image; empty where there are none.
    pub fn of(picture: &Reduced, pattern: &Pattern) -> Self {
        let none = Features { described: Vec::new() };
        let Some(image) = foreign(&picture.image) else { return none };
        let places: Vec<Point<u32>> =
            corners(&image).iter().map(|corner| Point::new(corner.x, corner.y)).collect();
        match brief(&image, &places, BITS, Some(&pattern.0)) {
            Ok((described, _)) => Features { described },
            Err(_) => none,
        }
    }

    pub fn len(&self) -> usize {
        self.described.len()
    }

    /// Returns the positions, full-size pixels.
    pub fn pixels(&self, picture: &Reduced) -> Vec<Vector2<f64>> {
        self.described.iter().map(|d| picture.full_size(place(d))).collect()
    }

    /// Returns pairs that are mutual nearest neighbours, with `self` as the reference.
    pub fn matches(&self, now: &Features, picture: &Reduced) -> Vec<Match> {
        let mut of_own = vec![(MOST_BITS_OFF + 1, 0); self.len()];
        let mut of_others = vec![(MOST_BITS_OFF + 1, 0); now.len()];
        for (i, own) in self.described.iter().enumerate() {
            for (j, other) in now.described.iter().enumerate() {
                let bits_off = own.hamming_distance(other);
                of_own[i] = of_own[i].min((bits_off, j));
                of_others[j] = of_others[j].min((bits_off, i));
            }
        }
        let pair = |(reference, (bits_off, j)): (usize, (u32, usize))| {
            let is_pair = bits_off <= MOST_BITS_OFF && of_others[j].1 == reference;
            is_pair.then(|| Match { reference, pixel: picture.full_size(place(&now.described[j])) })
        };
        of_own.iter().copied().enumerate().filter_map(pair).collect()
    }
}

fn place(described: &BriefDescriptor) -> Vector2<f64> {
    Vector2::new(f64::from(described.corner.x), f64::from(described.corner.y))
}

/// Converts an image to the type of the feature library.
pub(super) fn foreign(image: &GrayImage) -> Option<image::GrayImage> {
    image::GrayImage::from_raw(image.width_px, image.height_px, image.data.clone())
}

/// Returns the strongest corners of every cell, at the highest contrast that gives enough.
fn corners(image: &image::GrayImage) -> Vec<Corner> {
    let (width, height) = image.dimensions();
    if width <= 2 * BORDER_PX || height <= 2 * BORDER_PX {
        return Vec::new();
    }
    let inside = |corner: &Corner| {
        (BORDER_PX..width - BORDER_PX).contains(&corner.x)
            && (BORDER_PX..height - BORDER_PX).contains(&corner.y)
    };
    let mut found = Vec::new();
    for contrast in CONTRASTS {
        found = local_maxima(&corners_fast9(image, contrast), APART_PX);
        found.retain(inside);
        if ENOUGH <= found.len() {
            break;
        }
    }
    spread(found, width, height)
}

/// Selects the best corner of each cell first, then the second best, until there are enough.
fn spread(mut corners: Vec<Corner>, width: u32, height: u32) -> Vec<Corner> {
    corners.sort_by(|a, b| b.score.total_cmp(&a.score).then((a.y, a.x).cmp(&(b.y, b.x))));
    let mut taken = vec![0usize; (CELLS * CELLS) as usize];
    let rank = |corner: &Corner| {
        let cell = (corner.y * CELLS / height * CELLS + corner.x * CELLS / width) as usize;
        taken[cell] += 1;
        taken[cell]
    };
    let ranks: Vec<usize> = corners.iter().map(rank).collect();
    let mut order: Vec<usize> = (0..corners.len()).collect();
    order.sort_by_key(|i| ranks[*i]); // stable: within a rank the stronger first
    order.truncate(MOST);
    order.into_iter().map(|i| corners[i]).collect()
}
