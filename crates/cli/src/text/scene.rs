//! How a camera stands over its scene, in words.

use super::line;
use resight::answer::SceneViewAnswer;
use resight::report::words::{decimals, degrees, with_sigma};

/// Several lines.
pub fn describe(answer: &SceneViewAnswer) -> String {
    let mut out = format!("{}   {}\n", answer.view, answer.status.name().to_uppercase());
    let with = |value: Option<f64>, sigma: Option<f64>| value.zip(sigma);
    if let (Some((focal, sigma)), Some(field)) =
        (with(answer.focal_px, answer.focal_sigma_px), answer.horizontal_field_of_view_rad)
    {
        let text =
            format!("{focal:.0} ± {sigma:.0} px, {:.1}° from the left to the right edge", field.to_degrees());
        line(&mut out, "focal", &text);
    }
    let angle = |(value, sigma): (f64, f64)| {
        let (value_deg, sigma_deg) = (value.to_degrees(), sigma.to_degrees());
        format!("{value_deg:.*}° ± {}", decimals(sigma_deg), degrees(sigma))
    };
    if let Some(tilt) = with(answer.tilt_rad, answer.tilt_sigma_rad) {
        line(&mut out, "tilt", &format!("{} below the horizon", angle(tilt)));
    }
    if let Some(roll) = with(answer.roll_rad, answer.roll_sigma_rad) {
        line(&mut out, "roll", &format!("{} clockwise, seen from behind the camera", angle(roll)));
    }
    if let Some(heading) = with(answer.heading_rad, answer.heading_sigma_rad) {
        line(&mut out, "heading", &format!("{} from along towards across", angle(heading)));
    }
    if let Some((height_m, sigma_m)) = with(answer.height_m, answer.height_sigma_m) {
        line(&mut out, "height", &format!("{} over the ground", with_sigma(height_m, sigma_m)));
    }
    for remark in &answer.remarks {
        line(&mut out, "remark", remark);
    }
    line(&mut out, "verdict", &answer.message);
    out
}
