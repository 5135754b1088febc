//! Advice for measured points: where to put the next one.

use super::maps::FurtherPoint;
use super::read::MeasuredPoint;
use crate::Error;
use crate::answer::advise::{Figures, Picture, PointSuggestion, PointsAdvice, PointsNow, TriedPlaces};
use crate::answer::{SchemaNumber, Status};
use crate::core::advise::expect::{NEEDED_SEPARATION_SIGMA, View, expect};
use crate::core::advise::ground::{GroundLength, Plane};
use crate::core::advise::layout::layout_warnings;
use crate::core::advise::point::{Aim, Gain, NextPoint, spread_out};
use crate::core::locate::{Config, locate};
use crate::core::target::KnownPoint;
use crate::core::{Camera, Correspondence, Matrix6, Pixel, Point, Pose};

/// Cells along each side of a region.
const CELLS: usize = 60;
/// Number of positions advised in a region.
const ADVISED: usize = 5;
/// Number of positions advised from a list.
const LISTED: usize = 20;
/// Smallest distance between advised positions, as a part of the region's diagonal.
const APART: f64 = 0.15;

/// The quantity whose uncertainty is to become small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AimFor {
    /// The camera's position, in its worst direction.
    Place,
    /// The camera's rotation, about its worst axis.
    Rotation,
    /// The length of [`NextPointRequest::length_m`].
    Length,
}

/// A question about points.
#[derive(Debug, Clone)]
pub struct NextPointRequest<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Covariance of its intrinsics, row by row, in the order of `Camera::parameters`; none: exact.
    pub intrinsics_covariance: Option<&'a [f64]>,
    /// Points measured so far.
    pub points: &'a [MeasuredPoint],
    /// Standard deviation of u and v, pixels.
    pub sigma_px: f64,
    /// Approximate cam_from_target; by default solved from the points' pixels.
    pub pose: Option<Pose>,
    /// The positions to choose from; by default a grid over the region.
    pub candidates: Option<&'a [MeasuredPoint]>,
    /// Height of the ground in the target frame.
    pub ground_z_m: f64,
    /// The region on the ground for the next point, as x0, y0, x1, y1; by default around the points.
    pub region_m: Option<[f64; 4]>,
    /// x1, y1, x2, y2: ends of a length that will be measured on the ground.
    pub length_m: Option<[f64; 4]>,
    /// The quantity whose uncertainty is to become small; by default the length where one is given, else the position.
    pub aim: Option<AimFor>,
    /// Whether to draw maps, which takes seconds.
    pub pictures: bool,
}

/// Computes where to put the next point so that the uncertainty becomes smallest.
///
/// # Errors
/// A camera without an image size, points that give no pose, a region that the camera does not see.
pub fn advise_points(request: &NextPointRequest) -> Result<PointsAdvice, Error> {
    super::must_have_image(request.camera)?;
    let mut remarks = Vec::new();
    let cam_from_target = pose(request, &mut remarks)?;
    let length = length(request, &cam_from_target)?;
    let aim = aim(request, length)?;
    let known = request.points.iter().map(|point| point.known).collect();
    let names = request.points.iter().map(|point| point.name.clone()).collect();
    Question { request, cam_from_target, known, names, length, aim }.answer(remarks)
}

/// What the answer needs besides the request.
struct Question<'a> {
    request: &'a NextPointRequest<'a>,
    cam_from_target: Pose,
    known: Vec<KnownPoint>,
    names: Vec<String>,
    length: Option<GroundLength>,
    aim: (Aim, &'static str),
}

/// The positions to try, their names, and the box that contains them.
struct Candidates {
    known: Vec<KnownPoint>,
    names: Vec<String>,
    region_m: [f64; 4],
}

