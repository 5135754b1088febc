//! Kalibr's AprilGrid: tags whose corners touch small black squares.
//!
//! Two things defeat a plain tag detector here. Where a tag meets a corner square the two black regions run into
//! each other, so no closed outline remains; the joints are saddle points, so they are found as such (ChESS) and cut
//! by a white dot before the tags are sought. And Kalibr's border is two cells wide; both borders are looked for.
//! The joints are also the sharpest points of the target: each tag corner is moved to the saddle point it belongs to.

use super::apriltag::{DecodedTag, Edges, QuadDecoder};
use super::families::{Family, MarkerPattern, marker_pattern};
use super::homography::{Homography, PlanePoint};
use super::joints::{Joint, joints, nearest};
use super::noise::Quietened;
use super::print::{self, Place, Seen};
use super::region::{Region, joined, longer_side_px};
use super::tiles::{self, Look};
use super::{DetectError, sigma};
use crate::GrayImage;
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::{AprilGrid, Feature};

/// Finds one AprilGrid.
pub(super) struct AprilGridFinder {
    grid: AprilGrid,
    decoder: QuadDecoder,
    /// What is printed in each tag, border of one cell; none of families with more than a border around their bits.
    prints: Vec<MarkerPattern>,
}

impl AprilGridFinder {
    pub fn new(grid: &AprilGrid) -> Result<Self, DetectError> {
        let n_tags = grid.rows * grid.columns;
        let ids: Vec<u32> = (grid.first_id..grid.first_id.saturating_add(n_tags)).collect();
        let family = Family::named(&grid.family)?.only(&grid.family, &ids)?;
        let is_plain = !family.reversed_border && family.total_width == family.border_width + 2;
        let print = |id: &u32| marker_pattern(&grid.family, *id);
        let prints = ids.iter().filter(|_| is_plain).map(print).collect::<Result<_, _>>()?;
        let families = [family.clone(), family.with_double_border()];
        let decoder = QuadDecoder::new(&families).ok_or(DetectError::OutOfMemory)?;
        Ok(AprilGridFinder { grid: grid.clone(), decoder, prints })
    }

    fn ids(&self) -> impl Iterator<Item = u32> + use<> {
        self.grid.first_id..self.grid.first_id + self.grid.rows * self.grid.columns
    }

    /// Where the corners of a tag are by the tags beside it; none where fewer than two are near.
    fn predicted(&self, id: u32, tags: &[DecodedTag]) -> Option<[Pixel; 4]> {
        let apart = |tag: &DecodedTag| (self.corner(tag.id, 0) - self.corner(id, 0)).norm();
        let mut beside: Vec<&DecodedTag> = tags.iter().collect();
        beside.sort_by(|a, b| apart(a).total_cmp(&apart(b)).then(a.id.cmp(&b.id)));
        beside.truncate(4);
        if beside.len() < 2 || COMPLETE_REACH < apart(beside[1]) {
            return None;
        }
        let pairs: Vec<(PlanePoint, Pixel)> = beside
            .iter()
            .flat_map(|tag| (0..4).map(|k| (self.corner(tag.id, k), tag.corners[k as usize])))
            .collect();
        let map = Homography::fit(&pairs)?;
        Some([0, 1, 2, 3].map(|k| map.at(&self.corner(id, k))))
    }

    /// A tag too blurred to decode, when the tags beside it say where it is and a joint lies at each of its corners.
    fn complete(&self, id: u32, tags: &[DecodedTag], joints: &[Joint]) -> Option<Met> {
        let predicted = self.predicted(id, tags)?;
        let within_px = 0.06 * sigma::shortest_edge_px(&predicted);
        let mut met =
            Met { id, corners: [Joint { pixel: Pixel::zeros(), sigma_px: 0.0 }; 4], is_joint: [true; 4] };
        for (corner, pixel) in met.corners.iter_mut().zip(&predicted) {
            *corner = nearest(joints, pixel, within_px)?;
        }
        Some(met)
    }

