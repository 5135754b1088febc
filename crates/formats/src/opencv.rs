//! OpenCV FileStorage (YAML 1.0 and 1.2, XML, JSON), in the spellings its samples and its users have for K and D.
//!
//! Stereo files: R, T with x_2 = R x_1 + T, in the unit of the calibration board, which the file does not state.

use super::document::{Document, Fault, Value};
pub(super) use super::emit::matrix_rows;
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, Writer, checks, opencv_write};
use crate::core::camera::ImageSize;
use crate::core::{Camera, Pose};
use nalgebra::{DMatrix, DVector};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::OpenCv,
    words: &["opencv", "opencv-yaml"],
    reads: Some(Reads {
        recognises: |document| pairs(&document.entry()).next().is_some() || is_stereo(&document.entry()),
        read,
        together: None,
    }),
    write: Some(Writer::Rig(opencv_write::write_yaml)),
    traps: &[
        "R and T of a stereo file map the first camera's points into the second (x_2 = R x_1 + T); T is \
            not the second camera's position, that is -Rᵀ T.",
        "R1 and R2 rotate for rectification, they are not the cameras' attitudes.",
        "Four distortion coefficients mean k1, k2, p1, p2 to calibrateCamera and k1 … k4 to cv::fisheye; \
            the file itself does not say which.",
    ],
};

/// As XML; read by OpenCV's first row.
pub(super) const XML: CameraFormat = CameraFormat {
    format: Format::OpenCvXml,
    words: &["opencv-xml"],
    reads: None,
    write: Some(Writer::Rig(opencv_write::write_xml)),
    traps: FORMAT.traps,
};

/// Spellings of the camera matrix and its distortion; `#` stands for nothing or a camera's number.
const SPELLINGS: [(&str, &[&str]); 13] = [
    ("K#", &["D#", "d#", "D_k1k2p1p2k3"]),
    ("M#", &["D#"]),
    ("K_#", &["D_#"]),
    ("camera_matrix#", &["distortion_coefficients#", "dist_coeffs#", "distortion#", "dist_coeff#"]),
    ("camera_matrix_#", &["distortion_coefficients_#", "dist_coeffs_#"]),
    ("cameraMatrix#", &["distCoeffs#", "distortionCoefficients#", "distCoeff#"]),
    ("Camera_Matrix#", &["Distortion_Coefficients#"]),
    ("Camera_matrix#", &["Distortion_coefficients#"]),
    ("intrinsic_matrix#", &["distortion_coefficients#", "distortion#"]),
    ("mtx#", &["dist#"]),
    ("camMatrix#", &["distCoeffs#"]),
    ("k#", &["d#"]),
    ("intrinsics#", &["distortion#", "distortion_coefficients#"]),
];
const NUMBERS: [&str; 10] = ["", "1", "2", "3", "4", "0", "left", "right", "l", "r"];
const WIDTHS: [&str; 7] =
    ["image_width", "image_Width", "imageWidth", "width", "frame_width", "img_width", "calibImageWidth"];
const HEIGHTS: [&str; 7] = [
    "image_height",
    "image_Height",
    "imageHeight",
    "height",
    "frame_height",
    "img_height",
    "calibImageHeight",
];
const SIZES: [&str; 6] = ["image_size", "imageSize", "img_size", "size", "resolution", "Image_Size"];

struct Pair<'a> {
    number: &'static str,
    matrix: Entry<'a>,
    distortion: Option<Entry<'a>>,
}

/// Every camera matrix there is, with its distortion.
fn pairs<'a>(root: &Entry<'a>) -> impl Iterator<Item = Pair<'a>> {
    let root = root.clone();
    NUMBERS.iter().filter_map(move |number| {
        SPELLINGS.iter().find_map(|(matrix, distortions)| {
            // A number under such a key is something else: k1 of a lens, a fundamental length.
            let matrix = root.get(&matrix.replace('#', number)).filter(is_matrix)?;
            let distortion = distortions.iter().find_map(|d| root.get(&d.replace('#', number)));
            Some(Pair { number, matrix, distortion })
        })
    })
}

fn is_matrix(entry: &Entry<'_>) -> bool {
    matches!(entry.node.value, Value::List(_) | Value::Map(_))
}

