//! Builds a network from the tables of the scene file: names become indices, defaults are filled in, and every number is checked.

use super::file::{BirdseyeEntry, ControlPointEntry, PhotoEntry, PoseEntry, QueryEntry, SceneFile};
use super::{NamedQuery, NamedScene, QueryKind, SceneCamera, ScenePhoto};
use crate::FileError;
use crate::core::multiview::network::{Constraint, Plane};
use crate::core::multiview::triangulate::isotropic;
use crate::core::{Matrix6, Pixel, Point, Pose};
use crate::formats::{self, NamedCamera};
use crate::georeference::columns::{checked, within_utm};
use crate::georeference::earth::Utm;
use crate::georeference::{CoordinateSystem, Geographic, LocalFrame};
use crate::input::table::how_file_is_read;
use crate::locate::IntrinsicsCovariance;
use crate::measure::clicks::{ImagePoint, read_image_points};
use crate::report::words;
use crate::report::words::counted;
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

/// Default standard deviation of an image point, px: that of a careful person on a full-size display.
pub const DEFAULT_SIGMA_PX: f64 = 1.0;
/// Default flatness of a plane, m.
const DEFAULT_FLATNESS_M: f64 = 0.01;
/// Default inclination of an upright object, rad (½°).
const DEFAULT_LEAN_RAD: f64 = 0.01;
/// Coordinates farther from zero than this are shifted towards it for the computation, m.
const FAR_M: f64 = 10_000.0;

/// The identity of a camera: its file, the size of its images, and its stated sigmas.
type CameraUse<'a> = ((String, Option<String>), Option<(u32, u32)>, &'a BTreeMap<String, f64>);

/// A scene under construction.
pub(super) struct Builder {
    path: PathBuf,
    folder: PathBuf,
    pub(super) scene: NamedScene,
    /// The image points and distances added so far, with all digits.
    measured: HashSet<Measurement>,
    n_measured: usize,
}

/// The kind of a measurement, the indices of the items that it relates, and its numbers bit by bit.
type Measurement = (u8, [usize; 2], [u64; 2]);

impl Builder {
    pub(super) fn new(path: &Path, folder: PathBuf, sigma_px: Option<f64>) -> Result<Self, FileError> {
        let sigma_px = sigma_px.unwrap_or(DEFAULT_SIGMA_PX);
        let scene = NamedScene {
            cameras: Vec::new(),
            photos: Vec::new(),
            camera_of_photo: Vec::new(),
            points: Vec::new(),
            is_control_point: Vec::new(),
            planes: Vec::new(),
            has_ground: false,
            constraints: Vec::new(),
            queries: Vec::new(),
            origin_m: Point::zeros(),
            sigma_px,
            pixel_limit_m: 0.05,
            error_limit_m: 0.10,
            is_camera_frame: false,
            lengths_are_metres: false,
            frame: None,
            remarks: Vec::new(),
        };
        let builder = Builder { path: path.into(), folder, scene, measured: HashSet::new(), n_measured: 0 };
        builder.positive("sigma_px", sigma_px)?;
        Ok(builder)
    }

    fn fault(&self, reason: impl Into<String>) -> FileError {
        FileError::new(&self.path, reason)
    }

    fn positive(&self, key: &str, value: f64) -> Result<(), FileError> {
        match 0.0 < value && value.is_finite() {
            true => Ok(()),
            false => Err(self.fault(format!("{key} is {value}; a positive number is needed"))),
        }
    }

    /// Returns the index of a point; new names are added.
    fn point(&mut self, name: &str) -> usize {
        self.scene.points.iter().position(|p| p == name).unwrap_or_else(|| {
            self.scene.points.push(name.to_string());
            self.scene.is_control_point.push(false);
            self.scene.points.len() - 1
        })
    }

    fn known_point(&self, what: &str, name: &str) -> Result<usize, FileError> {
        self.scene.points.iter().position(|p| p == name).ok_or_else(|| {
            self.fault(format!("{what}: no point `{name}`; the points are {}", self.scene.points.join(", ")))
        })
    }

