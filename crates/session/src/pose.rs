//! Solves for the pose of a photograph from its points.

use crate::lens::{self, KnownLens};
use crate::places::Places;
use crate::state::{PhotoState, State};
use nalgebra::DMatrix;
use resight::core::advise::ground::Plane;
use resight::core::{Camera, Correspondence, Matrix6, Pixel, Point, Pose};
use resight::locate::{NamedPoint, PointsOptions, locate_points};
use resight::nominal::NominalLens;
use resight::{PoseAnswer, Status};
use std::sync::Arc;

/// A photograph whose camera has a pose.
#[derive(Debug, Clone)]
pub struct Solved {
    pub answer: PoseAnswer,
    /// The lens, estimated or given.
    pub camera: Camera,
    /// Covariance of its parameters, row by row, as it was before these points.
    pub intrinsics_covariance: Option<Vec<f64>>,
    /// The points that took part.
    pub points: Vec<NamedPoint>,
    /// The pose that is drawn: as answered or as chosen.
    pub cam_from_world: Pose,
    pub covariance: Matrix6,
    /// The other pose that fits.
    pub other_cam_from_world: Option<Pose>,
    /// 1 where z points up, −1 where it points into the ground.
    pub up: f64,
}

/// The inputs on which a pose depends.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The name of the photograph in messages.
    pub name: String,
    /// Its points that have positions.
    pub points: Vec<NamedPoint>,
    pub lens: Arc<KnownLens>,
    /// The minimum that the person chose.
    pub chosen: Option<usize>,
}

/// The result for the points of a photograph.
#[derive(Debug, Clone)]
pub enum Attempt {
    /// Something is missing.
    Incomplete,
    /// An answer without a pose.
    Refused(Box<PoseAnswer>),
    /// A pose.
    Solved(Arc<Solved>),
}

impl Attempt {
    /// Returns whether the answer says all that can be said: it is right, or the causes of the contradiction were sought.
    pub fn is_whole(&self, is_dragged: bool) -> bool {
        match self {
            Attempt::Incomplete => true,
            Attempt::Refused(_) => !is_dragged,
            Attempt::Solved(solved) => !is_dragged || solved.answer.verdict.status == Status::Ok,
        }
    }
}

/// Solves the points that have places; the causes of a contradiction are not sought while a point is dragged.
pub fn solve(Given { name, points, lens, chosen }: &Given, is_dragged: bool) -> Attempt {
    let lens = &**lens;
    let camera = camera_of(lens);
    let needed = if matches!(lens, KnownLens::Unknown(_)) { 4 } else { 3 };
    if points.len() < needed {
        return Attempt::Incomplete;
    }
    let mut options = PointsOptions { is_provisional: is_dragged, ..PointsOptions::default() };
    match lens {
        KnownLens::Camera { intrinsics, .. } => options.intrinsics = intrinsics.clone(),
        KnownLens::Unknown(prior) => options.estimate_focal = Some(*prior),
    }
    let answer = locate_points(name, points, &camera, &options);
    let Some(estimate) = answer.estimate else { return Attempt::Refused(Box::new(answer)) };
    let Some((camera, intrinsics_covariance)) = lens_of(lens, camera, &answer) else {
        return Attempt::Refused(Box::new(answer));
    };
    let all: Vec<_> = estimate.minima().collect();
    let alternatives = estimate.n_alternatives();
    let chosen = chosen.unwrap_or(0).min(all.len() - 1);
    let other = if chosen == 0 { 1 } else { 0 };
    let is_flat = points.iter().all(|p| p.seen.x_in_target.z == 0.0);
    let taken = all[chosen].minimum;
    let up = if is_flat && taken.cam_from_target.origin().z < 0.0 { -1.0 } else { 1.0 };
    Attempt::Solved(Arc::new(Solved {
        camera,
        intrinsics_covariance,
        points: points.clone(),
        cam_from_world: taken.cam_from_target,
        covariance: taken.covariance,
        other_cam_from_world: all
            .get(other)
            .filter(|_| other < alternatives.max(chosen + 1))
            .map(|h| h.minimum.cam_from_target),
        up,
        answer,
    }))
}

