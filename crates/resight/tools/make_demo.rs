//! Draws the images of `resight demo` and writes down where the cameras truly were: `testdata/demo`.
//!
//! `cargo run --release -p resight --example make_demo` from the repository's root; the same bytes every time.
//!
//! Two cameras with ordinary lenses look at a wall with a card of four dots (three on a line, one off it) and a grid of
//! tags. A third image shows the card from the one plane where two poses explain it:
//! through the fourth dot, perpendicular to the line.

use nalgebra::Matrix3;
use resight::core::camera::{BrownConrady, ImageSize};
use resight::core::target::{AprilGrid, LinePlusOne};
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose, Target};
use resight::render::{Finish, Placed, Scene, Style, render};
use std::fmt::Write as _;
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const SIZE: ImageSize = ImageSize { width_px: 800, height_px: 600 };

/// Fx, fy, cx, cy and k1, k2, p1, p2, k3 of a camera, as its file says.
struct Intrinsics {
    matrix: [f64; 4],
    distortion: [f64; 5],
}

const LEFT: Intrinsics =
    Intrinsics { matrix: [742.0, 744.0, 404.5, 297.0], distortion: [-0.28, 0.11, 0.0006, -0.0004, -0.02] };
const RIGHT: Intrinsics =
    Intrinsics { matrix: [757.0, 756.0, 396.0, 303.5], distortion: [-0.26, 0.09, -0.0003, 0.0005, -0.01] };

fn main() -> Result<()> {
    let folder = Path::new("testdata/demo");
    std::fs::create_dir_all(folder)?;
    let (left, right) = (camera(&LEFT)?, camera(&RIGHT)?);
    let left_from_wall = looking(Point::new(-0.26, -0.20, -0.62), Point::new(-0.045, -0.005, 0.0), 0.04);
    let right_from_wall = looking(Point::new(0.33, 0.12, -0.64), Point::new(-0.06, 0.0, 0.0), -0.03);
    let critical_from_wall = looking(Point::new(0.06, -0.34, -0.80), Point::new(0.10, 0.01, 0.0), 0.02);
    let wall = |cam_from_wall: Pose| vec![dots(cam_from_wall), grid(cam_from_wall)];
    draw(folder, "left.png", wall(left_from_wall), &left, 11)?;
    draw(folder, "right.png", wall(right_from_wall), &right, 12)?;
    draw(folder, "critical.png", vec![dots(critical_from_wall)], &left, 13)?;
    write_cameras(folder)?;
    let poses = [
        ("left_from_dots", dots(left_from_wall).cam_from_target),
        ("right_from_dots", dots(right_from_wall).cam_from_target),
        ("left_from_grid", grid(left_from_wall).cam_from_target),
        ("right_from_grid", grid(right_from_wall).cam_from_target),
        ("critical_from_dots", dots(critical_from_wall).cam_from_target),
        ("left_from_right", left_from_wall * right_from_wall.inverse()),
    ];
    Ok(std::fs::write(folder.join("truth.toml"), truth(&poses)?)?)
}

fn camera(intrinsics: &Intrinsics) -> Result<Camera> {
    let [fx_px, fy_px, cx_px, cy_px] = intrinsics.matrix;
    let model = BrownConrady::new(CameraMatrix { fx_px, fy_px, cx_px, cy_px }, &intrinsics.distortion)?;
    Ok(Camera { lens: Lens::BrownConrady(model), size: Some(SIZE) })
}

/// The paper's layout: the fourth dot over the first of the line.
fn dots(cam_from_wall: Pose) -> Placed {
    let target = Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.10, 0.15], off_m: [0.0, 0.15] });
    let wall_from_dots = Pose::new(Matrix3::identity(), Point::new(0.06, -0.075, 0.0));
    let style = Style { dot_diameter_m: Some(0.022), margin_m: Some(0.03), ..Style::default() };
    Placed { target, cam_from_target: cam_from_wall * wall_from_dots, style }
}

/// Kalibr's grid has y up and z towards the viewer: half a turn about x from the wall's axes.
fn grid(cam_from_wall: Pose) -> Placed {
    let family = "tag36h11".to_string();
    let target = Target::AprilGrid(AprilGrid {
        family,
        rows: 4,
        columns: 4,
        tag_size_m: 0.045,
        tag_spacing_ratio: 0.3,
        first_id: 0,
    });
    let half_rotation = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
    let wall_from_grid = Pose::new(half_rotation, Point::new(-0.27, 0.11, 0.0));
    Placed { target, cam_from_target: cam_from_wall * wall_from_grid, style: Style::default() }
}

/// A camera at `place` whose optical axis meets `aim` (wall frame: x right, y down, z into the wall), rotated by `roll_rad`.
fn looking(place: Point, aim: Point, roll_rad: f64) -> Pose {
    let z = (aim - place).normalize();
    let x = Point::y().cross(&z).normalize();
    let level = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    let (sin, cos) = roll_rad.sin_cos();
    let rotation = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0) * level;
    Pose::new(rotation, -(rotation * place))
}

fn draw(folder: &Path, name: &str, placed: Vec<Placed>, camera: &Camera, seed: u64) -> Result<()> {
    let scene = Scene { placed, background: 142.0, clutter: Vec::new() };
    let finish = Finish { seed, noise_sigma: 1.5, illumination_gradient: [0.25, -0.12], ..Finish::default() };
    let image = render(&scene, camera, &finish)?;
    let picture =
        image::GrayImage::from_raw(image.width_px, image.height_px, image.data).ok_or("image buffer")?;
    let file = std::io::BufWriter::new(std::fs::File::create(folder.join(name))?);
    let encoder = image::codecs::png::PngEncoder::new_with_quality(
        file,
        image::codecs::png::CompressionType::Best,
        image::codecs::png::FilterType::Adaptive,
    );
    Ok(picture.write_with_encoder(encoder)?)
}

fn write_cameras(folder: &Path) -> Result<()> {
    for (name, camera) in [("left", &LEFT), ("right", &RIGHT)] {
        std::fs::write(folder.join(format!("{name}.toml")), camera_toml(camera, &camera.distortion))?;
    }
    let forgotten = camera_toml(&LEFT, &[0.0; 5]);
    Ok(std::fs::write(folder.join("left-distortion-forgotten.toml"), forgotten)?)
}

fn camera_toml(camera: &Intrinsics, distortion: &[f64; 5]) -> String {
    let [fx, fy, cx, cy] = camera.matrix;
    format!(
        "model = \"brown_conrady\"\nwidth_px = {}\nheight_px = {}\nfx_px = {fx:?}\nfy_px = {fy:?}\ncx_px = {cx:?}\ncy_px = {cy:?}\ndistortion = {distortion:?}\n",
        SIZE.width_px, SIZE.height_px
    )
}

fn truth(poses: &[(&str, Pose)]) -> Result<String> {
    let mut text =
        "# Where the cameras were when the images were drawn: x_in_b = b_from_a * x_in_a.\n".to_string();
    for (name, pose) in poses {
        let [x, y, z]: [f64; 3] = pose.translation.into();
        writeln!(
            text,
            "\n[{name}]\nrotation_wxyz = {:?}\ntranslation_m = {:?}",
            pose.quaternion_wxyz(),
            [x, y, z]
        )?;
    }
    Ok(text)
}
