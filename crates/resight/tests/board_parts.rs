//! Boards that are partly hidden, cut off or strongly tilted: what is visible is found, and no id is ever wrong.

use crate::detect_support::*;
use resight::GrayImage;
use resight::core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight::core::correspondence::Detection;
use resight::core::target::*;
use resight::core::{Camera, Lens};
use resight::core::{Pixel, Target};
use resight::detect::Detector;
use resight::detect::absent::instead_of;
use resight::render::{Finish, Pcg, Scene, clutter, render};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

fn chessboard(rows: u32, columns: u32) -> Target {
    Target::Chessboard(Chessboard { rows, columns, square_m: 1.0 })
}

/// A chessboard of `rows` × `columns` inner corners, its middle at `centre`.
fn view(rows: u32, columns: u32, centre: Pixel, square_px: f64, roll_deg: f64, tilt_deg: f64) -> View {
    let mut view = View::new(centre, square_px, roll_deg, tilt_deg);
    let (x, y) = (-0.5 * (columns + 1) as f64, -0.5 * (rows + 1) as f64);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, x, 0.0, 1.0, y, 0.0, 0.0, 1.0);
    view
}

fn picture(rows: u32, columns: u32, view: &View) -> GrayImage {
    let ink = board_ink(rows as i32 + 1, columns as i32 + 1, |column, row| (column + row) % 2 == 0);
    photograph(WIDTH, HEIGHT, view, ink)
}

/// Grey over the pixels that `hides` says so of.
fn covered(mut image: GrayImage, hides: impl Fn(f64, f64) -> bool) -> GrayImage {
    let width = image.width_px;
    let at = |k: usize| (k as u32 % width, k as u32 / width);
    image.data.iter_mut().enumerate().for_each(|(k, value)| {
        let (u, v) = at(k);
        if hides(u as f64, v as f64) {
            *value = 95 + ((7 * u + 13 * v) % 5) as u8;
        }
    });
    image
}

fn found(target: &Target, image: &GrayImage) -> Vec<Detection> {
    Detector::new(target).unwrap().detect(image).unwrap()
}

/// How far the worst corner is from where its id says, pixels.
fn worst_px(found: &[Detection], columns: u32, view: &View) -> f64 {
    let place = |id: u32| view.at((id % columns + 1) as f64, (id / columns + 1) as f64);
    found.iter().map(|d| (d.pixel - place(d.feature.id)).norm()).fold(0.0, f64::max)
}

/// Three boards, one of them symmetric, under a straight edge and in any place of the image. A corner next to the cover may be off by its
/// blurred edge, a wrong id is off by a square.
#[test]
fn ids_of_a_partly_visible_board_are_never_wrong() {
    let (mut placed, mut silent, mut n) = (0, 0, 0);
    let scenes: usize = std::env::var("RESIGHT_SCENES").ok().and_then(|x| x.parse().ok()).unwrap_or(24);
    let mut pcg = Pcg::new(11);
    for scene in 0..scenes {
        let (rows, columns) = [(6, 9), (5, 7), (4, 11)][scene % 3];
        let centre = Pixel::new(pcg.between(120.0, 520.0), pcg.between(90.0, 390.0));
        // A symmetric board is numbered upright, so it must be nearly upright.
        let view = view(rows, columns, centre, 34.0, pcg.between(-35.0, 35.0), pcg.between(0.0, 40.0));
        let (angle, offset) = (pcg.between(0.0, std::f64::consts::TAU), pcg.between(0.0, 120.0));
        let hides = |u: f64, v: f64| offset < (u - centre.x) * angle.cos() + (v - centre.y) * angle.sin();
        let found = found(&chessboard(rows, columns), &covered(picture(rows, columns, &view), hides));
        assert!(
            worst_px(&found, columns, &view) < 3.0,
            "scene {scene}: {}",
            worst_px(&found, columns, &view)
        );
        let is_visible = |id: u32| {
            let at = view.at((id % columns + 1) as f64, (id / columns + 1) as f64);
            let inside =
                10.0 < at.x && 10.0 < at.y && at.x < WIDTH as f64 - 10.0 && at.y < HEIGHT as f64 - 10.0;
            inside && !hides(at.x + 12.0 * angle.cos(), at.y + 12.0 * angle.sin())
        };
        if found.is_empty() {
            silent += 1;
            continue;
        }
        placed += 1;
        n += (0..rows * columns)
            .filter(|&id| is_visible(id) && found.iter().all(|d| d.feature.id != id))
            .count();
    }
    println!("{placed} boards placed, {n} of their visible corners missed, {silent} boards silent");
    assert!(scenes <= 2 * placed && n <= placed, "{placed} placed, {silent} silent, {n} missed");
}