    /// A tag corner on the grid, in tag edges.
    fn corner(&self, id: u32, corner: u8) -> PlanePoint {
        let index = id - self.grid.first_id;
        let pitch = 1.0 + self.grid.tag_spacing_ratio;
        let (dx, dy) = [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)][corner as usize % 4];
        let (column, row) = (index % self.grid.columns, index / self.grid.columns);
        PlanePoint::new(column as f64 * pitch + dx, row as f64 * pitch + dy)
    }

    pub fn detect(&mut self, image: &GrayImage) -> Vec<Detection> {
        let joints = joints(image);
        let quiet = Quietened::new(image);
        self.decoder.set_least_contrast(quiet.least_contrast(LEAST_CONTRAST));
        let decimate =
            if image.width_px as u64 * image.height_px as u64 <= FULL_SIZE_PIXELS { 1.0 } else { 2.0 };
        let cut = cut_joints(quiet.image(), &joints, decimate);
        let look = Look { decimate, edges: Edges::FullSize };
        let mut tags = one_border(tiles::search(&mut self.decoder, &cut, look));
        drop(cut);
        if quiet.is_smoothed() || 1.0 < decimate {
            tags = self.with_missing(image, tags, &joints);
        }
        let undecoded = self.ids().filter(|id| tags.iter().all(|tag| tag.id != *id));
        let completed = undecoded.filter_map(|id| self.complete(id, &tags, &joints));
        let decoded = tags.iter().map(|tag| corners(tag, &joints));
        let met: Vec<Met> = decoded.chain(completed).collect();
        let is_double = tags.first().is_some_and(|tag| tag.family == 1);
        let mut detections = self.measured(image, quiet.noise_gray, &met, is_double);
        detections.sort_by_key(|d| d.feature);
        detections
    }

    /// The corners, each at a joint measured by the print around it.
    fn measured(&self, image: &GrayImage, noise_gray: f64, met: &[Met], is_double: bool) -> Vec<Detection> {
        let all = met.iter().flat_map(|tag| (0..4).map(move |k| (tag, k)));
        let detection = |(tag, k): (&Met, usize), pixel: Pixel, sigma_px: f64| {
            let feature = Feature { id: tag.id, corner: k as u8 };
            Detection { feature, pixel, sigma_px, lens_sigma_px: sigma::LENS_PX, covariance_px2: None }
        };
        let (with, without): (Vec<_>, Vec<_>) =
            all.partition(|(tag, k)| tag.is_joint[*k] && !self.prints.is_empty());
        let (with, places): (Vec<_>, Vec<_>) =
            with.into_iter().filter_map(|(tag, k)| Some(((tag, k), self.place(tag, k, is_double)?))).unzip();
        let seen = print::measure(image, noise_gray, &places);
        let measured = with.into_iter().zip(seen).filter_map(|(corner, seen)| match seen {
            Seen::Print { pixel, sigma_px } => Some(detection(corner, pixel, sigma_px)),
            Seen::Outside => {
                Some(detection(corner, corner.0.corners[corner.1].pixel, corner.0.corners[corner.1].sigma_px))
            }
            Seen::Otherwise => None,
        });
        let unmeasured = without
            .into_iter()
            .map(|(tag, k)| detection((tag, k), tag.corners[k].pixel, tag.corners[k].sigma_px));
        measured.chain(unmeasured).collect()
    }

    /// The print around a tag's corner, on a plane in edges of the tag, y down.
    fn place(&self, tag: &Met, k: usize, is_double: bool) -> Option<Place<impl Fn(PlanePoint) -> f32>> {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| PlanePoint::new(x, y));
        let pixels = tag.corners.map(|corner| corner.pixel);
        let map = Homography::fit(&[0, 1, 2, 3].map(|k: usize| (square[k], pixels[k])))?;
        let print = &self.prints[(tag.id - self.grid.first_id) as usize];
        let spacing = self.grid.tag_spacing_ratio;
        let ink = move |x: PlanePoint| ink(print, usize::from(is_double), spacing, x);
        let edge_px = sigma::shortest_edge_px(&pixels);
        // The gap to the next tag, whose bits are another's, holds the window.
        let square_px = (2.0 * spacing).min(1.0) * edge_px;
        // Beyond the gap around the outer tags anything may be.
        let clear_px =
            if self.is_outer(tag.id, k) { (0.7 * spacing * edge_px - 0.5).max(3.0) } else { f64::INFINITY };
        let reach_px = (0.05 * edge_px).clamp(1.0, MAX_MOVE_PX);
        Some(Place { found: pixels[k], place: square[k], map, square_px, clear_px, reach_px, ink })
    }

    /// Whether a tag's corner lies on the outline of the grid.
    fn is_outer(&self, id: u32, k: usize) -> bool {
        let corner = self.corner(id, k as u8);
        let pitch = 1.0 + self.grid.tag_spacing_ratio;
        let last = |n: u32| (n - 1) as f64 * pitch + 0.5;
        corner.x < 0.5
            || corner.y < 0.5
            || last(self.grid.columns) < corner.x
            || last(self.grid.rows) < corner.y
    }

    /// With the tags that show, in the image as it came, where those found say they are.
    fn with_missing(
        &mut self,
        image: &GrayImage,
        tags: Vec<DecodedTag>,
        joints: &[Joint],
    ) -> Vec<DecodedTag> {
        let missing = self.ids().filter(|id| tags.iter().all(|tag| tag.id != *id));
        let around = |corners: [Pixel; 4]| {
            let margin_px = 16.0 + 0.3 * longer_side_px(&corners);
            Region::around(&corners, margin_px, [image.width_px, image.height_px])
        };
        let regions = joined(missing.filter_map(|id| self.predicted(id, &tags).and_then(around)).collect());
        self.decoder.set_least_contrast(LEAST_CONTRAST);
        let mut part = GrayImage::filled(0, 0, 0);
        let mut all = tags;
        for region in regions {
            if region.cut(image, &mut part).is_none() {
                continue;
            }
            let inside = joints.iter().filter(|joint| region.contains(&joint.pixel));
            let inside = inside.map(|joint| Joint { pixel: joint.pixel - region.origin(), ..*joint });
            let cut = cut_joints(&part, &inside.collect::<Vec<_>>(), 1.0);
            let look = Look { decimate: 1.0, edges: Edges::FullSize };
            let mut found = tiles::search(&mut self.decoder, &cut, look);
            found.iter_mut().flat_map(|tag| &mut tag.corners).for_each(|corner| *corner += region.origin());
            all.extend(found);
        }
        one_border(all)
    }
}

