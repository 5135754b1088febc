//! KITTI calibration: the object and odometry benchmarks' `calib.txt`, and the raw data's `calib_cam_to_cam.txt`,
//! `calib_velo_to_cam.txt`, `calib_imu_to_velo.txt`.
//!
//! Cameras are rectified: all have the attitude of frame `rect`, and Pᵢ = Kᵢ [I | tᵢ] holds the place of camera i as
//! cam_i_from_rect = (I, Kᵢ⁻¹ p₄). The raw data's cameras before rectification (`S_0i`, `K_0i`, `D_0i` in OpenCV's order, `R_0i`, `T_0i` from
//! camera 0) are read as `FILE#cam0_unrectified` … `R0_rect` is rect_from_cam0 (cam0 before rectification), `Tr_velo_to_cam` is
//! cam0_from_velo, `Tr_imu_to_velo` velo_from_imu; the odometry benchmark's `Tr` is rect_from_velo. Metres; KITTI counts
//! pixels from 0, as we do.

use super::document::{Document, Fault, Syntax};
use super::emit::number;
use super::entry::Entry;
use super::frames::Frames;
use super::lens::{self, LensNumbers};
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    Written, checks, opencv,
};
use crate::core::Pose;
use crate::core::camera::{CameraMatrix, ImageSize};
use nalgebra::{Matrix3, Vector3};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Kitti,
    words: &["kitti"],
    reads: Some(Reads { recognises, read, together: None }),
    write: Some(Writer::Rig(write_object)),
    traps: &[
        "P holds K and the baseline times the focal length: the camera stands at −K⁻¹ p₄ in the rectified frame; P[0][3] is \
            not a length.",
        "Images and P are rectified: no distortion, one attitude for all cameras. Points of the laser scanner need R0_rect \
            too: x_rect = R0_rect · Tr_velo_to_cam · x_velo. The odometry benchmark's Tr already contains R0_rect.",
        "The files state no image size (raw: S_rect_00); it differs by a few pixels from drive to drive.",
    ],
};

/// The odometry benchmark's file; read by the row above.
pub(super) const ODOMETRY: CameraFormat = CameraFormat {
    format: Format::KittiOdometry,
    words: &["kitti-odometry"],
    reads: None,
    write: Some(Writer::Rig(write_odometry)),
    traps: FORMAT.traps,
};

const RECT: &str = "rect";
/// Camera 0 before rectification, to which laser and IMU are tied.
const CAM0: &str = "cam0_unrectified";
const VELO: &str = "velo";
const IMU: &str = "imu";

/// Key, frame b, frame a, numbers (9 for a rotation, 12 with a translation).
const RELATIONS: [(&str, &str, &str, usize); 7] = [
    ("R0_rect", RECT, CAM0, 9),
    ("R_rect_00", RECT, CAM0, 9),
    ("R_rect", RECT, CAM0, 9),
    ("Tr_velo_to_cam", CAM0, VELO, 12),
    ("Tr_velo_cam", CAM0, VELO, 12),
    ("Tr_imu_to_velo", VELO, IMU, 12),
    ("Tr", RECT, VELO, 12),
];

fn recognises(document: &Document) -> bool {
    let root = document.entry();
    let projection = |i: usize| root.has(&format!("P{i}")) || root.has(&format!("P_rect_0{i}"));
    let relation = root.has("Tr_velo_to_cam") || root.has("Tr_imu_to_velo");
    document.syntax == Syntax::Yaml && ((0..4).any(projection) || relation || is_raw_pose(&root))
}

/// `calib_velo_to_cam.txt`, `calib_imu_to_velo.txt`: a date, nine and three numbers in a line each.
fn is_raw_pose(root: &Entry<'_>) -> bool {
    root.has("calib_time") && root.has("R") && root.has("T")
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    for i in 0..4 {
        let raw = format!("P_rect_0{i}");
        if let Some(p) = root.first_of(&[&format!("P{i}"), &raw]) {
            let size = root.get(&format!("S_rect_0{i}")).map(|s| size(&s)).transpose()?;
            let camera = camera(&p, i, size, &mut contents.warnings)?;
            contents.cameras.push(camera);
        }
    }
    for i in 0..4 {
        unrectified(&root, i, &mut contents)?;
    }
    if !contents.spare.is_empty() {
        let name = &contents.spare[0].name;
        contents.notes.push(format!(
            "The cameras are those of the rectified images; lenses before rectification by name, FILE#{name} …"
        ));
    }
    for (key, b, a, n) in RELATIONS {
        if let Some(entry) = root.get(key)
            && contents.relations.iter().all(|p| (p.b.as_str(), p.a.as_str()) != (b, a))
        {
            contents.relations.push(relation(b, a, pose(&row(&entry, n)?, &entry)?));
        }
    }
    if is_raw_pose(&root) && contents.cameras.is_empty() {
        contents.relations.push(raw_pose(&root)?);
    }
    if contents.cameras.iter().any(|c| c.camera.size.is_none()) {
        contents.warnings.push("the file states no image size".into());
    }
    Ok(contents)
}

