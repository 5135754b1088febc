//! Moves zones by the rotation of their camera, and bounds what else may have moved them. Equations: docs/math/zones.md.

use super::file::{Zone, ZonesFile};
use super::motion::CameraMotion;
use crate::Error;
use crate::answer::SchemaNumber;
use crate::answer::zones::ZoneAnswer;
use crate::core::camera::ImageSize;
use crate::core::{Camera, Matrix6, Pixel, Point};
use crate::report::verdict::Status;
use crate::report::words::{length, percent};
use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2};

/// An edge is subdivided until its middle is this near the straight line between its ends, px.
const BEND_PX: f64 = 0.25;
/// … into this many parts at most, 2 to this power.
const MOST_HALVINGS: u32 = 7;
/// √χ² of two degrees of freedom at 95 %.
const SIGMAS_95: f64 = 2.447_746_830_680_816;
/// The nearest distance that is searched for a limit, m.
const NEAREST_M: f64 = 0.01;
/// Halvings between that and the farthest.
const HALVINGS: usize = 60;
/// A zone this near the border of the old image may have been cut by it, px.
const BORDER_PX: f64 = 1.5;
/// A smaller part outside the image is that of rounding.
const ALL_OF_IT: f64 = 0.999;

/// How zones are moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZoneOptions {
    /// How far a moved zone may be off, 95 %, px.
    pub limit_px: f64,
    /// The distance of the nearest thing in the zones that matters, m.
    pub nearest_m: Option<f64>,
    /// By how much the camera may have shifted, one standard deviation along each axis, m; `None` where only the motion states that.
    pub shift_sigma_m: Option<f64>,
}

impl Default for ZoneOptions {
    fn default() -> Self {
        ZoneOptions { limit_px: 2.0, nearest_m: None, shift_sigma_m: None }
    }
}

/// The zones after a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedZones {
    /// One answer for each zone, in order.
    pub answers: Vec<ZoneAnswer>,
    /// The file of zones for the present image, in the format of the old one; `None` unless every zone is `ok`.
    pub file: Option<String>,
    /// What is to be known about the motion.
    pub remarks: Vec<String>,
}

/// Moves zones of a camera's reference image to its present image.
///
/// # Errors
/// Zones of images that are not of the camera's aspect; options that are not positive.
pub fn move_zones(
    zones: &ZonesFile,
    camera: &Camera,
    motion: &CameraMotion,
    options: &ZoneOptions,
) -> Result<MovedZones, Error> {
    let is_positive = |x: f64| 0.0 < x && x.is_finite();
    if !is_positive(options.limit_px)
        || !options.nearest_m.is_none_or(is_positive)
        || options.shift_sigma_m.is_some_and(|s| !(0.0..f64::INFINITY).contains(&s))
    {
        return Err(Error::request(
            "the limit in pixels and the nearest distance must be positive, and the shift 0 or more",
        ));
    }
    let ImageSize { width_px, height_px } = zones.size;
    let camera = crate::formats::check_image_size(camera, width_px, height_px).map_err(Error::request)?;
    let motion = match options.shift_sigma_m.map(|sigma_m| motion.with_shift_prior(sigma_m)).transpose() {
        Ok(narrowed) => narrowed.unwrap_or_else(|| motion.clone()),
        Err(reason) => return Ok(contradicted(zones, motion, options, &reason)),
    };
    let motion = &motion;
    let mover = Mover { camera: &camera, motion, size: zones.size };
    let answers: Vec<ZoneAnswer> = zones.zones.iter().map(|zone| mover.answer(zone, options)).collect();
    let polygons: Option<Vec<Vec<[f64; 2]>>> =
        answers.iter().map(|answer| answer.polygon_px.clone()).collect();
    let file = polygons.map(|polygons| zones.with_polygons(&polygons)).transpose()?;
    Ok(MovedZones { answers, file, remarks: motion.remarks.clone() })
}

/// What there is to say of zones whose camera shifted though it should not have.
fn contradicted(zones: &ZonesFile, motion: &CameraMotion, options: &ZoneOptions, reason: &str) -> MovedZones {
    let answer = |zone: &Zone| ZoneAnswer {
        schema: SchemaNumber,
        kind: "zone",
        status: Status::Inconsistent,
        zone: zone.name.clone(),
        polygon_px: None,
        coordinates: None,
        moved_px: None,
        error_px: None,
        limit_px: options.limit_px,
        holds_from_m: None,
        share_in_image: None,
        message: reason.to_string(),
    };
    MovedZones {
        answers: zones.zones.iter().map(answer).collect(),
        file: None,
        remarks: motion.remarks.clone(),
    }
}

