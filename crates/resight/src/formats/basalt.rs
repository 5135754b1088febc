//! Basalt calibration JSON (cereal: everything below `value0`); T_imu_cam maps camera points into the IMU frame.

use super::document::{Document, Fault};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks};
use crate::core::Camera;
use crate::core::camera::{CameraMatrix, ImageSize};
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Basalt,
    words: &[],
    reads: Some(Reads {
        recognises: |document| document.root.get("value0").is_some_and(|v| v.get("intrinsics").is_some()),
        read,
        together: None,
    }),
    write: None,
    traps: &["T_imu_cam maps camera points into the IMU frame: the inverse of Kalibr's T_cam_imu. Its \
            quaternion is keyed qx, qy, qz, qw."],
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
        contents.cameras.push(NamedCamera { name, camera, placement });
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
