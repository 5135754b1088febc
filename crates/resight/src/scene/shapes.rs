//! Foxglove's messages, field by field; the numbers are those of `schema.rs`.

use super::protobuf::Message;
use crate::core::camera::Lens;
use crate::core::{Camera, Point, Pose};

/// Red, green, blue and opacity, 0 to 1.
pub(super) type Rgba = [f64; 4];

/// Okabe and Ito's colours without black, which can be distinguished with every kind of colour vision. The report page uses the same.
pub(super) const COLORS: [[f64; 3]; 7] = [
    [0.0, 0.447, 0.698],
    [0.835, 0.369, 0.0],
    [0.0, 0.620, 0.451],
    [0.8, 0.475, 0.655],
    [0.902, 0.624, 0.0],
    [0.337, 0.706, 0.914],
    [0.780, 0.740, 0.120],
];

/// Returns the colour of a camera.
pub(super) fn color_of(camera: usize, opacity: f64) -> Rgba {
    let [r, g, b] = COLORS[camera % COLORS.len()];
    [r, g, b, opacity]
}

pub(super) fn timestamp(time_ns: u64) -> Message {
    Message::new().integer(1, time_ns / 1_000_000_000).integer(2, time_ns % 1_000_000_000)
}

fn vector(x: &Point) -> Message {
    Message::new().double(1, x.x).double(2, x.y).double(3, x.z)
}

fn quaternion(parent_from_child: &Pose) -> Message {
    let [w, x, y, z] = parent_from_child.quaternion_wxyz();
    Message::new().double(1, x).double(2, y).double(3, z).double(4, w)
}

fn pose(parent_from_child: &Pose) -> Message {
    Message::new()
        .message(1, &vector(&parent_from_child.translation))
        .message(2, &quaternion(parent_from_child))
}

fn color(rgba: Rgba) -> Message {
    (1..).zip(rgba).fold(Message::new(), |color, (field, value)| color.double(field, value))
}

/// Returns a `FrameTransform`: translation and rotation of the child frame in the parent, so x_in_parent = parent_from_child · x_in_child.
pub(super) fn transform(time_ns: u64, parent: &str, child: &str, parent_from_child: &Pose) -> Message {
    Message::new()
        .message(1, &timestamp(time_ns))
        .text(2, parent)
        .text(3, child)
        .message(4, &vector(&parent_from_child.translation))
        .message(5, &quaternion(parent_from_child))
}

/// The primitives of a `SceneEntity`.
#[derive(Default)]
pub(super) struct Shapes {
    pub spheres: Vec<Message>,
    pub lines: Vec<Message>,
    pub texts: Vec<Message>,
}

/// Returns a `SceneUpdate` with one entity, which replaces the earlier one of the same name.
pub(super) fn scene_update(time_ns: u64, frame: &str, id: &str, shapes: Shapes) -> Message {
    let entity = Message::new()
        .message(1, &timestamp(time_ns))
        .text(2, frame)
        .text(3, id)
        .integer(5, 1)
        .messages(9, shapes.spheres)
        .messages(11, shapes.lines)
        .messages(13, shapes.texts);
    Message::new().message(2, &entity)
}

/// How the points of a `LinePrimitive` are connected.
#[derive(Clone, Copy)]
pub(super) enum Join {
    Loop = 1,
    Pairs = 2,
}

/// Returns a `LinePrimitive`, 2 px wide at any distance; points in the frame of the pose.
pub(super) fn line(join: Join, frame_from_shape: &Pose, points: &[Point], rgba: Rgba) -> Message {
    Message::new()
        .integer(1, join as u64)
        .message(2, &pose(frame_from_shape))
        .double(3, 2.0)
        .flag(4, true)
        .messages(5, points.iter().map(vector))
        .message(6, &color(rgba))
}

/// Returns a `SpherePrimitive`: an ellipsoid with these diameters along the axes of its pose, m.
pub(super) fn ellipsoid(frame_from_shape: &Pose, diameters_m: &Point, rgba: Rgba) -> Message {
    Message::new()
        .message(1, &pose(frame_from_shape))
        .message(2, &vector(diameters_m))
        .message(3, &color(rgba))
}

/// Returns a `TextPrimitive` that always faces the viewer, 14 px high.
pub(super) fn text(place: &Point, text: &str, rgba: Rgba) -> Message {
    Message::new()
        .message(1, &pose(&Pose { translation: *place, ..Pose::identity() }))
        .flag(2, true)
        .double(3, 14.0)
        .flag(4, true)
        .message(5, &color(rgba))
        .text(6, text)
}

/// Returns a `PointCloud` of x, y, z as 32-bit floats.
pub(super) fn point_cloud(time_ns: u64, frame: &str, points: &[Point]) -> Message {
    const FLOAT32: u64 = 7;
    let field =
        |(offset, name): (u32, &str)| Message::new().text(1, name).fixed(2, offset).integer(3, FLOAT32);
    let data: Vec<u8> =
        points.iter().flat_map(|x| [x.x, x.y, x.z]).flat_map(|x| (x as f32).to_le_bytes()).collect();
    Message::new()
        .message(1, &timestamp(time_ns))
        .text(2, frame)
        .message(3, &pose(&Pose::identity()))
        .fixed(4, 12)
        .messages(5, [(0, "x"), (4, "y"), (8, "z")].map(field))
        .bytes(6, &data)
}

/// Returns a `CameraCalibration`; `None` for a camera without an image size, and for lens models that the schema cannot express.
pub(super) fn calibration(time_ns: u64, frame: &str, camera: &Camera) -> Option<Message> {
    let (model, coefficients) = match &camera.lens {
        Lens::Pinhole(_) => ("plumb_bob", vec![0.0; 5]),
        Lens::BrownConrady(lens) => brown_conrady(lens.coefficients())?,
        Lens::KannalaBrandt(lens) => ("kannala_brandt", lens.coefficients().to_vec()),
        _ => return None,
    };
    let (size, m) = (camera.size?, camera.matrix()?);
    let k = [m.fx_px, 0.0, m.cx_px, 0.0, m.fy_px, m.cy_px, 0.0, 0.0, 1.0];
    let p = [m.fx_px, 0.0, m.cx_px, 0.0, 0.0, m.fy_px, m.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0];
    let message = Message::new()
        .message(1, &timestamp(time_ns))
        .fixed(2, size.width_px)
        .fixed(3, size.height_px)
        .text(4, model)
        .doubles(5, &coefficients)
        .doubles(6, &k)
        .doubles(7, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
        .doubles(8, &p)
        .text(9, frame);
    Some(message)
}

/// Names the model: five coefficients are `plumb_bob`, eight `rational_polynomial`; thin prism and tilt have no name there.
fn brown_conrady(coefficients: &[f64]) -> Option<(&'static str, Vec<f64>)> {
    let (used, beyond) = coefficients.split_at(coefficients.len().min(8));
    if beyond.iter().any(|c| *c != 0.0) {
        return None;
    }
    let (name, length) = if used.len() <= 5 { ("plumb_bob", 5) } else { ("rational_polynomial", 8) };
    let mut padded = used.to_vec();
    padded.resize(length, 0.0);
    Some((name, padded))
}