/// A point of a zone's border: where the rotation moves it.
#[derive(Debug, Clone, Copy)]
struct Moved {
    old: Pixel,
    /// Beyond the field of the lens, a pixel far outside the image in the same direction.
    new: Pixel,
    is_in_field: bool,
}

struct Mover<'a> {
    camera: &'a Camera,
    motion: &'a CameraMotion,
    size: ImageSize,
}

impl Mover<'_> {
    fn answer(&self, zone: &Zone, options: &ZoneOptions) -> ZoneAnswer {
        let border = self.border(zone);
        let whole: Vec<Vector2<f64>> = border.iter().map(|p| p.new).collect();
        let clipped = self.clipped(&whole);
        let share = area(&clipped) / area(&whole).max(f64::MIN_POSITIVE);
        let moved_px = zone.polygon_px.iter().map(|p| self.moved_px(&Pixel::from(*p))).fold(0.0, f64::max);
        let points: Vec<Pixel> =
            border.iter().filter(|p| p.is_in_field && self.camera.contains(&p.new)).map(|p| p.old).collect();
        // A zone around the whole image has no border in it: the image's own corners stand for it.
        let points = if points.is_empty() { self.corners_seen() } else { points };
        let error = |s: f64| points.iter().map(|p| self.error_px(p, s)).fold(0.0, f64::max);
        let holds_from_m = holds_from_m(&error, options.limit_px);
        let shifts = self.may_shift();
        let nearest = options.nearest_m.map_or((!shifts).then_some(0.0), |d| Some(1.0 / d));
        let error_px = nearest.map(|s| error(s).max(error(0.0))).filter(|px| px.is_finite());
        let is_known = error_px.is_some_and(|px| px <= options.limit_px);
        let status = match (clipped.len() < 3 || !(0.0 < share), is_known) {
            (true, _) => Status::NotFound,
            (false, true) => Status::Ok,
            (false, false) => Status::Undecided,
        };
        let polygon_px: Option<Vec<[f64; 2]>> =
            (status == Status::Ok).then(|| clipped.iter().map(|p| [p.x, p.y]).collect());
        let message = match status {
            Status::Ok => self.moved_words(zone, moved_px, error_px, share, options),
            Status::NotFound => format!(
                "the zone has left the image: the rotation moves it by {moved_px:.0} px; turn the camera back, or draw a new one"
            ),
            _ => self.limit_words(error(0.0), error_px, holds_from_m, options),
        };
        ZoneAnswer {
            schema: SchemaNumber,
            kind: "zone",
            status,
            zone: zone.name.clone(),
            coordinates: polygon_px.as_ref().and_then(|polygon| zone.coordinates(polygon, self.size)),
            polygon_px,
            moved_px: Some(moved_px),
            error_px,
            limit_px: options.limit_px,
            holds_from_m: holds_from_m.map(|d| if shifts { d } else { 0.0 }),
            share_in_image: Some(share.clamp(0.0, 1.0)),
            message,
        }
    }

    fn moved_words(
        &self,
        zone: &Zone,
        moved_px: f64,
        error_px: Option<f64>,
        share: f64,
        options: &ZoneOptions,
    ) -> String {
        let mut text =
            format!("moved by up to {moved_px:.1} px, to within {:.1} px", error_px.unwrap_or(0.0));
        if let (true, Some(nearest_m)) = (self.may_shift(), options.nearest_m) {
            text += &format!(" for everything at {} or farther", length(nearest_m));
        }
        if share < ALL_OF_IT {
            text += &format!("; {} of it is in the image, the rest is cut off", percent(share));
        }
        if self.was_cut(zone) {
            text += "; it reached the border of the old image, and what lies beyond that is not in it";
        }
        text
    }

    fn limit_words(
        &self,
        far_px: f64,
        error_px: Option<f64>,
        holds_from_m: Option<f64>,
        options: &ZoneOptions,
    ) -> String {
        let limit = options.limit_px;
        let shift_m = self.motion.old_from_new.translation.norm();
        let sigma_m =
            (self.motion.covariance.fixed_view::<3, 3>(3, 3)).symmetric_eigenvalues().max().max(0.0).sqrt();
        let shift = format!("a shift of {} ± {}", length(shift_m), length(sigma_m));
        match (holds_from_m, error_px, options.nearest_m) {
            (None, ..) => format!(
                "the rotation itself is known to {far_px:.1} px only, more than the limit of {limit} px: measure it better, or raise --limit-px"
            ),
            (Some(from), Some(px), Some(nearest)) => format!(
                "{shift} moves things at {} by up to {px:.1} px more than the rotation does, and the limit is {limit} px: a rotation explains what is farther than {}; draw the zone again",
                length(nearest),
                length(from)
            ),
            (Some(from), ..) => format!(
                "{shift} moves near things more than far ones: a rotation explains what is farther than {} to {limit} px; state the nearest distance in the zone with --nearest-m",
                length(from)
            ),
        }
    }

    /// Whether the camera may have shifted, as far as is known.
    fn may_shift(&self) -> bool {
        let shift = self.motion.old_from_new.translation.amax();
        0.0 < shift || 0.0 < self.motion.covariance.fixed_view::<3, 3>(3, 3).amax()
    }

    /// Rotates a direction of the old camera frame into the present one.
    fn rotated(&self, x_in_old: &Point) -> Point {
        self.motion.old_from_new.rotation.tr_mul(x_in_old)
    }

    /// zones.md eq. (2).
    fn moved(&self, old: &Pixel) -> Moved {
        let middle = self.middle();
        let far = 4.0 * middle.norm();
        let Ok(bearing) = self.camera.bearing(old) else {
            // Beyond the lens model, as corners of a fisheye are: outside, in the direction that it had.
            let new = middle + (old - middle).try_normalize(0.0).unwrap_or_default() * far;
            return Moved { old: *old, new, is_in_field: false };
        };
        let x_in_new = self.rotated(&bearing.into_inner());
        match self.camera.project(&x_in_new) {
            Some(new) => Moved { old: *old, new, is_in_field: true },
            None => {
                let outwards = Vector2::new(x_in_new.x, x_in_new.y).try_normalize(0.0).unwrap_or_default();
                Moved { old: *old, new: middle + outwards * far, is_in_field: false }
            }
        }
    }

    fn moved_px(&self, old: &Pixel) -> f64 {
        let moved = self.moved(old);
        (moved.new - old).norm()
    }

    fn middle(&self) -> Vector2<f64> {
        Vector2::new(f64::from(self.size.width_px), f64::from(self.size.height_px)) * 0.5
            - Vector2::repeat(0.5)
    }

    /// Moves the border of a zone, its edges subdivided where the lens bends them.
    fn border(&self, zone: &Zone) -> Vec<Moved> {
        let corners: Vec<Moved> = zone.polygon_px.iter().map(|p| self.moved(&Pixel::from(*p))).collect();
        let mut border = Vec::new();
        for (i, corner) in corners.iter().enumerate() {
            border.push(*corner);
            self.subdivide(corner, &corners[(i + 1) % corners.len()], MOST_HALVINGS, &mut border);
        }
        border
    }

    fn subdivide(&self, a: &Moved, b: &Moved, halvings: u32, border: &mut Vec<Moved>) {
        let middle = self.moved(&((a.old + b.old) * 0.5));
        let is_bent = BEND_PX < (middle.new - (a.new + b.new) * 0.5).norm();
        if halvings == 0 || !is_bent {
            return;
        }
        self.subdivide(a, &middle, halvings - 1, border);
        border.push(middle);
        self.subdivide(&middle, b, halvings - 1, border);
    }

    /// Cuts a polygon at the border of the image.
    fn clipped(&self, polygon: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
        let far = [f64::from(self.size.width_px) - 0.5, f64::from(self.size.height_px) - 0.5];
        let mut polygon = polygon.to_vec();
        for axis in 0..2 {
            polygon = kept(&polygon, axis, 1.0, -0.5);
            polygon = kept(&polygon, axis, -1.0, -far[axis]);
        }
        // Where an edge was cut it is rounded.
        polygon.iter().map(|p| Vector2::new(p.x.clamp(-0.5, far[0]), p.y.clamp(-0.5, far[1]))).collect()
    }

    fn was_cut(&self, zone: &Zone) -> bool {
        let far = [f64::from(self.size.width_px) - 1.0, f64::from(self.size.height_px) - 1.0];
        zone.polygon_px
            .iter()
            .any(|p| (0..2).any(|i| p[i] < BORDER_PX - 0.5 || far[i] + 0.5 - BORDER_PX < p[i]))
    }

    /// The corners of the present image where they were in the old one.
    fn corners_seen(&self) -> Vec<Pixel> {
        let [w, h] = [f64::from(self.size.width_px) - 1.0, f64::from(self.size.height_px) - 1.0];
        let corners = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h], [0.5 * w, 0.5 * h]];
        let old = corners.iter().filter_map(|corner| {
            let bearing = self.camera.bearing(&Pixel::from(*corner)).ok()?;
            self.camera.project(&(self.motion.old_from_new.rotation * bearing.into_inner()))
        });
        old.collect()
    }

    /// How far the image of something at the inverse distance `s` (1/m) may be from where the rotation moves it, 95 %: zones.md eq. (6).
    fn error_px(&self, old: &Pixel, s: f64) -> f64 {
        let Ok(bearing) = self.camera.bearing(old) else { return 0.0 };
        let b = bearing.into_inner();
        let there = self.camera.project_with_jacobian(&self.rotated(&b));
        let shifted = self.camera.project(&self.rotated(&(b - s * self.motion.old_from_new.translation)));
        let (Some((there, jacobian)), Some(shifted)) = (there, shifted) else { return f64::INFINITY };
        let covariance = self.covariance_px2(&b, &jacobian, s);
        let measured =
            self.motion.shift_px.map_or(0.0, |([u, v], [su, sv])| u.hypot(v) + SIGMAS_95 * su.max(sv));
        (shifted - there).norm()
            + SIGMAS_95 * covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
            + measured
    }

    /// zones.md eq. (5).
    fn covariance_px2(&self, b: &Point, jacobian: &Matrix2x3<f64>, s: f64) -> Matrix2<f64> {
        let to_pixel = jacobian * self.motion.old_from_new.rotation.transpose();
        let mut by_motion = SMatrix::<f64, 2, 6>::zeros();
        by_motion.fixed_columns_mut::<3>(0).copy_from(&(to_pixel * b.cross_matrix()));
        by_motion.fixed_columns_mut::<3>(3).copy_from(&(to_pixel * -s));
        let covariance: &Matrix6 = &self.motion.covariance;
        by_motion * covariance * by_motion.transpose()
    }
}