fn is_stereo(root: &Entry<'_>) -> bool {
    root.has("R") && (root.has("T") || root.has("t")) || root.has("rvec") && root.has("tvec")
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    let size = image_size(&root)?;
    for pair in pairs(&root) {
        let camera = one_camera(&root, &pair, size, &mut contents.warnings)?;
        let stated = root.get(&format!("camera_name{}", pair.number)).map(|n| n.text()).transpose()?;
        let single = pair.number.is_empty();
        let name = stated
            .map(str::to_owned)
            .unwrap_or_else(|| if single { document.stem() } else { pair.matrix.path.clone() });
        let intrinsics_covariance = standard_deviations(&root, &pair, &camera)?;
        contents.cameras.push(NamedCamera { name, camera, placement: None, intrinsics_covariance });
    }
    if size.is_none() && !contents.cameras.is_empty() {
        contents.warnings.push(
            "the file states no image size, so images of another resolution cannot be found out".into(),
        );
    }
    place(&root, &mut contents)?;
    Ok(contents)
}

/// Spellings of what `calibrateCameraExtended` returns as stdDeviationsIntrinsics: fx, fy, cx, cy, then its coefficients in order; 0 where
/// a parameter was held.
const DEVIATIONS: [&str; 4] =
    ["stdDeviationsIntrinsics#", "std_deviations_intrinsics#", "std_dev_intrinsics#", "std_intrinsics#"];

/// Independent of one another: the file says nothing of their correlations.
fn standard_deviations(
    root: &Entry<'_>,
    pair: &Pair<'_>,
    camera: &Camera,
) -> Result<Option<DMatrix<f64>>, Fault> {
    let found = DEVIATIONS.iter().find_map(|key| root.get(&key.replace('#', pair.number)));
    let Some(entry) = found else { return Ok(None) };
    let (sigmas, parameters) = (entry.numbers()?, camera.parameters());
    if sigmas.len() < parameters.len() {
        let (seen, needed) = (sigmas.len(), parameters.len());
        return Err(
            entry.fault(format!("holds {seen} standard deviations; this camera has {needed} parameters"))
        );
    }
    if let Some(bad) = sigmas.iter().find(|s| **s < 0.0) {
        return Err(entry.fault(format!("holds {bad}; a standard deviation is not negative")));
    }
    let variances: Vec<f64> = sigmas.iter().take(parameters.len()).map(|s| s * s).collect();
    Ok(Some(DMatrix::from_diagonal(&DVector::from_vec(variances))))
}

pub(super) fn image_size(root: &Entry<'_>) -> Result<Option<ImageSize>, Fault> {
    match (root.first_of(&WIDTHS), root.first_of(&HEIGHTS), root.first_of(&SIZES)) {
        (Some(w), Some(h), _) => Ok(Some(ImageSize { width_px: w.count(1)?, height_px: h.count(1)? })),
        (None, None, Some(size)) if size.has("width") => {
            let (w, h) = (size.need("width")?, size.need("height")?);
            Ok(Some(ImageSize { width_px: w.count(1)?, height_px: h.count(1)? }))
        }
        (None, None, Some(size)) => checks::size_pair(&size).map(Some),
        (None, None, None) => Ok(None),
        (Some(one), None, _) | (None, Some(one), _) => {
            Err(one.fault("width and height belong together; the other is missing"))
        }
    }
}

fn one_camera(
    root: &Entry<'_>,
    pair: &Pair<'_>,
    size: Option<ImageSize>,
    warnings: &mut Vec<String>,
) -> Result<Camera, Fault> {
    let matrix = checks::camera_matrix(&pair.matrix)?;
    let lens = lens_numbers(root, pair, warnings)?;
    lens::camera(pair.distortion.as_ref().unwrap_or(&pair.matrix), &lens, matrix, size, warnings)
        .map_err(|fault| Fault { line: fault.line.or(Some(pair.matrix.node.line)), ..fault })
}

fn lens_numbers(root: &Entry<'_>, pair: &Pair<'_>, warnings: &mut Vec<String>) -> Result<LensNumbers, Fault> {
    let fisheye = is_fisheye(root)?;
    let Some(distortion) = &pair.distortion else {
        if fisheye {
            return Err(pair.matrix.fault("is a fisheye's, but its four coefficients are missing"));
        }
        warnings.push(format!(
            "{}: no distortion coefficients beside it; read as a camera without distortion",
            pair.matrix.path
        ));
        return Ok(LensNumbers::Pinhole);
    };
    let d = distortion.numbers()?;
    if fisheye {
        let k = <[f64; 4]>::try_from(d)
            .map_err(|d| distortion.fault(format!("holds {} coefficients; fisheye takes 4", d.len())))?;
        return Ok(LensNumbers::KannalaBrandt(k));
    }
    if d.len() == 4 && fisheye_unstated(root) && d.iter().any(|x| *x != 0.0) {
        warnings.push(format!(
            "{}: four coefficients are read as k1, k2, p1, p2; if cv::fisheye made \
            them, add `distortion_model: fisheye`",
            distortion.path
        ));
    }
    brown_conrady(distortion, d)
}

