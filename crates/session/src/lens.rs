//! Converts what is stated about a lens to a camera.

use crate::cameras::COMMON_CAMERAS;
use crate::command::{GivenLens, GivenLine, LineDirection};
use crate::photograph::Photograph;
use crate::state::{PhotoState, SIGMA_PX, State};
use crate::texts;
use resight::answer::{EstimatedFocal, Status};
use resight::core::camera::ImageSize;
use resight::core::locate::unknown_focal::LensPrior;
use resight::core::locate::unknown_focal::marked_lines::{Axis, MarkedLine};
use resight::core::{Camera, Pixel};
use resight::formats::{self, NamedCamera};
use resight::image::exif::{ExifLens, FocalSource};
use resight::locate::IntrinsicsCovariance;
use resight::marked_lines::{MarkedView, NamedMarkedLine, SceneLens, scene_view_of};
use resight::nominal::{NominalLens, lens_of_unknown_focal};
use std::path::Path;

/// Largest number of lines used.
const MOST_LINES: usize = 100;
/// By how much a visible horizon is off the true one, in parts of the width of the photograph: 0.1° of a lens of 60°, which is what the horizon at
/// sea lies too low by from a height of ten metres.
const HORIZON_SIGMA: f64 = 0.1 / 60.0;
/// Relative standard deviation that a stated field of view has for the nominal lens.
const FIELD_OF_VIEW_SIGMA: f64 = 0.05;

/// A lens that points can be solved with.
#[derive(Debug, Clone, PartialEq)]
pub enum KnownLens {
    /// At the size of the photograph.
    Camera {
        camera: Box<Camera>,
        intrinsics: Option<IntrinsicsCovariance>,
        /// The remark that it is not calibrated, or has another size.
        remark: Option<String>,
        name: String,
    },
    /// Its focal length is estimated with the pose.
    Unknown(LensPrior),
}

/// Returns the number of the photograph from which another one takes its lens; the error is a sentence.
pub fn lender(state: &State, photo: usize) -> Option<Result<usize, String>> {
    let GivenLens::Photograph { name } = state.photos.get(photo)?.lens.as_ref()? else { return None };
    let found = state.photos.iter().position(|p| p.photograph.name == *name);
    Some(match found {
        Some(other) if matches!(state.photos[other].lens, Some(GivenLens::Photograph { .. })) => {
            Err(texts::borrowed_lens(name))
        }
        Some(other) => Ok(other),
        None => Err(texts::no_photograph_named(name)),
    })
}

/// Returns the lens of a photograph for another one of the same camera; a sentence where it has none, or the sizes differ.
pub fn of_photograph(
    lender: &PhotoState,
    known: Option<&KnownLens>,
    estimated_focal: Option<&EstimatedFocal>,
    size: ImageSize,
) -> Result<KnownLens, String> {
    let Photograph { name, .. } = &*lender.photograph;
    if lender.photograph.size() != size {
        return Err(texts::other_size(name, lender.photograph.size(), size));
    }
    match (known, estimated_focal) {
        (Some(KnownLens::Camera { camera, intrinsics, remark, .. }), _) => Ok(KnownLens::Camera {
            camera: camera.clone(),
            intrinsics: intrinsics.clone(),
            remark: remark.clone(),
            name: texts::lens_of(name),
        }),
        (Some(KnownLens::Unknown(prior)), Some(found)) => {
            let nominal = NominalLens::HorizontalFieldOfView(found.horizontal_field_of_view_rad.to_degrees());
            let mut named = nominal.camera(size).map_err(|reason| reason.to_string())?;
            named.camera = estimated(found, prior).ok_or_else(|| texts::no_lens_yet(name))?;
            open_focal(&mut named, found.focal_px, found.sigma_px);
            let words = format!("{}: {}", texts::lens_of(name), found.words());
            Ok(of_named(named, &words, Some(texts::BY_PHOTOGRAPH.to_owned())))
        }
        _ => Err(texts::no_lens_yet(name)),
    }
}

/// Gives a nominal lens the standard deviation that its focal length was estimated with.
fn open_focal(named: &mut NamedCamera, focal_px: f64, sigma_px: f64) {
    if let Some(covariance) = &mut named.intrinsics_covariance {
        let open = sigma_px.powi(2) - (FIELD_OF_VIEW_SIGMA * focal_px).powi(2);
        (0..4).for_each(|k| covariance[(k / 2, k % 2)] += open);
    }
}

/// The lens that was stated, for this photograph; a sentence where it cannot be.
pub fn known(given: &GivenLens, photograph: &Photograph) -> Result<KnownLens, String> {
    let size = photograph.size();
    let nominal = |lens: NominalLens| {
        let remark = Some(lens.remark());
        let named = lens.camera(size).map_err(|reason| reason.to_string())?;
        Ok(of_named(named, "nominal", remark))
    };
    match given {
        GivenLens::File { name, text } => of_file(name, text, photograph),
        GivenLens::FieldOfView { hfov_deg } => nominal(NominalLens::HorizontalFieldOfView(*hfov_deg)),
        GivenLens::Exif => match &photograph.exif {
            Some(exif) => nominal(NominalLens::Exif(exif.clone())),
            None => Err(texts::no_exif_lens(photograph.camera.as_ref())),
        },
        GivenLens::Common { name } => {
            let known = COMMON_CAMERAS.iter().find(|camera| camera.name == name);
            let camera = known.ok_or_else(|| texts::no_common_camera(name))?;
            let (focal_35mm, source) = (camera.focal_35mm, FocalSource::Stated);
            let stated = ExifLens { focal_35mm, source, camera: Some(name.clone()) };
            let named = NominalLens::Exif(stated).camera(size).map_err(|reason| reason.to_string())?;
            Ok(of_named(named, name, Some(texts::COMMON_CAMERA.to_owned())))
        }
        GivenLens::Lines { lines } => of_lines(lines, size),
        GivenLens::Photograph { name } => Err(texts::no_lens_yet(name)),
        GivenLens::Unknown => Ok(KnownLens::Unknown(lens_of_unknown_focal(size))),
    }
}

