//! Which dots are the target: clutter, several targets, hidden dots, hostile images. Not found is allowed where said,
//! wrong never is.

use crate::dots_support::*;
use resight::GrayImage;
use resight::detect::dots::{DotDetector, DotError, Polarity};
use resight::render::{Blob, Finish, Pcg, Scene, Style, clutter, true_pixels};
use resight_core::Pixel;
use resight_core::target::LinePlusOne;

const SIZE: [u32; 2] = [960, 720];

/// How many dots and words are strewn, and their grey.
#[derive(Clone, Copy)]
struct Clutter {
    dots: usize,
    words: usize,
    grey: f64,
}

fn strewn(c: Clutter, seed: u64) -> Vec<Blob> {
    let mut blobs = clutter::dots(c.dots, SIZE, [2.0, 12.0], c.grey, seed);
    blobs.extend(clutter::words(c.words, SIZE, 14.0, c.grey, seed));
    blobs
}

/// (found, tried); panics on any wrong answer. `hide` covers one dot.
fn among_clutter(
    style: Style,
    background: f64,
    clutter: Clutter,
    with_camera: bool,
    hide: bool,
) -> (usize, usize) {
    let camera = camera(SIZE[0], SIZE[1], 800.0);
    let mut pcg = Pcg::new(77);
    let (mut found, mut tried) = (0, 0);
    for i in 0..16 {
        let target = if i % 2 == 0 { UNEQUAL } else { EQUAL };
        let tilt = pcg.between(0.0, 1.0);
        let distance = pcg.between(0.5, 1.5);
        let placed = placed(&target, pose(&target, distance, tilt, 0.15, &mut pcg), style);
        let scene = Scene { placed: vec![placed.clone()], background, clutter: strewn(clutter, i) };
        let mut image = picture(&scene, &camera, &Finish { seed: i, ..Finish::default() });
        let truth = true_pixels(&placed, &camera);
        if truth.len() < 4 {
            continue;
        }
        if hide {
            cover(&mut image, &truth[i as usize % 4].1, background as u8);
        }
        let mut detector = DotDetector::new(&target).unwrap();
        let camera_given = with_camera.then_some(&camera);
        let all = detector.detect_all(&image, camera_given).unwrap();
        tried += 1;
        for t in &all {
            assert!(!hide, "image {i}: a target with a hidden dot was found: {t:?}");
            let worst = worst_px(&errors(&t.detections, &placed, &camera).unwrap());
            assert!(worst < 1.0, "image {i}: wrong by {worst} px, {t:?}");
        }
        found += usize::from(!all.is_empty());
    }
    (found, tried)
}

/// A square patch of background over a dot, larger than the dot.
fn cover(image: &mut GrayImage, at: &Pixel, grey: u8) {
    for v in (at.y - 30.0).max(0.0) as u32..((at.y + 30.0) as u32).min(image.height_px) {
        for u in (at.x - 30.0).max(0.0) as u32..((at.x + 30.0) as u32).min(image.width_px) {
            image.data[(v * image.width_px + u) as usize] = grey;
        }
    }
}

const PRINTED: Style = Style {
    ink: 20.0,
    paper: Some(235.0),
    margin_m: None,
    dot_diameter_m: Some(0.025),
    tag_border_bits: None,
};

const INK: Clutter = Clutter { dots: 60, words: 12, grey: 25.0 };
const LIGHTS: Clutter = Clutter { dots: 60, words: 12, grey: 210.0 };

#[test]
fn printed_dots_are_found_among_clutter_and_never_wrong() {
    for with_camera in [true, false] {
        let (found, tried) = among_clutter(PRINTED, 140.0, INK, with_camera, false);
        println!("printed among 60 dots and 12 words, camera {with_camera}: {found}/{tried}");
        assert!(9 * tried <= 10 * found, "{found} of {tried}");
    }
}

