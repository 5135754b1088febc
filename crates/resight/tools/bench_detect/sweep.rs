//! The images of the sweep: which targets, which conditions, and where every feature truly is.

use resight::GrayImage;
use resight::core::camera::{BrownConrady, CameraMatrix, ImageSize, KannalaBrandt, Pinhole};
use resight::core::target::{AprilGrid, Charuco, Chessboard, Feature, LinePlusOne, NamedPoint, Tag};
use resight::core::{Camera, Pixel, Point, Pose, Target};
use resight::render::{self, Finish, Pcg, Placed, Scene, Style, clutter, true_pixels};
use std::error::Error;

/// What a cell of the sweep changes of the easy image.
#[derive(Debug, Clone, Copy)]
pub struct Condition {
    pub name: &'static str,
    /// Pixels of a square, of a tag's edge or (a quarter of it) of a dot.
    size_px: f64,
    tilt_deg: f64,
    blur_px: f64,
    motion_px: f64,
    noise: f64,
    contrast: f64,
    occluders: usize,
    /// Diameter of an occluder over the largest distance of two features.
    occluder_size: f64,
    /// The board's middle lies on the image's edge, or this share of the way there.
    off_centre: f64,
    has_clutter: bool,
    lens: LensKind,
    /// Edges of the image over those of 1280 × 960.
    enlarged: f64,
}

#[derive(Debug, Clone, Copy)]
enum LensKind {
    Straight,
    Barrel,
    Fisheye,
}

const EASY: Condition = Condition {
    name: "easy",
    size_px: 48.0,
    tilt_deg: 25.0,
    blur_px: 0.7,
    motion_px: 0.0,
    noise: 2.0,
    contrast: 1.0,
    occluders: 0,
    occluder_size: 0.12,
    off_centre: 0.0,
    has_clutter: false,
    lens: LensKind::Straight,
    enlarged: 1.0,
};

/// The cells, each with one or few changes to the easy one.
pub fn conditions() -> Vec<Condition> {
    let c = EASY;
    vec![
        c,
        Condition { name: "size 16", size_px: 16.0, ..c },
        Condition { name: "size 24", size_px: 24.0, ..c },
        Condition { name: "size 32", size_px: 32.0, ..c },
        Condition { name: "size 80", size_px: 80.0, ..c },
        Condition { name: "tilt 0", tilt_deg: 0.0, ..c },
        Condition { name: "tilt 45", tilt_deg: 45.0, ..c },
        Condition { name: "tilt 60", tilt_deg: 60.0, ..c },
        Condition { name: "tilt 70", tilt_deg: 70.0, ..c },
        Condition { name: "tilt 75", tilt_deg: 75.0, ..c },
        Condition { name: "blur 0", blur_px: 0.0, ..c },
        Condition { name: "blur 2", blur_px: 2.0, ..c },
        Condition { name: "blur 3", blur_px: 3.0, ..c },
        Condition { name: "noise 0", noise: 0.0, ..c },
        Condition { name: "noise 5", noise: 5.0, ..c },
        Condition { name: "noise 10", noise: 10.0, ..c },
        Condition { name: "noise 15", noise: 15.0, ..c },
        Condition { name: "contrast 30 %", contrast: 0.3, ..c },
        Condition { name: "contrast 15 %", contrast: 0.15, ..c },
        Condition { name: "motion 3", motion_px: 3.0, ..c },
        Condition { name: "motion 5", motion_px: 5.0, ..c },
        Condition { name: "motion 10", motion_px: 10.0, ..c },
        Condition { name: "occlusion", occluders: 3, ..c },
        Condition { name: "hidden", occluders: 1, occluder_size: 0.5, ..c },
        Condition { name: "cut off", off_centre: 0.9, ..c },
        Condition { name: "clutter", has_clutter: true, ..c },
        Condition { name: "barrel", lens: LensKind::Barrel, ..c },
        Condition { name: "fisheye", lens: LensKind::Fisheye, ..c },
        Condition {
            name: "hard",
            size_px: 28.0,
            tilt_deg: 45.0,
            blur_px: 1.2,
            noise: 6.0,
            contrast: 0.5,
            has_clutter: true,
            ..c
        },
        Condition { name: "12 megapixels", size_px: 150.0, blur_px: 1.5, enlarged: 3.125, ..c },
    ]
}

/// The targets by name, with the metres of what `size_px` measures.
pub fn targets() -> Vec<(&'static str, Target, f64)> {
    let family = || "tag36h11".to_string();
    let dictionary = "DICT_4X4_50".to_string();
    vec![
        ("tag", Target::Tag(Tag { family: family(), id: 7, size_m: 0.1 }), 0.1),
        (
            "aprilgrid",
            Target::AprilGrid(AprilGrid {
                family: family(),
                rows: 6,
                columns: 6,
                tag_size_m: 0.08,
                tag_spacing_ratio: 0.3,
                first_id: 0,
            }),
            0.08,
        ),
        (
            "charuco",
            Target::Charuco(Charuco {
                rows: 7,
                columns: 10,
                square_m: 0.04,
                marker_m: 0.03,
                dictionary,
                legacy_pattern: false,
            }),
            0.04,
        ),
        ("chessboard", Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.03 }), 0.03),
        ("dots", Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.3, 0.5], off_m: [0.2, 0.25] }), 0.12),
    ]
}

