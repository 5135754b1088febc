//! Refines corners of an AprilGrid whose tag was not decoded, or that are not saddle points, by fitting the known print to the image.
//!
//! A few decoded tags determine where every corner of the grid is. The print around a corner (the tag's border and bits, the corner square)
//! shows whether the corner is visible, and where. So all visible corners of tags too small, too blurred or partly covered are used.

use super::super::DetectError;
use super::super::families::{MarkerPattern, marker_pattern};
use super::super::homography::{Homography, PlanePoint, floor};
use super::super::joints::Joint;
use super::super::print::{self, Common, Observed, Place};
use super::super::template::{self, Fit, REDRAWN_PX, Window};
use crate::GrayImage;
use resight_core::Pixel;
use resight_core::target::{AprilGrid, Feature};
use std::collections::{BTreeMap, BTreeSet};

/// Least share of the variance that the print has to explain.
const EXPLAINED: f64 = 0.6;
/// Least contrast of a print, grey levels.
const CONTRAST_GRAY: f64 = 10.0;
/// Radius around a corner in which the print is compared, in tag edges,
const PRINT_EDGES: f64 = 0.25;
/// within these bounds, pixels.
const PRINT_PX: (f64, f64) = (4.0, 8.0);
/// Radius around its prediction in which a corner is searched for, in tag edges,
const SEARCH_EDGES: f64 = 0.08;
/// within these bounds, pixels: nearer than the far corner of a corner square.
const SEARCH_PX: (f64, f64) = (1.5, 4.0);
/// Shortest edge of a tag at which its print is visible, pixels.
const LEAST_EDGE_PX: f64 = 8.0;
/// Blurs that are tried, standard deviations in pixels.
const BLURS_PX: [f64; 4] = [0.8, 1.3, 2.0, 3.2];
/// Number of corners from which the blur is estimated.
const BLUR_CORNERS: usize = 6;
/// Number of known corners from which a position is predicted.
const NEAREST: usize = 12;
/// Largest distance of these, in tag edges.
const REACH_EDGES: f64 = 2.5;
/// Largest number of rounds, each of which searches beside the corners found in the last.
const MOST_ROUNDS: usize = 20;

/// The print of a grid.
pub(super) struct GridPrint {
    grid: AprilGrid,
    /// Tags and spaces per edge of a tag.
    per_pitch: f64,
    /// The pattern of each tag, with a border of one cell.
    patterns: Vec<MarkerPattern>,
}

/// Corners by tag and corner.
pub(super) type Corners = BTreeMap<Feature, Joint>;

impl GridPrint {
    pub fn new(grid: &AprilGrid) -> Result<Self, DetectError> {
        let ids = grid.first_id..grid.first_id.saturating_add(grid.rows * grid.columns);
        let patterns = ids.map(|id| marker_pattern(&grid.family, id)).collect::<Result<_, _>>()?;
        let per_pitch = 1.0 / (1.0 + grid.tag_spacing_ratio);
        Ok(GridPrint { grid: grid.clone(), per_pitch, patterns })
    }

