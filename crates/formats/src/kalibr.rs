//! Kalibr camera chain (`camchain.yaml`, `imucam.yaml`).
//!
//! `T_cn_cnm1` maps the previous camera's points into this one's; `T_cam_imu` maps the IMU's into the camera's.
//! OpenVINS keeps the same shape with `T_imu_cam`, the inverse.

use super::document::{Document, Fault, Value};
use super::emit::{list, number};
use super::entry::Entry;
use super::frames::Frames;
use super::lens::{self, LensNumbers};
use super::scene::xyz;
use super::{
    CameraFile, CameraFormat, ClockOffset, Contents, Format, NamedCamera, OutFile, Placement, Reads,
    WriteError, Writer, Written, checks,
};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pose};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Kalibr,
    words: &["kalibr", "camchain"],
    reads: Some(Reads {
        recognises: |document| cameras(&document.entry()).next().is_some(),
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "T_cn_cnm1 maps the previous camera's points into this camera's (x_cam1 = R x_cam0 + t); its \
            translation is not this camera's position, that is −Rᵀ t.",
        "T_cam_imu maps IMU points into the camera. OpenVINS files look the same but hold T_imu_cam, the \
            inverse; copies that changed the numbers and kept the key are common.",
    ],
};

fn cameras<'a>(root: &Entry<'a>) -> impl Iterator<Item = Entry<'a>> {
    root.entries().unwrap_or_default().into_iter().filter(|e| {
        matches!(e.node.value, Value::Map(_))
            && e.has("intrinsics")
            && (e.has("camera_model") || e.has("distortion_model"))
    })
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    let mut previous: Option<(String, Option<Pose>)> = None;
    for entry in cameras(&root) {
        let name = entry.name().to_owned();
        let camera = camera_of(&entry, "distortion_coeffs", &mut contents.warnings)?;
        let from_imu = imu_pose(&entry)?;
        let from_previous = match (entry.get("T_cn_cnm1"), &previous) {
            (Some(t), Some((a, _))) => Some((a.clone(), checks::pose4x4(&t)?, t)),
            (Some(t), None) => return Err(t.fault("the first camera has no previous one")),
            (None, _) => None,
        };
        if let (Some((_, chain, at)), Some(this), Some((_, Some(before)))) =
            (&from_previous, &from_imu, &previous)
        {
            contents.warnings.extend(contradiction(at, chain, this, before));
        }
        let placement = match (from_previous, from_imu) {
            (Some((a, b_from_a, _)), _) => Some(Placement { b: name.clone(), a, b_from_a, covariance: None }),
            (None, Some(b_from_a)) => {
                Some(Placement { b: name.clone(), a: "imu".into(), b_from_a, covariance: None })
            }
            (None, None) => None,
        };
        if let Some(cam_from_imu) = from_imu.filter(|_| entry.has("T_cam_imu")) {
            contents.notes.push(other_reading(&name, &cam_from_imu));
        }
        previous = Some((name.clone(), from_imu));
        if let Some(shift) = entry.get("timeshift_cam_imu") {
            let (camera, offset_s) = (name.clone(), shift.number()?);
            contents.clocks.push(ClockOffset { camera, reference: "imu".into(), offset_s });
        }
        contents.cameras.push(NamedCamera::new(name, camera, placement));
    }
    Ok(contents)
}

/// `cam_from_imu`, from either direction's key.
fn imu_pose(entry: &Entry<'_>) -> Result<Option<Pose>, Fault> {
    match (entry.get("T_cam_imu"), entry.get("T_imu_cam")) {
        (Some(t), _) => checks::pose4x4(&t).map(Some),
        (None, Some(t)) => Ok(Some(checks::pose4x4(&t)?.inverse())),
        (None, None) => Ok(None),
    }
}

/// Numbers that distinguish the two for a person who knows the device.
fn other_reading(name: &str, cam_from_imu: &Pose) -> String {
    format!(
        "T_cam_imu puts {name} at {} m in the IMU's frame; were its numbers those of an OpenVINS T_imu_cam, {name} would \
            stand at {} m. Measure on the device which is true.",
        xyz(&cam_from_imu.origin()),
        xyz(&cam_from_imu.translation)
    )
}

/// The chain and the IMU poses say the same thing twice; when only the inverses agree, a key lies.
fn contradiction(at: &Entry<'_>, chain: &Pose, this: &Pose, before: &Pose) -> Option<String> {
    let agree = |a: &Pose, b: &Pose| {
        a.angle_to_rad(b) < 0.02
            && (a.translation - b.translation).norm() < 0.02 + 0.02 * b.translation.norm()
    };
    let line = at.node.line;
    if agree(chain, &(*this * before.inverse())) {
        None
    } else if agree(chain, &(this.inverse() * *before)) {
        Some(format!(
            "line {line}: T_cam_imu contradicts T_cn_cnm1 unless it is read as T_imu_cam; the key has the \
                wrong name (an OpenVINS copy?)"
        ))
    } else {
        Some(format!("line {line}: T_cn_cnm1 and the two IMU poses contradict each other; T_cn_cnm1 is used"))
    }
}

