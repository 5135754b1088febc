//! Numbers that are hardly meant: lengths that are no metres, lenses that do not exist. The only place with such limits, asked wherever
//! a camera, a target, points or distances are read.
//!
//! Nothing is refused: a remark says the number seen and what was probably meant. The limits lie far beyond what anybody prints, hangs up,
//! tapes or buys, and far below the thousandfold of a slip of unit, so that neither side is near.

use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::target::{LinePlusOne, NamedPoint, TagMap};
use crate::core::{Pixel, Point, Target};

/// A printed square: the largest boards are 2 m overall.
const LARGEST_SQUARE_M: f64 = 1.5;
/// A tag: landing marks of 1 to 2 m are the largest in use.
const LARGEST_TAG_M: f64 = 4.0;
/// Either: at a tenth of a millimetre nothing can be printed.
const SMALLEST_M: f64 = 1e-4;
/// Three points on a line and one off it: a scene that one photograph shows well.
const LARGEST_LINE_M: f64 = 50.0;
/// Neighbouring tags in edges: a detector needs 12 px of a tag, so that tags farther apart than this are never in one image of 4000 px.
const FARTHEST_TAGS_EDGES: f64 = 1000.0;
/// Round numbers (multiples of 0.1) over more than this are millimetres: a survey in metres states centimetres. Pitches, the largest
/// places that are known by round numbers of metres, are 120 m long.
const ROUND_EXTENT_M: f64 = 150.0;
/// Farther than any target is seen.
const LARGEST_EXTENT_M: f64 = 1e5;
/// Fewer coordinates other than zero may be round by chance.
const LEAST_COORDINATES: usize = 6;
/// Over more than this fewer are enough where they are multiples of 10: a rectangle in millimetres has two sides and zeros.
const COARSE_EXTENT_M: f64 = 1000.0;
const LEAST_COARSE: usize = 3;
/// Coordinates in metres that are round to 0.1 m have this standard deviation at least: 0.1 m / √12.
const ROUND_SIGMA_M: f64 = 0.028;
/// Numbers that are parts of a whole, to rounding.
const PARTS: std::ops::RangeInclusive<f64> = -0.01..=1.01;
/// Fewer pixels may be in the corner of an image.
const LEAST_PIXELS: usize = 3;
/// Images of fewer pixels a side are those of no camera.
const SMALLEST_IMAGE_PX: u32 = 16;
/// Taped distances beyond this, all round, are millimetres.
const LONGEST_TAPE_M: f64 = 100.0;
/// Where the shortest taped distance of a scene is longer than this, round or not, all are centimetres or millimetres.
const SHORTEST_TAPE_M: f64 = 150.0;
/// Where all are shorter than this, they are centimetres rather than millimetres.
const LONGEST_CENTIMETRES: f64 = 3000.0;
/// What people print and hang up: where the likely meaning of a wrong number should lie.
const USUAL_M: std::ops::RangeInclusive<f64> = 0.003..=2.0;

/// Tangential coefficients: a lens whose elements are 1° out of line has 0.01.
const LARGEST_TANGENTIAL: f64 = 0.05;
/// Pixels are square to a tenth; those of digitised television (12 : 11, 16 : 15) are.
const USUAL_ASPECT: std::ops::RangeInclusive<f64> = 0.9..=1.1;
/// Share of the image by which a principal point is off the middle where exchanged numbers are looked for.
const FARTHEST_EXCHANGED: f64 = 0.08;
/// Principal point from the middle of the image, in parts of its width or height: lenses that are shifted on purpose stay below.
const FARTHEST_CENTRE: f64 = 0.2;
/// A focal length in pixels below this part of the image's side is one in millimetres.
const SHORTEST_FOCAL: f64 = 0.1;

/// What the numbers of a lens should be looked at for, in sentences; none where a camera can have them.
///
/// `radial_and_tangential`: k1, k2, p1, p2 of the models that have them.
pub(super) fn of_lens(
    radial_and_tangential: Option<[f64; 4]>,
    k: &CameraMatrix,
    size: Option<ImageSize>,
) -> Vec<String> {
    let size = size.map(|size| [f64::from(size.width_px), f64::from(size.height_px)]);
    let found = [
        of_focal_lengths(k, size),
        size.and_then(|size| of_centre(k, size)),
        radial_and_tangential.and_then(of_tangential),
    ];
    found.into_iter().flatten().collect()
}