/// An image with its truth.
pub struct Picture {
    pub image: GrayImage,
    pub truth: Vec<(Feature, Pixel)>,
}

const FOCAL_PX: f64 = 1000.0;
/// Features nearer to the image's edge are not counted.
const RIM_PX: f64 = 8.0;

/// Image `index` of a cell; its pose and its noise are drawn from index and cell.
pub fn draw(target: &Target, size_m: f64, c: &Condition, index: u64) -> Result<Picture, Box<dyn Error>> {
    draw_with(target, size_m, c, index, true)
}

/// The same image without its target, what hides it included.
pub fn draw_absent(
    target: &Target,
    size_m: f64,
    c: &Condition,
    index: u64,
) -> Result<GrayImage, Box<dyn Error>> {
    Ok(draw_with(target, size_m, c, index, false)?.image)
}

fn draw_with(
    target: &Target,
    size_m: f64,
    c: &Condition,
    index: u64,
    is_there: bool,
) -> Result<Picture, Box<dyn Error>> {
    let seed = 1000 * index + c.name.bytes().fold(7, |sum, byte| (sum * 31 + byte as u64) % 997);
    let mut pcg = Pcg::new(seed);
    let camera = camera(c)?;
    let size = camera.size.ok_or("a camera without size")?;
    let ink = 127.5 - 107.5 * c.contrast;
    let style = Style { ink, paper: Some(255.0 - ink), ..Style::default() };
    let cam_from_target = pose(target, size_m, c, &mut pcg);
    let placed = Placed { target: target.clone(), cam_from_target, style };
    let occluder = occluders(&placed, c, &mut pcg);
    let (width, height) = (size.width_px as f64, size.height_px as f64);
    let is_counted = |feature: &Feature, p: &Pixel| {
        let inside =
            RIM_PX < p.x && RIM_PX < p.y && p.x < width - 1.0 - RIM_PX && p.y < height - 1.0 - RIM_PX;
        inside && !is_covered(&placed, *feature, &occluder)
    };
    let truth =
        true_pixels(&placed, &camera).into_iter().filter(|(feature, p)| is_counted(feature, p)).collect();
    let placed = if is_there { vec![placed] } else { Vec::new() };
    let mut scene = Scene { placed, background: 120.0, clutter: Vec::new() };
    scene.placed.extend(occluder);
    if c.has_clutter {
        let size = [size.width_px, size.height_px];
        scene.clutter.extend(clutter::dots(150, size, [4.0, 30.0], 60.0, seed));
        scene.clutter.extend(clutter::words(120, size, 14.0, 30.0, seed + 1));
        scene.clutter.extend(clutter::dots(60, size, [3.0, 20.0], 220.0, seed + 2));
    }
    // With 8 an edge along the pixels is drawn up to 0.06 px off, more than corners are off where they are found.
    let finish =
        Finish { blur_sigma_px: c.blur_px, noise_sigma: 0.0, samples_per_axis: 24, ..Finish::default() };
    let mut image = render::render(&scene, &camera, &finish)?;
    let direction = pcg.between(0.0, std::f64::consts::PI);
    smear(&mut image, c.motion_px, direction);
    let mut noise = Pcg::new(seed + 3);
    image
        .data
        .iter_mut()
        .for_each(|x| *x = (*x as f64 + c.noise * noise.normal()).round().clamp(0.0, 255.0) as u8);
    Ok(Picture { image, truth })
}

fn camera(c: &Condition) -> Result<Camera, Box<dyn Error>> {
    let (width, height) = (1280.0 * c.enlarged, 960.0 * c.enlarged);
    let focal = FOCAL_PX * c.enlarged;
    let matrix =
        CameraMatrix { fx_px: focal, fy_px: focal, cx_px: 0.5 * (width - 1.0), cy_px: 0.5 * (height - 1.0) };
    let size = Some(ImageSize { width_px: width as u32, height_px: height as u32 });
    Ok(match c.lens {
        LensKind::Straight => Camera::new(Pinhole::new(matrix)?, size)?,
        LensKind::Barrel => Camera::new(BrownConrady::new(matrix, &[-0.28, 0.08, 0.001, -0.001])?, size)?,
        LensKind::Fisheye => {
            let matrix = CameraMatrix { fx_px: 450.0, fy_px: 450.0, ..matrix };
            Camera::new(KannalaBrandt::new(matrix, &[-0.01, 0.002, 0.0, 0.0])?, size)?
        }
    })
}