    pub(super) fn photos(&mut self, file: &SceneFile) -> Result<(), FileError> {
        if file.photo.is_empty() {
            return Err(self.fault("no [[photo]]; give at least one with name, camera and image points"));
        }
        let mut used: Vec<CameraUse> = Vec::new();
        for (index, photo) in file.photo.iter().enumerate() {
            if file.photo[..index].iter().any(|other| other.name == photo.name) {
                return Err(
                    self.fault(format!("two photographs are called `{}`; names must differ", photo.name))
                );
            }
            let picture = photo.file.as_ref().map(|f| self.folder.join(f));
            let size = picture.as_deref().map(crate::image::size).transpose()?;
            let source = (photo.camera.clone(), photo.camera_text.clone());
            let known = used.iter().position(|(camera, s, _)| *camera == source && *s == size);
            let camera = match known {
                Some(known) if *used[known].2 != photo.intrinsics_sigma => {
                    return Err(self.fault(format!(
                        "photo `{}`: intrinsics_sigma differs from that of another photo with camera {}; one camera has one",
                        photo.name, photo.camera
                    )));
                }
                Some(known) => known,
                None => {
                    used.push((source, size, &photo.intrinsics_sigma));
                    let camera = self.camera(photo, size)?;
                    self.scene.cameras.push(camera);
                    self.scene.cameras.len() - 1
                }
            };
            self.scene.camera_of_photo.push(camera);
            self.scene.photos.push(ScenePhoto { name: photo.name.clone(), file: picture, camera });
            if let Some(pose) = &photo.pose {
                let constraint = self.pose(index, pose)?;
                self.scene.constraints.push(constraint);
            }
        }
        Ok(())
    }

    fn named_camera(&mut self, photo: &PhotoEntry) -> Result<NamedCamera, FileError> {
        let Some(text) = &photo.camera_text else {
            let file = self.folder.join(&photo.camera);
            let (camera, remarks) = formats::read_camera_with_remarks(&file)?;
            self.scene.remarks.extend(remarks);
            return Ok(camera);
        };
        let read = formats::read_cameras_from_bytes(&self.path, text.clone().into_bytes())?;
        self.scene.remarks.extend(read.warnings.iter().map(|w| format!("photo `{}`: {w}", photo.name)));
        let n = read.cameras.len();
        match <[NamedCamera; 1]>::try_from(read.cameras) {
            Ok([camera]) => Ok(camera),
            Err(_) => {
                Err(self
                    .fault(format!("photo `{}`: camera_text holds {n} cameras; one is needed", photo.name)))
            }
        }
    }

    fn camera(&mut self, photo: &PhotoEntry, size: Option<(u32, u32)>) -> Result<SceneCamera, FileError> {
        let named = self.named_camera(photo)?;
        let stated = &named.camera;
        let camera = match size {
            Some((width, height)) => formats::check_image_size(stated, width, height)
                .map_err(|reason| self.fault(format!("photo `{}`: {reason}", photo.name)))?,
            None => stated.clone(),
        };
        let known = match photo.intrinsics_sigma.is_empty() {
            true => IntrinsicsCovariance::of(&named),
            false => Some(
                IntrinsicsCovariance::independent(&photo.intrinsics_sigma, stated)
                    .map_err(|reason| self.fault(format!("intrinsics_sigma: {reason}")))?,
            ),
        };
        let intrinsics_covariance = known.map(|known| known.covariance(&camera));
        Ok(SceneCamera { camera, intrinsics_covariance })
    }

    fn pose(&self, photo: usize, pose: &PoseEntry) -> Result<Constraint, FileError> {
        let length = pose.rotation_wxyz.iter().map(|q| q * q).sum::<f64>().sqrt();
        if !((length - 1.0).abs() < 1e-3) {
            return Err(
                self.fault(format!("pose: rotation_wxyz has length {length:.4}; a rotation has length 1"))
            );
        }
        let cam_from_world =
            Pose::from_quaternion_wxyz(pose.rotation_wxyz, Vector3::from(pose.translation_m));
        let covariance = pose.covariance.map(|rows| with_floor(&Matrix6::from_fn(|i, j| rows[i][j])));
        Ok(Constraint::Pose { photo, cam_from_world, covariance: covariance.filter(|c| 0.0 < c.amax()) })
    }

    pub(super) fn control_points(&mut self, file: &SceneFile) -> Result<(), FileError> {
        let system = self.system(file)?;
        for control_point in &file.control_point {
            if self.scene.points.contains(&control_point.name) {
                return Err(self.fault(format!(
                    "two control points are called `{}`; names must differ",
                    control_point.name
                )));
            }
            let point = self.point(&control_point.name);
            self.scene.is_control_point[point] = true;
            let x_in_world = self.position(control_point, system.as_ref())?;
            let sigma_m = Vector3::repeat(control_point.sigma_m);
            self.scene.constraints.push(Constraint::Place { point, x_in_world, sigma_m });
        }
        for d in &file.known_distance {
            self.positive("distance_m", d.distance_m)?;
            self.positive("sigma_m of a known_distance", d.sigma_m)?;
            if d.a == d.b {
                return Err(self.fault(format!("known_distance from `{}` to itself", d.a)));
            }
            let (a, b) = (self.point(&d.a), self.point(&d.b));
            self.scene.is_control_point[a] = true;
            self.scene.is_control_point[b] = true;
            self.once(Constraint::Distance { a, b, distance_m: d.distance_m, sigma_m: d.sigma_m });
        }
        Ok(())
    }

