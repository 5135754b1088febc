//! A camera without a calibration: nominal intrinsics from a data sheet or from a photograph's EXIF, with realistic standard deviations.
//!
//! The lens is assumed to have square pixels, a central principal point and no distortion, with the deviations that are usual for such lenses:
//!
//! | what | one standard deviation | why |
//! | --- | --- | --- |
//! | focal length | 5 % from a field of view, 4 % from millimetres of focal length and sensor or from EXIF, besides the rounding of EXIF | data sheets round, count the distortion or name the diagonal; video modes crop |
//! | fy / fx | 0.4 % | pixels are square |
//! | principal point | 2 % of the width | lenses are glued or screwed |
//! | k1 | what moves the corner of the image by 15 % at 70° of field of view, more in proportion where it is wider | wide lenses are barrels |
//!
//! These values are estimates; `nominal_cameras_are_within_their_sigmas` compares them with calibrated cameras.

use crate::core::camera::{BrownConrady, CameraMatrix, ImageSize};
use crate::core::locate::unknown_focal::LensPrior;
use crate::core::{Camera, Lens};
use crate::error::Error;
use crate::formats::NamedCamera;
use crate::image::exif::{ExifLens, FILM_DIAGONAL_MM, FocalSource};
use nalgebra::DMatrix;

/// One standard deviation of log fy/fx, of the principal point in widths of the image, and of the relative displacement of the corner by
/// distortion at 70° of field of view.
const ASPECT_SIGMA: f64 = 0.004;
const PRINCIPAL_POINT_SIGMA: f64 = 0.02;
const BEND_SIGMA_AT_70_DEG: f64 = 0.15;

/// Returns the prior for a lens of unknown focal length, for images of this size: the input of `estimate_focal`.
pub fn lens_of_unknown_focal(size: ImageSize) -> LensPrior {
    LensPrior {
        size,
        principal_point_sigma_px: PRINCIPAL_POINT_SIGMA * f64::from(size.width_px),
        aspect_sigma: ASPECT_SIGMA,
        bend_sigma_per_rad: BEND_SIGMA_AT_70_DEG / 70f64.to_radians(),
    }
}

/// What is known of the lens.
#[derive(Debug, Clone, PartialEq)]
pub enum NominalLens {
    /// The field of view from the left to the right edge of the image, degrees.
    HorizontalFieldOfView(f64),
    /// Focal length and width of the sensor, both in millimetres.
    FocalLength {
        /// The focal length.
        focal_mm: f64,
        /// The width of the part of the sensor that gives the image.
        sensor_width_mm: f64,
    },
    /// The lens stated in a photograph's EXIF.
    Exif(ExifLens),
}

/// A wider field of view is that of a fisheye.
const MOST_DEG: f64 = 130.0;
/// A narrower field of view is that of a telescope, or was given in radians.
const LEAST_DEG: f64 = 2.0;