fn camera_of(lens: &KnownLens) -> Camera {
    match lens {
        KnownLens::Camera { camera, .. } => (**camera).clone(),
        KnownLens::Unknown(_) => Camera::normalized(),
    }
}

/// Returns the points of a photograph that have positions.
pub fn named_points(state: &State, photo: &PhotoState, lens: &KnownLens, places: &Places) -> Vec<NamedPoint> {
    let camera = &camera_of(lens);
    let one = |point: &crate::state::ImagePoint| {
        let place = places.by_name.get(&point.name)?;
        let pixel = Pixel::new(point.u_px, point.v_px);
        let sigma_px = point.sigma_px.unwrap_or(state.sigma_px);
        let seen = match lens {
            // Rays play no part where the lens is estimated: there is none yet.
            KnownLens::Unknown(_) => Correspondence::new(camera, place.x_m, Pixel::new(0.0, 0.0), sigma_px)
                .map(|c| Correspondence { pixel, ..c }),
            KnownLens::Camera { .. } => Correspondence::new(camera, place.x_m, pixel, sigma_px),
        };
        let seen = Correspondence { sigma_m: place.sigma_m, ..seen.ok()? };
        Some(NamedPoint { name: point.name.clone(), line: None, seen })
    };
    photo.points.iter().filter_map(one).collect()
}

/// The lens with the covariance that its parameters have besides these points.
fn lens_of(lens: &KnownLens, camera: Camera, answer: &PoseAnswer) -> Option<(Camera, Option<Vec<f64>>)> {
    match lens {
        KnownLens::Camera { intrinsics, .. } => {
            let rows = intrinsics.as_ref().map(|known| known.covariance(&camera));
            Some((camera, rows))
        }
        KnownLens::Unknown(prior) => {
            let found = answer.estimated_focal.as_ref()?;
            let camera = lens::estimated(found, prior)?;
            let nominal =
                NominalLens::HorizontalFieldOfView(lens::hfov_deg(&camera)?).camera(prior.size).ok()?;
            let mut covariance: DMatrix<f64> = nominal.intrinsics_covariance?;
            // The focal length is open: only the points determine it.
            let open = (WIDE_FOCAL * found.focal_px).powi(2);
            (0..4).for_each(|k| covariance[(k / 2, k % 2)] += open);
            Some((camera, Some(covariance.transpose().iter().copied().collect())))
        }
    }
}

/// Standard deviation of a focal length of which nothing is known, in parts of it.
const WIDE_FOCAL: f64 = 0.5;

/// Share of the distance from the camera by which a foot is raised to see which way is up.
const RAISED: f64 = 0.01;

/// Returns foot and top of an object on the ground, whichever was clicked first.
pub fn foot_first(solved: &Solved, [a, b]: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let pixel = |[u, v]: [f64; 2]| Pixel::new(u, v);
    let on_ground = |at| Plane::level(0.0).seen_at(&solved.camera, &solved.cam_from_world, &pixel(at));
    let is_above = |foot: Point| {
        let height = RAISED * (foot - solved.cam_from_world.origin()).norm();
        let raised = foot + Point::z() * (solved.up * height);
        let seen = |x: Point| solved.camera.project(&(solved.cam_from_world * x));
        let up = seen(raised)? - seen(foot)?;
        Some(0.0 <= up.dot(&(pixel(b) - pixel(a))))
    };
    match on_ground(a).map(is_above) {
        Some(Some(false)) => [b, a],
        // A point whose ray does not meet the ground is above the horizon.
        None if on_ground(b).is_some() => [b, a],
        _ => [a, b],
    }
}

/// Names of the points that have a pixel but no place.
pub fn without_place<'a>(photo: &'a PhotoState, places: &Places) -> Vec<&'a str> {
    let names = photo.points.iter().map(|p| p.name.as_str());
    names.filter(|name| !places.by_name.contains_key(*name)).collect()
}

/// Smallest box around the points, target frame.
pub fn bounds(points: &[NamedPoint]) -> (Point, Point) {
    let all = || points.iter().map(|p| p.seen.x_in_target);
    let least = all().fold(Point::repeat(f64::INFINITY), |m, p| m.inf(&p));
    (least, all().fold(Point::repeat(f64::NEG_INFINITY), |m, p| m.sup(&p)))
}