fn of_focal_lengths(k: &CameraMatrix, size: Option<[f64; 2]>) -> Option<String> {
    let (fx, fy) = (k.fx_px, k.fy_px);
    let side = size.map_or(0.0, |[width, height]| width.max(height));
    if fx.max(fy) < SHORTEST_FOCAL * side {
        return Some(format!(
            "focal length {} for images of {side} px; is it in millimetres? Pixels are needed",
            short(fx.max(fy))
        ));
    }
    (!USUAL_ASPECT.contains(&(fx / fy))).then(|| {
        format!(
            "fx {} px is {} times fy {} px, and cameras have square pixels: were the images stretched or their size changed in one \
            direction, or is one of the two in another unit?",
            short(fx),
            short(fx / fy),
            short(fy)
        )
    })
}

/// A principal point that would be the middle of images of another size, or of a part of larger ones.
fn of_centre(k: &CameraMatrix, [width, height]: [f64; 2]) -> Option<String> {
    let off = [k.cx_px + 0.5 - width / 2.0, k.cy_px + 0.5 - height / 2.0];
    let parts = [off[0] / width, off[1] / height];
    let exchanged = [(k.cy_px + 0.5) / width - 0.5, (k.cx_px + 0.5) / height - 0.5];
    let largest = |of: [f64; 2]| of[0].abs().max(of[1].abs());
    if FARTHEST_EXCHANGED < largest(parts) && largest(exchanged) < largest(parts) / 4.0 {
        return Some(format!(
            "the principal point ({}, {}) px is near the middle of images of {width} × {height} px with its numbers exchanged: are cx and cy?",
            short(k.cx_px),
            short(k.cy_px)
        ));
    }
    let farthest = if parts[0].abs() < parts[1].abs() { 1 } else { 0 };
    let part = parts[farthest];
    (FARTHEST_CENTRE < part.abs()).then(|| {
        let (side, way) = [
            ("width", ["left of", "right of"]),
            ("height", ["above", "below"]),
        ][farthest];
        let middle = format!("{:.0} × {:.0}", 2.0 * k.cx_px + 1.0, 2.0 * k.cy_px + 1.0);
        format!(
            "the principal point is {:.0} px ({:.0} % of the {side}) {} the middle of images of {width} × {height} px: was the camera \
            calibrated on images of another size (its middle fits {middle} px) or on a part of them?",
            off[farthest].abs(),
            100.0 * part.abs(),
            way[usize::from(0.0 < part)]
        )
    })
}

fn of_tangential([k1, k2, p1, p2]: [f64; 4]) -> Option<String> {
    let largest = |a: f64, b: f64| a.abs().max(b.abs());
    (LARGEST_TANGENTIAL < largest(p1, p2)).then(|| {
        let meant = match largest(k1, k2) < LARGEST_TANGENTIAL {
            true => "are k1, k2 and p1, p2 exchanged?",
            false => "is the order another one, or are they k3 and k4 of a fisheye?",
        };
        format!(
            "the tangential coefficients p1 = {}, p2 = {} are those of no lens (real ones stay below {LARGEST_TANGENTIAL}); the order is \
            k1, k2, p1, p2: {meant}",
            p1, p2
        )
    })
}

/// What a target's dimensions should be looked at for, in sentences; none where they can be metres.
pub fn of_target(target: &Target) -> Vec<String> {
    match target.design() {
        Target::LinePlusOne(line) => of_line(line).into_iter().collect(),
        Target::Tag(tag) => edge("size_m", tag.size_m, LARGEST_TAG_M).into_iter().collect(),
        Target::AprilGrid(grid) => edge("tag_size_m", grid.tag_size_m, LARGEST_TAG_M).into_iter().collect(),
        Target::Chessboard(board) => edge("square_m", board.square_m, LARGEST_SQUARE_M).into_iter().collect(),
        Target::Charuco(board) => edge("square_m", board.square_m, LARGEST_SQUARE_M).into_iter().collect(),
        Target::CircleGrid(grid) => {
            let spacing = edge("spacing_m", grid.spacing_m, LARGEST_SQUARE_M);
            let diameter = grid.diameter_m.and_then(|m| edge("diameter_m", m, LARGEST_SQUARE_M));
            spacing.into_iter().chain(diameter).collect()
        }
        Target::TagMap(map) => of_map(map),
        Target::Points(points) => of_named(points).into_iter().collect(),
        _ => Vec::new(),
    }
}

