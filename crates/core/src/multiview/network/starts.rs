//! Initial values of everything: control points by coordinates or distances, photographs by `locate`, further points by rays.

use super::segments::{by_segments, line_of_segments};
use super::state::{LensAt, PlaneAt, State};
use super::trilaterate::{Length, Network, Places, lengths, plane_of};
use super::{Constraint, Item, NetworkProblem, Plane, gauge, spread};
use crate::correspondence::Correspondence;
use crate::locate::{Config, locate};
use crate::multiview::triangulate::{PointView, triangulate};
use crate::{Error, Point, Pose};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// The initial values, and the reasons why the rest has none.
pub(super) struct Draft {
    pub(super) state: State,
    pub(super) dropped: Vec<(Item, Error)>,
    /// Other poses of photographs that fit their control points about as well.
    pub(super) alternatives: Vec<(usize, Pose)>,
    pub(super) control_points: Option<[usize; 3]>,
}

/// Returns the arrangements of the control points whose coordinates or mutual distances are given; one without any control point where poses are
/// given instead.
pub(super) fn control_points(problem: &NetworkProblem) -> Result<Vec<Places>, Error> {
    check_length(problem)?;
    let mut places: Places = vec![None; problem.n_points];
    for constraint in problem.constraints {
        if let Constraint::Place { point, x_in_world, .. } = constraint {
            places[*point] = Some(*x_in_world);
        }
    }
    let lengths: Vec<Length> = lengths(problem).into_iter().map(|l| l.1).collect();
    let planes = plane_of(problem);
    let network = Network { lengths: &lengths, plane_of: &planes };
    let given = gauge::is_given(problem);
    if !places.iter().any(Option::is_some)
        && let Some(laid) = network.triangle()
    {
        let on_known = known_plane_of(problem, &planes, &laid);
        places = on_known.map_or_else(|| laid.clone(), |plane| onto(&laid, &plane));
    } else if !places.iter().any(Option::is_some) {
        if let Some(line) = line_of_segments(problem) {
            return Err(line);
        }
        let mut laid = by_segments(problem);
        let line = laid.first().and_then(|places| spread::of_laid(problem, places));
        laid.retain(|places| spread::of_laid(problem, places).is_none());
        if let (true, Some(line)) = (laid.is_empty(), line) {
            return Err(line);
        }
        let on_plane = |laid: Places| match known_plane_of(problem, &planes, &laid) {
            Some(plane) => onto(&laid, &plane),
            None => laid,
        };
        if !laid.is_empty() {
            return Ok(laid.into_iter().map(on_plane).collect());
        }
        if !given {
            return Err(no_start(problem, &lengths));
        }
    }
    let normals = normals(problem, &planes, &places);
    Ok(network.grow(places, &normals))
}

/// Returns the reason why distances alone give no initial values.
fn no_start(problem: &NetworkProblem, lengths: &[Length]) -> Error {
    spread::of_lengths(problem).unwrap_or(Error::Undetermined {
            what: "the frame of point",
            index: 0,
            reason: "no three points have all their mutual distances, and no photograph shows three known lengths on one plane; measure the sides of one triangle of control points, or give coordinates",
            metric: lengths.len() as f64,
            needed: 3.0,
    })
}

fn check_length(problem: &NetworkProblem) -> Result<(), Error> {
    let count = |is: fn(&Constraint) -> bool| problem.constraints.iter().filter(|f| is(f)).count();
    let distances = count(|f| matches!(f, Constraint::Distance { .. }));
    let places = count(|f| matches!(f, Constraint::Place { .. }));
    let poses = count(|f| matches!(f, Constraint::Pose { .. }));
    let planes = problem.planes.iter().filter(|p| **p != Plane::Unknown).count();
    let is_known = 0 < distances || 2 <= places || 2 <= poses || (0 < poses && 0 < places + planes);
    if is_known { Ok(()) } else { Err(Error::NoLength) }
}