    /// Returns the system of eastings and northings, where the file states one.
    fn system(&self, file: &SceneFile) -> Result<Option<CoordinateSystem>, FileError> {
        let is_on_earth =
            |c: &ControlPointEntry| c.lat_deg.or(c.lon_deg).or(c.easting_m).or(c.northing_m).is_some();
        let first = file.control_point.iter().find(|c| is_on_earth(c));
        let other = file.control_point.iter().find(|c| !is_on_earth(c));
        if let (Some(first), Some(other)) = (first, other) {
            return Err(self.fault(format!(
                "control point `{}` is on the Earth and `{}` in a frame of its own; give all in one system",
                first.name, other.name
            )));
        }
        if let (Some(first), Some(photo)) = (first, file.photo.iter().find(|photo| photo.pose.is_some())) {
            return Err(self.fault(format!(
                "photo `{}` has a pose in a frame of its own, and control point `{}` is on the Earth; leave one out",
                photo.name, first.name
            )));
        }
        file.crs
            .as_ref()
            .map(|text| text.parse().map_err(|reason| self.fault(format!("crs: {reason}"))))
            .transpose()
    }

    /// Returns the position of a control point in the scene's frame, which is that of the first one where they are on the Earth; its z is the height.
    fn position(
        &mut self,
        at: &ControlPointEntry,
        system: Option<&CoordinateSystem>,
    ) -> Result<Point, FileError> {
        let fault =
            |reason: String| FileError::new(&self.path, format!("control point `{}`: {reason}", at.name));
        let given = [at.x_m.or(at.y_m).or(at.z_m), at.lat_deg.or(at.lon_deg), at.easting_m.or(at.northing_m)];
        let [is_own, is_geographic, is_projected] = given.map(|x| x.is_some());
        let is_one = [is_own, is_geographic, is_projected].iter().filter(|x| **x).count() == 1;
        let earth = match (is_one, at.lat_deg.zip(at.lon_deg), at.easting_m.zip(at.northing_m), at.x_m.zip(at.y_m)) {
            (true, None, None, Some((x_m, y_m))) => return Ok(Point::new(x_m, y_m, at.z_m.unwrap_or(0.0))),
            (true, Some((lat_deg, lon_deg)), ..) => Some([lat_deg, lon_deg]),
            (true, None, Some(_), _) => None,
            _ => return Err(fault("x_m and y_m are needed, or lat_deg, lon_deg and height_m, or easting_m, northing_m and height_m".into())),
        };
        let Some(height_m) = at.height_m else {
            return Err(fault("height_m is missing; each point needs its height in metres, all above the ellipsoid or all above sea level".into()));
        };
        let (system, place) = match (earth, at.easting_m.zip(at.northing_m), system) {
            (Some([lat_deg, lon_deg]), ..) => {
                let place = checked(Geographic { lat_deg, lon_deg, height_m }).map_err(fault)?;
                (CoordinateSystem::Geographic, place)
            }
            (None, Some((easting_m, northing_m)), Some(CoordinateSystem::Utm(zone))) => {
                within_utm([easting_m, northing_m]).map_err(fault)?;
                let place = Utm::new(*zone).and_then(|utm| utm.unproject([easting_m, northing_m], height_m));
                (
                    CoordinateSystem::Utm(*zone),
                    place.ok_or_else(|| fault(format!("is no place in zone {zone}")))?,
                )
            }
            // Of another grid nothing is known: its metres are taken as they are.
            (None, Some((easting_m, northing_m)), _) => {
                return Ok(Point::new(easting_m, northing_m, height_m));
            }
            (None, None, _) => return Err(fault("its coordinates are missing".into())),
        };
        let level = Geographic { height_m: 0.0, ..place };
        let frame = self.scene.frame.get_or_insert_with(|| LocalFrame::at(system, level));
        Ok(frame.local(&place).unwrap_or_default())
    }