/// The extent of a printed target that is no size at all (metres): its points would leave the range of numbers.
pub(super) fn absurd_extent_m(target: &Target) -> Option<f64> {
    const LARGEST_M: f64 = 1e9;
    let extent_m = match target.design() {
        Target::Tag(tag) => tag.size_m,
        Target::AprilGrid(grid) => {
            grid.tag_size_m * (1.0 + grid.tag_spacing_ratio) * f64::from(grid.rows.max(grid.columns))
        }
        Target::Chessboard(board) => board.square_m * f64::from(board.rows.max(board.columns)),
        Target::Charuco(board) => board.square_m * f64::from(board.rows.max(board.columns)),
        Target::CircleGrid(grid) => 2.0 * grid.spacing_m * f64::from(grid.rows.max(grid.columns)),
        Target::TagMap(map) => map.tags.iter().map(|tag| tag.size_m).fold(0.0, f64::max),
        _ => 0.0,
    };
    (!(extent_m <= LARGEST_M)).then_some(extent_m)
}

/// Coordinates of points, such as a file's columns x_m, y_m, z_m: a remark where they are hardly metres.
pub fn of_points(points: &[Point]) -> Option<String> {
    let extent_m = extent_m(points);
    if !(ROUND_EXTENT_M < extent_m && extent_m.is_finite()) {
        return None; // Without a look at single coordinates, for the millions of rows of a batch.
    }
    let coordinates = || points.iter().flat_map(|p| [p.x, p.y, p.z]).filter(|x| *x != 0.0);
    let n = coordinates().count();
    let is_coarse =
        COARSE_EXTENT_M < extent_m && LEAST_COARSE <= n && coordinates().all(|x| is_round(x / 100.0));
    let is_round = is_coarse || (LEAST_COORDINATES <= n && coordinates().all(is_round));
    let is_suspect = is_round || (LARGEST_EXTENT_M < extent_m && extent_m < 1e12);
    is_suspect.then(|| {
        let why = if is_round { ", every coordinate a round number" } else { "" };
        format!("the points lie over {} m{why}: {}", short(extent_m), in_other_units(extent_m))
    })
}

/// Asks for the unit of a number that is hardly metres, with what it is in metres.
fn in_other_units(seen: f64) -> String {
    format!(
        "are they in millimetres ({} m: divide by 1000), centimetres ({} m: divide by 100) or inches ({} m: multiply by 0.0254)?",
        short(seen / 1e3),
        short(seen / 1e2),
        short(seen * 0.0254)
    )
}

/// Points with their standard deviations, metres: a remark where their coordinates are hardly metres. Round coordinates whose stated standard
/// deviation is that of rounding to 0.1 m are metres.
pub fn of_uncertain_points(points: impl IntoIterator<Item = (Point, f64)>) -> Option<String> {
    let (points, sigmas): (Vec<Point>, Vec<f64>) = points.into_iter().unzip();
    let is_stated = sigmas.iter().all(|sigma_m| ROUND_SIGMA_M <= *sigma_m);
    of_points(&points).filter(|_| !is_stated || LARGEST_EXTENT_M < extent_m(&points)).map(|remark| {
        format!("{remark}; of points in metres that are known to 0.1 m only state the standard deviation (sigma_m)")
    })
}

/// Pixels of a camera's images: a remark where all are parts of the image's width and height.
pub fn of_pixels(pixels: impl IntoIterator<Item = Pixel>, size: Option<ImageSize>) -> Option<String> {
    let ImageSize { width_px, height_px } = size?;
    let mut n = 0;
    let is_part = |pixel: Pixel| {
        n += 1;
        PARTS.contains(&pixel.x) && PARTS.contains(&pixel.y)
    };
    let are_parts = pixels.into_iter().all(is_part);
    (are_parts && LEAST_PIXELS <= n && SMALLEST_IMAGE_PX < width_px.min(height_px)).then(|| {
        format!(
            "every pixel lies between 0 and 1: are they parts of the image's width and height? Then multiply u by {width_px} and v by {height_px}"
        )
    })
}

