//! What every format checks the same way: rotations, camera matrices, image sizes.

use super::document::Fault;
use super::entry::Entry;
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pose, Target};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Largest deviation of RᵀR from 1 that rounding to four decimals explains.
const ORTHONORMAL: f64 = 1e-3;
/// Deviation of a matrix written with all its digits; such a one is kept bit by bit.
const EXACT: f64 = 1e-14;
/// A skew that moves no pixel by more than this is none: solvers leave such remainders.
const SKEW_PX: f64 = 0.01;
/// Longest translation between cameras that is accepted as metres without a remark.
pub(super) const LONG_BASELINE_M: f64 = 20.0;

/// A rotation matrix, made orthonormal to rounding; refuses mirrors and what is not a rotation.
pub(super) fn rotation(at: &Entry<'_>, r: &Matrix3<f64>) -> Result<Matrix3<f64>, Fault> {
    let off = (r.transpose() * r - Matrix3::identity()).amax();
    // NaN fails too.
    if !(..=ORTHONORMAL).contains(&off) {
        let needed = "a rotation matrix has orthonormal rows (to 1e-3)";
        return Err(at.fault(format!("is not a rotation: RᵀR differs from 1 by {off:.1e}; {needed}")));
    }
    if r.determinant() < 0.0 {
        return Err(at.fault("is a mirror (determinant −1), not a rotation; one axis is flipped"));
    }
    if off <= EXACT {
        return Ok(*r);
    }
    Ok(Pose::from_quaternion_wxyz(Pose::new(*r, Vector3::zeros()).quaternion_wxyz(), Vector3::zeros())
        .rotation)
}

fn matrix3(m: &DMatrix<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m[(i, j)])
}

/// 3×3 rotation matrix.
pub(super) fn rotation_matrix(at: &Entry<'_>) -> Result<Matrix3<f64>, Fault> {
    rotation(at, &matrix3(&at.matrix(3, 3)?))
}

/// 3×3 rotation matrix, or a Rodrigues vector of three numbers (radians).
pub(super) fn rotation_matrix_or_vector(at: &Entry<'_>) -> Result<Matrix3<f64>, Fault> {
    let numbers = at.numbers()?;
    match numbers.as_slice() {
        [x, y, z] => rodrigues(at, Vector3::new(*x, *y, *z)),
        [_, _, _, _] => Err(at.fault(
            "is four numbers: a quaternion of unclear order; a 3×3 matrix or a rotation vector is needed",
        )),
        _ => rotation_matrix(at),
    }
}

/// Rotation of a vector axis · angle, radians.
pub(super) fn rodrigues(at: &Entry<'_>, w: Vector3<f64>) -> Result<Matrix3<f64>, Fault> {
    let turn = w.norm();
    if !(..=std::f64::consts::TAU).contains(&turn) {
        return Err(
            at.fault(format!("is a rotation by {turn:.3} rad, more than a full turn; is it in degrees?"))
        );
    }
    Ok(Pose::exp(&crate::core::Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation)
}

/// Three numbers.
pub(super) fn vector3(at: &Entry<'_>) -> Result<Vector3<f64>, Fault> {
    Ok(Vector3::from_row_slice(&at.exactly(3, "x, y, z")?))
}

/// Homogeneous 4×4 pose.
pub(super) fn pose4x4(at: &Entry<'_>) -> Result<Pose, Fault> {
    let m = at.matrix(4, 4)?;
    let last = [m[(3, 0)], m[(3, 1)], m[(3, 2)], m[(3, 3)]];
    if last != [0.0, 0.0, 0.0, 1.0] {
        if [0, 1, 2, 3].map(|i| m[(i, 3)]) == [0.0, 0.0, 0.0, 1.0] {
            return Err(at.fault(
                "is transposed: its last column is 0 0 0 1 and the translation stands in the last row; write the matrix row by row, with the translation in the last column",
            ));
        }
        return Err(at.fault(format!("has the last row {last:?}; a pose ends with 0 0 0 1")));
    }
    let r = Matrix3::from_fn(|i, j| m[(i, j)]);
    Ok(Pose::new(rotation(at, &r)?, Vector3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)])))
}

/// Pose as 4×4, or as 3×4 without the last row.
pub(super) fn pose3x4_or_4x4(at: &Entry<'_>) -> Result<Pose, Fault> {
    if at.numbers()?.len() != 12 {
        return pose4x4(at);
    }
    let m = at.matrix(3, 4)?;
    let r = Matrix3::from_fn(|i, j| m[(i, j)]);
    Ok(Pose::new(rotation(at, &r)?, Vector3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)])))
}

/// Pose from a quaternion already in the order w, x, y, z.
pub(super) fn quaternion_pose(
    at: &Entry<'_>,
    wxyz: [f64; 4],
    translation: Vector3<f64>,
) -> Result<Pose, Fault> {
    let norm = wxyz.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !(..=ORTHONORMAL).contains(&(norm - 1.0).abs()) {
        return Err(
            at.fault(format!("is a quaternion of length {norm:.4}; a rotation has length 1 (to 1e-3)"))
        );
    }
    Ok(Pose::from_quaternion_wxyz(wxyz, translation))
}

/// fx, fy, cx, cy of a 3×3 camera matrix without a skew that would move a pixel.
pub(super) fn camera_matrix(at: &Entry<'_>) -> Result<CameraMatrix, Fault> {
    without_skew(at, &matrix3(&at.matrix(3, 3)?))
}

