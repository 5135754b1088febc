//! The scene file (TOML): photographs, control points, distances, planes, uprights and queries by name, every key with its unit.
//!
//! The keys are listed in docs/measuring.md. Unknown keys are refused, so that a misspelling does not silently select a default.

mod file;
mod saved;
mod rig;
mod build;

use crate::FileError;
use crate::core::multiview::network::{Constraint, NetworkCamera, NetworkProblem, Plane, Query};
use crate::core::{Camera, Point};
use crate::georeference::LocalFrame;
use crate::input::Kind;
use build::Builder;
use file::SceneFile;
use serde::Deserialize;
use std::path::{Path, PathBuf};

pub use rig::rig_scene;

/// The kinds of queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QueryKind {
    /// The distance between two points.
    Distance,
    /// The length along points.
    Polyline,
    /// The angle at the second of three points.
    Angle,
    /// The area of a polygon.
    Area,
    /// The heights of points above the plane.
    Height,
    /// The coordinates of points.
    Position,
}

impl QueryKind {
    /// Returns the name in the scene file.
    pub fn name(self) -> &'static str {
        match self {
            QueryKind::Distance => "distance",
            QueryKind::Polyline => "polyline",
            QueryKind::Angle => "angle",
            QueryKind::Area => "area",
            QueryKind::Height => "height",
            QueryKind::Position => "position",
        }
    }
}

/// A query with the names of its points.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedQuery {
    /// Its name in the table.
    pub name: String,
    /// The kind of the query.
    pub kind: QueryKind,
    /// Indices of its points.
    pub points: Vec<usize>,
}

/// A photograph of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenePhoto {
    /// Its name.
    pub name: String,
    /// The image, where one was given.
    pub file: Option<PathBuf>,
    /// Index into `NamedScene::cameras`.
    pub camera: usize,
}

/// A camera of a scene; photographs of one camera file share it and its errors.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneCamera {
    /// The lens.
    pub camera: Camera,
    /// Covariance of its parameters, row by row; `None` where they are exact.
    pub intrinsics_covariance: Option<Vec<f64>>,
}

/// A scene as input of the solver, with names.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedScene {
    /// Cameras.
    pub cameras: Vec<SceneCamera>,
    /// Photographs in file order.
    pub photos: Vec<ScenePhoto>,
    /// Camera of each photograph: what `NetworkProblem` takes.
    pub camera_of_photo: Vec<usize>,
    /// Names of the points, in the order they first appear: control points, distances, planes, uprights, image points.
    pub points: Vec<String>,
    /// Which points are control points: known by coordinates or mutual distances.
    pub is_control_point: Vec<bool>,
    /// The planes: a ground plane, if any, is plane 0; a level plane given by gravity is the last.
    pub planes: Vec<Plane>,
    /// Whether plane 0 is a ground plane with points on it.
    pub has_ground: bool,
    /// Everything known about the scene.
    pub constraints: Vec<Constraint>,
    /// The queries.
    pub queries: Vec<NamedQuery>,
    /// Added to every coordinate shown, because large coordinates are shifted towards zero for the computation, m.
    pub origin_m: Point,
    /// Standard deviation of image points where none is stated, px.
    pub sigma_px: f64,
    /// Limit for bird's-eye images: with a larger pixel size on the ground they are hatched, m.
    pub pixel_limit_m: f64,
    /// Limit for bird's-eye images: with a larger 95 % position error they are hatched, m.
    pub error_limit_m: f64,
    /// Whether the frame is that of a camera (z forward, y down) instead of a ground (z up).
    pub is_camera_frame: bool,
    /// Whether the file declares that its lengths are metres, however large they are.
    pub lengths_are_metres: bool,
    /// Where the frame is on the Earth, where the control points are given there: x east, y north, z the height.
    pub frame: Option<LocalFrame>,
    /// Remarks on the files of the cameras, in sentences.
    pub remarks: Vec<String>,
}

impl NamedScene {
    /// Returns the cameras as input of the solver.
    pub fn network_cameras(&self) -> Vec<NetworkCamera<'_>> {
        let mut cameras = Vec::with_capacity(self.cameras.len());
        for SceneCamera { camera, intrinsics_covariance } in &self.cameras {
            cameras.push(NetworkCamera { camera, intrinsics_covariance: intrinsics_covariance.as_deref() });
        }
        cameras
    }

    /// Returns the input of the solver.
    pub fn network<'a>(&'a self, cameras: &'a [NetworkCamera<'a>]) -> NetworkProblem<'a> {
        NetworkProblem {
            cameras,
            camera_of_photo: &self.camera_of_photo,
            n_points: self.points.len(),
            planes: &self.planes,
            constraints: &self.constraints,
        }
    }

    /// Returns the solver's queries for one of the scene; a `position` is three.
    pub fn core_queries(&self, query: &NamedQuery) -> Vec<Query> {
        let p = &query.points;
        match query.kind {
            QueryKind::Distance => vec![Query::Distance { a: p[0], b: p[1] }],
            QueryKind::Polyline => vec![Query::Polyline { points: p.clone() }],
            QueryKind::Angle => vec![Query::Angle { a: p[0], vertex: p[1], b: p[2] }],
            QueryKind::Area => vec![Query::Area { points: p.clone() }],
            QueryKind::Height => vec![Query::Height { plane: 0, point: p[0] }],
            QueryKind::Position => (0..3).map(|axis| Query::Coordinate { point: p[0], axis }).collect(),
        }
    }
}

/// Reads a scene file, its image points and its cameras; paths in it are relative to its folder.
///
/// # Errors
/// Unreadable or invalid files with the line, unknown names, impossible numbers.
pub fn read_scene(path: impl AsRef<Path>) -> Result<NamedScene, FileError> {
    let path = path.as_ref();
    let text = saved::without_session(&crate::input::read_text(path, Kind::Session)?);
    Kind::Scene.must_hold(path, text.len())?;
    let file: SceneFile = toml::from_str(&text).map_err(|e| {
        let (line, reason) = crate::input::toml_reason(&text, &e);
        FileError { path: path.into(), line, reason }
    })?;
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    let mut builder = Builder::new(path, folder, file.sigma_px)?;
    builder.photos(&file)?;
    builder.control_points(&file)?;
    builder.ground(&file)?;
    builder.image_points(&file)?;
    builder.queries(&file.query)?;
    builder.limits(file.birdseye)?;
    builder.moved_near_zero();
    builder.scene.lengths_are_metres = file.lengths_are_metres;
    Ok(builder.finished())
}