/// The lens before rectification, and its place against camera 0's.
fn unrectified(root: &Entry<'_>, i: usize, contents: &mut Contents) -> Result<(), Fault> {
    let key = |letter: &str| root.get(&format!("{letter}_0{i}"));
    let name = format!("cam{i}_unrectified");
    if let (Some(k), Some(d)) = (key("K"), key("D")) {
        let matrix = checks::without_skew(&k, &Matrix3::from_row_slice(&row(&k, 9)?))?;
        let lens = opencv::brown_conrady(&d, row(&d, 5)?)?;
        let size = key("S").map(|s| size(&s)).transpose()?;
        let camera = lens::camera(&k, &lens, matrix, size, &mut contents.warnings)?;
        contents.spare.push(NamedCamera::new(&name, camera, None));
    }
    if let (Some(r), Some(t)) = (key("R"), key("T"))
        && name != CAM0
    {
        let rotation = checks::rotation(&r, &Matrix3::from_row_slice(&row(&r, 9)?))?;
        let b_from_a = Pose::new(rotation, Vector3::from_row_slice(&row(&t, 3)?));
        contents.relations.push(relation(&name, CAM0, b_from_a));
    }
    Ok(())
}

fn relation(b: &str, a: &str, b_from_a: Pose) -> Placement {
    Placement { b: b.into(), a: a.into(), b_from_a, covariance: None }
}

/// Numbers of a line, separated by blanks.
fn row(at: &Entry<'_>, n: usize) -> Result<Vec<f64>, Fault> {
    let text = at.text().map_err(|_| at.fault(format!("holds one number; {n} are needed")))?;
    let mut numbers = Vec::new();
    for word in text.split_whitespace() {
        match word.parse::<f64>() {
            Ok(x) if x.is_finite() => numbers.push(x),
            _ => {
                let short: String = word.chars().take(40).collect();
                return Err(at.fault(format!("`{short}` is not a finite number")));
            }
        }
    }
    if numbers.len() != n {
        return Err(at.fault(format!("holds {} numbers; {n} are needed", numbers.len())));
    }
    Ok(numbers)
}

fn size(at: &Entry<'_>) -> Result<ImageSize, Fault> {
    let n = row(at, 2)?;
    let whole = |x: f64| 1.0 <= x && x.fract() == 0.0 && x <= f64::from(u32::MAX);
    if n.iter().all(|x| whole(*x)) {
        return Ok(ImageSize { width_px: n[0] as u32, height_px: n[1] as u32 });
    }
    Err(at.fault(format!("is {} {}; width and height in whole pixels are needed", n[0], n[1])))
}

/// Row by row, 3×3 or 3×4.
fn pose(n: &[f64], at: &Entry<'_>) -> Result<Pose, Fault> {
    let columns = n.len() / 3;
    let r = Matrix3::from_fn(|i, j| n[columns * i + j]);
    let t = if columns == 4 { Vector3::new(n[3], n[7], n[11]) } else { Vector3::zeros() };
    Ok(Pose::new(checks::rotation(at, &r)?, t))
}

fn raw_pose(root: &Entry<'_>) -> Result<Placement, Fault> {
    let (r, t) = (root.need("R")?, root.need("T")?);
    let rotation = checks::rotation(&r, &Matrix3::from_row_slice(&row(&r, 9)?))?;
    let b_from_a = Pose::new(rotation, Vector3::from_row_slice(&row(&t, 3)?));
    // Only the scanner's file says how it was optimised against the images.
    let (b, a) = if root.has("delta_f") { (CAM0, VELO) } else { (VELO, IMU) };
    Ok(relation(b, a, b_from_a))
}