/// Returns the pose that the request states, or else solves it from the points' pixels.
fn pose(request: &NextPointRequest, remarks: &mut Vec<String>) -> Result<Pose, Error> {
    if let Some(pose) = request.pose {
        return Ok(pose);
    }
    let one = |point: &MeasuredPoint| {
        let Some([u, v]) = point.pixel else {
            return Err(Error::request(format!(
                "mark {} has no u_px,v_px; fill them in, or give about where the camera is with --pose",
                point.name
            )));
        };
        let c =
            Correspondence::new(request.camera, point.known.position, Pixel::new(u, v), request.sigma_px)?;
        Ok(Correspondence { sigma_m: point.known.sigma_m, ..c })
    };
    let seen: Vec<Correspondence> = request.points.iter().map(one).collect::<Result<_, Error>>()?;
    let intrinsics_covariance = request.intrinsics_covariance;
    let config = Config { intrinsics_covariance, ..Config::default() };
    let answer = locate(&seen, request.camera, &config)
        .map_err(|reason| Error::request(format!("the control points' pixels give no pose: {reason}")))?;
    let all: Vec<Pose> =
        answer.minima().filter(|h| h.is_alternative).map(|h| h.minimum.cam_from_target).collect();
    // Of poses that fit about equally well, the one above the ground is taken; the user can state another.
    let above = |pose: &&Pose| request.ground_z_m < pose.origin().z;
    let taken = all.iter().find(above).copied().unwrap_or(answer.cam_from_target);
    if 1 < all.len() {
        let at = |p: &Pose| format!("({:.2}, {:.2}, {:.2}) m", p.origin().x, p.origin().y, p.origin().z);
        let list = all.iter().map(at).collect::<Vec<_>>().join(", ");
        remarks.push(format!(
            "{} poses fit these control points, camera at {list}; {} is taken, say otherwise with --pose",
            all.len(),
            at(&taken)
        ));
    }
    Ok(taken)
}

fn length(request: &NextPointRequest, pose: &Pose) -> Result<Option<GroundLength>, Error> {
    let Some([a, b, c, d]) = request.length_m else { return Ok(None) };
    let ends = [Point::new(a, b, request.ground_z_m), Point::new(c, d, request.ground_z_m)];
    let length = Plane::level(request.ground_z_m).length(request.camera, pose, ends, request.sigma_px);
    length.map(Some).map_err(|reason| Error::request(format!("--length-m: {reason}")))
}

fn aim(request: &NextPointRequest, length: Option<GroundLength>) -> Result<(Aim, &'static str), Error> {
    match (request.aim, length) {
        (Some(AimFor::Length) | None, Some(length)) => Ok((Aim::Length(length), "length")),
        (Some(AimFor::Length), None) => Err(Error::request("--minimise length needs --length-m X1,Y1,X2,Y2")),
        (Some(AimFor::Rotation), _) => Ok((Aim::Rotation, "rotation")),
        (Some(AimFor::Place) | None, _) => Ok((Aim::Place, "camera's position")),
    }
}