    pub(super) fn ground(&mut self, file: &SceneFile) -> Result<(), FileError> {
        if let Some(plane) = &file.plane {
            let sigma_m = plane.sigma_m.unwrap_or(DEFAULT_FLATNESS_M);
            self.positive("sigma_m of the plane", sigma_m)?;
            self.scene.planes.push(match plane.z_m {
                Some(z) if !file.control_point.is_empty() || file.photo.iter().any(|p| p.pose.is_some()) => {
                    Plane::Known { normal_in_world: Vector3::z(), offset_m: z }
                }
                Some(_) => return Err(self.fault("[plane] z_m needs [[control_point]] coordinates or poses to say where z = 0 is; leave it out: the plane is found from its points")),
                None => Plane::Unknown,
            });
            self.scene.has_ground = true;
            for name in &plane.points {
                let point = self.point(name);
                self.scene.constraints.push(Constraint::OnPlane { plane: 0, point, sigma_m });
            }
        }
        let gravity = self.gravity(file)?;
        for upright in &file.upright {
            let plane =
                match gravity {
                    Some(level) => level,
                    None if self.scene.has_ground => 0,
                    None => return Err(self.fault(
                        "[[upright]] needs a [plane], or down_in_cam in a [[photo]], to know what upright is",
                    )),
                };
            let sigma_rad = upright.sigma_rad.unwrap_or(DEFAULT_LEAN_RAD);
            self.positive("sigma_rad of an upright", sigma_rad)?;
            let (foot, top) = (self.point(&upright.foot), self.point(&upright.top));
            if foot == top {
                return Err(self.fault(format!("[[upright]] from `{}` to itself", upright.foot)));
            }
            self.scene.constraints.push(Constraint::Upright { plane, foot, top, sigma_rad });
        }
        Ok(())
    }

    /// Adds a level plane, where the direction of gravity is known in a photograph.
    fn gravity(&mut self, file: &SceneFile) -> Result<Option<usize>, FileError> {
        let mut level = None;
        for (photo, entry) in file.photo.iter().enumerate() {
            let Some(down) = entry.down_in_cam else { continue };
            let (down, sigma_rad) = (Vector3::from(down), entry.down_sigma_rad.unwrap_or(DEFAULT_LEAN_RAD));
            self.positive("the length of down_in_cam", down.norm())?;
            self.positive("down_sigma_rad", sigma_rad)?;
            let plane = *level.get_or_insert_with(|| {
                self.scene.planes.push(Plane::Unknown);
                self.scene.planes.len() - 1
            });
            self.scene.constraints.push(Constraint::Gravity {
                plane,
                photo,
                down_in_cam: down.normalize(),
                sigma_rad,
            });
        }
        Ok(level)
    }

    pub(super) fn image_points(&mut self, file: &SceneFile) -> Result<(), FileError> {
        for photo in &file.photo {
            for c in &photo.image_points {
                let (photo, point) = (photo.name.clone(), c.point.clone());
                self.image_point(&ImagePoint {
                    photo,
                    point,
                    u_px: c.u_px,
                    v_px: c.v_px,
                    sigma_px: c.sigma_px,
                })?;
            }
        }
        if let Some(path) = &file.image_points {
            let path = self.folder.join(path);
            for image_point in read_image_points(&path)? {
                self.image_point(&image_point)?;
            }
            self.scene.remarks.extend(how_file_is_read(&path));
        }
        Ok(())
    }

    pub(super) fn image_point(&mut self, image_point: &ImagePoint) -> Result<(), FileError> {
        let Some(photo) = self.scene.photos.iter().position(|p| p.name == image_point.photo) else {
            let known: Vec<&str> = self.scene.photos.iter().map(|p| p.name.as_str()).collect();
            return Err(self.fault(format!(
                "an image point names photo `{}`; the photos are {}",
                image_point.photo,
                known.join(", ")
            )));
        };
        let sigma_px = image_point.sigma_px.unwrap_or(self.scene.sigma_px);
        self.positive(&format!("sigma_px of {} in {}", image_point.point, image_point.photo), sigma_px)?;
        let pixel = Pixel::new(image_point.u_px, image_point.v_px);
        let camera = &self.scene.cameras[self.scene.camera_of_photo[photo]].camera;
        if !camera.contains(&pixel) {
            return Err(self.fault(format!(
                "{} in {} was clicked at ({}, {}), outside the image; check the columns u_px and v_px",
                image_point.point, image_point.photo, image_point.u_px, image_point.v_px
            )));
        }
        let point = self.point(&image_point.point);
        let given = Constraint::ImagePoint { photo, point, pixel, covariance_px2: isotropic(sigma_px) };
        self.once(given);
        Ok(())
    }