/// As `camera_matrix`, of numbers that the file states otherwise.
pub(super) fn without_skew(at: &Entry<'_>, k: &Matrix3<f64>) -> Result<CameraMatrix, Fault> {
    if k.iter().all(|x| *x == 0.0) {
        return Err(at.fault("holds zeros: this camera was never calibrated; calibrate it (resight intrinsics) and give that file"));
    }
    // Rows that are as far from the principal point as it is from row 0, and half as far again.
    let moved_px = 1.5 * (k[(0, 1)] * k[(1, 2)] / k[(1, 1)]).abs();
    if k[(0, 1)] != 0.0 && !(moved_px <= SKEW_PX) {
        return Err(at.fault(format!(
            "has skew {} (row 1, column 2), which moves pixels by {moved_px:.2} px; only cameras without skew (up to {SKEW_PX} px) are \
            supported",
            k[(0, 1)]
        )));
    }
    let rest = [k[(1, 0)], k[(2, 0)], k[(2, 1)], k[(2, 2)] - 1.0];
    if rest.iter().any(|x| 1e-9 < x.abs()) {
        return Err(at.fault("is not a camera matrix; [fx 0 cx; 0 fy cy; 0 0 1] is needed, row by row"));
    }
    Ok(CameraMatrix { fx_px: k[(0, 0)], fy_px: k[(1, 1)], cx_px: k[(0, 2)], cy_px: k[(1, 2)] })
}

/// Width and height, two positive whole numbers.
pub(super) fn size_pair(at: &Entry<'_>) -> Result<ImageSize, Fault> {
    let items = at.items()?;
    match items.as_slice() {
        [width, height] => Ok(ImageSize { width_px: width.count(1)?, height_px: height.count(1)? }),
        _ => Err(at.fault(format!("holds {} numbers; width and height are needed", items.len()))),
    }
}

/// A translation that would be tens of metres in metres is probably in millimetres.
pub(super) fn unit_warning(what: &str, length: f64) -> Option<String> {
    (LONG_BASELINE_M < length).then(|| {
        format!(
            "{what} is {length:.1} long; the file states no unit and it is read as metres. If it \
            is in millimetres, divide by 1000"
        )
    })
}

/// Why a `line_plus_one` target is a poor choice, with the way out.
pub(super) fn critical_plane_warning(target: &Target) -> Option<String> {
    let Target::LinePlusOne(t) = target.design() else { return None };
    let ratio = t.foot_ratio();
    (0.2 < ratio && ratio < 0.8).then(|| {
        let min = t.line_m.iter().copied().fold(f64::INFINITY, f64::min);
        format!(
            "the fourth point stands over the middle of the line ({:.0} % of its length). A camera \
                anywhere near the plane through the fourth point across the line sees two poses alike and \
                cannot tell which is true. Put the fourth point over an end, e.g. off_m = [{min}, {}]",
            100.0 * ratio,
            t.off_m[1]
        )
    })
}

/// Why poses of a board that looks the same after a rotation are ambiguous, with the way out.
pub fn symmetry_warning(target: &Target) -> Option<String> {
    let (rotation, poses) = match target.alike() {
        4 => ("a quarter of a turn", "four"),
        2 => ("half a turn", "two"),
        _ => return None,
    };
    let board = match target.design() {
        Target::Chessboard(t) => format!("a chessboard of {} × {} inner corners", t.rows, t.columns),
        Target::CircleGrid(t) => format!(
            "{} circle grid of {} rows × {} columns",
            if t.asymmetric { "an asymmetric" } else { "a symmetric" },
            t.rows,
            t.columns
        ),
        _ => return None,
    };
    let instead = unambiguous_instead(target);
    Some(format!(
        "{board} looks the same after {rotation}, so each view has {poses} poses, of which only what you know chooses \
            (intrinsics do not depend on it; `watch`, `rig` and `hand-eye` take the one that is upright in the image). Take {instead}"
    ))
}

/// The target to take instead of one that looks the same after a rotation.
pub fn unambiguous_instead(target: &Target) -> &'static str {
    match target.design() {
        Target::CircleGrid(_) => {
            "an asymmetric grid with an odd number of rows, such as 11 rows × 4 columns, or a ChArUco board"
        }
        _ => "a board with an odd and an even number of corners, such as 6 × 9, or a ChArUco board",
    }
}

/// The camera for images of this size: itself when the size agrees, scaled when the images are a uniform enlargement
/// or reduction of the calibrated size (pixel centres kept), refused when the aspect differs.
pub fn check_image_size(camera: &Camera, width_px: u32, height_px: u32) -> Result<Camera, String> {
    let images = ImageSize { width_px, height_px };
    let (w, h) = (width_px, height_px);
    match camera.size {
        None => Ok(Camera { size: Some(images), ..camera.clone() }),
        Some(calibrated) if calibrated == images => Ok(camera.clone()),
        Some(ImageSize { width_px, height_px }) => camera.scaled_to(w, h).map_err(|_| {
            let reason = match camera.scaled_to(h, w) {
                Ok(_) => {
                    "they are rotated by 90°; take them as the sensor reads them (EXIF orientation ignored), or calibrate on rotated ones"
                }
                Err(_) => "another aspect, so they are cropped or from another camera; calibrate at this size or undo the crop",
            };
            format!("the camera was calibrated for {width_px}×{height_px} px, the images have {w}×{h}: {reason}")
        }),
    }
}
