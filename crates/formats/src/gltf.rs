//! The rig as glTF 2.0, written only: an image to turn around in any viewer.
//!
//! glTF has y up and cameras that look along −z (x right, y up). The frame of the rig is the top node, turned so that
//! it stands upright: a camera's frame by its own axes, any other is assumed to have z up. Each camera is a child whose
//! rotation and translation are root_from_cam, with a frustum of lines that goes through the true lens (the edge of
//! the image, bent where the lens bends it). Lenses that are nearly pinholes also get a perspective camera; a
//! principal point off the middle and distortion have no place there and stand in `extras`.

use super::lens::{self, LensNumbers};
use super::placed::{Placed, PlacedRig, cam_from_gl_cam, placed, size_of};
use super::{CameraFile, CameraFormat, Format, NamedCamera, OutFile, WriteError, Writer};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Bearing, Camera, Pixel, Point, Pose};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use nalgebra::{Matrix3, Vector3};
use serde_json::{Map, Value, json};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Gltf,
    words: &["gltf"],
    reads: None,
    write: Some(Writer::Rig(write)),
    traps: &[],
};

/// Points along each edge of the image: enough to show barrel and pincushion.
const PER_EDGE: usize = 8;
/// Depth of a frustum where no second camera gives the scale, m.
const DEPTH_M: f64 = 0.1;
/// A lens that sees farther off its axis than this has no flat image plane to draw (cosine).
const FLAT: f64 = 0.2;

/// Lines of one camera: points in OpenGL camera axes, and pairs of them.
struct Wires {
    points: Vec<[f32; 3]>,
    pairs: Vec<u16>,
}

fn write(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let rig = placed(file, Format::Gltf)?;
    let depth_m = depth_of(&rig);
    let mut wires = Vec::with_capacity(file.cameras.len());
    for camera in &file.cameras {
        let size = size_of(camera, "glTF")?;
        let lines = frustum(&camera.camera, size, depth_m).ok_or_else(|| {
            WriteError(format!(
                "{}: no point of the image's edge is in the lens model's valid field",
                camera.name
            ))
        })?;
        wires.push((lines, size));
    }
    Ok(OutFile::only("rig.gltf", document(&rig, &wires, depth_m)?.to_string() + "\n"))
}

/// A third of the smallest distance between two cameras.
fn depth_of(rig: &PlacedRig<'_>) -> f64 {
    let centres: Vec<Point> = rig.cameras.iter().map(|c| c.cam_from_root.origin()).collect();
    let mut least = f64::INFINITY;
    for (i, a) in centres.iter().enumerate() {
        for b in &centres[..i] {
            let away = (a - b).norm();
            if 0.0 < away && away < least {
                least = away;
            }
        }
    }
    if least.is_finite() { least / 3.0 } else { DEPTH_M }
}

/// The image's edge through the lens, and rays to its corners; none when the lens sees no part of the edge.
fn frustum(camera: &Camera, size: ImageSize, depth_m: f64) -> Option<Wires> {
    let (right, bottom) = (f64::from(size.width_px) - 0.5, f64::from(size.height_px) - 0.5);
    let corners = [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)];
    let edge: Vec<Option<Bearing>> = (0..4 * PER_EDGE)
        .map(|i| {
            let ((u0, v0), (u1, v1)) = (corners[i / PER_EDGE], corners[(i / PER_EDGE + 1) % 4]);
            let t = (i % PER_EDGE) as f64 / PER_EDGE as f64;
            camera.bearing(&Pixel::new(u0 + t * (u1 - u0), v0 + t * (v1 - v0))).ok()
        })
        .collect();
    let flat = edge.iter().flatten().all(|b| FLAT < b.z);
    let mut wires = Wires { points: vec![[0.0; 3]], pairs: Vec::new() };
    let index: Vec<Option<u16>> = edge
        .iter()
        .map(|bearing| {
            let x_in_cam =
                bearing.as_ref()?.into_inner() * (depth_m / if flat { bearing.as_ref()?.z } else { 1.0 });
            let x = cam_from_gl_cam().inverse() * x_in_cam;
            wires.points.push([x.x as f32, x.y as f32, x.z as f32]);
            Some((wires.points.len() - 1) as u16)
        })
        .collect();
    for i in 0..index.len() {
        if let (Some(a), Some(b)) = (index[i], index[(i + 1) % index.len()]) {
            wires.pairs.extend([a, b]);
        }
        if let (Some(corner), 0) = (index[i], i % PER_EDGE) {
            wires.pairs.extend([0, corner]);
        }
    }
    (1 < wires.points.len()).then_some(wires)
}