/// Lamps have no sheet, so clutter may touch one, and lamps of a few pixels show no shape. Among a dozen other lights
/// most are found with the camera; of a hundred and fifty lights hardly any four can be distinguished from chance.
#[test]
fn lamps_among_like_lights_are_found_with_a_camera_and_never_wrong() {
    let few = Clutter { dots: 12, words: 0, grey: 210.0 };
    for (clutter, with_camera, needed) in
        [(few, true, 0.8), (few, false, 0.0), (LIGHTS, true, 0.1), (LIGHTS, false, 0.0)]
    {
        for diameter_m in [0.005, 0.012] {
            let (found, tried) = among_clutter(Style::lamps(diameter_m), 20.0, clutter, with_camera, false);
            println!("lamps {diameter_m} m, {} lights, camera {with_camera}: {found}/{tried}", clutter.dots);
            assert!(needed * tried as f64 <= found as f64, "{found} of {tried}");
        }
    }
}

#[test]
fn a_hidden_dot_means_not_found() {
    for with_camera in [true, false] {
        among_clutter(PRINTED, 140.0, INK, with_camera, true);
        among_clutter(Style::lamps(0.01), 20.0, LIGHTS, with_camera, true);
    }
}

/// Each detector returns its own target; duplicates are all returned by `detect_all`.
#[test]
fn several_targets_in_one_picture_are_reported_apart() {
    let camera = camera(1280, 960, 900.0);
    let other = LinePlusOne { line_m: [0.0, 0.04, 0.15], off_m: [0.10, -0.10] };
    let style = Style { dot_diameter_m: Some(0.02), ..PRINTED };
    let mut pcg = Pcg::new(31);
    for i in 0..6 {
        let shifted = |target: &LinePlusOne, x: f64, y: f64, pcg: &mut Pcg| {
            let mut at = pose(target, 1.1, 0.5, 0.0, pcg);
            at.translation += resight_core::Point::new(x, y, 0.0);
            placed(target, at, style)
        };
        let first = shifted(&UNEQUAL, -0.4, -0.2, &mut pcg);
        let second = shifted(&other, 0.35, -0.2, &mut pcg);
        let duplicate = shifted(&other, 0.0, 0.3, &mut pcg);
        let scene = Scene {
            placed: vec![first.clone(), second.clone(), duplicate.clone()],
            background: 150.0,
            clutter: Vec::new(),
        };
        let image = picture(&scene, &camera, &Finish { seed: i, ..Finish::default() });
        for with in [Some(&camera), None] {
            let own = DotDetector::new(&UNEQUAL).unwrap().detect_all(&image, with).unwrap();
            assert_eq!(own.len(), 1, "image {i}");
            assert!(worst_px(&errors(&own[0].detections, &first, &camera).unwrap()) < 0.2);
            let duplicates = DotDetector::new(&other).unwrap().detect_all(&image, with).unwrap();
            assert_eq!(duplicates.len(), 2, "image {i}");
            for truth in [&second, &duplicate] {
                let best = duplicates
                    .iter()
                    .filter_map(|t| errors(&t.detections, truth, &camera))
                    .map(|e| worst_px(&e));
                assert!(best.fold(f64::INFINITY, f64::min) < 0.2, "image {i}");
            }
        }
    }
}

/// Seen in a mirror, or from behind through glass, the handedness is wrong: not this target.
#[test]
fn a_mirrored_target_is_not_found() {
    let camera = camera(640, 480, 600.0);
    for target in [UNEQUAL, EQUAL] {
        let placed = placed(&target, pose(&target, 0.6, 0.3, 0.05, &mut Pcg::new(3)), PRINTED);
        let scene = Scene::of(placed.target.clone(), placed.cam_from_target, PRINTED);
        let mut image = picture(&scene, &camera, &Finish::default());
        let mut detector = DotDetector::new(&target).unwrap();
        assert_eq!(detector.detect(&image).unwrap().len(), 4);
        image.data.chunks_mut(640).for_each(|row| row.reverse());
        assert_eq!(detector.detect(&image).unwrap().len(), 0);
    }
}

#[test]
fn empty_images_have_no_target() {
    let mut detector = DotDetector::new(&UNEQUAL).unwrap();
    for (w, h) in [(0, 0), (1, 1), (1, 500), (500, 1), (7, 9), (640, 480)] {
        for grey in [0, 255] {
            let image = GrayImage::filled(w, h, grey);
            assert_eq!(detector.detect(&image).unwrap().len(), 0);
            let sized = camera(w, h, 500.0);
            assert_eq!(detector.detect_with_camera(&image, &sized).unwrap().len(), 0);
        }
    }
}