/// Distances taped or stepped: a remark where the shortest is longer than any tape, and where all are round numbers of hundreds or thousands.
pub fn of_distances(distances_m: &[f64]) -> Option<String> {
    let shortest = distances_m.iter().copied().fold(f64::INFINITY, f64::min);
    let longest = distances_m.iter().copied().fold(0.0, f64::max);
    if shortest.is_finite() && SHORTEST_TAPE_M < shortest && longest < LONGEST_CENTIMETRES {
        return Some(format!(
            "the shortest distance stated is {} m, and no tape is that long: {}",
            short(shortest),
            in_other_units(shortest)
        ));
    }
    let is_suspect = !distances_m.is_empty()
        && distances_m.iter().all(|x| x.is_finite() && is_round(*x))
        && LONGEST_TAPE_M < shortest;
    is_suspect.then(|| {
        format!(
            "the shortest distance stated is {} m, all are round numbers: {}",
            short(shortest),
            in_other_units(shortest)
        )
    })
}

fn of_line(line: &LinePlusOne) -> Option<String> {
    let [along, across] = line.off_m;
    let points =
        line.line_m.map(|x| Point::new(x, 0.0, 0.0)).into_iter().chain([Point::new(along, across, 0.0)]);
    let extent_m = extent_m(&points.collect::<Vec<_>>());
    (LARGEST_LINE_M < extent_m).then(|| {
        format!("the points of line_m and off_m lie over {} m: {}", short(extent_m), in_other_units(extent_m))
    })
}

fn of_map(map: &TagMap) -> Vec<String> {
    let mut remarks = Vec::new();
    let largest = map.tags.iter().max_by(|a, b| a.size_m.total_cmp(&b.size_m));
    let smallest = map.tags.iter().min_by(|a, b| a.size_m.total_cmp(&b.size_m));
    for tag in largest.into_iter().chain(smallest.filter(|tag| tag.size_m < SMALLEST_M)) {
        remarks.extend(
            edge("size_m", tag.size_m, LARGEST_TAG_M).map(|remark| format!("tag {}: {remark}", tag.id)),
        );
    }
    remarks.extend(spread(map));
    let widest = map.tags.iter().max_by(|a, b| (a.sigma_m / a.size_m).total_cmp(&(b.sigma_m / b.size_m)));
    if let Some(tag) = widest.filter(|tag| 10.0 * tag.size_m < tag.sigma_m) {
        remarks.push(format!(
            "tag {}: sigma_m is {}, many times the tag itself: did you mean {}?",
            tag.id,
            short(tag.sigma_m),
            short(tag.sigma_m / 1e3)
        ));
    }
    remarks
}

/// The places of a map in millimetres beside sizes in metres.
fn spread(map: &TagMap) -> Option<String> {
    let nearest = |i: usize| {
        let others = map.tags.iter().enumerate().filter(|(k, _)| *k != i);
        let apart = others.map(|(_, other)| {
            (other.world_from_tag.translation - map.tags[i].world_from_tag.translation).norm()
        });
        apart.fold(f64::INFINITY, f64::min)
    };
    // The two that are nearest of all: one tag far away from the rest is no slip of unit. A few tags say it as well as many.
    let n = map.tags.len().min(200);
    let apart_m = (0..n).map(nearest).fold(f64::INFINITY, f64::min);
    let size_m = map.tags.iter().map(|tag| tag.size_m).fold(0.0, f64::max);
    (FARTHEST_TAGS_EDGES * size_m < apart_m && apart_m.is_finite()).then(|| {
        format!(
            "the nearest two tags are {} m apart, {:.0} times their size: are translation_m in millimetres? Then divide by 1000 ({} m)",
            short(apart_m),
            apart_m / size_m,
            short(apart_m / 1e3)
        )
    })
}

fn of_named(points: &[NamedPoint]) -> Option<String> {
    of_uncertain_points(points.iter().map(|p| (p.position, p.sigma_m)))
}

/// An edge that can be printed.
fn edge(key: &str, seen_m: f64, largest_m: f64) -> Option<String> {
    if (SMALLEST_M..=largest_m).contains(&seen_m) {
        return None;
    }
    // In the order in which such slips are made: millimetres, centimetres; too small a number was divided once too often.
    let meant = [1e-3, 1e-2, 1e3, 1e2].map(|factor| seen_m * factor);
    let meant = meant.into_iter().find(|x| USUAL_M.contains(x));
    Some(match meant {
        Some(x) => format!("{key} is {} m: did you mean {}?", short(seen_m), short(x)),
        None => format!("{key} is {} m, which is no size of a print; the unit is metres", short(seen_m)),
    })
}

