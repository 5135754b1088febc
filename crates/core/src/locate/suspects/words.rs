//! The faults in words: the name of each, and the correction that makes points agree.

use super::Fault;
use crate::camera::{Camera, CameraMatrix, ImageSize};

/// Returns the correction of one fault, or of two, in words: `with u and v exchanged …`. `camera` is the one as stated, and `label` names the point at an
/// index.
pub fn correction(
    faults: &[Fault],
    camera: Option<&Camera>,
    is_planar: bool,
    label: impl Fn(usize) -> String,
) -> String {
    let one = |fault: &Fault| fault.correction(camera, is_planar, &label);
    faults.iter().map(one).collect::<Vec<_>>().join(" and ")
}

impl Fault {
    /// Returns its name, as in JSON.
    pub fn name(&self) -> &'static str {
        match self {
            Fault::PixelsExchanged => "uv_exchanged",
            Fault::RowsUpwards => "v_upwards",
            Fault::ColumnsLeftwards => "u_leftwards",
            Fault::AxesExchanged => "xy_exchanged",
            Fault::AxisReversed => "axis_reversed",
            Fault::AxisUnit { .. } => "axis_unit",
            Fault::LabelsShifted { .. } => "labels_shifted",
            Fault::GridExchanged { .. } => "rows_columns_exchanged",
            Fault::LabelsExchanged { .. } => "labels_exchanged",
            Fault::OtherResolution { .. } => "other_resolution",
            Fault::CoefficientOrder => "coefficient_order",
            Fault::UndistortedAlready => "undistorted_already",
            Fault::OtherFocalLength { .. } => "other_focal_length",
            Fault::OtherCrop { .. } => "other_crop",
            Fault::Distorted { .. } => "distorted",
        }
    }

    fn correction(
        &self,
        camera: Option<&Camera>,
        is_planar: bool,
        label: impl Fn(usize) -> String,
    ) -> String {
        match self {
            Fault::PixelsExchanged => {
                "with u and v exchanged (u_px counts columns from the left, v_px rows from the top)".to_owned()
            }
            Fault::RowsUpwards => {
                "with v counted from the bottom of the image (v_px counts rows from the top: height − 1 − v)".to_owned()
            }
            Fault::ColumnsLeftwards => {
                "with u counted from the right, as in a mirrored image (u_px counts columns from the left: width − 1 − u)"
                    .to_owned()
            }
            Fault::AxesExchanged => "with two axes exchanged (northing and easting? y and z?)".to_owned(),
            Fault::AxisReversed => {
                "with the sign of one axis changed (left-handed coordinates, as of Unity and Unreal?)".to_owned()
            }
            Fault::AxisUnit { axis, factor } => in_other_unit(*axis, *factor),
            Fault::LabelsShifted { rows } => {
                format!("with each pixel moved to the row {} it", if 0 < *rows { "above" } else { "below" })
            }
            Fault::LabelsExchanged { a, b } => {
                format!("with the pixels of {} and {} exchanged", label(*a), label(*b))
            }
            Fault::GridExchanged { along_columns: true } => {
                "with the points of the grid numbered along its columns (they are stated along its rows)".to_owned()
            }
            Fault::GridExchanged { along_columns: false } => {
                "with as many columns as rows are stated, and as many rows as columns".to_owned()
            }
            _ => self.lens_correction(camera, is_planar),
        }
    }

    fn lens_correction(&self, camera: Option<&Camera>, is_planar: bool) -> String {
        match (self, camera.and_then(|camera| camera.size), camera.and_then(Camera::matrix)) {
            (Fault::OtherResolution { size }, Some(ImageSize { width_px, height_px }), _) => {
                let ImageSize { width_px: w, height_px: h } = size;
                format!(
                    "with pixels of images of {w} × {h} px, for which the intrinsics, stated for {width_px} × {height_px} px, are scaled"
                )
            }
            (Fault::OtherFocalLength { focal_px }, _, Some(CameraMatrix { fx_px, .. })) => format!(
                "with a focal length of {focal_px:.0} px instead of {fx_px:.0} px (another lens or zoom, or images of another size?)"
            ),
            (Fault::OtherCrop { principal_point_px: at }, _, Some(CameraMatrix { cx_px, cy_px, .. })) => {
                let (u, v) = (at.x, at.y);
                let plane = match is_planar {
                    true => "; points in one plane do not show which of the intrinsics are wrong",
                    false => "",
                };
                format!(
                    "with the principal point at ({u:.0}, {v:.0}) px instead of ({cx_px:.0}, {cy_px:.0}) px (intrinsics of another crop of the image?{plane})"
                )
            }
            (Fault::CoefficientOrder, ..) => {
                "with the coefficients in the order k1, k2, p1, p2 (they are stated as p1, p2, k1, k2)"
                    .to_owned()
            }
            (Fault::UndistortedAlready, ..) => {
                "without the distortion of the lens (pixels that were undistorted already?)".to_owned()
            }
            (Fault::Distorted { k1, k2 }, ..) => format!(
                "with the distortion k1 = {k1:.3}, k2 = {k2:.3} (of a lens that is stated to have none)"
            ),
            _ => "with other intrinsics".to_owned(),
        }
    }
}

fn in_other_unit(axis: usize, factor: f64) -> String {
    let axis = ["x", "y", "z"].get(axis).copied().unwrap_or("one axis");
    match 1.0 < factor {
        true => format!("with {axis} multiplied by 1000 (the other axes in millimetres?)"),
        false => format!("with {axis} divided by 1000 ({axis} in millimetres?)"),
    }
}
