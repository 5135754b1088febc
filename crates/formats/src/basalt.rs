//! Basalt calibration JSON (cereal: everything below `value0`); T_imu_cam maps camera points into the IMU frame.

use super::document::{Document, Fault};
use super::emit::{list, number};
use super::entry::Entry;
use super::frames::Frames;
use super::lens::{self, LensNumbers};
use super::{
    CameraFile, CameraFormat, ClockOffset, Contents, Format, NamedCamera, OutFile, Placement, Reads,
    WriteError, Writer, Written, checks,
};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pose};
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Basalt,
    words: &["basalt"],
    reads: Some(Reads {
        recognises: |document| document.root.get("value0").is_some_and(|v| v.get("intrinsics").is_some()),
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "T_imu_cam maps camera points into the IMU frame: the inverse of Kalibr's T_cam_imu. Its quaternion is keyed \
            qx, qy, qz, qw.",
        "A file that Resight writes holds zero IMU biases and Basalt's own default noise, because Basalt refuses a \
            file without them; calibrate the IMU before relying on them.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry().need("value0")?;
    let mut contents = Contents::default();
    let cameras = root.need("intrinsics")?.items()?;
    let sizes = root.need("resolution")?;
    let poses = root.get("T_imu_cam").map(|p| p.items()).transpose()?;
    let seen = sizes.items()?.len();
    if seen != cameras.len() {
        return Err(sizes.fault(format!("has {seen} sizes for {} cameras", cameras.len())));
    }
    for (i, (entry, size)) in cameras.iter().zip(sizes.items()?).enumerate() {
        let name = format!("cam{i}");
        let camera = one_camera(entry, checks::size_pair(&size)?, &mut contents.warnings)?;
        let placement = match &poses {
            None => None,
            Some(poses) => Some(placement(&root, poses.get(i), &name)?),
        };
        contents.cameras.push(NamedCamera::new(name, camera, placement));
    }
    // Basalt adds it to the images' time stamps: one offset for all cameras.
    let offset_s = root.get("cam_time_offset_ns").map_or(Ok(0.0), |ns| ns.number())? * 1e-9;
    if offset_s != 0.0 {
        let clock =
            |c: &NamedCamera| ClockOffset { camera: c.name.clone(), reference: "imu".into(), offset_s };
        contents.clocks = contents.cameras.iter().map(clock).collect();
    }
    Ok(contents)
}

fn one_camera(entry: &Entry<'_>, size: ImageSize, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let kind = entry.need("camera_type")?;
    let n = entry.need("intrinsics")?;
    let get = |key: &str| n.need(key)?.number();
    let lens =
        match kind.text()? {
            "pinhole" => LensNumbers::Pinhole,
            "kb4" => LensNumbers::KannalaBrandt([get("k1")?, get("k2")?, get("k3")?, get("k4")?]),
            "ds" => LensNumbers::DoubleSphere { xi: get("xi")?, alpha: get("alpha")? },
            "eucm" => LensNumbers::Eucm { alpha: get("alpha")?, beta: get("beta")? },
            // The unified model is the enhanced one with β = 1.
            "ucm" => LensNumbers::Eucm { alpha: get("alpha")?, beta: 1.0 },
            "fov" => LensNumbers::Fov { w_rad: get("w")? },
            "pinhole-radtan8" => {
                let keys = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
                LensNumbers::BrownConrady(keys.into_iter().map(get).collect::<Result<_, _>>()?)
            }
            other => return Err(kind.fault(format!(
                "unknown camera_type `{other}`; pinhole, pinhole-radtan8, kb4, ds, eucm, ucm and fov are read"
            ))),
        };
    let matrix = CameraMatrix { fx_px: get("fx")?, fy_px: get("fy")?, cx_px: get("cx")?, cy_px: get("cy")? };
    lens::camera(&n, &lens, matrix, Some(size), warnings)
}

fn placement(root: &Entry<'_>, pose: Option<&Entry<'_>>, name: &str) -> Result<Placement, Fault> {
    let pose = pose.ok_or_else(|| root.fault(format!("T_imu_cam has no pose for {name}")))?;
    let get = |key: &str| pose.need(key)?.number();
    let wxyz = [get("qw")?, get("qx")?, get("qy")?, get("qz")?];
    let translation = Vector3::new(get("px")?, get("py")?, get("pz")?);
    Ok(Placement {
        b: "imu".into(),
        a: name.to_owned(),
        b_from_a: checks::quaternion_pose(pose, wxyz, translation)?,
        covariance: None,
    })
}

/// Basalt reads no file without the IMU's numbers: biases are written as zero, noises as Basalt's own defaults.
const IMU: [(&str, &str); 7] = [
    ("calib_accel_bias", "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"),
    ("calib_gyro_bias", "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"),
    ("imu_update_rate", "200.0"),
    ("accel_noise_std", "[0.016, 0.016, 0.016]"),
    ("gyro_noise_std", "[0.000282, 0.000282, 0.000282]"),
    ("accel_bias_std", "[0.001, 0.001, 0.001]"),
    ("gyro_bias_std", "[0.0001, 0.0001, 0.0001]"),
];

fn write(rig: &CameraFile) -> Written {
    let frames = Frames::of_rig(rig);
    let imu = frames.common(&rig.cameras, &["imu", "body"], Format::Basalt)?;
    let (mut poses, mut lenses, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
    for camera in &rig.cameras {
        let imu_from_cam = frames.between(&imu, &camera.name).unwrap_or_else(Pose::identity);
        poses.push(pose_text(&imu_from_cam));
        lenses.push(lens_text(camera)?);
        let size = camera.camera.size.ok_or_else(|| {
            WriteError(format!("{}: Basalt needs the image size, which this camera has not", camera.name))
        })?;
        sizes.push(format!("[{}, {}]", size.width_px, size.height_px));
    }
    let block = |key: &str, items: &[String]| {
        format!("    \"{key}\": [\n      {}\n    ],\n", items.join(",\n      "))
    };
    let imu: String = IMU.map(|(key, value)| format!("    \"{key}\": {value},\n")).concat();
    let text = [
        "{\n  \"value0\": {\n".to_owned(),
        block("T_imu_cam", &poses),
        block("intrinsics", &lenses),
        block("resolution", &sizes),
        imu,
        format!("    \"cam_time_offset_ns\": {},\n", offset_ns(rig)?),
        "    \"vignette\": []\n  }\n}\n".to_owned(),
    ];
    Ok(OutFile::only("calibration.json", text.concat()))
}

fn pose_text(pose: &Pose) -> String {
    let [w, x, y, z] = pose.quaternion_wxyz();
    let t = pose.translation;
    let pairs = [("px", t.x), ("py", t.y), ("pz", t.z), ("qx", x), ("qy", y), ("qz", z), ("qw", w)];
    object(&pairs)
}

fn object(pairs: &[(&str, f64)]) -> String {
    let parts: Vec<String> = pairs.iter().map(|(key, x)| format!("\"{key}\": {}", number(*x))).collect();
    format!("{{{}}}", parts.join(", "))
}

/// One offset for all cameras, in whole nanoseconds.
fn offset_ns(rig: &CameraFile) -> Result<i64, WriteError> {
    let of = |name: &str| rig.clocks.iter().find(|c| c.camera == name && c.reference == "imu");
    let offsets: Vec<f64> = rig.cameras.iter().map(|c| of(&c.name).map_or(0.0, |c| c.offset_s)).collect();
    if offsets.iter().any(|x| *x != offsets[0]) {
        let ms: Vec<f64> = offsets.iter().map(|x| 1e3 * x).collect();
        let said = list(&ms);
        return Err(WriteError(format!(
            "Basalt has one clock offset for all cameras, these differ: {said} ms"
        )));
    }
    Ok((offsets[0] * 1e9).round() as i64)
}

fn lens_text(camera: &NamedCamera) -> Result<String, WriteError> {
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let refuse =
        |what: &str| Err(WriteError(format!("{}: Basalt has no {what}; write resight", camera.name)));
    const BROWN: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
    let (kind, more): (&str, Vec<(&str, f64)>) = match &numbers {
        LensNumbers::Pinhole => ("pinhole", vec![]),
        LensNumbers::KannalaBrandt(d) => ("kb4", THETA.iter().copied().zip(d.iter().copied()).collect()),
        LensNumbers::DoubleSphere { xi, alpha } => ("ds", vec![("xi", *xi), ("alpha", *alpha)]),
        LensNumbers::Eucm { alpha, beta } => ("eucm", vec![("alpha", *alpha), ("beta", *beta)]),
        LensNumbers::Fov { w_rad } => ("fov", vec![("w", *w_rad)]),
        LensNumbers::BrownConrady(d) if d.iter().skip(8).all(|x| *x == 0.0) => {
            let values = d.iter().copied().chain(std::iter::repeat(0.0));
            // rpmax 0: Basalt itself works out how far from the axis the polynomial holds.
            let all = BROWN.iter().copied().zip(values).chain([("rpmax", 0.0)]);
            ("pinhole-radtan8", all.collect())
        }
        LensNumbers::BrownConrady(_) => return refuse("thin-prism or tilt terms"),
        other => return refuse(&format!("{} model", other.model())),
    };
    let matrix = [("fx", k.fx_px), ("fy", k.fy_px), ("cx", k.cx_px), ("cy", k.cy_px)];
    let body = object(&[&matrix[..], &more[..]].concat());
    Ok(format!("{{\"camera_type\": \"{kind}\", \"intrinsics\": {body}}}"))
}

/// Coefficients of the fisheye polynomial.
const THETA: [&str; 4] = ["k1", "k2", "k3", "k4"];
