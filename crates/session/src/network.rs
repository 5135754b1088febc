//! The network for measuring in the photographs, which `resight measure` adjusts, built from the session.

use crate::command::MeasuredKind;
use crate::lens;
use crate::places::Places;
use crate::pose::Solved;
use crate::state::{Measurement, State};
use nalgebra::Vector3;
use resight::core::multiview::network::{Constraint, Plane};
use resight::core::multiview::triangulate::isotropic;
use resight::core::{Pixel, Point};
use resight::measure::NamedScene;
use resight::measure::scene::SceneCamera;
use resight::measure::{Answers, NamedQuery, QueryKind, ScenePhoto};

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A scene, as input of `resight measure`.
pub type Scene = NamedScene;

/// Flatness of the ground, relative to the extent of the points: 9 mm over 3 m; never more than that of `resight measure`.
const FLATNESS: f64 = 0.003;
const MOST_FLATNESS_M: f64 = 0.01;
/// Inclination of upright objects, rad, as in `resight measure`.
const LEAN_RAD: f64 = 0.01;

/// Standard deviation of a point's distance from the ground, m.
pub fn flatness_m(places: &Places) -> f64 {
    let all = || places.by_name.values().map(|p| p.x_m);
    let least = all().fold(Point::repeat(f64::INFINITY), |m, p| m.inf(&p));
    let extent_m = (all().fold(Point::repeat(f64::NEG_INFINITY), |m, p| m.sup(&p)) - least).norm();
    match FLATNESS * extent_m {
        flatness if 0.0 < flatness && flatness < MOST_FLATNESS_M => flatness,
        _ => MOST_FLATNESS_M,
    }
}

/// A scene with every photograph that has a pose and every measurement in one of them; `on_plane` puts the points themselves on the ground
/// too, which bird's-eye images need.
pub fn scene(
    state: &State,
    solved: &[Option<Arc<Solved>>],
    places: &Places,
    on_plane: bool,
) -> Option<Scene> {
    let shown: Vec<(usize, &Solved)> =
        solved.iter().enumerate().filter_map(|(i, s)| Some((i, s.as_deref()?))).collect();
    let up = shown.first()?.1.up;
    let scene = empty(state.sigma_px, up);
    let mut builder = Builder { scene, state, flatness_m: flatness_m(places), numbers: BTreeMap::new() };
    for (photo, own) in &shown {
        // A lens that another photograph lends is one camera of both.
        let lender = lens::lender(state, *photo).and_then(Result::ok);
        let lens = lender.and_then(|lender| solved.get(lender)?.as_deref());
        builder.photo(*photo, own, lens.unwrap_or(own));
    }
    builder.known(places, on_plane);
    for (at, (photo, _)) in shown.iter().enumerate() {
        let is_posed = state.photos[*photo].chosen.is_some();
        builder.image_points(at, *photo, places, is_posed);
        state.measurements.iter().filter(|m| m.photo == *photo).for_each(|m| builder.measurement(at, m));
    }
    builder.asked(places);
    Some(builder.scene)
}

/// A scene of nothing but the ground.
pub fn empty(sigma_px: f64, up: f64) -> Scene {
    Scene {
        cameras: Vec::new(),
        photos: Vec::new(),
        camera_of_photo: Vec::new(),
        points: Vec::new(),
        is_control_point: Vec::new(),
        planes: vec![Plane::Known { normal_in_world: Vector3::z() * up, offset_m: 0.0 }],
        has_ground: true,
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
    }
}

struct Builder<'a> {
    scene: Scene,
    state: &'a State,
    flatness_m: f64,
    /// The index of the point with each name.
    numbers: BTreeMap<String, usize>,
}

