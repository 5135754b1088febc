//! Suggests the view to take next, in a sentence and as an outline in the image.

use crate::answer::capture::SuggestionObject;
use crate::core::camera::ImageSize;
use crate::core::multiview::intrinsics::{Placement, SolvedIntrinsics};
use crate::core::{Camera, Pixel, Point, Pose, Target};
use crate::intrinsics::{next_view_words, placed};
use crate::nominal::NominalLens;

/// Views with which a capture begins, before a camera is known: position of the centre and size as shares of the image, tilt and its axis in
/// degrees. The first faces the camera; the others are repeated until the views determine a camera.
const FIRST: [([f64; 2], f64, [f64; 2]); 5] = [
    ([0.5, 0.5], 0.7, [0.0, 0.0]),
    ([0.5, 0.5], 0.7, [40.0, 90.0]),
    ([0.5, 0.5], 0.7, [40.0, 270.0]),
    ([0.5, 0.5], 0.7, [40.0, 0.0]),
    ([0.5, 0.5], 0.7, [40.0, 180.0]),
];
/// Horizontal field of view of an ordinary lens, degrees: with it the outline is drawn while the camera is unknown.
const ORDINARY_DEG: f64 = 60.0;
/// Parts into which each edge of the outline is cut, because a lens bends it.
const PARTS: usize = 8;

/// Returns the view that helps most next.
pub(super) fn suggestion(
    solved: Option<&SolvedIntrinsics>,
    n_kept: usize,
    target: &Target,
    size: ImageSize,
) -> Option<SuggestionObject> {
    match solved.and_then(|solved| Some((solved, solved.next_view?))) {
        Some((solved, next)) => {
            let outline_px = outline(&solved.camera, &next.cam_from_target, bounds(target)?);
            let message = next_view_words(&next, size);
            Some(SuggestionObject { message, outline_px, then_px: Some(next.then_px) })
        }
        None => first(n_kept, target, size),
    }
}

fn first(n_kept: usize, target: &Target, size: ImageSize) -> Option<SuggestionObject> {
    let repeated = if n_kept == 0 { 0 } else { 1 + (n_kept - 1) % (FIRST.len() - 1) };
    let ([u, v], part, [tilt_deg, axis_deg]) = FIRST[repeated];
    let centre = Pixel::new(u * f64::from(size.width_px), v * f64::from(size.height_px));
    let (tilt_rad, axis_rad) = (f64::to_radians(tilt_deg), f64::to_radians(axis_deg));
    let placement = Placement { centre, tilt_rad, axis_rad, part };
    let camera = NominalLens::HorizontalFieldOfView(ORDINARY_DEG).camera(size).ok()?.camera;
    let cam_from_target = placement.cam_from_target(&camera, size, bounds(target)?)?;
    Some(SuggestionObject {
        message: format!("{}, {:.0} % of its height large", placed(&placement, size), 100.0 * part),
        outline_px: outline(&camera, &cam_from_target, bounds(target)?),
        then_px: None,
    })
}

/// Returns the corners of the box around a target's points.
fn bounds(target: &Target) -> Option<[Point; 2]> {
    let points = target.features().into_iter().filter_map(|feature| target.point(feature));
    points
        .map(|known| [known.position; 2])
        .reduce(|[low, high], [a, b]| [low.zip_map(&a, f64::min), high.zip_map(&b, f64::max)])
}

/// Returns the closed outline of a target in the image; points outside the camera's field are left out.
fn outline(camera: &Camera, cam_from_target: &Pose, [low, high]: [Point; 2]) -> Vec<[f64; 2]> {
    let z = 0.5 * (low.z + high.z);
    let corners = [(low.x, low.y), (high.x, low.y), (high.x, high.y), (low.x, high.y), (low.x, low.y)];
    let corners = corners.map(|(x, y)| Point::new(x, y, z));
    let edge = |pair: &[Point]| {
        let [a, b] = [pair[0], pair[1]];
        (0..PARTS).map(move |i| a + (b - a) * (i as f64 / PARTS as f64))
    };
    let points = corners.windows(2).flat_map(edge);
    points.filter_map(|x| camera.project(&(*cam_from_target * x)).map(Into::into)).collect()
}