/// Largest image, pixels, in which tags are sought at full size. At half size a third of the tags of a 1-megapixel
/// fisheye view is lost (22 of 36, against 36 at full size).
const FULL_SIZE_PIXELS: u64 = 4_000_000;

/// Least contrast of an outline, grey levels: what a grid of a seventh of full contrast has left when it is blurred. In outlines of noise a
/// search spent nine tenths of its time.
const LEAST_CONTRAST: u8 = 8;

/// The second nearest decoded tag may be this far from one to complete, in tag edges: two tags on.
const COMPLETE_REACH: f64 = 3.0;

/// Radius of the white dot, pixels of the decimated image.
const CUT_RADIUS_PX: f64 = 1.5;

/// The image with a dot as bright as its surroundings over every saddle point.
fn cut_joints(image: &GrayImage, joints: &[Joint], decimate: f32) -> GrayImage {
    let mut cut = image.clone();
    let radius = CUT_RADIUS_PX * decimate as f64;
    for joint in joints {
        let bright =
            window(image, &joint.pixel, radius + 2.0).map(|(u, v)| image.at(u, v)).max().unwrap_or(255);
        for (u, v) in window(image, &joint.pixel, radius) {
            if (Pixel::new(u as f64, v as f64) - joint.pixel).norm() <= radius {
                cut.data[v as usize * image.width_px as usize + u as usize] = bright;
            }
        }
    }
    cut
}

/// The pixels of a square window that lie in the image.
fn window(image: &GrayImage, centre: &Pixel, radius: f64) -> impl Iterator<Item = (u32, u32)> + use<> {
    let range = |c: f64, n: u32| {
        let first = (c - radius).ceil().clamp(0.0, n as f64) as u32;
        first..((c + radius).floor() + 1.0).clamp(first as f64, n as f64) as u32
    };
    let columns = range(centre.x, image.width_px);
    range(centre.y, image.height_px).flat_map(move |v| columns.clone().map(move |u| (u, v)))
}

/// Of the two borders the one that shows more tags; of an id seen twice the clearer one.
fn one_border(tags: Vec<DecodedTag>) -> Vec<DecodedTag> {
    let of = |family: usize| tags.iter().filter(|t| t.family == family).count();
    let border = usize::from(of(0) < of(1));
    let mut kept: Vec<DecodedTag> = tags.into_iter().filter(|t| t.family == border).collect();
    kept.sort_by(|a, b| a.id.cmp(&b.id).then(b.margin_gray.total_cmp(&a.margin_gray)));
    kept.dedup_by_key(|t| t.id);
    kept
}

/// −1 where a tag with its gaps and corner squares is black, 1 where it is white; its neighbours count as black.
fn ink(print: &MarkerPattern, more_border: usize, spacing: f64, x: PlanePoint) -> f32 {
    let in_gap = |x: f64| 1.0 <= x.rem_euclid(1.0 + spacing);
    if !(0.0 <= x.x && x.x < 1.0 && 0.0 <= x.y && x.y < 1.0) {
        return if in_gap(x.x) == in_gap(x.y) { -1.0 } else { 1.0 };
    }
    let cells = print.width_cells - 2 * print.inset_cells;
    let cell = |x: f64| ((x * (cells + 2 * more_border) as f64) as usize).checked_sub(more_border);
    match (cell(x.x), cell(x.y)) {
        (Some(u), Some(v)) if u < cells && v < cells => {
            let is_white = print.white[(v + print.inset_cells) * print.width_cells + u + print.inset_cells];
            if is_white { 1.0 } else { -1.0 }
        }
        _ => -1.0,
    }
}

/// The corners of a tag, and which of them are saddle points.
struct Met {
    id: u32,
    corners: [Joint; 4],
    is_joint: [bool; 4],
}

/// The corners of a tag, each at the joint it belongs to, or where the tag's edges meet when it has none (a corner
/// square missing or covered).
fn corners(tag: &DecodedTag, joints: &[Joint]) -> Met {
    let edge_px = sigma::shortest_edge_px(&tag.corners);
    // Half a corner square (spacing ratio 0.3 of the tag) away lies the square's other corner.
    let within_px = (0.1 * edge_px).clamp(1.5, 4.0);
    let joints = tag.corners.map(|corner| nearest(joints, &corner, within_px));
    let edges = |k: usize| Joint { pixel: tag.corners[k], sigma_px: sigma::tag_px(tag) };
    let corners = [0, 1, 2, 3].map(|k| joints[k].unwrap_or(edges(k)));
    Met { id: tag.id, corners, is_joint: joints.map(|joint| joint.is_some()) }
}

/// A print further than this from its saddle point is another's, pixels.
const MAX_MOVE_PX: f64 = 1.5;