fn camera(
    at: &Entry<'_>,
    i: usize,
    size: Option<ImageSize>,
    warnings: &mut Vec<String>,
) -> Result<NamedCamera, Fault> {
    let p = row(at, 12)?;
    let zero = [p[1], p[4], p[8], p[9], p[10] - 1.0];
    if zero.iter().any(|x| 1e-9 < x.abs()) || p[0] <= 0.0 || p[5] <= 0.0 {
        return Err(
            at.fault("is not [fx 0 cx a; 0 fy cy b; 0 0 1 c], row by row: a rectified projection is needed")
        );
    }
    let k = CameraMatrix { fx_px: p[0], fy_px: p[5], cx_px: p[2], cy_px: p[6] };
    let t = Vector3::new((p[3] - k.cx_px * p[11]) / k.fx_px, (p[7] - k.cy_px * p[11]) / k.fy_px, p[11]);
    let camera = lens::camera(at, &LensNumbers::Pinhole, k, size, warnings)?;
    let name = format!("cam{i}");
    let placement = relation(&name, RECT, Pose::new(Matrix3::identity(), t));
    Ok(NamedCamera::new(name, camera, Some(placement)))
}

/// Largest turn between cameras that rounding explains, radians.
const SAME_ATTITUDE_RAD: f64 = 1e-6;

/// P0 … of the cameras in order; the rectified frame is the rig's own, else the first camera's.
fn projections(rig: &CameraFile, format: Format) -> Result<(String, String), WriteError> {
    let n = rig.cameras.len();
    if 4 < n {
        return Err(WriteError(format!("a KITTI file holds P0 to P3, not {n} cameras; write resight")));
    }
    let frames = Frames::of_rig(rig);
    let rect = frames.common(&rig.cameras, &[RECT, rig.cameras[0].name.as_str()], format)?;
    let mut out = String::new();
    for (i, camera) in rig.cameras.iter().enumerate() {
        let cam_from_rect = frames.between(&camera.name, &rect).unwrap_or_else(Pose::identity);
        out += &line(&format!("P{i}"), &projection(camera, &cam_from_rect, &rect)?);
    }
    Ok((rect, out))
}

fn projection(camera: &NamedCamera, cam_from_rect: &Pose, rect: &str) -> Result<[f64; 12], WriteError> {
    let blamed = |reason: String| Err(WriteError(format!("{}: {reason}", camera.name)));
    let turn = cam_from_rect.angle_to_rad(&Pose::identity());
    if SAME_ATTITUDE_RAD < turn {
        return blamed(format!(
            "rotated by {:.4}° against `{rect}`, but KITTI's P holds rectified cameras of one attitude; rectify the images \
                first, or write kalibr",
            turn.to_degrees()
        ));
    }
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    if numbers != LensNumbers::Pinhole {
        return blamed(
            "has distortion, but KITTI's P holds rectified cameras; rectify the images first".into(),
        );
    }
    let t = cam_from_rect.translation;
    let column = [k.fx_px * t.x + k.cx_px * t.z, k.fy_px * t.y + k.cy_px * t.z, t.z];
    Ok([
        k.fx_px, 0.0, k.cx_px, column[0], //
        0.0, k.fy_px, k.cy_px, column[1], //
        0.0, 0.0, 1.0, column[2],
    ])
}

fn line(key: &str, numbers: &[f64]) -> String {
    let words: Vec<String> = numbers.iter().map(|x| number(*x)).collect();
    format!("{key}: {}\n", words.join(" "))
}

fn rows(pose: &Pose) -> Vec<f64> {
    pose.matrix()[..3].concat()
}

/// `R0_rect` is the identity where the rig knows no unrectified camera.
fn write_object(rig: &CameraFile) -> Written {
    let (rect, mut out) = projections(rig, Format::Kitti)?;
    let frames = Frames::of_rig(rig);
    let rect_from_cam0 = frames.between(&rect, CAM0).unwrap_or_else(Pose::identity);
    if rect_from_cam0.translation.norm() != 0.0 {
        return Err(WriteError(format!("`{CAM0}` stands apart from `{rect}`; R0_rect is a rotation only")));
    }
    let r: Vec<f64> = rect_from_cam0.rotation.transpose().iter().copied().collect();
    out += &line("R0_rect", &r);
    if let Some(rect_from_velo) = frames.between(&rect, VELO) {
        out += &line("Tr_velo_to_cam", &rows(&(rect_from_cam0.inverse() * rect_from_velo)));
    }
    if let Some(velo_from_imu) = frames.between(VELO, IMU) {
        out += &line("Tr_imu_to_velo", &rows(&velo_from_imu));
    }
    Ok(OutFile::only("calib.txt", out))
}

fn write_odometry(rig: &CameraFile) -> Written {
    let (rect, mut out) = projections(rig, Format::KittiOdometry)?;
    if let Some(rect_from_velo) = Frames::of_rig(rig).between(&rect, VELO) {
        out += &line("Tr", &rows(&rect_from_velo));
    }
    Ok(OutFile::only("calib.txt", out))
}