/// A dot cut by the edge of the image has no centre to measure.
#[test]
fn a_dot_at_the_border_means_not_found() {
    let camera = camera(640, 480, 600.0);
    let mut at = pose(&UNEQUAL, 0.5, 0.0, 0.0, &mut Pcg::new(3));
    let dot = at * resight_core::Point::zeros();
    at.translation.x -= dot.x + 0.5 * (319.5 / 600.0);
    let placed = placed(&UNEQUAL, at, PRINTED);
    let scene = Scene::of(placed.target.clone(), placed.cam_from_target, PRINTED);
    let image = picture(&scene, &camera, &Finish::default());
    // Crop so that the first dot's centre lies on the new left edge.
    let u = true_pixels(&placed, &camera)[0].1.x.round() as usize;
    let data = image.data.chunks(640).flat_map(|row| row[u..].to_vec()).collect();
    let cropped = GrayImage { width_px: 640 - u as u32, height_px: 480, data };
    assert_eq!(DotDetector::new(&UNEQUAL).unwrap().detect(&cropped).unwrap().len(), 0);
}

/// Pure noise, and a hundred thousand specks: nothing found, in bounded time.
#[test]
fn specks_and_noise_neither_hang_nor_match() {
    let mut pcg = Pcg::new(5);
    let mut noise = GrayImage::filled(1280, 960, 0);
    noise.data.iter_mut().for_each(|p| *p = pcg.next_u32() as u8);
    let mut specks = GrayImage::filled(1280, 960, 30);
    for _ in 0..100_000 {
        let (u, v) = (pcg.between(1.0, 1278.0) as usize, pcg.between(1.0, 958.0) as usize);
        for (du, dv) in [(0, 0), (1, 0), (0, 1)] {
            specks.data[(v + dv) * 1280 + u + du] = 220;
        }
    }
    let camera = camera(1280, 960, 1000.0);
    let start = std::time::Instant::now();
    for image in [noise, specks] {
        let mut detector = DotDetector::new(&UNEQUAL).unwrap();
        assert_eq!(detector.detect(&image).unwrap().len(), 0);
        assert_eq!(detector.detect_with_camera(&image, &camera).unwrap().len(), 0);
    }
    // Measured 0.04 s each; the bound only tells linear from quadratic.
    assert!(start.elapsed().as_secs_f64() < 10.0);
}

#[test]
fn what_cannot_be_searched_is_refused() {
    let mut detector = DotDetector::new(&UNEQUAL).unwrap();
    let mut image = GrayImage::filled(64, 48, 0);
    let wrong = detector.detect_with_camera(&image, &camera(640, 480, 500.0));
    assert!(matches!(wrong, Err(DotError::CameraSize { camera_width_px: 640, .. })));
    image.data.pop();
    assert!(matches!(detector.detect(&image), Err(DotError::BufferSize { seen: 3071, .. })));
    assert!(DotDetector::new(&LinePlusOne { line_m: [0.0, 0.1, 0.2], off_m: [0.0, 0.0] }).is_err());
    let config = resight::detect::dots::DotConfig { diameter_m: Some(-1.0), ..Default::default() };
    assert!(DotDetector::with_config(&UNEQUAL, config).is_err());
}

/// Asking for the other polarity finds nothing; asking for the right one, or either, does.
#[test]
fn polarity_is_respected() {
    let camera = camera(640, 480, 600.0);
    let placed = placed(&UNEQUAL, pose(&UNEQUAL, 0.6, 0.3, 0.05, &mut Pcg::new(3)), PRINTED);
    let scene = Scene::of(placed.target.clone(), placed.cam_from_target, PRINTED);
    let image = picture(&scene, &camera, &Finish::default());
    for (polarity, n) in [(Polarity::Either, 4), (Polarity::DarkOnLight, 4), (Polarity::LightOnDark, 0)] {
        let config = resight::detect::dots::DotConfig { polarity, ..Default::default() };
        let found = DotDetector::with_config(&UNEQUAL, config).unwrap().detect(&image).unwrap();
        assert_eq!(found.len(), n, "{polarity:?}");
    }
}
