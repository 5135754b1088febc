//! Rendered photographs of a printed page: through a lens with distortion, with uneven light, vignetting, blur and noise, and
//! saved as JPEG. The commands that read them know nothing of the lens or of the printer.

use anyhow::{Result, anyhow};
use nalgebra::{Matrix3, Rotation3, Vector3};
use resight::core::camera::{BrownConrady, ImageSize};
use resight::core::target::{Printed, PrintedScale};
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose, Target};
use resight::render::{Finish, Pcg, Scene, Style, clutter, render};
use std::path::Path;

/// An ordinary camera: 65° across, as a webcam or a telephone at its short end.
const SIZE: ImageSize = ImageSize { width_px: 960, height_px: 720 };
const MATRIX: CameraMatrix = CameraMatrix { fx_px: 752.6, fy_px: 753.1, cx_px: 486.2, cy_px: 352.8 };
/// k1, k2, p1, p2, k3.
const DISTORTION: [f64; 5] = [-0.236, 0.081, 0.0004, -0.0003, 0.0];
/// Printed over designed length: what this printer did to the page.
const PRINTED: [f64; 2] = [0.9964, 1.0018];
/// What the user reads off the rulers is off by this, mm.
const READING_ERROR_MM: [f64; 2] = [0.13, -0.17];
const JPEG_QUALITY: u8 = 93;

/// Where the camera is held: tilt off the front and its direction, roll (degrees), distance (m), and which part of the board the middle of
/// the image shows, off its centre (m).
type Held = (f64, f64, f64, f64, [f64; 2]);

/// As docs/first-pose.md asks: from all sides, tilted, upright and across, near, and with the board in the corners of the image.
const VIEWS: [Held; 13] = [
    (8.0, 0.0, 7.0, 0.30, [0.0, 0.0]),
    (35.0, 0.0, 95.0, 0.28, [0.0, 0.0]),
    (35.0, 90.0, 100.0, 0.28, [0.0, 0.0]),
    (35.0, 180.0, -8.0, 0.32, [0.0, 0.0]),
    (35.0, 270.0, 80.0, 0.28, [0.0, 0.0]),
    (35.0, 45.0, 100.0, 0.27, [0.05, 0.08]),
    (35.0, 135.0, 75.0, 0.27, [-0.05, 0.08]),
    (35.0, 225.0, 260.0, 0.27, [-0.05, -0.08]),
    (35.0, 315.0, 285.0, 0.27, [0.05, -0.08]),
    (30.0, 20.0, 100.0, 0.25, [0.06, -0.09]),
    (30.0, 200.0, 80.0, 0.25, [-0.06, 0.09]),
    (40.0, 110.0, 10.0, 0.30, [0.08, 0.06]),
    (40.0, 290.0, 185.0, 0.30, [-0.08, -0.06]),
];
/// The camera whose pose is asked for.
const HERE: Held = (38.0, 240.0, 12.0, 0.62, [0.025, -0.02]);
/// Middle of the board, m.
const MIDDLE: [f64; 2] = [0.075, 0.12];

/// The truth, which the program does not know.
pub struct Truth {
    /// Lens and image size.
    pub camera: Camera,
    /// Of the photograph `here.jpg`.
    pub cam_from_target: Pose,
}

impl Truth {
    /// The camera of the demo.
    pub fn new() -> Result<Self> {
        let lens = Lens::BrownConrady(BrownConrady::new(MATRIX, &DISTORTION)?);
        Ok(Truth { camera: Camera { lens, size: Some(SIZE) }, cam_from_target: held(&HERE) })
    }

    /// Rulers of the printed page as the user reads them, mm.
    pub fn read_off(&self, designed_mm: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| designed_mm[i] * PRINTED[i] + READING_ERROR_MM[i])
    }

    /// Writes `photos/01.jpg` and so on, and `here.jpg`.
    pub fn photograph(&self, design: &Target, folder: &Path) -> Result<()> {
        let scale = PrintedScale { ratio: PRINTED, sigma: [0.0; 2] };
        let page = Target::Printed(Printed { design: Box::new(design.clone()), scale });
        let photos = folder.join("photos");
        crate::files::make_folder("-o", &photos)?;
        let named =
            VIEWS.iter().enumerate().map(|(i, held)| (photos.join(format!("{:02}.jpg", i + 1)), held));
        let all: Vec<_> = named.chain([(folder.join("here.jpg"), &HERE)]).enumerate().collect();
        resight::parallel::in_order(
            &all,
            |(i, (path, view))| (path.clone(), self.image(&page, view, *i as u64)),
            |(path, jpeg)| Ok::<(), anyhow::Error>(resight::formats::write_atomically(&path, &jpeg?)?),
        )
    }

    fn image(&self, page: &Target, view: &Held, seed: u64) -> Result<Vec<u8>> {
        let style = Style { ink: 38.0, paper: Some(205.0), margin_m: Some(0.018), ..Style::default() };
        let mut scene = Scene::of(page.clone(), held(view), style);
        let mut pcg = Pcg::new(100 + seed);
        scene.background = 70.0;
        // A desk with things on it.
        let size = [SIZE.width_px, SIZE.height_px];
        scene.clutter = clutter::dots(14, size, [30.0, 120.0], 95.0, seed);
        scene.clutter.extend(clutter::words(30, size, 14.0, 40.0, seed));
        let finish = Finish {
            blur_sigma_px: pcg.between(0.8, 1.2),
            noise_sigma: 3.0,
            seed,
            illumination_gradient: [pcg.between(-0.4, 0.4), pcg.between(-0.3, 0.3)],
            vignetting: 0.35,
            samples_per_axis: 4,
        };
        let image = render(&scene, &self.camera, &finish)?;
        image.jpeg(JPEG_QUALITY).map_err(|reason| anyhow!(reason))
    }
}

/// The pose `cam_from_target` of a camera held so.
fn held((tilt, direction, roll, distance_m, off_m): &Held) -> Pose {
    let [tilt, direction, roll] = [tilt, direction, roll].map(|angle| angle.to_radians());
    let tilted = Rotation3::new(Vector3::new(direction.cos(), direction.sin(), 0.0) * tilt);
    let rotation: Matrix3<f64> = (Rotation3::from_axis_angle(&Vector3::z_axis(), roll) * tilted).into_inner();
    let aim = Point::new(MIDDLE[0] + off_m[0], MIDDLE[1] + off_m[1], 0.0);
    Pose::new(rotation, Point::new(0.0, 0.0, *distance_m) - rotation * aim)
}