impl Builder<'_> {
    fn point(&mut self, name: &str) -> usize {
        if let Some(known) = self.numbers.get(name) {
            return *known;
        }
        self.scene.points.push(name.to_owned());
        self.scene.is_control_point.push(false);
        self.numbers.insert(name.to_owned(), self.scene.points.len() - 1);
        self.scene.points.len() - 1
    }

    /// Photographs of one lens, stated alike, share its errors.
    fn photo(&mut self, photo: usize, solved: &Solved, lens: &Solved) {
        let camera = SceneCamera {
            camera: lens.camera.clone(),
            intrinsics_covariance: lens.intrinsics_covariance.clone(),
        };
        let known = self.scene.cameras.iter().position(|c| *c == camera);
        let camera = known.unwrap_or_else(|| {
            self.scene.cameras.push(camera);
            self.scene.cameras.len() - 1
        });
        let at = self.scene.photos.len();
        self.scene.camera_of_photo.push(camera);
        let name = self.state.photos[photo].photograph.name.clone();
        self.scene.photos.push(ScenePhoto { name, file: None, camera });
        if self.state.photos[photo].chosen.is_some() {
            let (cam_from_world, covariance) = (solved.cam_from_world, Some(solved.covariance));
            self.scene.constraints.push(Constraint::Pose { photo: at, cam_from_world, covariance });
        }
    }

    fn known(&mut self, places: &Places, on_plane: bool) {
        for (name, place) in &places.by_name {
            let point = self.point(name);
            self.scene.is_control_point[point] = true;
            let sigma_m = Vector3::repeat(place.sigma_m);
            self.scene.constraints.push(Constraint::Place { point, x_in_world: place.x_m, sigma_m });
            if on_plane && place.x_m.z == 0.0 {
                self.scene.constraints.push(Constraint::OnPlane {
                    plane: 0,
                    point,
                    sigma_m: self.flatness_m,
                });
            }
        }
    }

    /// Where the user chose the pose, it already depends on the points behind it.
    fn image_points(&mut self, at: usize, photo: usize, places: &Places, is_posed: bool) {
        let state = self.state;
        for p in &state.photos[photo].points {
            if is_posed && places.by_name.contains_key(&p.name) {
                continue;
            }
            let sigma_px = p.sigma_px.unwrap_or(self.scene.sigma_px);
            let point = self.point(&p.name);
            self.seen(at, point, [p.u_px, p.v_px], sigma_px);
        }
    }

    fn seen(&mut self, photo: usize, point: usize, [u, v]: [f64; 2], sigma_px: f64) {
        let (pixel, covariance_px2) = (Pixel::new(u, v), isotropic(sigma_px));
        self.scene.constraints.push(Constraint::ImagePoint { photo, point, pixel, covariance_px2 });
    }

    fn measurement(&mut self, at: usize, m: &Measurement) {
        let points: Vec<usize> =
            (0..m.points.len()).map(|i| self.point(&format!("{} · {}", m.name, i + 1))).collect();
        for (i, (point, pixel)) in points.iter().zip(&m.points).enumerate() {
            self.seen(at, *point, *pixel, self.scene.sigma_px);
            if !(m.what == MeasuredKind::Height && i == 1) {
                self.scene.constraints.push(Constraint::OnPlane {
                    plane: 0,
                    point: *point,
                    sigma_m: self.flatness_m,
                });
            }
        }
        let (kind, points) = match m.what {
            MeasuredKind::Length => (QueryKind::Distance, points),
            MeasuredKind::Polyline => (QueryKind::Polyline, points),
            MeasuredKind::Area => (QueryKind::Area, points),
            MeasuredKind::Position => (QueryKind::Position, points),
            MeasuredKind::Height => {
                let (foot, top) = (points[0], points[1]);
                self.scene.constraints.push(Constraint::Upright { plane: 0, foot, top, sigma_rad: LEAN_RAD });
                (QueryKind::Height, vec![top])
            }
        };
        self.scene.queries.push(NamedQuery { name: m.name.clone(), kind, points });
    }

    /// Adds queries for the positions of points without stated ones that two photographs show.
    fn asked(&mut self, places: &Places) {
        let shown = |name: &str| {
            self.state.photos.iter().filter(|p| p.points.iter().any(|q| q.name == *name)).count()
        };
        let all: BTreeSet<&String> =
            self.state.photos.iter().flat_map(|p| p.points.iter().map(|q| &q.name)).collect();
        let open = all.into_iter().filter(|name| !places.by_name.contains_key(*name) && 1 < shown(name));
        for name in open.cloned().collect::<Vec<_>>() {
            let points = vec![self.point(&name)];
            self.scene.queries.push(NamedQuery { name, kind: QueryKind::Position, points });
        }
    }
}

/// Solves it; a sentence where that is impossible.
pub fn measured(scene: &Scene) -> Result<Answers, String> {
    measured_after(scene, None)
}

/// Measures a scene while something in it is dragged.
pub fn measured_provisionally(scene: &Scene) -> Result<Answers, String> {
    resight::measure::measure_provisionally(scene).map_err(|reason| reason.to_string())
}

/// Measures a scene after an earlier one: only what differs is measured again.
pub fn measured_after(scene: &Scene, before: Option<(&Scene, &Answers)>) -> Result<Answers, String> {
    resight::measure::measure_after(scene, before).map_err(|reason| reason.to_string())
}