fn document(rig: &PlacedRig<'_>, wires: &[(Wires, ImageSize)], depth_m: f64) -> Result<Value, WriteError> {
    let mut bytes = Vec::new();
    let (mut views, mut accessors, mut meshes, mut cameras) = (vec![], vec![], vec![], vec![]);
    let mut nodes = vec![root_node(rig)];
    for (placed, (lines, size)) in rig.cameras.iter().zip(wires) {
        let (points, pairs) = (accessors.len(), accessors.len() + 1);
        accessors.extend([points_accessor(lines, points), pairs_accessor(lines, pairs)]);
        views.extend(views_of(lines, &mut bytes));
        let name = &placed.camera.name;
        let primitive = json!({ "attributes": { "POSITION": points }, "indices": pairs, "mode": 1 });
        meshes.push(json!({ "name": name, "primitives": [primitive] }));
        let mut node = camera_node(placed, *size)?;
        node.insert("mesh".into(), json!(meshes.len() - 1));
        if let Some(camera) = perspective(placed.camera, *size, depth_m)? {
            cameras.push(camera);
            node.insert("camera".into(), json!(cameras.len() - 1));
        }
        nodes.push(Value::Object(node));
    }
    let uri = format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&bytes));
    let mut top = json!({
        "asset": { "version": "2.0", "generator": "Resight" },
        "scene": 0,
        "scenes": [{ "name": "rig", "nodes": [0] }],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len(), "uri": uri }],
    });
    // glTF forbids empty lists.
    if !cameras.is_empty() {
        top["cameras"] = Value::Array(cameras);
    }
    Ok(top)
}

fn root_node(rig: &PlacedRig<'_>) -> Value {
    let r = if rig.root_is_camera {
        cam_from_gl_cam().rotation
    } else {
        Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0)
    };
    let children: Vec<usize> = (1..=rig.cameras.len()).collect();
    let rotation = xyzw(&Pose::new(r, Vector3::zeros()));
    json!({ "name": rig.root, "rotation": rotation, "children": children })
}

fn xyzw(pose: &Pose) -> [f64; 4] {
    let [w, x, y, z] = pose.quaternion_wxyz();
    [x, y, z, w]
}

fn camera_node(placed: &Placed<'_>, size: ImageSize) -> Result<Map<String, Value>, WriteError> {
    let pose = placed.root_from_gl_cam();
    let mut extras = Map::new();
    extras.insert("model".into(), json!(placed.camera.camera.model_name()));
    extras.insert("width_px".into(), json!(size.width_px));
    extras.insert("height_px".into(), json!(size.height_px));
    extras.extend(placed.camera.camera.parameters().iter().map(|(name, x)| ((*name).to_owned(), json!(x))));
    let mut node = Map::new();
    node.insert("name".into(), json!(placed.camera.name));
    node.insert("rotation".into(), json!(xyzw(&pose)));
    node.insert("translation".into(), json!(pose.translation.as_slice()));
    node.insert("extras".into(), Value::Object(extras));
    Ok(node)
}

/// The pinhole part of lenses that have one.
fn perspective(camera: &NamedCamera, size: ImageSize, depth_m: f64) -> Result<Option<Value>, WriteError> {
    let Some(CameraMatrix { fx_px, fy_px, .. }) = camera.camera.matrix() else { return Ok(None) };
    let (_, numbers) = lens::numbers_of(&camera.camera)?;
    if !matches!(numbers, LensNumbers::Pinhole | LensNumbers::BrownConrady(_)) {
        return Ok(None);
    }
    let (w, h) = (f64::from(size.width_px), f64::from(size.height_px));
    let view = json!({
        "yfov": 2.0 * (0.5 * h / fy_px).atan(),
        "aspectRatio": (w * fy_px) / (h * fx_px),
        "znear": 0.01 * depth_m,
    });
    Ok(Some(json!({ "name": camera.name, "type": "perspective", "perspective": view })))
}

/// glTF's numbers: 5126 float, 5123 unsigned short; 34962 vertices, 34963 indices.
fn points_accessor(lines: &Wires, view: usize) -> Value {
    let bound = |pick: fn(f32, f32) -> f32| {
        (0..3).map(|i| lines.points.iter().map(|p| p[i]).reduce(pick)).collect::<Vec<Option<f32>>>()
    };
    json!({ "bufferView": view, "componentType": 5126, "count": lines.points.len(), "type": "VEC3",
        "min": bound(f32::min), "max": bound(f32::max) })
}

fn pairs_accessor(lines: &Wires, view: usize) -> Value {
    json!({ "bufferView": view, "componentType": 5123, "count": lines.pairs.len(), "type": "SCALAR" })
}

fn views_of(lines: &Wires, bytes: &mut Vec<u8>) -> [Value; 2] {
    let start = bytes.len();
    bytes.extend(lines.points.iter().flatten().flat_map(|x| x.to_le_bytes()));
    let middle = bytes.len();
    bytes.extend(lines.pairs.iter().flat_map(|i| i.to_le_bytes()));
    let views = [
        json!({ "buffer": 0, "byteOffset": start, "byteLength": middle - start, "target": 34962 }),
        json!({ "buffer": 0, "byteOffset": middle, "byteLength": bytes.len() - middle, "target": 34963 }),
    ];
    // Floats must begin at multiples of four bytes.
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    views
}
