//! Writes a rig as a scene file for viewers of MCAP: cameras, their pyramids and error ellipsoids, targets in every view.
//!
//! The file contains Foxglove's schemas as Protocol Buffers. Foxglove draws all of it; other viewers that know these schemas show parts of it.
//! docs/report.md describes the contents.

pub mod around;
pub(crate) mod geometry;
mod protobuf;
mod schema;
mod shapes;

use crate::core::{Point, Pose};
use crate::recording::{RecordingError, Writer};
use crate::rig::RigRun;
use geometry::{Extent, TargetInView};
use nalgebra::Matrix3;
use shapes::{Join, Shapes, color_of};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Number of colours of cameras, which report pages use too: `c0` … in page.css.
pub(crate) const N_COLORS: usize = shapes::COLORS.len();
/// Views have names, not times: they follow each other at ten per second.
const VIEW_PERIOD_NS: u64 = 100_000_000;
/// Size of a chunk; a reader holds one chunk in memory at a time.
const CHUNK_BYTES: u64 = 1 << 18;
const RIG: &str = "rig";
const GREY: shapes::Rgba = [0.55, 0.57, 0.60, 1.0];

/// Returns the rig as an MCAP file, which `--scene FILE.mcap` writes. View k is at (k + 1) · 0.1 s; what does not move is at the first.
///
/// The frames are `rig`, `camera/NAME` and `target/NAME`; units are metres. The same run gives the same bytes.
///
/// # Errors
/// More cameras than the format has topic numbers for (65,535).
pub fn rig_scene(run: &RigRun) -> Result<Vec<u8>, RecordingError> {
    let targets = geometry::targets_in_views(run);
    let extent = geometry::extent(run, &targets);
    let mut file = Writer::new(Cursor::new(Vec::new()), "", CHUNK_BYTES)?;
    let topics = Topics::new(&mut file)?;
    let magnification = geometry::ellipse_magnification(run, &extent);
    cameras(&mut file, &topics, run, &extent, magnification)?;
    views(&mut file, &topics, run, &targets)?;
    file.metadata("resight", metadata(run, magnification))?;
    Ok(file.finish()?.into_inner())
}

type File = Writer<Cursor<Vec<u8>>>;

fn channel(file: &mut File, schema: u16, topic: &str) -> Result<u16, RecordingError> {
    file.channel(schema, topic, "protobuf", &BTreeMap::new())
}

struct Topics {
    transforms: u16,
    cameras: u16,
    targets: u16,
    points: u16,
    calibration: u16,
}

impl Topics {
    /// `calibration` is a schema, because every camera has a topic of its own; the others are topics.
    fn new(file: &mut File) -> Result<Self, RecordingError> {
        let mut schema =
            |root: &str| file.schema(&format!("foxglove.{root}"), "protobuf", &schema::descriptor_set(root));
        let transforms = schema("FrameTransforms")?;
        let scene = schema("SceneUpdate")?;
        let points = schema("PointCloud")?;
        let calibration = schema("CameraCalibration")?;
        Ok(Topics {
            transforms: channel(file, transforms, "/tf")?,
            cameras: channel(file, scene, "/cameras")?,
            targets: channel(file, scene, "/targets")?,
            points: channel(file, points, "/points")?,
            calibration,
        })
    }
}

fn time_ns(view: usize) -> u64 {
    (view as u64 + 1) * VIEW_PERIOD_NS
}

fn cameras(
    file: &mut File,
    topics: &Topics,
    run: &RigRun,
    extent: &Extent,
    magnification: f64,
) -> Result<(), RecordingError> {
    let time = time_ns(0);
    let frames = run.rig.cameras.iter().zip(&run.solution.cameras).map(|(named, placed)| {
        shapes::transform(time, RIG, &format!("camera/{}", named.name), &placed.cam_from_rig.inverse())
    });
    let transforms = protobuf::Message::new().messages(1, frames);
    file.message(topics.transforms, time, &transforms.into_bytes())?;
    for (i, named) in run.rig.cameras.iter().enumerate() {
        let frame = format!("camera/{}", named.name);
        let Some(calibration) = shapes::calibration(time, &frame, &run.rig.lenses[i]) else { continue };
        let topic = format!("/camera/{}/calibration", named.name);
        let channel = channel(file, topics.calibration, &topic)?;
        file.message(channel, time, &calibration.into_bytes())?;
    }
    for i in 0..run.rig.cameras.len() {
        let update = camera_shapes(run, i, extent, magnification);
        let entity = format!("camera/{}", run.rig.cameras[i].name);
        file.message(topics.cameras, time, &shapes::scene_update(time, RIG, &entity, update).into_bytes())?;
    }
    Ok(())
}