/// 0 (no distortion), 4, 5, 8, 12 or 14 coefficients.
pub(super) fn brown_conrady(at: &Entry<'_>, d: Vec<f64>) -> Result<LensNumbers, Fault> {
    match d.len() {
        0 => Ok(LensNumbers::Pinhole),
        4 | 5 | 8 | 12 | 14 if d.iter().all(|x| *x == 0.0) => Ok(LensNumbers::Pinhole),
        4 | 5 | 8 | 12 | 14 => Ok(LensNumbers::BrownConrady(d)),
        n => Err(at.fault(format!("holds {n} coefficients; OpenCV's model takes 4, 5, 8, 12 or 14"))),
    }
}

fn model_key<'a>(root: &Entry<'a>) -> Option<Entry<'a>> {
    root.first_of(&[
        "distortion_model",
        "camera_model",
        "model",
        "lens_model",
        "fisheye_model",
        "fisheye",
        "isFisheye",
    ])
}

fn fisheye_unstated(root: &Entry<'_>) -> bool {
    model_key(root).is_none()
}

pub(super) fn is_fisheye(root: &Entry<'_>) -> Result<bool, Fault> {
    let Some(model) = model_key(root) else { return Ok(false) };
    let Ok(word) = model.text() else { return model.flag() };
    match word.to_ascii_lowercase().as_str() {
        "fisheye" | "equidistant" | "kannala_brandt" => Ok(true),
        "pinhole" | "brown_conrady" | "plumb_bob" | "radtan" | "rational_polynomial" | "none" => Ok(false),
        other => Err(model.fault(format!(
            "unknown model `{other}`; pinhole, plumb_bob, rational_polynomial or fisheye are read"
        ))),
    }
}

/// rvec, tvec of `solvePnP` beside one camera (or alone): x_camera = R x_object + t, in the unit of the object.
fn place_object(root: &Entry<'_>, contents: &mut Contents) -> Result<(), Fault> {
    let (Some(r), Some(t)) = (root.get("rvec"), root.get("tvec")) else { return Ok(()) };
    let b_from_a = Pose::new(checks::rotation_matrix_or_vector(&r)?, checks::vector3(&t)?);
    contents.warnings.extend(checks::unit_warning(&t.path, b_from_a.translation.norm()));
    let placement = |b: &str| Placement { b: b.into(), a: "object".into(), b_from_a, covariance: None };
    match contents.cameras.as_mut_slice() {
        [] => contents.relations.push(placement("camera")),
        [camera] => camera.placement = Some(placement(&camera.name)),
        many => return Err(r.fault(format!("rvec and tvec are of one camera; the file has {}", many.len()))),
    }
    contents.notes.push(
        "rvec and tvec map the object (the target) into the camera, as solvePnP gives them; the camera's position is -Rᵀ tvec.".into(),
    );
    Ok(())
}

/// R, T beside two cameras (or alone) place the second in the first's frame.
fn place(root: &Entry<'_>, contents: &mut Contents) -> Result<(), Fault> {
    if !root.has("R") {
        return place_object(root, contents);
    }
    let (Some(r), Some(t)) = (root.get("R"), root.first_of(&["T", "t"])) else { return Ok(()) };
    let b_from_a = Pose::new(checks::rotation_matrix_or_vector(&r)?, checks::vector3(&t)?);
    let names: Vec<&str> = contents.cameras.iter().map(|c| c.name.as_str()).collect();
    let (a, b) = match names.as_slice() {
        [a, b] => (a.to_string(), b.to_string()),
        [] => ("first".into(), "second".into()),
        _ => return Err(r.fault(format!("R and T need two cameras; the file has {}", names.len()))),
    };
    contents.warnings.extend(checks::unit_warning(&t.path, b_from_a.translation.norm()));
    let placement = Placement { b, a, b_from_a, covariance: None };
    match contents.cameras.get_mut(1) {
        Some(second) => second.placement = Some(placement),
        None => contents.relations.push(placement),
    }
    contents.notes.push(
        "T is in the unit of the calibration board, which the file does not state; metres are assumed."
            .into(),
    );
    Ok(())
}
