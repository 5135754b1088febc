//! Draws the images of CONVENTIONS.md: every target's frame and the order of its points, as the code has them.
//!
//! `cargo run --release -p resight --example make_pictures` from the repository's root. Each target is rendered from a
//! known pose, its points are put where that pose sends them, and the overlay draws its axes and names.

use nalgebra::Vector3;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::correspondence::{Detection, correspond};
use resight::core::locate::{Config, locate};
use resight::core::target::{AprilGrid, Charuco, Chessboard, CircleGrid, LinePlusOne, Tag};
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose, Target, Vector6};
use resight::overlay::{self, Tone};
use resight::render::{Finish, Placed, Scene, Style, render, true_pixels};
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let folder = Path::new("docs/images");
    std::fs::create_dir_all(folder)?;
    for (title, target) in targets() {
        let picture = picture(title, &target)?;
        std::fs::write(folder.join(format!("target-{}.png", target.kind())), picture)?;
    }
    Ok(())
}

/// Caption and target of each image.
fn targets() -> [(&'static str, Target); 6] {
    let family = || "tag36h11".to_string();
    let dictionary = || "DICT_4X4_50".to_string();
    [
        (
            "three dots on a line and one off it",
            Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.10, 0.15], off_m: [0.0, 0.15] }),
        ),
        ("id.corner", Target::Tag(Tag { family: family(), id: 7, size_m: 0.16 })),
        (
            "ids of the tags",
            Target::AprilGrid(AprilGrid {
                family: family(),
                rows: 3,
                columns: 4,
                tag_size_m: 0.05,
                tag_spacing_ratio: 0.3,
                first_id: 0,
            }),
        ),
        ("ids along the rows", Target::Chessboard(Chessboard { rows: 4, columns: 5, square_m: 0.04 })),
        (
            "ids of the inner corners",
            Target::Charuco(Charuco {
                rows: 5,
                columns: 6,
                square_m: 0.04,
                marker_m: 0.03,
                dictionary: dictionary(),
                legacy_pattern: false,
            }),
        ),
        (
            "ids along the rows",
            Target::CircleGrid(CircleGrid {
                rows: 7,
                columns: 4,
                spacing_m: 0.025,
                diameter_m: None,
                asymmetric: true,
            }),
        ),
    ]
}

fn picture(title: &str, target: &Target) -> Result<Vec<u8>> {
    let matrix = CameraMatrix { fx_px: 700.0, fy_px: 700.0, cx_px: 319.5, cy_px: 199.5 };
    let size = Some(ImageSize { width_px: 640, height_px: 400 });
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size };
    let placed = Placed { target: target.clone(), cam_from_target: pose(target), style: Style::default() };
    let pixels = true_pixels(&placed, &camera);
    let detections: Vec<Detection> = pixels
        .into_iter()
        .map(|(feature, pixel)| Detection {
            feature,
            pixel,
            sigma_px: 0.05,
            lens_sigma_px: 0.0,
            covariance_px2: None,
        })
        .collect();
    let (seen, _) = correspond(&detections, target, &camera);
    let points: Vec<_> = seen.iter().map(|(_, point)| *point).collect();
    let estimate = locate(&points, &camera, &Config::default())?;
    let scene = Scene { placed: vec![placed], background: 150.0, clutter: Vec::new() };
    let image = render(&scene, &camera, &Finish { noise_sigma: 0.0, ..Finish::default() })?;
    let drawn = overlay::draw(&overlay::Scene {
        image: &image,
        detections: &detections,
        camera: Some(&camera),
        target,
        estimate: Some(&estimate),
        title,
        verdict: target.kind(),
        tone: Tone::Good,
    });
    Ok(drawn.png()?)
}

/// Upright, seen from the front, turned enough to show all three axes; the middle of its points on the optical axis.
fn pose(target: &Target) -> Pose {
    let points: Vec<Point> =
        target.features().iter().filter_map(|f| target.point(*f)).map(|p| p.position).collect();
    let middle: Vector3<f64> = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let tilt = Pose::exp(&Vector6::new(0.35, 0.45, 0.0, 0.0, 0.0, 0.0));
    // Kalibr's grid has y up and z towards the viewer: half a turn about x makes it upright.
    let half_rotation = match target {
        Target::AprilGrid(_) => Pose::exp(&Vector6::new(std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0, 0.0)),
        _ => Pose::identity(),
    };
    let turned = tilt * half_rotation;
    Pose::new(turned.rotation, Vector3::new(0.0, 0.0, 0.5) - turned.rotation * middle)
}