/// Returns pyramid, name, and the 95 % ellipsoid of the position, magnified.
fn camera_shapes(run: &RigRun, camera: usize, extent: &Extent, magnification: f64) -> Shapes {
    let placed = &run.solution.cameras[camera];
    let rig_from_cam = placed.cam_from_rig.inverse();
    let depth = geometry::pyramid_depth_m(extent);
    let area = geometry::image_area(&run.rig, camera);
    let border = geometry::border_in_cam(&run.rig.lenses[camera], &area);
    let border: Vec<Point> = border.iter().map(|x| x * depth).collect();
    let rgba = color_of(camera, 1.0);
    let corners = border.iter().step_by((border.len() / 4).max(1)).take(4);
    let edges: Vec<Point> = corners.flat_map(|x| [Point::zeros(), *x]).collect();
    let above = rig_from_cam * Point::new(0.0, -0.6 * depth, 0.0);
    let covariance = geometry::position_covariance(&placed.cam_from_rig, &placed.covariance);
    Shapes {
        spheres: ellipsoid(&rig_from_cam.translation, &covariance, magnification, camera)
            .into_iter()
            .collect(),
        lines: vec![
            shapes::line(Join::Loop, &rig_from_cam, &border, rgba),
            shapes::line(Join::Pairs, &rig_from_cam, &edges, rgba),
        ],
        texts: vec![shapes::text(&above, &run.rig.cameras[camera].name, rgba)],
    }
}

/// Returns `None` for the reference camera, which has no uncertainty.
fn ellipsoid(
    place: &Point,
    covariance: &Matrix3<f64>,
    magnification: f64,
    camera: usize,
) -> Option<protobuf::Message> {
    let axes = geometry::half_axes(covariance, geometry::CHI2_3_95.sqrt());
    let lengths = Point::from_fn(|i, _| axes.column(i).norm());
    if !(0.0 < lengths.z && lengths.x.is_finite()) {
        return None;
    }
    let [long, middle] = [0, 1].map(|i| axes.column(i) / lengths[i]);
    let rotation = Matrix3::from_columns(&[long, middle, long.cross(&middle)]);
    let rig_from_shape = Pose::new(rotation, *place);
    Some(shapes::ellipsoid(&rig_from_shape, &(lengths * (2.0 * magnification)), color_of(camera, 0.4)))
}

/// The message of each view contains all of that view, so that a viewer may jump to any time.
fn views(
    file: &mut File,
    topics: &Topics,
    run: &RigRun,
    targets: &[TargetInView],
) -> Result<(), RecordingError> {
    let points = geometry::target_points(&run.rig);
    let mut rest = targets;
    for view in 0..run.rig.views.len() {
        let here = rest.iter().take_while(|t| t.view == view).count();
        let (in_view, later) = rest.split_at(here);
        rest = later;
        let time = time_ns(view);
        let frames = in_view.iter().map(|t| {
            let name = format!("target/{}", run.rig.targets[t.target].name);
            shapes::transform(time, RIG, &name, &t.rig_from_target)
        });
        let transforms = protobuf::Message::new().messages(1, frames).into_bytes();
        file.message(topics.transforms, time, &transforms)?;
        let update = shapes::scene_update(time, RIG, "targets", target_shapes(run, view, in_view, &points));
        file.message(topics.targets, time, &update.into_bytes())?;
        let cloud: Vec<Point> =
            in_view.iter().flat_map(|t| points[t.target].iter().map(|x| t.rig_from_target * *x)).collect();
        file.message(topics.points, time, &shapes::point_cloud(time, RIG, &cloud).into_bytes())?;
    }
    Ok(())
}

/// Returns outlines and names of the targets, and a line from each camera to each target that it observed.
fn target_shapes(run: &RigRun, view: usize, in_view: &[TargetInView], points: &[Vec<Point>]) -> Shapes {
    let mut all = Shapes::default();
    for t in in_view {
        let points = &points[t.target];
        let corners: Vec<Point> = geometry::outline(points).into_iter().map(|i| points[i]).collect();
        all.lines.push(shapes::line(Join::Loop, &t.rig_from_target, &corners, GREY));
        let label = format!("{} · {}", run.rig.targets[t.target].name, run.rig.views[view]);
        all.texts.push(shapes::text(&t.rig_from_target.translation, &label, GREY));
        for (camera, place) in geometry::cameras_that_saw(run, view, t.target) {
            let ends = [place, t.rig_from_target * geometry::mean(points)];
            all.lines.push(shapes::line(Join::Pairs, &Pose::identity(), &ends, color_of(camera, 0.5)));
        }
    }
    all
}

fn metadata(run: &RigRun, magnification: f64) -> BTreeMap<String, String> {
    let own = |key: &str, value: String| (key.to_string(), value);
    let mut texts = BTreeMap::from([
        own("reference_camera", run.rig.cameras[run.solution.reference].name.clone()),
        own("ellipsoids", format!("95 % of each camera's position, magnified {magnification} times")),
        own("times", "views have no times here: view k is at (k + 1) * 0.1 s".into()),
    ]);
    texts.extend(run.command.iter().map(|line| own("command", line.clone())));
    texts.extend(run.inputs.iter().map(|f| own(&format!("sha256 {}", f.path), f.sha256.clone())));
    texts
}