/// Returns the known plane on which all corners of the triangle lie.
fn known_plane_of(problem: &NetworkProblem, plane_of: &[Option<usize>], laid: &Places) -> Option<PlaneAt> {
    let mut corners = (0..laid.len()).filter(|p| laid[*p].is_some());
    let plane = plane_of[corners.next()?]?;
    let all = corners.all(|p| plane_of[p] == Some(plane));
    match problem.planes[plane] {
        Plane::Known { normal_in_world, offset_m } if all => Some(PlaneAt::known(&normal_in_world, offset_m)),
        _ => None,
    }
}

/// Maps positions in the frame of the xy-plane onto a plane.
fn onto(laid: &Places, plane: &PlaneAt) -> Places {
    let [u, _] = plane.tangents();
    let v = plane.normal.cross(&u);
    laid.iter().map(|x| x.map(|x| plane.pivot + u * x.x + v * x.y + plane.normal * x.z)).collect()
}

/// Returns the normals of known planes, and of those that three placed points span.
fn normals(
    problem: &NetworkProblem,
    plane_of: &[Option<usize>],
    places: &Places,
) -> Vec<Option<Vector3<f64>>> {
    let normal = |(index, plane): (usize, &Plane)| match plane {
        Plane::Known { normal_in_world, .. } => Some(*normal_in_world),
        Plane::Unknown => fitted(index, plane_of, places).map(|p| p.normal),
    };
    problem.planes.iter().enumerate().map(normal).collect()
}

/// Smallest ratio of middle to largest extent of points that span a plane.
const LEAST_WIDTH: f64 = 1e-3;

/// Returns the plane nearest to the placed points that lie on it; none below three or where they lie on a line.
fn fitted(index: usize, plane_of: &[Option<usize>], places: &Places) -> Option<PlaneAt> {
    let on_it: Vec<Point> =
        (0..places.len()).filter(|p| plane_of[*p] == Some(index)).filter_map(|p| places[p]).collect();
    if on_it.len() < 3 {
        return None;
    }
    let pivot = on_it.iter().sum::<Point>() / on_it.len() as f64;
    let scatter: Matrix3<f64> = on_it.iter().map(|x| (x - pivot) * (x - pivot).transpose()).sum();
    let eigen = SymmetricEigen::new(scatter);
    let least = eigen.eigenvalues.imin();
    let mut sorted: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let is_spanned = LEAST_WIDTH * LEAST_WIDTH * sorted[2] < sorted[1];
    is_spanned.then(|| PlaneAt { normal: eigen.eigenvectors.column(least).into(), pivot, height_m: 0.0 })
}

/// The points, photographs and planes that have initial values so far.
struct Building<'a> {
    problem: &'a NetworkProblem<'a>,
    plane_of: Vec<Option<usize>>,
    points: Places,
    photos: Vec<Option<Pose>>,
    planes: Vec<Option<PlaneAt>>,
    alternatives: Vec<(usize, Pose)>,
    reasons: Vec<(Item, Error)>,
}

/// Finds initial values from an arrangement of the control points; `forced` poses replace those of `locate`.
pub(super) fn draft(problem: &NetworkProblem, control_points: &Places, forced: &[(usize, Pose)]) -> Draft {
    let mut building = Building {
        problem,
        plane_of: plane_of(problem),
        points: control_points.clone(),
        photos: vec![None; problem.camera_of_photo.len()],
        planes: vec![None; problem.planes.len()],
        alternatives: Vec::new(),
        reasons: Vec::new(),
    };
    for (photo, cam_from_world) in forced {
        building.photos[*photo] = Some(*cam_from_world);
    }
    for constraint in problem.constraints {
        if let Constraint::Pose { photo, cam_from_world, .. } = constraint {
            building.photos[*photo] = Some(*cam_from_world);
        }
    }
    // Each round places something or is the last.
    for _ in 0..problem.n_points + problem.camera_of_photo.len() + 2 {
        let before = building.n_placed();
        building.reasons.clear();
        building.place_planes();
        building.place_photos();
        building.face_cameras();
        building.place_points();
        if building.n_placed() == before {
            break;
        }
    }
    building.finish(control_points)
}

