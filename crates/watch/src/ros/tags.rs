//! The common parts of the messages of tag detectors.

use resight::detect::sigma::tag_corner_px;
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use resight_recording::ros::value::Value;
use std::collections::BTreeMap;

/// Largest number of tags in an image.
const MAX_TAGS: usize = 4096;

/// A tag of a message, with its corners in our order and pixel convention.
pub(super) struct ReportedTag {
    pub family: String,
    pub id: u32,
    /// Grey levels, where the detector states them.
    pub margin_gray: Option<f64>,
    pub corners: [Pixel; 4],
}

/// Returns the corners of all tags of a message, read one by one. A tag that occurs twice is left out, because either may be the right one.
///
/// # Errors
/// Tags of several families, which would share ids.
pub(super) fn detections(
    message: &Value<'_>,
    read: impl Fn(&Value<'_>) -> Result<ReportedTag, String>,
) -> Result<Vec<Detection>, String> {
    let list = message.list("detections")?;
    if MAX_TAGS < list.len() {
        return Err(format!("{} tags in one image; at most {MAX_TAGS} are read", list.len()));
    }
    let mut by_id: BTreeMap<u32, Vec<ReportedTag>> = BTreeMap::new();
    let mut family: Option<String> = None;
    for (i, reported) in list.iter().enumerate() {
        let tag = read(reported).map_err(|reason| format!("detections[{i}]: {reason}"))?;
        match &family {
            Some(family) if *family != tag.family => {
                return Err(format!(
                    "tags of {family} and {} in one message, whose ids would be mixed up; publish each family on a topic of its own",
                    tag.family
                ));
            }
            _ => family = Some(tag.family.clone()),
        }
        by_id.entry(tag.id).or_default().push(tag);
    }
    Ok(by_id.into_values().filter(|tags| tags.len() == 1).flatten().flat_map(|tag| corners(&tag)).collect())
}

fn corners(tag: &ReportedTag) -> [Detection; 4] {
    let sigma_px = tag_corner_px(&tag.corners, tag.margin_gray);
    [0, 1, 2, 3].map(|corner: u8| Detection {
        feature: Feature { id: tag.id, corner },
        pixel: tag.corners[usize::from(corner)],
        sigma_px,
        lens_sigma_px: resight::detect::sigma::LENS_PX,
        covariance_px2: None,
    })
}

/// Returns family and id.
pub(super) fn label(tag: &Value<'_>) -> Result<(String, u32), String> {
    Ok((tag.text("family")?.to_string(), tag.count("id")?))
}

/// Returns four corners in the order of the message: a list of points with x and y, or eight numbers.
pub(super) fn four_corners(tag: &Value<'_>) -> Result<[Pixel; 4], String> {
    let points: Vec<Pixel> = match tag.get("corners") {
        Some(Value::Numbers(numbers)) => numbers.chunks_exact(2).map(|x| Pixel::new(x[0], x[1])).collect(),
        Some(Value::List(list)) => {
            let point = |p: &Value<'_>| Ok(Pixel::new(p.number("x")?, p.number("y")?));
            list.iter().map(point).collect::<Result<_, String>>()?
        }
        _ => return Err("the message has no field `corners`".to_string()),
    };
    let n = points.len();
    let four: [Pixel; 4] = points.try_into().map_err(|_| format!("{n} corners; 4 are needed"))?;
    match four.iter().all(|pixel| pixel.iter().all(|x| x.is_finite())) {
        true => Ok(four),
        false => Err("a corner that is not finite".to_string()),
    }
}