/// Also EuRoC's, which names its coefficients in full.
pub(super) fn camera_of(
    entry: &Entry<'_>,
    coefficients: &str,
    warnings: &mut Vec<String>,
) -> Result<Camera, Fault> {
    let size = checks::size_pair(&entry.need("resolution")?)?;
    let (intrinsics, lens, matrix) = lens_of(entry, coefficients)?;
    lens::camera(&intrinsics, &lens, matrix, Some(size), warnings)
}

/// The lens of a camera's entry, and the entry of its intrinsics; also of Kalibr's report.
pub(super) fn lens_of<'a>(
    entry: &Entry<'a>,
    coefficients: &str,
) -> Result<(Entry<'a>, LensNumbers, CameraMatrix), Fault> {
    let intrinsics = entry.need("intrinsics")?;
    let d = match entry.get(coefficients) {
        Some(d) => d.numbers()?,
        None => Vec::new(),
    };
    let at = entry.get(coefficients).unwrap_or_else(|| entry.clone());
    let model = entry.get("camera_model").map_or(Ok("pinhole"), |m| m.text())?;
    let distortion = match entry.get("distortion_model") {
        Some(word) => word.text()?,
        None => "none",
    };
    let (projection, matrix) = projection(entry, model, &intrinsics)?;
    let lens = with_distortion(entry, &at, projection, distortion, d)?;
    Ok((intrinsics, lens, matrix))
}

/// The model without its distortion, and fu fv pu pv, which come last.
fn projection(
    entry: &Entry<'_>,
    model: &str,
    intrinsics: &Entry<'_>,
) -> Result<(LensNumbers, CameraMatrix), Fault> {
    let (extra, meaning) = match model {
        "pinhole" => (0, "fu, fv, pu, pv"),
        "omni" => (1, "xi, fu, fv, pu, pv"),
        "eucm" => (2, "alpha, beta, fu, fv, pu, pv"),
        "ds" => (2, "xi, alpha, fu, fv, pu, pv"),
        other => {
            let reason = format!("unknown camera_model `{other}`; pinhole, omni, eucm and ds are read");
            return Err(entry.get("camera_model").unwrap_or_else(|| entry.clone()).fault(reason));
        }
    };
    let n = intrinsics.exactly(extra + 4, &format!("{model}: {meaning}"))?;
    let lens = match model {
        "omni" => LensNumbers::Omni { xi: n[0], k1k2p1p2: [0.0; 4] },
        "eucm" => LensNumbers::Eucm { alpha: n[0], beta: n[1] },
        "ds" => LensNumbers::DoubleSphere { xi: n[0], alpha: n[1] },
        _ => LensNumbers::Pinhole,
    };
    Ok((
        lens,
        CameraMatrix { fx_px: n[extra], fy_px: n[extra + 1], cx_px: n[extra + 2], cy_px: n[extra + 3] },
    ))
}

fn with_distortion(
    entry: &Entry<'_>,
    at: &Entry<'_>,
    projection: LensNumbers,
    word: &str,
    d: Vec<f64>,
) -> Result<LensNumbers, Fault> {
    let four = || {
        <[f64; 4]>::try_from(d.clone())
            .map_err(|d| at.fault(format!("holds {} coefficients; {word} takes 4", d.len())))
    };
    match (projection, word) {
        (projection, "none" | "") if d.iter().all(|x| *x == 0.0) => Ok(projection),
        (_, "none" | "") => Err(at.fault("has coefficients although distortion_model is none")),
        (LensNumbers::Pinhole, "radtan" | "radial-tangential" | "plumb_bob") => {
            Ok(LensNumbers::BrownConrady(four()?.to_vec()))
        }
        (LensNumbers::Pinhole, "equidistant" | "equi") => Ok(LensNumbers::KannalaBrandt(four()?)),
        (LensNumbers::Pinhole, "fov") => match d.as_slice() {
            [w_rad] => Ok(LensNumbers::Fov { w_rad: *w_rad }),
            many => Err(at.fault(format!("holds {} coefficients; fov takes 1", many.len()))),
        },
        (LensNumbers::Omni { xi, .. }, "radtan" | "radial-tangential") => {
            Ok(LensNumbers::Omni { xi, k1k2p1p2: four()? })
        }
        (projection, "radtan" | "radial-tangential" | "equidistant" | "equi" | "fov") => {
            let model = projection.model();
            Err(at.fault(format!(
                "distortion_model {word} on top of {model} is not supported; calibrate {model} with none"
            )))
        }
        (_, other) => {
            let reason =
                format!("unknown distortion_model `{other}`; radtan, equidistant, fov and none are read");
            Err(entry.get("distortion_model").unwrap_or_else(|| entry.clone()).fault(reason))
        }
    }
}