/// The longest side of the box about the points.
fn extent_m(points: &[Point]) -> f64 {
    let side = |i: usize| {
        let ends = points.iter().map(|p| p[i]);
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    (0..3).map(side).fold(0.0, f64::max)
}

/// A multiple of 0.1, to rounding.
fn is_round(x: f64) -> bool {
    let tenths = 10.0 * x;
    (tenths - tenths.round()).abs() <= 1e-9 * tenths.abs().max(1.0)
}

/// Four figures, without trailing zeros.
fn short(x: f64) -> String {
    let digits = (3 - x.abs().max(1e-12).log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Pose;
    use crate::core::target::{Chessboard, MapTag, Tag};

    fn board(square_m: f64) -> Vec<String> {
        of_target(&Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m }))
    }

    fn lens(f: [f64; 2], c: [f64; 2], d: [f64; 4]) -> Vec<String> {
        let k = CameraMatrix { fx_px: f[0], fy_px: f[1], cx_px: c[0], cy_px: c[1] };
        let size = ImageSize { width_px: 1920, height_px: 1080 };
        of_lens(Some(d), &k, Some(size))
    }

    #[test]
    fn lenses_that_nobody_builds_are_remarked_on() {
        let good = [-0.28, 0.07, 0.001, -0.002];
        assert!(lens([1105.0, 1104.0], [959.5, 539.5], good).is_empty());
        assert!(lens([1105.0, 1014.0], [800.0, 600.0], good).is_empty(), "12 : 11, 8 and 6 % off");
        let centre = lens([1105.0, 1104.0], [352.0, 318.0], good);
        assert!(
            centre[0].contains("608 px (32 % of the width) left of") && centre[0].contains("705 × 637"),
            "{centre:?}"
        );
        let below = lens([1105.0, 1104.0], [959.5, 860.0], good);
        assert!(below[0].contains("(30 % of the height) below"), "{below:?}");
        let exchanged = lens([1105.0, 1104.0], [959.5, 539.5], [-0.0018, 0.0026, -0.31, 0.12]);
        assert!(exchanged[0].contains("p1 = -0.31") && exchanged[0].contains("exchanged?"), "{exchanged:?}");
        let fisheye = lens([1105.0, 1104.0], [959.5, 539.5], [0.2, -0.1, 0.31, -0.12]);
        assert!(fisheye[0].contains("fisheye?"), "{fisheye:?}");
        let stretched = lens([1105.0, 830.0], [959.5, 539.5], good);
        assert!(stretched[0].contains("1.331 times"), "{stretched:?}");
        let millimetres = lens([8.0, 8.0], [959.5, 539.5], good);
        assert!(millimetres.len() == 1 && millimetres[0].contains("millimetres"), "{millimetres:?}");
    }

    #[test]
    fn edges_say_what_was_meant() {
        assert_eq!(board(25.0), ["square_m is 25 m: did you mean 0.025?"]);
        assert_eq!(board(2.5), ["square_m is 2.5 m: did you mean 0.025?"]);
        assert_eq!(board(0.000_025), ["square_m is 0.000025 m: did you mean 0.025?"]);
        let tag = |size_m| of_target(&Target::Tag(Tag { family: "tag36h11".into(), id: 0, size_m }));
        assert_eq!(tag(160.0), ["size_m is 160 m: did you mean 0.16?"]);
        for good in [0.0005, 0.02, 0.25, 1.0] {
            assert!(board(good).is_empty() && tag(good).is_empty(), "{good}");
        }
    }

    fn map(scale: f64, size_m: f64) -> Vec<String> {
        let tag = |id: u32, x: f64| MapTag {
            id,
            size_m,
            world_from_tag: Pose::new(nalgebra::Matrix3::identity(), Point::new(x * scale, 0.3 * scale, 0.0)),
            sigma_m: 0.0,
            sigma_rad: 0.0,
        };
        of_target(&Target::TagMap(TagMap {
            family: "tag36h11".into(),
            tags: vec![tag(0, 0.0), tag(1, 1.5), tag(2, 16.0)],
            joint_covariance: None,
        }))
    }

    #[test]
    fn maps_in_millimetres_are_seen() {
        assert!(map(1.0, 0.1651).is_empty());
        assert!(map(1000.0, 0.1651)[0].contains("1500 m apart"), "{:?}", map(1000.0, 0.1651));
        assert!(map(1000.0, 165.1)[0].contains("did you mean 0.1651?"));
        assert!(map(30.0, 0.1651).is_empty(), "a hall with a tag every 45 m");
    }

    fn points(xyz: &[[f64; 3]]) -> Option<String> {
        of_points(&xyz.iter().map(|x| Point::from(*x)).collect::<Vec<_>>())
    }

    #[test]
    fn points_in_millimetres_are_seen() {
        let road = [[0.0, 0.0, 0.0], [3500.0, 0.0, 0.0], [3500.0, 12000.0, 0.0], [100.0, 11950.5, 20.0]];
        assert!(
            points(&road).is_some_and(|r| r.contains("12000 m") && r.contains("millimetres (12 m:")),
            "{:?}",
            points(&road)
        );
        assert!(points(&road.map(|x| x.map(|x| x / 1000.0))).is_none());
        // Two sides of a rectangle; a yard and a runway of round metres are that.
        let rectangle = |x: f64, y: f64| [[0.0; 3], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0]];
        assert!(points(&rectangle(3500.0, 6000.0)).is_some() && points(&rectangle(3.5, 6.0)).is_none());
        assert!(points(&rectangle(3500.0, 6000.0)[..3]).is_some());
        assert!(points(&rectangle(200.0, 100.0)).is_none() && points(&rectangle(3000.0, 45.0)).is_none());
        // A surveyor's national grid, to the centimetre.
        let network = [
            [4_512_345.17, 5_401_233.82, 412.31],
            [4_512_745.5, 5_401_633.06, 415.9],
            [4_512_300.0, 5_401_200.4, 411.0],
        ];
        assert!(points(&network).is_none());
        // A few round numbers of a field of play.
        let pitch =
            [[0.0, 0.0], [105.0, 0.0], [105.0, 68.0], [0.0, 68.0], [52.5, 0.0], [52.5, 68.0], [11.0, 34.0]];
        assert!(points(&pitch.map(|[x, y]| [x, y, 0.0])).is_none());
        assert!(points(&[]).is_none() && points(&[[f64::NAN, 0.0, 0.0]]).is_none());
    }

    #[test]
    fn pixels_that_are_parts_of_the_image_are_seen() {
        let pixels = [[0.34, 0.6], [0.68, 0.56], [0.0, 1.0]].map(|[u, v]| Pixel::new(u, v));
        let size = |width_px| Some(ImageSize { width_px, height_px: 960 });
        let remark = of_pixels(pixels, size(1280)).expect("a remark");
        assert!(remark.ends_with("multiply u by 1280 and v by 960"), "{remark}");
        assert!(of_pixels(pixels, None).is_none() && of_pixels(pixels, size(1)).is_none());
        assert!(of_pixels(pixels.map(|p| p * 3.0), size(1280)).is_none());
        assert!(of_pixels(pixels[..2].to_vec(), size(1280)).is_none());
    }

    /// A landscape by a map: known to 0.1 m, and stated so.
    #[test]
    fn round_points_that_are_stated_to_be_coarse_are_metres() {
        let peaks = [[0.0, 0.0, 1412.0], [3500.0, 120.0, 1873.5], [4200.0, 12000.0, 2044.0]].map(Point::from);
        let of = |sigma_m: f64| of_uncertain_points(peaks.map(|x| (x, sigma_m)));
        assert!(of(0.0).is_some_and(|remark| remark.contains("(sigma_m)")) && of(0.01).is_some());
        assert_eq!(of(0.1), None);
        let far = of_uncertain_points(peaks.map(|x| (x * 100.0, 0.1)));
        assert!(far.is_some(), "no target is seen over 1200 km");
    }

    #[test]
    fn tapes_in_millimetres_are_seen() {
        assert!(
            of_distances(&[3500.0, 12_000.0])
                .is_some_and(|r| r.contains("millimetres (3.5 m: divide by 1000)"))
        );
        assert!(of_distances(&[3.5, 120.0]).is_none() && of_distances(&[]).is_none());
        assert!(of_distances(&[123.45]).is_none());
        // Tapes of 6.98 and 12.31 m in centimetres, and in millimetres.
        let centimetres = of_distances(&[698.4, 1231.2]).expect("a remark");
        assert!(
            centimetres.contains("centimetres (6.984 m: divide by 100) or inches (17.74 m"),
            "{centimetres}"
        );
        let millimetres = of_distances(&[6984.0, 12_312.0]).expect("a remark");
        assert!(millimetres.contains("millimetres (6.984 m: divide by 1000)"), "{millimetres}");
        assert!(of_distances(&[2.2, 698.4]).is_none(), "a short tape beside a long one");
    }
}
