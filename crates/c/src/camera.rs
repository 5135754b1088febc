//! `resight_camera`: a lens with its image size, and how well both are known.

use crate::call::{done, guarded};
use crate::message::Message;
use crate::pointer::{Out, borrowed, free, optional_text, slice, text};
use crate::status::{Refusal, Status};
use resight::core::camera::{BrownConrady, ImageSize, KannalaBrandt, Pinhole};
use resight::core::{CameraMatrix, Lens};
use resight::formats::{self, NamedCamera};
use resight::locate::IntrinsicsCovariance;
use std::ffi::{c_char, c_int};
use std::path::Path;

/// A lens with its image size, and how well both are known. It does not change: threads may share it.
pub struct Camera {
    pub(crate) known: NamedCamera,
    pub(crate) remarks: Vec<String>,
}

/// OpenCV's camera matrix and distortion coefficients.
#[repr(C)]
pub struct Intrinsics {
    /// Focal length in columns, px.
    pub fx_px: f64,
    /// Focal length in rows, px.
    pub fy_px: f64,
    /// Column of the principal point; pixel (0, 0) is the centre of the top-left pixel.
    pub cx_px: f64,
    /// Row of the principal point.
    pub cy_px: f64,
    /// Distortion coefficients in OpenCV's order (k1, k2, p1, p2, k3, …); may be null where there are none.
    pub distortion: *const f64,
    /// Their number: 0, 4, 5, 8, 12 or 14; of a fisheye 4.
    pub n_distortion: usize,
    /// 0 for the usual model, anything else for OpenCV's fisheye model.
    pub is_fisheye: c_int,
    /// Columns of the images, 0 with 0 rows where the size is unknown.
    pub width_px: u32,
    /// Rows of the images.
    pub height_px: u32,
}

/// Reads the camera of a file in any format that the program reads; "FILE#NAME" picks one of several.
///
/// Gives RESIGHT_STATUS_FILE where the file is missing or wrong: the message names line and key.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_camera_read(
    file: *const c_char,
    camera: *mut *mut Camera,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (camera, file) = unsafe { (Out::handle("camera", camera)?, text("file", file)?) };
        let (known, remarks) = formats::read_camera_with_remarks(file)?;
        camera.give(Camera { known, remarks });
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Reads a camera from the text of a file of any format that the program reads; `name` picks one of several, and is null otherwise.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_camera_parse(
    content: *const c_char,
    name: *const c_char,
    camera: *mut *mut Camera,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (camera, content, name) = unsafe {
            (Out::handle("camera", camera)?, text("content", content)?, optional_text("name", name)?)
        };
        let bytes = content.as_bytes().to_vec();
        let (known, remarks) = formats::read_camera_from_bytes(Path::new("camera"), bytes, name)?;
        camera.give(Camera { known, remarks });
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Makes a camera of OpenCV's numbers, taken as exact. Other lens models and standard deviations: resight_camera_parse.
///
/// Gives RESIGHT_STATUS_INVALID_ARGUMENT for numbers that no camera has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_camera_of_intrinsics(
    intrinsics: *const Intrinsics,
    camera: *mut *mut Camera,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (camera, intrinsics) =
            unsafe { (Out::handle("camera", camera)?, borrowed("intrinsics", intrinsics)?) };
        // SAFETY: what callers promise of the pointers in their structures.
        let distortion = unsafe { slice("distortion", intrinsics.distortion, intrinsics.n_distortion)? };
        camera.give(of_intrinsics(intrinsics, distortion)?);
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Frees a camera; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_camera_free(camera: *mut Camera) {
    // SAFETY: what callers promise of handles.
    guarded((), || unsafe { free(camera) });
}

fn of_intrinsics(intrinsics: &Intrinsics, distortion: &[f64]) -> Result<Camera, Refusal> {
    let Intrinsics { fx_px, fy_px, cx_px, cy_px, width_px, height_px, .. } = *intrinsics;
    let matrix = CameraMatrix { fx_px, fy_px, cx_px, cy_px };
    let lens: Lens = match intrinsics.is_fisheye {
        0 if distortion.iter().all(|d| *d == 0.0) => Pinhole::new(matrix)?.into(),
        0 => BrownConrady::new(matrix, distortion)?.into(),
        _ => KannalaBrandt::new(matrix, distortion)?.into(),
    };
    let size = (width_px != 0 || height_px != 0).then_some(ImageSize { width_px, height_px });
    let camera = resight::core::Camera::new(lens, size)?;
    let known =
        NamedCamera { name: "camera".to_owned(), camera, placement: None, intrinsics_covariance: None };
    Ok(Camera { known, remarks: Vec::new() })
}

impl Camera {
    /// How well the intrinsics are known; none: exactly.
    pub(crate) fn intrinsics(&self) -> Option<IntrinsicsCovariance> {
        IntrinsicsCovariance::of(&self.known)
    }
}
