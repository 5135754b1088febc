//! What is stated of a lens, as a camera.

use crate::command::GivenLens;
use crate::photograph::Photograph;
use crate::texts;
use resight::answer::EstimatedFocal;
use resight::core::Camera;
use resight::core::locate::unknown_focal::LensPrior;
use resight::formats::{self, NamedCamera};
use resight::locate::IntrinsicsCovariance;
use resight::nominal::{NominalLens, lens_of_unknown_focal};
use std::path::Path;

/// A lens that points can be solved with.
#[derive(Debug, Clone, PartialEq)]
pub enum KnownLens {
    /// At the size of the photograph.
    Camera {
        camera: Box<Camera>,
        intrinsics: Option<IntrinsicsCovariance>,
        /// That it is not calibrated, or of another size.
        remark: Option<String>,
        name: String,
    },
    /// To be estimated with the pose.
    Unknown(LensPrior),
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
            None => Err(texts::NO_EXIF.to_owned()),
        },
        GivenLens::Unknown => Ok(KnownLens::Unknown(lens_of_unknown_focal(size))),
    }
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