/// The focal length by lines that are parallel in the scene; the rest of the lens is nominal.
fn of_lines(lines: &[GivenLine], size: ImageSize) -> Result<KnownLens, String> {
    if MOST_LINES < lines.len() {
        return Err(texts::too_many_lines(lines.len(), MOST_LINES));
    }
    let marked = |(i, line): (usize, &GivenLine)| {
        let axis = match line.direction {
            LineDirection::Along => Axis::Along,
            LineDirection::Across => Axis::Across,
            LineDirection::Up => Axis::Up,
            LineDirection::Horizon => Axis::Horizon,
        };
        let sigma_px = match axis {
            Axis::Horizon => SIGMA_PX.hypot(HORIZON_SIGMA * f64::from(size.width_px)),
            _ => SIGMA_PX,
        };
        let ends_px = line.ends.map(|[u, v]| Pixel::new(u, v));
        let line = MarkedLine { ends_px, sigma_px, axis, length: None };
        NamedMarkedLine { name: format!("Line {}", i + 1), line }
    };
    let view = MarkedView { name: String::new(), lines: lines.iter().enumerate().map(marked).collect() };
    let found = scene_view_of(&view, &SceneLens::Unknown(lens_of_unknown_focal(size)));
    let focal = found.focal_px.zip(found.focal_sigma_px).zip(found.horizontal_field_of_view_rad);
    let Some(((focal_px, sigma_px), hfov_rad)) = focal.filter(|_| found.status == Status::Ok) else {
        return Err(found.message);
    };
    let nominal = NominalLens::HorizontalFieldOfView(hfov_rad.to_degrees());
    let mut named = nominal.camera(size).map_err(|reason| reason.to_string())?;
    open_focal(&mut named, focal_px, sigma_px);
    Ok(of_named(named, &texts::by_lines(focal_px, sigma_px), Some(texts::BY_LINES.to_owned())))
}

fn of_named(named: NamedCamera, name: &str, remark: Option<String>) -> KnownLens {
    let intrinsics = IntrinsicsCovariance::of(&named);
    KnownLens::Camera { camera: Box::new(named.camera), intrinsics, remark, name: name.to_owned() }
}

fn of_file(spec: &str, text: &str, photograph: &Photograph) -> Result<KnownLens, String> {
    let (file, wanted) = spec.split_once('#').map_or((spec, None), |(file, name)| (file, Some(name)));
    let read = formats::read_cameras_from_bytes(Path::new(file), text.as_bytes().to_vec());
    let read = read.map_err(|reason| reason.to_string())?;
    let mut cameras = read.cameras;
    let at = match (wanted, cameras.len()) {
        (Some(name), _) => cameras.iter().position(|camera| camera.name == name),
        (None, 1) => Some(0),
        (None, _) => None,
    };
    let Some(at) = at else {
        let names: Vec<String> = cameras.into_iter().map(|camera| camera.name).collect();
        return Err(texts::several_cameras(file, &names));
    };
    let named = cameras.swap_remove(at);
    let (width_px, height_px) = (photograph.image.width_px, photograph.image.height_px);
    let camera = formats::check_image_size(&named.camera, width_px, height_px)
        .map_err(|reason| format!("{file}: {reason}"))?;
    let stated = named.camera.size.filter(|size| Some(*size) != camera.size);
    let remarks: Vec<String> =
        read.warnings.into_iter().chain(stated.map(|size| texts::scaled(size, photograph.size()))).collect();
    let remark = (!remarks.is_empty()).then(|| remarks.join("; "));
    let intrinsics = IntrinsicsCovariance::of(&named);
    Ok(KnownLens::Camera { camera: Box::new(camera), intrinsics, remark, name: named.name })
}

/// The camera that goes with an estimated focal length.
pub fn estimated(found: &EstimatedFocal, prior: &LensPrior) -> Option<Camera> {
    let plain = NominalLens::HorizontalFieldOfView(60.0).camera(prior.size).ok()?.camera;
    let value = |(name, _): &(&'static str, f64)| found.parameters.get(*name).copied();
    let values: Vec<f64> = plain.parameters().iter().map(value).collect::<Option<_>>()?;
    plain.with_parameters(&values).ok()
}

/// The horizontal field of view, degrees.
pub fn hfov_deg(camera: &Camera) -> Option<f64> {
    let (width, f) = (f64::from(camera.size?.width_px), camera.matrix()?.fx_px);
    Some(2.0 * (0.5 * width).atan2(f).to_degrees())
}
