//! Finds targets and tags in a photograph, as points with positions.

use crate::command::GivenTarget;
use crate::photograph::Photograph;
use crate::state::{ImagePoint, Position};
use crate::texts;
use resight::core::Target;
use resight::core::correspondence::Detection;
use resight::detect::every_tag::EveryTagFinder;
use resight::detect::job;
use std::path::Path;

/// Returns the points found with their positions; the error is a sentence.
pub fn find(given: &GivenTarget, photograph: &Photograph) -> Result<Vec<(ImagePoint, Position)>, String> {
    match given {
        GivenTarget::File { name, text } => {
            let read = resight::formats::read_target_from_bytes(Path::new(name), text.as_bytes().to_vec());
            of_target(&read.map_err(|reason| reason.to_string())?.target, photograph)
        }
        GivenTarget::Family { family, size_m } => of_family(family, *size_m, photograph),
    }
}

fn of_target(target: &Target, photograph: &Photograph) -> Result<Vec<(ImagePoint, Position)>, String> {
    let found = job::points(target, &photograph.image)?;
    let one = |d: &Detection| {
        let known = target.point(d.feature)?;
        let name = match target.has_tag_corners() {
            true => format!("{}.{}", d.feature.id, d.feature.corner),
            false => d.feature.id.to_string(),
        };
        let place = known.position;
        let position = Position { x_m: place.x, y_m: place.y, z_m: place.z, sigma_m: known.sigma_m };
        Some((image_point(name, d), position))
    };
    Ok(found.iter().filter_map(one).collect())
}

fn image_point(name: String, d: &Detection) -> ImagePoint {
    ImagePoint { name, u_px: d.pixel.x, v_px: d.pixel.y, sigma_px: Some(d.total_sigma_px()) }
}

/// The largest tag of the family.
fn of_family(
    family: &str,
    size_m: f64,
    photograph: &Photograph,
) -> Result<Vec<(ImagePoint, Position)>, String> {
    if !(0.0 < size_m && size_m.is_finite()) {
        return Err(texts::not_positive("The size of the tag", size_m, "m"));
    }
    let mut finder = EveryTagFinder::new(family).map_err(|reason| reason.to_string())?;
    let found = finder.find(&photograph.image);
    let tags = found.iter().flat_map(|family| &family.tags);
    let edge = |tag: &resight::detect::tags::FoundTag| (tag.corners[0] - tag.corners[2]).norm();
    let tag = tags.max_by(|a, b| edge(a).total_cmp(&edge(b))).ok_or(texts::NO_TAG)?;
    let half = 0.5 * size_m;
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    let position = |[x_m, y_m]: [f64; 2]| Position { x_m, y_m, z_m: 0.0, sigma_m: 0.0 };
    let name = |d: &Detection| format!("{}.{}", d.feature.id, d.feature.corner);
    Ok(tag.detections().zip(corners).map(|(d, at)| (image_point(name(&d), &d), position(at))).collect())
}