impl NominalLens {
    /// Returns the camera for images of this size, with the covariance of its intrinsics.
    ///
    /// # Errors
    /// `Intrinsics` for an impossible lens, with its field of view.
    pub fn camera(&self, size: ImageSize) -> Result<NamedCamera, Error> {
        let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
        let (f_px, relative_sigma) = match self {
            NominalLens::HorizontalFieldOfView(deg) => (0.5 * width / (0.5 * deg.to_radians()).tan(), 0.05),
            NominalLens::FocalLength { focal_mm, sensor_width_mm } => {
                (width * focal_mm / sensor_width_mm, 0.04)
            }
            NominalLens::Exif(lens) => {
                let focal = f64::from(lens.focal_35mm);
                // Rounded to whole millimetres: a uniform error of up to half a millimetre.
                let rounding = 0.5 / (3.0_f64.sqrt() * focal);
                (width.hypot(height) * focal / FILM_DIAGONAL_MM, rounding.hypot(0.04))
            }
        };
        let fov_deg = 2.0 * (0.5 * width).atan2(f_px).to_degrees();
        let is_possible = self.is_positive() && (LEAST_DEG..=MOST_DEG).contains(&fov_deg);
        if !is_possible {
            let reason = format!(
                "{}: a horizontal field of view of {LEAST_DEG}° to {MOST_DEG}° is needed; check the unit, and calibrate a fisheye",
                self.seen(fov_deg)
            );
            return Err(Error::Intrinsics { reason });
        }
        let matrix = CameraMatrix {
            fx_px: f_px,
            fy_px: f_px,
            cx_px: 0.5 * (width - 1.0),
            cy_px: 0.5 * (height - 1.0),
        };
        let lens = Lens::from(BrownConrady::new(matrix, &[0.0; 4])?);
        let camera = Camera::new(lens, Some(size))?;
        let corner = 0.5 * width.hypot(height) / f_px;
        let bend = BEND_SIGMA_AT_70_DEG * fov_deg / 70.0;
        let (common, aspect) = ((relative_sigma * f_px).powi(2), (ASPECT_SIGMA * f_px).powi(2));
        let mut covariance = DMatrix::zeros(8, 8);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            covariance[(i, j)] = common + if i == j { 0.25 * aspect } else { -0.25 * aspect };
        }
        for i in [2, 3] {
            covariance[(i, i)] = (PRINCIPAL_POINT_SIGMA * width).powi(2);
        }
        covariance[(4, 4)] = (bend / (corner * corner)).powi(2);
        let name = "nominal".to_owned();
        Ok(NamedCamera { name, camera, placement: None, intrinsics_covariance: Some(covariance) })
    }

    fn is_positive(&self) -> bool {
        match self {
            NominalLens::HorizontalFieldOfView(deg) => 0.0 < *deg && *deg < 180.0,
            NominalLens::FocalLength { focal_mm, sensor_width_mm } => {
                0.0 < *focal_mm
                    && 0.0 < *sensor_width_mm
                    && focal_mm.is_finite()
                    && sensor_width_mm.is_finite()
            }
            NominalLens::Exif(lens) => 0 < lens.focal_35mm,
        }
    }

    fn seen(&self, fov_deg: f64) -> String {
        match self {
            NominalLens::HorizontalFieldOfView(deg) => format!("a horizontal field of view of {deg}°"),
            NominalLens::FocalLength { focal_mm, sensor_width_mm } => {
                format!(
                    "{focal_mm} mm on a sensor {sensor_width_mm} mm wide, a horizontal field of view of {fov_deg:.1}°"
                )
            }
            NominalLens::Exif(lens) => {
                format!(
                    "EXIF with {} mm (35 mm film), a horizontal field of view of {fov_deg:.1}°",
                    lens.focal_35mm
                )
            }
        }
    }

    /// Describes the source of the figures and their accuracy.
    pub fn remark(&self) -> String {
        let source = match self {
            NominalLens::HorizontalFieldOfView(deg) => format!("a horizontal field of view of {deg}°"),
            NominalLens::FocalLength { focal_mm, sensor_width_mm } => {
                format!("{focal_mm} mm of focal length on a sensor {sensor_width_mm} mm wide")
            }
            NominalLens::Exif(lens) => {
                let camera = lens.camera.as_ref().map_or_else(String::new, |camera| format!(" of {camera}"));
                let source = match lens.source {
                    FocalSource::Stated => "",
                    FocalSource::Sensor => "focal length and size of the sensor, ",
                };
                format!("the photograph's EXIF{camera}: {source}{} mm as of 35 mm film", lens.focal_35mm)
            }
        };
        format!(
            "the camera is not calibrated: its intrinsics are nominal, from {source}, and every ± holds how far such figures are off"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// fx, fy, cx, cy and k1 of calibrated cameras (the chessboard's two of examples/photo, four webcams) with their image sizes.
    const CALIBRATED: [([f64; 5], [u32; 2]); 6] = [
        ([535.9, 535.9, 342.3, 235.6, -0.266], [640, 480]),
        ([542.4, 541.6, 328.3, 246.9, -0.281], [640, 480]),
        ([894.5, 896.9, 624.0, 361.3, -0.338], [1280, 720]),
        ([704.0, 706.2, 626.0, 348.9, 0.192], [1280, 720]),
        ([637.2, 633.6, 657.4, 378.2, 0.170], [1280, 720]),
        ([640.4, 643.6, 657.3, 333.5, 0.190], [1280, 720]),
    ];

    /// The errors of the nominal principal point, fy / fx and k1 of real cameras agree with the stated sigmas.
    #[test]
    fn nominal_cameras_are_within_their_sigmas() {
        let mut squares = [0.0; 4];
        for ([fx, fy, cx, cy, k1], [width_px, height_px]) in CALIBRATED {
            let hfov_deg = 2.0 * (0.5 * f64::from(width_px)).atan2(fx).to_degrees();
            let size = ImageSize { width_px, height_px };
            let nominal = NominalLens::HorizontalFieldOfView(hfov_deg).camera(size).expect("a camera");
            let c = nominal.intrinsics_covariance.expect("a covariance");
            let aspect = (c[(0, 0)] + c[(1, 1)] - 2.0 * c[(0, 1)]).sqrt();
            let k = nominal.camera.matrix().expect("a matrix");
            let off =
                [(fy - fx) / aspect, (cx - k.cx_px) / c[(2, 2)].sqrt(), (cy - k.cy_px) / c[(3, 3)].sqrt()];
            for (sum, x) in squares.iter_mut().zip(off.into_iter().chain([k1 / c[(4, 4)].sqrt()])) {
                *sum += x * x / CALIBRATED.len() as f64;
            }
        }
        assert!(squares.iter().all(|s| (0.2..2.5).contains(s)), "{squares:?}");
    }

    const SIZE: ImageSize = ImageSize { width_px: 1280, height_px: 720 };

    fn of_film(focal_35mm: u16) -> ExifLens {
        ExifLens { focal_35mm, source: FocalSource::Stated, camera: None }
    }

    fn focal_px(lens: &NominalLens) -> f64 {
        lens.camera(SIZE).expect("a camera").camera.matrix().expect("a matrix").fx_px
    }

    #[test]
    fn three_ways_to_the_same_focal_length() {
        let by_angle = focal_px(&NominalLens::HorizontalFieldOfView(2.0 * 0.5_f64.atan().to_degrees()));
        let by_length = focal_px(&NominalLens::FocalLength { focal_mm: 5.0, sensor_width_mm: 5.0 });
        // 1280 × 720 has a diagonal of 1468.6 px: 38 mm on film of 43.27 mm.
        let by_exif = focal_px(&NominalLens::Exif(of_film(38)));
        assert!((by_angle - 1280.0).abs() < 1e-9 && by_length == 1280.0, "{by_angle} {by_length}");
        assert!((by_exif / 1289.8 - 1.0).abs() < 1e-4, "{by_exif}");
    }

    #[test]
    fn impossible_lenses_are_refused() {
        for (lens, seen) in [
            (NominalLens::HorizontalFieldOfView(1.1), "1.1°"),
            (NominalLens::HorizontalFieldOfView(170.0), "170°"),
            (NominalLens::HorizontalFieldOfView(-60.0), "-60°"),
            (NominalLens::HorizontalFieldOfView(f64::NAN), "NaN°"),
            (NominalLens::FocalLength { focal_mm: 0.004, sensor_width_mm: 0.006 * 1000.0 }, "0.004 mm"),
            (NominalLens::FocalLength { focal_mm: 4.0, sensor_width_mm: -6.0 }, "-6 mm"),
            (NominalLens::Exif(of_film(4)), "4 mm (35 mm film)"),
        ] {
            let refused = lens.camera(SIZE).expect_err("refused").to_string();
            assert!(refused.contains(seen) && refused.contains("2° to 130°"), "{refused}");
        }
    }
}