/// Returns the nearest distance from which on the error stays within the limit; `None` where it does not even infinitely far away.
fn holds_from_m(error: &impl Fn(f64) -> f64, limit_px: f64) -> Option<f64> {
    let is_within = |s: f64| error(s) <= limit_px;
    if !is_within(0.0) {
        return None;
    }
    // The error is the larger of two ends of a convex function, zones.md section 3, so that within the limit is an interval from 0 on.
    let (mut within, mut beyond) = (0.0, 1.0 / NEAREST_M);
    if is_within(beyond) {
        return Some(NEAREST_M);
    }
    for _ in 0..HALVINGS {
        let half = 0.5 * (within + beyond);
        if is_within(half) { within = half } else { beyond = half }
    }
    (0.0 < within).then(|| 1.0 / within)
}

/// Keeps what has side · x[axis] ≥ least (Sutherland and Hodgman).
fn kept(polygon: &[Vector2<f64>], axis: usize, side: f64, least: f64) -> Vec<Vector2<f64>> {
    let inside = |p: &Vector2<f64>| side * p[axis] - least;
    let mut kept = Vec::with_capacity(polygon.len() + 4);
    for (i, b) in polygon.iter().enumerate() {
        let a = &polygon[(i + polygon.len() - 1) % polygon.len()];
        if (0.0 <= inside(a)) != (0.0 <= inside(b)) {
            kept.push(a.lerp(b, inside(a) / (inside(a) - inside(b))));
        }
        if 0.0 <= inside(b) {
            kept.push(*b);
        }
    }
    kept
}

fn area(polygon: &[Vector2<f64>]) -> f64 {
    let next = |i: usize| polygon[(i + 1) % polygon.len()];
    0.5 * (0..polygon.len()).map(|i| polygon[i].perp(&next(i))).sum::<f64>().abs()
}