    /// Returns the position of a tag corner on the grid, in tag edges, y upwards.
    pub fn place(&self, id: u32, corner: u8) -> PlanePoint {
        let index = id - self.grid.first_id;
        let pitch = 1.0 + self.grid.tag_spacing_ratio;
        let (dx, dy) = [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)][corner as usize % 4];
        let (column, row) = (index % self.grid.columns, index / self.grid.columns);
        PlanePoint::new(column as f64 * pitch + dx, row as f64 * pitch + dy)
    }

    /// Returns −1 where the grid is black and 1 where it is white, at a position in tag edges.
    fn ink(&self, x: PlanePoint, border_cells: usize) -> f32 {
        let (pitch, spacing) = (1.0 + self.grid.tag_spacing_ratio, self.grid.tag_spacing_ratio);
        let per_pitch = self.per_pitch;
        let cell = |x: f64, n: u32| {
            // A space belongs to the tag after it; the last space has no tag.
            let index = floor((x + spacing) * per_pitch);
            (0..=n as i32).contains(&index).then_some((index as u32, x - index as f64 * pitch))
        };
        let (Some((column, a)), Some((row, b))) = (cell(x.x, self.grid.columns), cell(x.y, self.grid.rows))
        else {
            return 1.0;
        };
        match (a < 0.0, b < 0.0) {
            (true, true) => -1.0,
            (false, false) if column < self.grid.columns && row < self.grid.rows => {
                self.tag_ink((row * self.grid.columns + column) as usize, (a, 1.0 - b), border_cells)
            }
            _ => 1.0,
        }
    }

    /// Returns the ink inside a tag, at a position relative to its top-left corner.
    fn tag_ink(&self, index: usize, (x, y): (f64, f64), border_cells: usize) -> f32 {
        let pattern = &self.patterns[index];
        let single = pattern.width_cells - 2 * pattern.inset_cells;
        let more = border_cells - 1;
        let cells = single + 2 * more;
        let cell = |x: f64| ((x * cells as f64) as usize).min(cells - 1).checked_sub(more);
        let (Some(u), Some(v)) = (cell(x), cell(y)) else { return -1.0 };
        let is_white = u < single
            && v < single
            && pattern.white[(v + pattern.inset_cells) * pattern.width_cells + u + pattern.inset_cells];
        if is_white { 1.0 } else { -1.0 }
    }

    /// Adds the corners whose print is visible, and moves those in `doubtful` to the position of their print.
    pub fn complete(
        &self,
        image: &GrayImage,
        noise_gray: f64,
        border_cells: usize,
        known: &mut Corners,
        doubtful: &[Feature],
    ) {
        let blur_px = self.blur_px(image, noise_gray, border_cells, known);
        let look = CameraWatcher { print: self, image, noise_gray, border_cells, blur_px };
        for feature in doubtful {
            if let Some(fit) = look.at(known, *feature) {
                known.insert(*feature, printed(&fit));
            }
        }
        let mut fresh: BTreeSet<u32> = known.keys().map(|f| f.id).collect();
        for _ in 0..MOST_ROUNDS {
            let beside: BTreeSet<u32> = fresh.iter().flat_map(|id| self.tags_near(*id, 1)).collect();
            let all = beside.into_iter().flat_map(|id| (0..4).map(move |corner| Feature { id, corner }));
            let missing = all.filter(|f| !known.contains_key(f));
            let found: Vec<(Feature, Joint)> =
                missing.filter_map(|f| Some((f, printed(&look.at(known, f)?)))).collect();
            if found.is_empty() {
                break;
            }
            fresh = found.iter().map(|(f, _)| f.id).collect();
            known.extend(found);
        }
    }

    /// Returns the corners, the picked ones at the position of their print, and the blur. A corner without a visible print is covered and left
    /// out, except for those in `doubtful`, which rest on the edges of their tag: there a corner square is missing.
    pub fn measured(
        &self,
        image: &GrayImage,
        common: Common,
        border_cells: usize,
        known: &Corners,
        picked: &BTreeSet<Feature>,
        doubtful: &[Feature],
    ) -> (Corners, f64) {
        let noise_gray = common.noise_gray;
        let look = CameraWatcher { print: self, image, noise_gray, border_cells, blur_px: BLURS_PX[0] };
        let place = |(feature, joint): (&Feature, &Joint)| {
            let place = self.place(feature.id, feature.corner);
            let map = look.map_near(known, feature.id, &place)?;
            let edge_px = edge_px(&map, &place)?;
            let ink = move |x: PlanePoint| self.ink(x, border_cells);
            let spacing = self.grid.tag_spacing_ratio;
            // Beyond the gap around the outer tags the background is unknown.
            let outer_px = (0.7 * spacing * edge_px - 0.5).max(3.0);
            let clear_px = if self.is_outer(&place) { outer_px } else { f64::INFINITY };
            let square_px = (2.0 * spacing).min(1.0) * edge_px;
            let reach_px = (0.05 * edge_px).clamp(1.0, SEARCH_PX.0);
            Some((*feature, Place { found: joint.pixel, place, map, square_px, clear_px, reach_px, ink }))
        };
        let (features, places): (Vec<Feature>, Vec<Place<_>>) =
            known.iter().filter(|(feature, _)| picked.contains(feature)).filter_map(place).unzip();
        let mut measured = known.clone();
        let (said, blur_px) = print::measure(image, common, &places);
        for (feature, seen) in features.into_iter().zip(said) {
            match seen {
                Observed::Print { pixel, sigma_px } => {
                    measured.insert(feature, Joint { pixel, sigma_px });
                }
                Observed::Otherwise if !doubtful.contains(&feature) => {
                    measured.remove(&feature);
                }
                Observed::Otherwise | Observed::Outside => {}
            }
        }
        (measured, blur_px)
    }

    /// Checks whether a position is on the outline of the grid.
    fn is_outer(&self, x: &PlanePoint) -> bool {
        let last = |n: u32| (n - 1) as f64 * (1.0 + self.grid.tag_spacing_ratio) + 0.5;
        x.x < 0.5 || x.y < 0.5 || last(self.grid.columns) < x.x || last(self.grid.rows) < x.y
    }

    /// Iterates over a tag and the tags up to `reach` columns and rows away.
    fn tags_near(&self, id: u32, reach: u32) -> impl Iterator<Item = u32> + use<> {
        let AprilGrid { rows, columns, first_id, .. } = self.grid;
        let (column, row) = ((id - first_id) % columns, (id - first_id) / columns);
        let around = move |x: u32, n: u32| x.saturating_sub(reach)..(x + reach + 1).min(n);
        around(row, rows).flat_map(move |r| around(column, columns).map(move |c| first_id + r * columns + c))
    }

    /// Returns the blur that explains the known corners best.
    fn blur_px(&self, image: &GrayImage, noise_gray: f64, border_cells: usize, known: &Corners) -> f64 {
        let every = (known.len() / BLUR_CORNERS).max(1);
        let explained = |blur_px: f64| -> f64 {
            let look = CameraWatcher { print: self, image, noise_gray, border_cells, blur_px };
            let some = known.keys().skip(every / 2).step_by(every).take(BLUR_CORNERS);
            some.filter_map(|feature| look.at(known, *feature)).map(|fit| fit.explained).sum()
        };
        let shares = BLURS_PX.map(explained);
        let best = (0..BLURS_PX.len()).max_by(|&a, &b| shares[a].total_cmp(&shares[b]).then(b.cmp(&a)));
        BLURS_PX[best.unwrap_or(0)]
    }
}

