//! Common cameras and phones with the focal length of their main camera, for photographs without EXIF, which messengers remove, and for those whose
//! EXIF names the model and not its lens as of 35 mm film.

use schemars::JsonSchema;
use serde::Serialize;

/// A camera of the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CommonCamera {
    /// What it is called.
    pub name: &'static str,
    /// Focal length that sees the same diagonal on film of 36 × 24 mm, as its maker states it, millimetres.
    pub focal_35mm: u16,
    /// Models as EXIF names them; one that ends with `*` may go on.
    #[serde(skip)]
    models: &'static [&'static str],
}

const fn camera(name: &'static str, focal_35mm: u16, models: &'static [&'static str]) -> CommonCamera {
    CommonCamera { name, focal_35mm, models }
}

/// Returns the camera of the list that has a model as EXIF names it.
pub fn of_model(model: &str) -> Option<&'static CommonCamera> {
    let model = model.trim().to_ascii_lowercase();
    let is_named = |known: &&str| {
        let known = known.to_ascii_lowercase();
        match known.strip_suffix('*') {
            Some(begin) => model.starts_with(begin),
            None => model == known,
        }
    };
    let all: &'static [CommonCamera] = &COMMON_CAMERAS;
    all.iter().find(|camera| camera.models.iter().any(is_named))
}

/// The list, for whole photographs of the main camera, neither zoomed nor cropped.
pub const COMMON_CAMERAS: [CommonCamera; 17] = [
    camera(
        "Apple iPhone 7, 8, X, SE",
        28,
        &[
            "iPhone 7",
            "iPhone 7 Plus",
            "iPhone 8",
            "iPhone 8 Plus",
            "iPhone X",
            "iPhone SE (2nd generation)",
            "iPhone SE (3rd generation)",
        ],
    ),
    camera(
        "Apple iPhone XR, XS, 11, 12, 13, 14, 15",
        26,
        &[
            "iPhone XR",
            "iPhone XS",
            "iPhone XS Max",
            "iPhone 11*",
            "iPhone 12*",
            "iPhone 13*",
            "iPhone 14",
            "iPhone 14 Plus",
            "iPhone 15",
            "iPhone 15 Plus",
        ],
    ),
    camera(
        "Apple iPhone 14 Pro, 15 Pro, 16 Pro",
        24,
        &["iPhone 14 Pro*", "iPhone 15 Pro*", "iPhone 16 Pro*"],
    ),
    camera("Google Pixel 3, 4, 5", 27, &["Pixel 3", "Pixel 3 XL", "Pixel 4", "Pixel 4 XL", "Pixel 5"]),
    camera(
        "Google Pixel 6, 7, 8",
        25,
        &["Pixel 6", "Pixel 6 Pro", "Pixel 7", "Pixel 7 Pro", "Pixel 8", "Pixel 8 Pro"],
    ),
    camera(
        "Samsung Galaxy S8, S9, S10, S20, S21",
        26,
        &[
            "SM-G950*", "SM-G955*", "SM-G960*", "SM-G965*", "SM-G970*", "SM-G973*", "SM-G975*", "SM-G980*",
            "SM-G981*", "SM-G985*", "SM-G986*", "SM-G991*", "SM-G996*",
        ],
    ),
    camera(
        "Samsung Galaxy S22, S23, S24",
        24,
        &["SM-S901*", "SM-S906*", "SM-S911*", "SM-S916*", "SM-S921*", "SM-S926*"],
    ),
    camera(
        "Samsung Galaxy A5x",
        25,
        &["SM-A515*", "SM-A516*", "SM-A525*", "SM-A526*", "SM-A528*", "SM-A536*", "SM-A546*", "SM-A556*"],
    ),
    camera("Xiaomi Redmi Note", 25, &["Redmi Note*"]),
    camera(
        "DJI Mini, Air, Mavic 3, Phantom 4 Pro",
        24,
        &["FC7203", "FC7303", "FC3582", "FC3170", "L2D-20c", "FC6310*"],
    ),
    camera("DJI Phantom 4", 20, &["FC330"]),
    camera("Logitech C920, C922, C925e", 27, &[]),
    camera("Logitech C270", 37, &[]),
    camera("Raspberry Pi Camera Module 2", 29, &["imx219", "RP_imx219"]),
    camera("Raspberry Pi Camera Module 3", 28, &["imx708", "imx708_noir"]),
    camera("Raspberry Pi Camera Module 3 Wide", 15, &["imx708_wide", "imx708_wide_noir"]),
    camera("A phone of recent years, model unknown", 26, &[]),
];

#[cfg(test)]
mod tests {
    use super::{COMMON_CAMERAS, of_model};

    #[test]
    fn of_model_takes_the_names_of_exif_and_no_others() {
        for (model, focal_35mm) in [
            ("iPhone 14", Some(26)),
            ("iPhone 14 Pro Max", Some(24)),
            ("iPhone 13 mini", Some(26)),
            ("iphone 8 plus ", Some(28)),
            ("SM-S901B", Some(24)),
            ("SM-G988B", None),
            ("Pixel 6a", None),
            ("Redmi Note 9 Pro", Some(25)),
            ("RP_imx219", Some(29)),
            ("FC330", Some(20)),
            ("Canon EOS 5D Mark II", None),
            ("", None),
        ] {
            assert_eq!(of_model(model).map(|camera| camera.focal_35mm), focal_35mm, "{model}");
        }
    }

    /// A model that two cameras have would be of the first.
    #[test]
    fn models_belong_to_one_camera() {
        for camera in &COMMON_CAMERAS {
            for model in camera.models {
                let model = model.trim_end_matches('*');
                assert_eq!(of_model(model).map(|found| found.name), Some(camera.name), "{model}");
            }
        }
    }
}
