//! A Python script that makes the cameras in Blender, written only.
//!
//! Blender's camera is OpenGL's (x right, y up, looking along −z) and its world has z up. The frame of the rig becomes
//! an empty, its cameras the empty's children: their own matrices are root_from_cam. Where the rig's frame is a
//! camera's the empty is rotated so that this camera looks along +y with z up; other frames are assumed to have z up. Every
//! camera has a scene of its own, because image size and pixel aspect belong to Blender's scenes.
//!
//! With the sensor width as unit: lens = fx · sensor / w, shift_x = (w/2 − (cx + ½)) / m, shift_y = ((cy + ½) − h/2) / m
//! times the pixel's aspect, where m is the side that `sensor_fit` names: always HORIZONTAL, so m = w.

use super::emit::{list, number, quoted};
use super::lens::{self, LensNumbers};
use super::placed::{Placed, placed, size_of};
use super::{CameraFile, CameraFormat, Format, OutFile, WriteError, Writer};
use crate::core::Pose;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Blender,
    words: &["blender"],
    reads: None,
    write: Some(Writer::Rig(write)),
    traps: &[],
};

/// Any width will do, since the lens is given in the same unit; Blender's own default, mm.
const SENSOR_MM: f64 = 36.0;

fn write(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let rig = placed(file, Format::Blender)?;
    let rows = rig.cameras.iter().map(camera_text).collect::<Result<Vec<String>, WriteError>>()?;
    let turn = if rig.root_is_camera { upright_from_cam() } else { Pose::identity() };
    let values = format!(
        "ROOT = {}\nUPRIGHT_FROM_ROOT = {}\nSENSOR_MM = {}\nCAMERAS = [\n{}]\n",
        quoted(&rig.root),
        matrix(&turn),
        number(SENSOR_MM),
        rows.concat()
    );
    let text = [HEAD, &values, TAIL].concat();
    Ok(OutFile::only("blender_cameras.py", text))
}

/// x right, y forward, z up from our x right, y down, z forward.
fn upright_from_cam() -> Pose {
    let r = nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    Pose::new(r, nalgebra::Vector3::zeros())
}

fn camera_text(placed: &Placed<'_>) -> Result<String, WriteError> {
    let camera = placed.camera;
    let size = size_of(camera, "Blender")?;
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let distortion = match &numbers {
        LensNumbers::Pinhole => vec![],
        LensNumbers::BrownConrady(d) => d.clone(),
        other => {
            return Err(WriteError(format!(
                "{}: Blender's camera is a pinhole, it has no {} model; undistort the images and write their new \
                    camera matrix",
                camera.name,
                other.model()
            )));
        }
    };
    let (w, h) = (f64::from(size.width_px), f64::from(size.height_px));
    // Blender wants both aspects at least 1; only their ratio, height over width of a pixel, counts.
    let aspect = k.fx_px / k.fy_px;
    let (aspect_x, aspect_y) = if aspect < 1.0 { (1.0 / aspect, 1.0) } else { (1.0, aspect) };
    let shift_x = (0.5 * w - k.cx_px - 0.5) / w;
    let shift_y = (k.cy_px + 0.5 - 0.5 * h) * aspect / w;
    Ok([
        format!("    dict(\n        name={},\n", quoted(&camera.name)),
        format!("        root_from_cam={},\n", matrix(&placed.root_from_gl_cam())),
        format!(
            "        lens={},\n        shift=({}, {}),\n",
            number(k.fx_px * SENSOR_MM / w),
            number(shift_x),
            number(shift_y)
        ),
        format!("        size=({}, {}),\n", size.width_px, size.height_px),
        format!("        aspect=({}, {}),\n", number(aspect_x), number(aspect_y)),
        format!("        distortion={},\n    ),\n", list(&distortion)),
    ]
    .concat())
}

fn matrix(b_from_a: &Pose) -> String {
    format!("[{}]", b_from_a.matrix().map(|row| list(&row)).join(", "))
}

const HEAD: &str = r#"# Makes calibrated cameras in Blender: Scripting, Open, Run Script (or `blender --python THIS_FILE`).
# Lengths in metres. A camera looks along its own -z, y is up. Each camera has a scene with its image size.
import bpy
from mathutils import Matrix

"#;

const TAIL: &str = r#"

def make(root, collection, c):
    data = bpy.data.cameras.new(c["name"])
    data.type = "PERSP"
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_MM
    data.lens = c["lens"]
    data.shift_x, data.shift_y = c["shift"]
    # Blender renders without distortion: undistort the images, or put these numbers into a compositor.
    data["brown_conrady"] = c["distortion"]
    if any(c["distortion"]):
        print(c["name"] + ": Blender does not apply the lens distortion; it is kept as a property of the camera")
    camera = bpy.data.objects.new(c["name"], data)
    camera.parent = root
    camera.matrix_parent_inverse = Matrix()
    camera.matrix_basis = Matrix(c["root_from_cam"])
    collection.objects.link(camera)
    return camera


def show(collection, camera, c):
    scene = bpy.data.scenes.new(c["name"])
    scene.collection.children.link(collection)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = c["size"]
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = c["aspect"]


def main():
    collection = bpy.data.collections.new(ROOT)
    bpy.context.scene.collection.children.link(collection)
    root = bpy.data.objects.new(ROOT, None)
    root.matrix_basis = Matrix(UPRIGHT_FROM_ROOT)
    collection.objects.link(root)
    for c in CAMERAS:
        show(collection, make(root, collection, c), c)


main()
"#;