impl Question<'_> {
    fn view<'b>(&'b self, points: &'b [KnownPoint]) -> View<'b> {
        View {
            camera: self.request.camera,
            cam_from_target: self.cam_from_target,
            points,
            sigma_px: self.request.sigma_px,
            intrinsics_covariance: self.request.intrinsics_covariance,
        }
    }

    fn answer(&self, mut remarks: Vec<String>) -> Result<PointsAdvice, Error> {
        let so_far = |reason| Error::request(format!("the control points so far: {reason}"));
        let view = self.view(&self.known);
        let next = NextPoint::new(view).map_err(so_far)?;
        let candidates = self.candidates();
        let ranked = next.ranked(&candidates.known, &self.aim.0);
        if ranked.is_empty() {
            return Err(Error::request(format!(
                "none of the {} places tried can be seen by the camera; check --pose, the region and --ground-z-m",
                candidates.known.len()
            )));
        }
        let figures = self.figures(&view).map_err(so_far)?;
        let best = self.best(&candidates, &ranked);
        let mut suggestions = Vec::new();
        for (rank, i) in best.iter().enumerate() {
            match self.suggestion(rank + 1, &candidates.names[*i], &candidates.known[*i]) {
                Ok(suggestion) => suggestions.push(suggestion),
                Err(reason) => remarks.push(format!("{}: {reason}", candidates.names[*i])),
            }
        }
        let answered = suggestions.iter().any(|s| s.status == Status::Ok);
        let places: Vec<Point> = best.iter().map(|i| candidates.known[*i].position).collect();
        let with = next.with(&candidates.known[best[0]]).map(|gain| gain.covariance);
        Ok(PointsAdvice {
            now: PointsNow {
                schema: SchemaNumber,
                kind: "now",
                status: if answered { Status::Ok } else { Status::Degenerate },
                n_points: self.known.len(),
                sigma_px: self.request.sigma_px,
                camera_m: self.cam_from_target.origin().into(),
                figures,
            },
            suggestions,
            tried: self.tried(&candidates, &ranked),
            aim: self.aim.1,
            remarks,
            pictures: self.pictures(&next, &places, candidates.region_m, with),
        })
    }

    fn figures(&self, view: &View) -> Result<Figures, crate::core::Error> {
        let e = expect(view)?;
        let sigma_length = self.length.map(|l| l.sigma_m(&e.covariance));
        Ok(Figures::new(&e, sigma_length, &layout_warnings(view, &e)))
    }

    /// Returns the best positions: of a region those apart from each other, of a list all.
    fn best(&self, candidates: &Candidates, ranked: &[(usize, Gain)]) -> Vec<usize> {
        let [x0, y0, x1, y1] = candidates.region_m;
        let (apart_m, most) = match self.request.candidates {
            None => (APART * (x1 - x0).hypot(y1 - y0), ADVISED),
            Some(_) => (0.0, LISTED),
        };
        spread_out(&candidates.known, ranked, apart_m, most)
    }

    fn suggestion(
        &self,
        rank: usize,
        id: &str,
        candidate: &KnownPoint,
    ) -> Result<PointSuggestion, crate::core::Error> {
        let points = [self.known.as_slice(), &[*candidate]].concat();
        let figures = self.figures(&self.view(&points))?;
        Ok(PointSuggestion {
            schema: SchemaNumber,
            kind: "suggestion",
            status: if figures.first_order_valid { Status::Ok } else { Status::Degenerate },
            rank,
            id: id.to_owned(),
            x_in_target_m: candidate.position.into(),
            figures,
        })
    }

    /// Summarises what the other positions would give, which shows how much the choice matters.
    fn tried(&self, candidates: &Candidates, ranked: &[(usize, Gain)]) -> TriedPlaces {
        let is_clear = |(_, g): &&(usize, Gain)| NEEDED_SEPARATION_SIGMA <= g.separation_sigma;
        let clear = ranked.iter().filter(is_clear);
        let clear: Vec<f64> = clear.map(|(_, g)| self.aim.0.sigma(&g.covariance)).collect();
        TriedPlaces {
            n_tried: candidates.known.len(),
            n_hidden: candidates.known.len() - ranked.len(),
            n_ambiguous: ranked.len() - clear.len(),
            sigma: match clear.as_slice() {
                [] => None,
                all => Some([all[0], all[all.len() / 2], all[all.len() - 1]]),
            },
        }
    }

    fn candidates(&self) -> Candidates {
        let of_points = self.known.iter().map(|p| p.position);
        if let Some(listed) = self.request.candidates {
            let known: Vec<KnownPoint> = listed.iter().map(|p| p.known).collect();
            let region_m = around(known.iter().map(|p| p.position).chain(of_points), 0.1);
            return Candidates { known, names: listed.iter().map(|p| p.name.clone()).collect(), region_m };
        }
        let ends = self.request.length_m.iter();
        let ends = ends.flat_map(|[a, b, c, d]| [Point::new(*a, *b, 0.0), Point::new(*c, *d, 0.0)]);
        let region_m = self.request.region_m.unwrap_or_else(|| around(of_points.chain(ends), 0.5));
        let [x0, y0, x1, y1] = region_m;
        let part = |i: usize| (i as f64 + 0.5) / CELLS as f64;
        let cell = |k: usize| {
            let (x, y) = (x0 + (x1 - x0) * part(k % CELLS), y0 + (y1 - y0) * part(k / CELLS));
            KnownPoint { position: Point::new(x, y, self.request.ground_z_m), sigma_m: 0.0 }
        };
        let known: Vec<KnownPoint> = (0..CELLS * CELLS).map(cell).collect();
        Candidates { names: vec![String::new(); known.len()], known, region_m }
    }

    fn pictures(
        &self,
        next: &NextPoint,
        best: &[Point],
        region_m: [f64; 4],
        with_best: Option<Matrix6>,
    ) -> Vec<Picture> {
        if !self.request.pictures {
            return Vec::new();
        }
        let maps = FurtherPoint {
            view: self.view(&self.known),
            names: &self.names,
            next,
            aim: self.aim.0,
            aim_name: self.aim.1,
            ground_z_m: self.request.ground_z_m,
            region_m,
            length_m: self.request.length_m,
            best,
        };
        let pictures = [
            ("next-point-ground.png", Some(maps.over_ground())),
            ("next-point-image.png", maps.over_image()),
            ("places-ground.png", with_best.map(|c| maps.places_over_ground(&c))),
            ("places-image.png", with_best.and_then(|c| maps.places_over_image(&c))),
        ];
        super::drawn(pictures.map(|(name, map)| (name.to_owned(), map)))
    }
}

/// Returns the box around some points, widened by a part of its longer side.
fn around(points: impl Iterator<Item = Point>, part: f64) -> [f64; 4] {
    let [mut x0, mut y0, mut x1, mut y1] =
        [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for p in points {
        (x0, y0, x1, y1) = (x0.min(p.x), y0.min(p.y), x1.max(p.x), y1.max(p.y));
    }
    let by = part * (x1 - x0).max(y1 - y0);
    [x0 - by, y0 - by, x1 + by, y1 + by]
}
