//! A board that is seen in a mirror: found, but no pose to rely on.

use resight::locate::{LocateOptions, locate_image};
use resight::render::{Finish, Scene, Style, render};
use resight::{GrayImage, Status};
use resight_core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight_core::target::{Charuco, Printed, PrintedScale};
use resight_core::{Camera, Lens, Point, Pose, Target};

fn flipped(image: &GrayImage) -> GrayImage {
    let rows = image.data.chunks(image.width_px as usize);
    GrayImage { data: rows.flat_map(|row| row.iter().rev().copied()).collect(), ..image.clone() }
}

/// The mirror image of a view fits its pixels exactly as well, behind the sheet: the detector reads boards from behind, because boards may be
/// printed on both sides. Whether a scale of the print was measured makes no difference.
#[test]
fn a_mirrored_image_is_not_ok() {
    let matrix = CameraMatrix { fx_px: 700.0, fy_px: 700.0, cx_px: 319.5, cy_px: 239.5 };
    let size = ImageSize { width_px: 640, height_px: 480 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: Some(size) };
    let board = Target::Charuco(Charuco {
        rows: 6,
        columns: 5,
        square_m: 0.03,
        marker_m: 0.022,
        dictionary: "DICT_5X5_100".into(),
        legacy_pattern: false,
    });
    let scale = PrintedScale { ratio: [1.0; 2], sigma: [1e-3; 2] };
    let printed = Target::Printed(Printed { design: Box::new(board.clone()), scale });
    let tilted = Pose::exp(&[0.4, 0.3, 0.1, 0.0, 0.0, 0.0].into()).rotation;
    let cam_from_target =
        Pose::new(tilted, Point::new(0.0, 0.0, 0.5) - tilted * Point::new(0.075, 0.09, 0.0));
    let scene = Scene::of(board.clone(), cam_from_target, Style::default());
    let image = render(&scene, &camera, &Finish::default()).unwrap();
    for target in [&board, &printed] {
        let answer = |image| locate_image(image, &camera, target, &LocateOptions::default()).unwrap();
        assert_eq!(answer(&image).status(), Status::Ok, "{}", answer(&image).verdict.message);
        let mirrored = answer(&flipped(&image));
        assert_eq!(mirrored.status(), Status::Inconsistent);
        assert!(mirrored.verdict.message.contains("seen mirrored"), "{}", mirrored.verdict.message);
    }
}