    /// Adds an image point or a distance, unless it repeats an earlier one in all digits: equal rows are one observation.
    fn once(&mut self, given: Constraint) {
        let bits = |x: f64| (x + 0.0).to_bits();
        let measurement = match given {
            Constraint::ImagePoint { photo, point, pixel, .. } => {
                (0, [photo, point], [pixel.x, pixel.y].map(bits))
            }
            Constraint::Distance { a, b, distance_m, .. } => (1, [a.min(b), a.max(b)], [bits(distance_m), 0]),
            _ => return self.scene.constraints.push(given),
        };
        self.n_measured += 1;
        if self.measured.insert(measurement) {
            self.scene.constraints.push(given);
        }
    }

    /// Returns the scene, with a remark about equal rows.
    pub(super) fn finished(mut self) -> NamedScene {
        let n_repeated = self.n_measured - self.measured.len();
        self.scene.remarks.extend(words::repeated(n_repeated, self.n_measured));
        self.scene
    }

    pub(super) fn queries(&mut self, queries: &[QueryEntry]) -> Result<(), FileError> {
        for query in queries {
            let kind = query.kind.name();
            let points =
                query.points.iter().map(|p| self.known_point(kind, p)).collect::<Result<Vec<_>, _>>()?;
            let (least, most) = match query.kind {
                QueryKind::Distance => (2, 2),
                QueryKind::Angle => (3, 3),
                QueryKind::Height | QueryKind::Position => (1, 1),
                QueryKind::Polyline => (2, usize::MAX),
                QueryKind::Area => (3, usize::MAX),
            };
            if !(least..=most).contains(&points.len()) {
                let needed = if least == most { format!("{least}") } else { format!("{least} or more") };
                return Err(self.fault(format!(
                    "query {kind}: {} given, {needed} needed",
                    counted(points.len(), "point")
                )));
            }
            if query.kind == QueryKind::Height && !self.scene.has_ground {
                return Err(self.fault("query height: there is no [plane] to measure heights from"));
            }
            let name = query.name.clone().unwrap_or_else(|| query.points.join("–"));
            self.scene.queries.push(NamedQuery { name, kind: query.kind, points });
        }
        if queries.is_empty() {
            // Without queries, the positions of all points are computed.
            let all = (0..self.scene.points.len()).map(|p| NamedQuery {
                name: self.scene.points[p].clone(),
                kind: QueryKind::Position,
                points: vec![p],
            });
            self.scene.queries = all.collect();
        }
        Ok(())
    }

    pub(super) fn limits(&mut self, entry: Option<BirdseyeEntry>) -> Result<(), FileError> {
        let Some(entry) = entry else { return Ok(()) };
        for (key, value, at) in [
            ("pixel_limit_m", entry.pixel_limit_m, &mut self.scene.pixel_limit_m),
            ("error_limit_m", entry.error_limit_m, &mut self.scene.error_limit_m),
        ] {
            if let Some(value) = value {
                if !(0.0 < value && value.is_finite()) {
                    return Err(FileError::new(
                        &self.path,
                        format!("{key} is {value}; a positive number is needed"),
                    ));
                }
                *at = value;
            }
        }
        Ok(())
    }

    /// Shifts coordinates such as those of national grids, which have millions of metres, towards zero for the computation.
    pub(super) fn moved_near_zero(&mut self) {
        let has_pose = self.scene.constraints.iter().any(|f| matches!(f, Constraint::Pose { .. }));
        let places = self.scene.constraints.iter().filter_map(|f| match f {
            Constraint::Place { x_in_world, .. } => Some(*x_in_world),
            _ => None,
        });
        let Some(first) = places.clone().next() else { return };
        if has_pose || first.amax() < FAR_M {
            return;
        }
        let origin = Point::new(first.x.floor(), first.y.floor(), 0.0);
        self.scene.origin_m = origin;
        for constraint in &mut self.scene.constraints {
            if let Constraint::Place { x_in_world, .. } = constraint {
                *x_in_world -= origin;
            }
        }
    }
}

/// Adds a floor to a covariance in which a direction is exact (a hinge), so that it has an inverse: 1e-6 of its largest variances, and (1 µrad)²
/// and (1 µm)², which change no visible digit.
pub(super) fn with_floor(covariance: &Matrix6) -> Matrix6 {
    let most = |first: usize| covariance.diagonal().rows(first, 3).max().max(0.0);
    let (turn, shift) = (1e-6 * most(0) + 1e-12, 1e-6 * most(3) + 1e-12);
    covariance + Matrix6::from_diagonal(&crate::core::Vector6::new(turn, turn, turn, shift, shift, shift))
}