/// The left half of the board, with one outer edge in view: the rows are all there, the columns could be any.
#[test]
fn a_part_that_could_lie_anywhere_gets_no_ids_and_a_reason() {
    let target = chessboard(6, 9);
    let view = view(6, 9, Pixel::new(320.0, 240.0), 40.0, 0.0, 0.0);
    let image = picture(6, 9, &view);
    let (left, right) = (view.at(3.4, 0.0).x, view.at(8.6, 0.0).x);
    let middle = covered(image.clone(), |u, _| u < left || right < u);
    assert!(found(&target, &middle).is_empty());
    let reason = instead_of(&target, &middle).expect("a reason");
    println!("{reason}");
    assert!(reason.contains("inner corners") && reason.contains("6 × 9 board"), "{reason}");
    // With its left edge in view the same part has one place.
    let with_edge = covered(image, |u, _| right < u);
    let seen = found(&target, &with_edge);
    assert!(42 <= seen.len() && worst_px(&seen, 9, &view) < 1.0, "{}", seen.len());
    assert!(instead_of(&target, &GrayImage::filled(WIDTH, HEIGHT, 120)).is_none());
}

/// The outer squares of many boards are cut, and their white margin is narrow: a line more is no part of them that something hides, and a line less is
/// another board.
#[test]
fn cut_outer_squares_end_a_board() {
    let view = view(6, 9, Pixel::new(320.0, 240.0), 40.0, 12.0, 30.0);
    for width in [0.5, 0.9] {
        let ink = |x: f64, y: f64| {
            let is_paper = (-0.2..10.2).contains(&x) && (0.8 - width..7.2).contains(&y);
            let is_print = (0.0..10.0).contains(&x) && (1.0 - width..7.0).contains(&y);
            let is_black = (x.floor() as i32 + y.floor() as i32).rem_euclid(2) == 0;
            is_paper.then_some(if is_print && is_black { 20.0 } else { 230.0 })
        };
        let image = photograph(WIDTH, HEIGHT, &view, ink);
        let seen = found(&chessboard(6, 9), &image);
        assert_eq!(seen.len(), 54, "{width}");
        assert!(worst_px(&seen, 9, &view) < 1.0, "{width}: {}", worst_px(&seen, 9, &view));
        for (rows, columns) in [(7, 9), (5, 9), (6, 10), (6, 8)] {
            assert!(found(&chessboard(rows, columns), &image).is_empty(), "{width}: {rows} × {columns}");
        }
    }
}

#[test]
fn a_strongly_tilted_board_is_found_whole() {
    for (roll_deg, tilt_deg) in [(20.0, 70.0), (40.0, 74.0), (110.0, 72.0)] {
        let view = view(6, 9, Pixel::new(320.0, 240.0), 40.0, roll_deg, tilt_deg);
        let found = found(&chessboard(6, 9), &picture(6, 9, &view));
        assert_eq!(found.len(), 54, "{roll_deg}° {tilt_deg}°");
        assert!(worst_px(&found, 9, &view) < 0.5, "{}", worst_px(&found, 9, &view));
    }
}

/// Light gathered along a way of 10 px: no saddle point is left at full size.
#[test]
fn a_smeared_board_is_found_whole() {
    let view = view(6, 9, Pixel::new(320.0, 240.0), 30.0, 10.0, 20.0);
    let sharp = picture(6, 9, &view);
    let mut image = sharp.clone();
    for (k, value) in image.data.iter_mut().enumerate() {
        let (u, v) = ((k as u32 % WIDTH) as i32, (k as u32 / WIDTH) as i32);
        let at = |s: i32| {
            let clamp = |x: i32, n: u32| x.clamp(0, n as i32 - 1) as u32;
            sharp.at(clamp(u + s, WIDTH), clamp(v + s, HEIGHT)) as u32
        };
        *value = ((-4..=4).map(at).sum::<u32>() / 9) as u8;
    }
    let found = found(&chessboard(6, 9), &image);
    assert_eq!(found.len(), 54);
    assert!(worst_px(&found, 9, &view) < 0.5, "{}", worst_px(&found, 9, &view));
}

/// Spots, words and noise, in 100 images, are no chessboard, not even a small one.
#[test]
fn clutter_is_no_chessboard() {
    let size = [WIDTH, HEIGHT];
    let matrix = CameraMatrix { fx_px: 600.0, fy_px: 600.0, cx_px: 319.5, cy_px: 239.5 };
    let size_px = Some(ImageSize { width_px: WIDTH, height_px: HEIGHT });
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: size_px };
    for seed in 0..100 {
        let mut spots = clutter::dots(100, size, [3.0, 25.0], 40.0, seed);
        spots.extend(clutter::words(100, size, 6.0 + (seed % 12) as f64, 30.0, seed + 1000));
        spots.extend(clutter::dots(60, size, [3.0, 25.0], 225.0, seed + 2000));
        let scene = Scene { placed: Vec::new(), background: 120.0, clutter: spots };
        let noise_sigma = [1.0, 6.0, 15.0][seed as usize % 3];
        let image = render(&scene, &camera, &Finish { seed, noise_sigma, ..Finish::default() }).unwrap();
        for (rows, columns) in [(6, 9), (3, 4)] {
            let target = chessboard(rows, columns);
            let found = found(&target, &image);
            assert!(found.is_empty(), "image {seed}: {} corners of {rows} × {columns}", found.len());
        }
    }
}