/// Rotated about a random axis in the image plane by the tilt, by any angle in the image, near the middle of the view.
fn pose(target: &Target, size_m: f64, c: &Condition, pcg: &mut Pcg) -> Pose {
    let focal = if matches!(c.lens, LensKind::Fisheye) { 450.0 } else { FOCAL_PX * c.enlarged };
    let depth = focal * size_m / c.size_px;
    let azimuth = pcg.between(0.0, std::f64::consts::TAU);
    let roll = pcg.between(-0.5, 0.5);
    let tilt = c.tilt_deg.to_radians();
    let turn = |x: f64, y: f64, z: f64| Pose::exp(&[x, y, z, 0.0, 0.0, 0.0].into()).rotation;
    let facing = if matches!(target, Target::AprilGrid(_)) {
        turn(std::f64::consts::PI, 0.0, 0.0)
    } else {
        turn(0.0, 0.0, 0.0)
    };
    let rotation = turn(tilt * azimuth.cos(), tilt * azimuth.sin(), 0.0) * turn(0.0, 0.0, roll) * facing;
    let points: Vec<Point> =
        target.features().into_iter().filter_map(|f| target.point(f)).map(|p| p.position).collect();
    let middle = points.iter().sum::<Point>() / points.len().max(1) as f64;
    let shift = if c.off_centre == 0.0 {
        Point::new(pcg.between(-0.1, 0.1), pcg.between(-0.08, 0.08), 1.0) * depth
    } else {
        let towards = pcg.between(0.0, std::f64::consts::TAU);
        let edge = c.off_centre * (0.64 / towards.cos().abs()).min(0.48 / towards.sin().abs());
        Point::new(edge * towards.cos(), edge * towards.sin(), 1.0) * depth
    };
    Pose::new(rotation, shift - rotation * middle)
}

/// Balls of one grey in front of random features.
fn occluders(placed: &Placed, c: &Condition, pcg: &mut Pcg) -> Option<Placed> {
    let features = placed.target.features();
    let at = |f: Feature| placed.target.point(f).map(|p| placed.cam_from_target * p.position);
    let reach_m =
        features.iter().filter_map(|f| Some((at(*f)? - at(features[0])?).norm())).fold(0.0, f64::max);
    let balls = (0..c.occluders).filter_map(|_| {
        let position = at(features[pcg.next_u32() as usize % features.len()])? * 0.9;
        Some(NamedPoint { name: String::new(), position, sigma_m: 0.0 })
    });
    let balls: Vec<NamedPoint> = balls.collect();
    let style = Style { ink: 90.0, dot_diameter_m: Some(c.occluder_size * reach_m), ..Style::default() };
    (!balls.is_empty()).then(|| Placed {
        target: Target::Points(balls),
        cam_from_target: Pose::identity(),
        style,
    })
}

/// Whether a ball hides a feature or its surroundings, so that it is not counted.
fn is_covered(placed: &Placed, feature: Feature, occluder: &Option<Placed>) -> bool {
    let Some(Placed { target: Target::Points(balls), style, .. }) = occluder else { return false };
    let Some(point) = placed.target.point(feature) else { return false };
    let ray = (placed.cam_from_target * point.position).normalize();
    let radius_m = 0.5 * style.dot_diameter_m.unwrap_or(0.0);
    balls.iter().any(|ball| {
        let across_m = (ball.position - ray * ray.dot(&ball.position)).norm();
        across_m < radius_m + 0.012 * ball.position.norm()
    })
}

/// Light gathered while the image moves by `length_px`, middle of the way at the true place.
fn smear(image: &mut GrayImage, length_px: f64, direction_rad: f64) {
    if length_px <= 0.0 {
        return;
    }
    const STEPS: usize = 16;
    let source = image.clone();
    let (width, height) = (image.width_px as f64, image.height_px as f64);
    let at = |u: f64, v: f64| {
        let (u, v) = (u.clamp(0.0, width - 1.001), v.clamp(0.0, height - 1.001));
        let (a, b) = (u.fract(), v.fract());
        let value = |du: u32, dv: u32| {
            source.at((u as u32 + du).min(source.width_px - 1), (v as u32 + dv).min(source.height_px - 1))
                as f64
        };
        (1.0 - b) * ((1.0 - a) * value(0, 0) + a * value(1, 0))
            + b * ((1.0 - a) * value(0, 1) + a * value(1, 1))
    };
    for (k, pixel) in image.data.iter_mut().enumerate() {
        let (u, v) = ((k as u32 % source.width_px) as f64, (k as u32 / source.width_px) as f64);
        let sum: f64 = (0..STEPS)
            .map(|i| length_px * ((i as f64 + 0.5) / STEPS as f64 - 0.5))
            .map(|s| at(u + s * direction_rad.cos(), v + s * direction_rad.sin()))
            .sum();
        *pixel = (sum / STEPS as f64).round() as u8;
    }
}
