//! Dots and the renderer through lenses that bend lines: the same accuracy as through a pinhole.

use crate::dots_support::*;
use resight::detect::dots::DotDetector;
use resight::render::{Finish, Pcg, Scene, Style};
use resight_core::camera::{BrownConrady, CameraMatrix, ImageSize, KannalaBrandt};
use resight_core::{Camera, Lens};

fn lenses() -> Vec<(&'static str, Camera)> {
    let matrix = CameraMatrix { fx_px: 420.0, fy_px: 422.0, cx_px: 401.0, cy_px: 297.0 };
    let size = Some(ImageSize { width_px: 800, height_px: 600 });
    let brown = BrownConrady::new(matrix, &[-0.28, 0.09, 0.001, -0.0007, -0.012]).unwrap();
    let fisheye = KannalaBrandt::new(matrix, &[-0.02, 0.006, -0.002, 0.0003]).unwrap();
    vec![
        ("Brown–Conrady", Camera { lens: Lens::BrownConrady(brown), size }),
        ("fisheye", Camera { lens: Lens::KannalaBrandt(fisheye), size }),
    ]
}

/// Off the axis, where lines bow by pixels, with dots of 30 px: place and perspective's shift follow the lens.
#[test]
fn lenses_that_bend_lines_are_followed() {
    let style = Style { dot_diameter_m: Some(0.03), ..Style::default() };
    for (name, camera) in lenses() {
        let mut pcg = Pcg::new(12);
        let mut worst: f64 = 0.0;
        for i in 0..8u64 {
            let target = if i % 2 == 0 { UNEQUAL } else { EQUAL };
            let mut at = pose(&target, 0.45, 0.5, 0.0, &mut pcg);
            at.translation.x += if i < 4 { 0.15 } else { -0.15 };
            let placed = placed(&target, at, style);
            let scene = Scene::of(placed.target.clone(), at, style);
            let image =
                picture(&scene, &camera, &Finish { seed: i, samples_per_axis: 8, ..Finish::default() });
            let found = DotDetector::new(&target).unwrap().detect_with_camera(&image, &camera).unwrap();
            let off = errors(&found, &placed, &camera).unwrap_or_else(|| panic!("{name} {i}: not found"));
            worst = worst.max(worst_px(&off));
        }
        println!("{name}: worst of 32 dots {worst:.3} px");
        assert!(worst < 0.1, "{name}: {worst} px");
    }
}