/// Returns the shortest length of a tag's edge in the image at a position, in pixels.
fn edge_px(map: &Homography, place: &PlanePoint) -> Option<f64> {
    let beside = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)];
    let at = map.at(place);
    let half_px = beside.map(|(x, y)| (map.at(&(place + PlanePoint::new(x, y))) - at).norm());
    Some(2.0 * half_px.into_iter().fold(f64::INFINITY, f64::min)).filter(|edge| edge.is_finite())
}

fn printed(fit: &Fit) -> Joint {
    Joint { pixel: fit.pixel, sigma_px: fit.sigma_px() }
}

/// What the print is compared with at every corner of an image.
struct CameraWatcher<'a> {
    print: &'a GridPrint,
    image: &'a GrayImage,
    noise_gray: f64,
    border_cells: usize,
    blur_px: f64,
}

impl CameraWatcher<'_> {
    /// Fits the print around a corner; `None` where it does not explain the image.
    fn at(&self, known: &Corners, feature: Feature) -> Option<Fit> {
        let place = self.print.place(feature.id, feature.corner);
        let map = self.map_near(known, feature.id, &place)?;
        let at = map.at(&place);
        let inside = |x: f64, n: u32| -0.5 <= x && x < n as f64;
        if !inside(at.x, self.image.width_px) || !inside(at.y, self.image.height_px) {
            return None;
        }
        let edge_px = edge_px(&map, &place).filter(|edge| LEAST_EDGE_PX <= *edge)?;
        let reach_px = (SEARCH_EDGES * edge_px).clamp(SEARCH_PX.0, SEARCH_PX.1);
        let half_px = (PRINT_EDGES * edge_px).clamp(PRINT_PX.0, PRINT_PX.1) as usize;
        let window =
            Window { half_px, blur_px: self.blur_px, noise_gray: self.noise_gray, redrawn_px: REDRAWN_PX };
        let ink = |x: PlanePoint| self.print.ink(x, self.border_cells);
        let fit = template::fit(self.image, ink, &map, &place, at, reach_px, window)?;
        (EXPLAINED <= fit.explained && CONTRAST_GRAY <= fit.contrast_gray).then_some(fit)
    }

    /// Returns the homography of the corners known around a position.
    fn map_near(&self, known: &Corners, id: u32, place: &PlanePoint) -> Option<Homography> {
        let features =
            self.print.tags_near(id, 2).flat_map(|id| (0..4).map(move |corner| Feature { id, corner }));
        let mut near: Vec<(f64, PlanePoint, Pixel)> = features
            .filter_map(|f| Some((self.print.place(f.id, f.corner), known.get(&f)?.pixel)))
            .map(|(x, pixel)| ((x - place).norm_squared(), x, pixel))
            .filter(|(apart, ..)| *apart <= REACH_EDGES * REACH_EDGES)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(NEAREST);
        let spans = |along: fn(&PlanePoint) -> f64| {
            near.iter().any(|(_, x, _)| 0.5 < (along(x) - along(&near[0].1)).abs())
        };
        if near.len() < 4 || !spans(|x| x.x) || !spans(|x| x.y) {
            return None;
        }
        let pairs: Vec<(PlanePoint, Pixel)> = near.iter().map(|(_, x, pixel)| (*x, *pixel)).collect();
        Homography::fit(&pairs)
    }
}