/// A chain cam0, cam1, …; poses between neighbours through whatever frames join them.
fn write(rig: &CameraFile) -> Written {
    let (cameras, frames) = (&rig.cameras, Frames::of_rig(rig));
    let mut out = String::new();
    for (i, camera) in cameras.iter().enumerate() {
        out += &format!("cam{i}:\n");
        let previous = i.checked_sub(1).and_then(|p| cameras.get(p));
        if let Some(pose) = previous.and_then(|p| frames.between(&camera.name, &p.name)) {
            out += &matrix("T_cn_cnm1", &pose);
        }
        if let Some(pose) = frames.between(&camera.name, "imu") {
            out += &matrix("T_cam_imu", &pose);
        }
        out += &intrinsics(camera, i)?;
        if let Some(clock) = rig.clocks.iter().find(|c| c.camera == camera.name && c.reference == "imu") {
            out += &format!("  timeshift_cam_imu: {}\n", number(clock.offset_s));
        }
    }
    Ok(OutFile::only("camchain.yaml", out))
}

fn matrix(key: &str, pose: &Pose) -> String {
    let rows: String = pose.matrix().iter().map(|row| format!("  - {}\n", list(row))).collect();
    format!("  {key}:\n{rows}")
}

fn intrinsics(camera: &NamedCamera, i: usize) -> Result<String, WriteError> {
    let numbers = numbers("Kalibr", camera)?;
    Ok([
        format!("  camera_model: {}\n", numbers.model),
        format!("  distortion_coeffs: {}\n", list(&numbers.coefficients)),
        format!("  distortion_model: {}\n", numbers.distortion),
        format!("  intrinsics: {}\n", list(&numbers.intrinsics)),
        format!("  resolution: [{}, {}]\n", numbers.size.width_px, numbers.size.height_px),
        format!("  rostopic: /cam{i}/image_raw\n"),
    ]
    .concat())
}

/// A camera in Kalibr's words, which EuRoC shares.
pub(super) struct KalibrNumbers {
    pub model: &'static str,
    pub intrinsics: Vec<f64>,
    pub distortion: &'static str,
    pub coefficients: Vec<f64>,
    pub size: ImageSize,
}

pub(super) fn numbers(format: &str, camera: &NamedCamera) -> Result<KalibrNumbers, WriteError> {
    let blamed = |reason: String| WriteError(format!("{}: {reason}", camera.name));
    let size = camera
        .camera
        .size
        .ok_or_else(|| blamed(format!("{format} needs the image size, which this camera has not")))?;
    let (k, lens) = lens::numbers_of(&camera.camera)?;
    let (model, mut intrinsics, distortion, coefficients) = kalibr_names(lens).map_err(|e| blamed(e.0))?;
    intrinsics.extend([k.fx_px, k.fy_px, k.cx_px, k.cy_px]);
    Ok(KalibrNumbers { model, intrinsics, distortion, coefficients, size })
}

type Names = (&'static str, Vec<f64>, &'static str, Vec<f64>);

fn kalibr_names(numbers: LensNumbers) -> Result<Names, WriteError> {
    Ok(match numbers {
        LensNumbers::Pinhole => ("pinhole", vec![], "none", vec![]),
        LensNumbers::BrownConrady(d) if d.len() == 4 || d[4..].iter().all(|x| *x == 0.0) => {
            ("pinhole", vec![], "radtan", d[..4].to_vec())
        }
        LensNumbers::BrownConrady(_) => {
            return Err(WriteError(
                "Kalibr's radtan has k1, k2, p1, p2 only, this camera has more; write opencv, ros or resight"
                    .into(),
            ));
        }
        LensNumbers::KannalaBrandt(d) => ("pinhole", vec![], "equidistant", d.to_vec()),
        LensNumbers::Fov { w_rad } => ("pinhole", vec![], "fov", vec![w_rad]),
        LensNumbers::Omni { xi, k1k2p1p2 } if k1k2p1p2 == [0.0; 4] => ("omni", vec![xi], "none", vec![]),
        LensNumbers::Omni { xi, k1k2p1p2 } => ("omni", vec![xi], "radtan", k1k2p1p2.to_vec()),
        LensNumbers::Eucm { alpha, beta } => ("eucm", vec![alpha, beta], "none", vec![]),
        LensNumbers::DoubleSphere { xi, alpha } => ("ds", vec![xi, alpha], "none", vec![]),
        LensNumbers::Photogrammetric(_) => {
            return Err(WriteError("Kalibr has no photogrammetric model; write resight".into()));
        }
    })
}