impl Building<'_> {
    fn n_placed(&self) -> usize {
        self.points.iter().flatten().count()
            + self.photos.iter().flatten().count()
            + self.planes.iter().flatten().count()
    }

    fn place_planes(&mut self) {
        for (index, plane) in self.problem.planes.iter().enumerate() {
            self.planes[index] = self.planes[index].or_else(|| match plane {
                Plane::Known { normal_in_world, offset_m } => {
                    Some(PlaneAt::known(normal_in_world, *offset_m))
                }
                Plane::Unknown => fitted(index, &self.plane_of, &self.points).or_else(|| self.level(index)),
            });
            if self.planes[index].is_none() {
                let on_it = |p: &usize| self.plane_of[*p] == Some(index) && self.points[*p].is_some();
                let seen = (0..self.points.len()).filter(on_it).count();
                let reason = "fewer than three points off one line lie on it; put more points on it, or give its normal";
                self.reasons
                    .push((Item::Plane(index), undetermined("plane", index, reason, seen as f64, 3.0)));
            }
        }
        self.face_cameras();
    }

    /// Returns a plane of which only the normal is known, from gravity.
    fn level(&self, index: usize) -> Option<PlaneAt> {
        self.problem.constraints.iter().find_map(|f| match f {
            Constraint::Gravity { plane, photo, down_in_cam, .. } if *plane == index => {
                let normal = -(self.photos[*photo]?.rotation.tr_mul(down_in_cam));
                Some(PlaneAt { normal, pivot: Point::zeros(), height_m: 0.0 })
            }
            _ => None,
        })
    }

    /// Orients the normals of unknown planes to the side of the cameras, or up where gravity is measured.
    fn face_cameras(&mut self) {
        for (index, plane) in self.problem.planes.iter().enumerate() {
            let Some(found) = self.planes[index].filter(|_| *plane == Plane::Unknown) else { continue };
            let side = match self.level(index) {
                Some(level) => level.normal.dot(&found.normal),
                None => self.photos.iter().flatten().map(|pose| found.above_m(&pose.origin())).sum(),
            };
            if side < 0.0 {
                self.planes[index] = Some(PlaneAt { normal: -found.normal, ..found });
            }
        }
    }

    fn image_points(&self, is: impl Fn(usize, usize) -> bool) -> Vec<Constraint> {
        let wanted =
            |f: &&Constraint| matches!(f, Constraint::ImagePoint { photo, point, .. } if is(*photo, *point));
        self.problem.constraints.iter().filter(wanted).copied().collect()
    }

    /// Places photographs with at least four placed points; where there is none, one with three.
    fn place_photos(&mut self) {
        for least in [4, 3] {
            let mut placed = false;
            for photo in 0..self.photos.len() {
                let image_points = self.image_points(|p, point| p == photo && self.points[point].is_some());
                // Three points leave up to four poses: one photograph is placed at a time, so that the points it adds help the next.
                let is_next = !(placed && least == 3);
                if self.photos[photo].is_none() && is_next && least <= image_points.len() {
                    placed |= self.place_photo(photo, &image_points);
                }
            }
            if placed {
                return;
            }
        }
        for photo in (0..self.photos.len()).filter(|p| self.photos[*p].is_none()) {
            let seen = self.image_points(|p, point| p == photo && self.points[point].is_some()).len();
            let reason =
                "too few points of known place were clicked in it; image point at least four control points";
            if !self.reasons.iter().any(|r| r.0 == Item::Photo(photo)) {
                self.reasons
                    .push((Item::Photo(photo), undetermined("photo", photo, reason, seen as f64, 3.0)));
            }
        }
    }

    fn place_photo(&mut self, photo: usize, image_points: &[Constraint]) -> bool {
        let camera = self.problem.cameras[self.problem.camera_of_photo[photo]].camera;
        let mut seen = Vec::with_capacity(image_points.len());
        for image_point in image_points {
            let Constraint::ImagePoint { point, pixel, covariance_px2, .. } = image_point else { continue };
            let Some(x) = self.points[*point] else { continue };
            match Correspondence::new(camera, x, *pixel, covariance_px2.sigma_px()) {
                Ok(c) => seen.push(c.with_covariance(*covariance_px2)),
                Err(reason) => {
                    self.reasons.push((Item::Photo(photo), reason));
                    return false;
                }
            }
        }
        match locate(&seen, camera, &Config::default()) {
            Ok(estimate) => {
                self.photos[photo] = Some(estimate.cam_from_target);
                let others = estimate.minima().skip(1).map(|h| (photo, h.minimum.cam_from_target));
                self.alternatives.extend(others);
                true
            }
            Err(reason) => {
                self.reasons.push((Item::Photo(photo), reason));
                false
            }
        }
    }

    fn place_points(&mut self) {
        let mut seen: Vec<Vec<Constraint>> = vec![Vec::new(); self.points.len()];
        for image_point in
            self.image_points(|photo, p| self.photos[photo].is_some() && self.points[p].is_none())
        {
            if let [Some(point), _] = image_point.points() {
                seen[point].push(image_point);
            }
        }
        for point in (0..self.points.len()).filter(|p| self.points[*p].is_none()).collect::<Vec<_>>() {
            let image_points = core::mem::take(&mut seen[point]);
            let found = self.by_rays(&image_points);
            let place = match &found {
                Some(Ok(x)) => Some(*x),
                _ => self.on_plane(point, &image_points).or_else(|| self.above_foot(point, &image_points)),
            };
            self.points[point] = place;
            if place.is_none() {
                let n = image_points.len();
                let reason = match (n, self.plane_of[point]) {
                    (0, _) => "no photograph that has a place shows it",
                    (_, None) => {
                        "it was seen once and lies on no plane; mark it in a second photograph, or put it on a plane"
                    }
                    (_, Some(_)) => "its ray does not meet its plane in front of the camera",
                };
                let why = match found {
                    Some(Err(reason)) => reason,
                    _ => undetermined("point", point, reason, n as f64, 2.0),
                };
                self.reasons.push((Item::Point(point), why));
            }
        }
    }

    fn by_rays(&self, image_points: &[Constraint]) -> Option<Result<Point, Error>> {
        let view = |image_point: &Constraint| {
            let Constraint::ImagePoint { photo, pixel, covariance_px2, .. } = image_point else {
                return None;
            };
            Some(PointView {
                camera: self.problem.cameras[self.problem.camera_of_photo[*photo]].camera,
                cam_from_world: self.photos[*photo]?,
                covariance: None,
                intrinsics_covariance: None,
                pixel: *pixel,
                covariance_px2: *covariance_px2,
            })
        };
        let views: Vec<PointView> = image_points.iter().filter_map(view).collect();
        (2 <= views.len()).then(|| triangulate(&views).map(|t| t.x_in_world))
    }

    /// Returns centre and direction of an image point's ray, world frame.
    fn ray(&self, image_point: &Constraint) -> Option<(Point, Vector3<f64>)> {
        let Constraint::ImagePoint { photo, pixel, .. } = image_point else { return None };
        let pose = self.photos[*photo]?;
        let camera = self.problem.cameras[self.problem.camera_of_photo[*photo]].camera;
        Some((pose.origin(), pose.rotation.tr_mul(&camera.bearing(pixel).ok()?.into_inner())))
    }

    fn on_plane(&self, point: usize, image_points: &[Constraint]) -> Option<Point> {
        let plane = self.planes[self.plane_of[point]?]?;
        image_points.iter().find_map(|image_point| {
            let (centre, ray) = self.ray(image_point)?;
            let depth = -plane.above_m(&centre) / plane.normal.dot(&ray);
            (0.0 < depth && depth.is_finite()).then(|| centre + ray * depth)
        })
    }

    /// Returns the point of the upright through its foot (or below its top) that is nearest to the ray.
    fn above_foot(&self, point: usize, image_points: &[Constraint]) -> Option<Point> {
        let (other, up) = self.problem.constraints.iter().find_map(|f| match f {
            Constraint::Upright { plane, foot, top, .. } if *top == point => {
                Some((self.points[*foot]?, self.planes[*plane]?.normal))
            }
            Constraint::Upright { plane, foot, top, .. } if *foot == point => {
                Some((self.points[*top]?, -self.planes[*plane]?.normal))
            }
            _ => None,
        })?;
        let (centre, ray) = self.ray(image_points.first()?)?;
        // The nearest points of the lines other + s up and centre + t ray.
        let (between, cos) = (centre - other, up.dot(&ray));
        let s = (up.dot(&between) - cos * ray.dot(&between)) / (1.0 - cos * cos);
        (0.0 < s && s.is_finite()).then(|| other + up * s)
    }

    fn finish(mut self, control_points: &Places) -> Draft {
        self.face_cameras();
        let frame =
            if gauge::is_given(self.problem) { None } else { gauge::frame_control_points(control_points) };
        if let Some(frame) = frame {
            self.turn_into(frame);
        }
        let problem = self.problem;
        let dropped = |item: Item| match self.reasons.iter().find(|r| r.0 == item) {
            Some((_, reason)) => (item, reason.clone()),
            None => (item, undetermined("item", 0, "nothing that has a place refers to it", 0.0, 1.0)),
        };
        let lost_points = (0..self.points.len()).filter(|p| self.points[*p].is_none()).map(Item::Point);
        let lost_photos = (0..self.photos.len()).filter(|p| self.photos[*p].is_none()).map(Item::Photo);
        let lost_planes = (0..self.planes.len()).filter(|p| self.planes[*p].is_none()).map(Item::Plane);
        let dropped = lost_photos.chain(lost_points).chain(lost_planes).map(dropped).collect();
        let nowhere = PlaneAt { normal: Vector3::z(), pivot: Point::zeros(), height_m: 0.0 };
        let state = State {
            photos: self.photos.iter().map(|p| p.unwrap_or(Pose::identity())).collect(),
            points: self.points.iter().map(|p| p.unwrap_or_default()).collect(),
            planes: self.planes.iter().map(|p| p.unwrap_or(nowhere)).collect(),
            lenses: problem.cameras.iter().map(|c| LensAt::new(c.camera, c.intrinsics_covariance)).collect(),
            camera_of_photo: problem.camera_of_photo.to_vec(),
        };
        Draft { state, dropped, alternatives: self.alternatives, control_points: frame }
    }

    /// Transforms everything into the frame of three control points, z towards the cameras.
    fn turn_into(&mut self, [a, b, c]: [usize; 3]) {
        let at = |p: usize| self.points[p].unwrap_or_default();
        let x = (at(b) - at(a)).normalize();
        let mut z = x.cross(&(at(c) - at(a))).normalize();
        let side: f64 = self.photos.iter().flatten().map(|pose| z.dot(&(pose.origin() - at(a)))).sum();
        if side < 0.0 {
            z = -z;
        }
        let y = z.cross(&x);
        let rotation = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
        let control_points_from_world = Pose::new(rotation, -(rotation * at(a)));
        let world_from_control_points = control_points_from_world.inverse();
        self.points.iter_mut().flatten().for_each(|x| *x = control_points_from_world * *x);
        self.photos.iter_mut().flatten().for_each(|pose| *pose = *pose * world_from_control_points);
        self.planes.iter_mut().flatten().for_each(|plane| {
            plane.normal = rotation * plane.normal;
            plane.pivot = control_points_from_world * plane.pivot;
        });
    }
}

pub(super) fn undetermined(
    what: &'static str,
    index: usize,
    reason: &'static str,
    metric: f64,
    needed: f64,
) -> Error {
    Error::Undetermined { what, index, reason, metric, needed }
}
