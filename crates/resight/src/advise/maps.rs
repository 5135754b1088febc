//! The maps: which quantity is computed for which cell.

mod boards;

pub use boards::BoardMaps;

use super::heat::{Figure, HeatMap, MapMarker, MapMarkerKind, Under};
use crate::core::advise::expect::{NEEDED_SEPARATION_SIGMA, Optics, View, expect, worst_sigmas};
use crate::core::advise::ground::Plane;
use crate::core::advise::point::{Aim, NextPoint};
use crate::core::advise::volume::{Shape, Volume};
use crate::core::target::KnownPoint;
use crate::core::{Camera, Matrix6, Pixel, Point, Pose};
use nalgebra::Vector3;

/// Cells along the longer side of a map.
const CELLS: usize = 100;

/// The question for each cell: a further point on a level plane.
pub struct FurtherPoint<'a> {
    /// The view with the points so far.
    pub view: View<'a>,
    /// Names of its points.
    pub names: &'a [String],
    /// The view prepared for one more point.
    pub next: &'a NextPoint<'a>,
    /// The quantity whose uncertainty is to become small.
    pub aim: Aim,
    /// Its name in a title.
    pub aim_name: &'a str,
    /// Height of the plane in the target frame.
    pub ground_z_m: f64,
    /// The region as x0, y0, x1, y1.
    pub region_m: [f64; 4],
    /// Ends of the length to be measured.
    pub length_m: Option<[f64; 4]>,
    /// The advised positions, best first.
    pub best: &'a [Point],
}

/// Divides a box into a grid: returns the number of columns and the cell centres, row by row.
fn cells(least: [f64; 2], greatest: [f64; 2]) -> (usize, Vec<[f64; 2]>) {
    let [w, h] = [greatest[0] - least[0], greatest[1] - least[1]];
    let count = |side: f64| ((CELLS as f64 * side / w.max(h)).round() as usize).clamp(24, CELLS);
    let (columns, rows) = (count(w), count(h));
    let part = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    let all = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    let centres = all.map(|(i, j)| [least[0] + w * part(i, columns), least[1] + h * part(j, rows)]);
    (columns, centres.collect())
}

fn image_cells(camera: &Camera) -> Option<(usize, Vec<[f64; 2]>, Under)> {
    let size = camera.size?;
    let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
    let (columns, centres) = cells([-0.5, -0.5], [width - 0.5, height - 0.5]);
    Some((columns, centres, Under::Image { width_px: size.width_px, height_px: size.height_px }))
}

impl FurtherPoint<'_> {
    fn value(&self, x: Point) -> Option<f64> {
        let gain = self.next.with(&KnownPoint { position: x, sigma_m: 0.0 })?;
        (NEEDED_SEPARATION_SIGMA <= gain.separation_sigma).then(|| 2.0 * self.aim.sigma(&gain.covariance))
    }

    fn figure(&self) -> Figure {
        if matches!(self.aim, Aim::Rotation) { Figure::Angle } else { Figure::Length }
    }

    fn in_region(&self, x: &Point) -> bool {
        let [x0, y0, x1, y1] = self.region_m;
        (x0..=x1).contains(&x.x) && (y0..=y1).contains(&x.y)
    }

    /// Returns a map over the ground: 2σ of the aim if the further point is in the cell.
    pub fn over_ground(&self) -> HeatMap {
        let (columns, centres, under) = self.ground();
        let at = |c: &[f64; 2]| Point::new(c[0], c[1], self.ground_z_m);
        let values = centres.iter().map(at).map(|x| self.in_region(&x).then(|| self.value(x))?).collect();
        let title = format!("2σ of the {} with the next point here", self.aim_name);
        let notes = vec!["hatched: out of sight, out of the region, or the pose would stay ambiguous".into()];
        self.map(title, notes, self.figure(), under, columns, values)
    }

    /// Returns a map over the image: 2σ of the aim if the further point is the ground point at the pixel. `None` for a camera without an image
    /// size.
    pub fn over_image(&self) -> Option<HeatMap> {
        let (columns, centres, under) = image_cells(self.view.camera)?;
        let at = |c: &[f64; 2]| self.seen_at(c).filter(|x| self.in_region(x)).and_then(|x| self.value(x));
        let values = centres.iter().map(at).collect();
        let title = format!("2σ of the {} with the next point under this pixel", self.aim_name);
        let notes = vec!["hatched: not on the ground of the region, or the pose would stay ambiguous".into()];
        Some(self.map(title, notes, self.figure(), under, columns, values))
    }

    /// Returns a map over the ground: 2σ in the worst direction of a ground point that is marked in the image, for a pose of this covariance.
    pub fn places_over_ground(&self, covariance: &Matrix6) -> HeatMap {
        let (columns, centres, under) = self.ground();
        let at = |c: &[f64; 2]| Point::new(c[0], c[1], self.ground_z_m);
        let values = centres.iter().map(at).map(|x| self.place_value(&x, covariance)).collect();
        let title = "2σ of a place on the ground pointed at, the best next point added".to_string();
        let notes = vec!["worst direction; hatched: out of sight".into()];
        self.map(title, notes, Figure::Length, under, columns, values)
    }

    /// Returns the same figure as [`Self::places_over_ground`], as a map over the image. `None` for a camera without an image size.
    pub fn places_over_image(&self, covariance: &Matrix6) -> Option<HeatMap> {
        let (columns, centres, under) = image_cells(self.view.camera)?;
        let at = |c: &[f64; 2]| self.seen_at(c).and_then(|x| self.place_value(&x, covariance));
        let values = centres.iter().map(at).collect();
        let title = "2σ of the ground under this pixel, the best next point added".to_string();
        Some(self.map(
            title,
            vec!["worst direction; hatched: sky".into()],
            Figure::Length,
            under,
            columns,
            values,
        ))
    }

    fn place_value(&self, x: &Point, covariance: &Matrix6) -> Option<f64> {
        let seen = View { points: &[KnownPoint { position: *x, sigma_m: 0.0 }], ..self.view };
        crate::core::advise::correspondences_in_view(&seen)?;
        let place = self.plane().point(self.view.camera, &self.view.cam_from_target, x)?;
        Some(2.0 * place.worst_sigma_m(covariance, self.view.sigma_px))
    }

    fn plane(&self) -> Plane {
        Plane::level(self.ground_z_m)
    }

    fn seen_at(&self, pixel: &[f64; 2]) -> Option<Point> {
        self.plane().seen_at(self.view.camera, &self.view.cam_from_target, &Pixel::new(pixel[0], pixel[1]))
    }

    /// Returns the grid over the region, widened to the points and the camera's foot point where these are near.
    fn ground(&self) -> (usize, Vec<[f64; 2]>, Under) {
        let [x0, y0, x1, y1] = self.region_m;
        let foot = self.view.cam_from_target.origin();
        let reach = (x1 - x0).max(y1 - y0);
        let (mut least, mut greatest) = ([x0, y0], [x1, y1]);
        for p in self.view.points.iter().map(|p| p.position).chain([foot]) {
            let near = x0 - reach < p.x && p.x < x1 + reach && y0 - reach < p.y && p.y < y1 + reach;
            if near {
                let margin = 0.05 * reach;
                least = [least[0].min(p.x - margin), least[1].min(p.y - margin)];
                greatest = [greatest[0].max(p.x + margin), greatest[1].max(p.y + margin)];
            }
        }
        let (columns, centres) = cells(least, greatest);
        (columns, centres, Under::Plan { least_m: least, greatest_m: greatest, axes: ["x m", "y m"] })
    }

    fn map(
        &self,
        title: String,
        notes: Vec<String>,
        figure: Figure,
        under: Under,
        columns: usize,
        values: Vec<Option<f64>>,
    ) -> HeatMap {
        let is_plan = matches!(under, Under::Plan { .. });
        let project = |x: &Point| -> Option<[f64; 2]> {
            if is_plan {
                return Some([x.x, x.y]);
            }
            Some(self.view.camera.project(&(self.view.cam_from_target * *x))?.into())
        };
        let control_point = |x: &Point, name: String, kind| {
            project(x).filter(|at| is_inside(&under, at)).map(|at| MapMarker {
                at,
                name,
                kind,
                towards: None,
            })
        };
        let known = self.view.points.iter().zip(self.names);
        let mut control_points: Vec<MapMarker> = known
            .filter_map(|(p, name)| control_point(&p.position, name.clone(), MapMarkerKind::Known))
            .collect();
        let best = self.best.iter().enumerate().rev();
        control_points
            .extend(best.filter_map(|(i, x)| control_point(x, format!("{}", i + 1), MapMarkerKind::Best)));
        if is_plan {
            let r = &self.view.cam_from_target.rotation;
            let (foot, ahead) = (self.view.cam_from_target.origin(), r.tr_mul(&Vector3::z()));
            let sign = control_point(&foot, "camera".into(), MapMarkerKind::Camera);
            control_points
                .extend(sign.map(|m| MapMarker { towards: Some([foot.x + ahead.x, foot.y + ahead.y]), ..m }));
        }
        let ends = self.length_m.map(|[a, b, c, d]| [[a, b], [c, d]]);
        let ends = ends.and_then(|e| {
            let [p, q] = e.map(|[x, y]| project(&Point::new(x, y, self.ground_z_m)));
            Some([p?, q?])
        });
        HeatMap {
            title,
            notes,
            figure,
            under,
            columns,
            values,
            control_points,
            lines: ends.into_iter().collect(),
        }
    }
}

fn is_inside(under: &Under, [x, y]: &[f64; 2]) -> bool {
    let ([x0, y0], [x1, y1]) = match under {
        Under::Image { width_px, height_px } => ([-0.5, -0.5], [f64::from(*width_px), f64::from(*height_px)]),
        Under::Plan { least_m, greatest_m, .. } => (*least_m, *greatest_m),
    };
    (x0..=x1).contains(x) && (y0..=y1).contains(y)
}

/// With a likelihood bent more strongly than this, one error bar does not describe a view: frontal views, about where two tilts separate.
const MOST_BENT: f64 = 1.5;

/// The question for each cell: a target seen by a camera whose pose is free.
pub struct TargetMaps<'a> {
    /// The target.
    pub shape: &'a Shape,
    /// The camera and the uncertainty of its intrinsics.
    pub optics: Optics<'a>,
    /// Where the camera may be.
    pub volume: Volume,
}

impl TargetMaps<'_> {
    /// Returns 2σ of the camera's position; `None` where the target is out of view, the answer would be ambiguous, or the likelihood is badly
    /// bent.
    fn value(&self, cam_from_target: Pose) -> Option<f64> {
        let view = self.optics.view(cam_from_target, &self.shape.points);
        let e = expect(&view).ok()?;
        let is_clear = NEEDED_SEPARATION_SIGMA <= e.separation_sigma && e.bend_ratio < MOST_BENT;
        is_clear.then(|| 2.0 * worst_sigmas(&e.stated_covariance).1)
    }

    fn middle(range: [f64; 2]) -> f64 {
        0.5 * (range[0] + range[1])
    }

    /// Returns a map over the image: the target's centre is at the pixel, at the middle distance, tilt and direction of the volume.
    pub fn over_image(&self) -> Option<HeatMap> {
        let (columns, centres, under) = image_cells(self.optics.camera)?;
        let v = &self.volume;
        let [distance_m, tilt, direction] = [v.distance_m, v.tilt_rad, v.direction_rad].map(Self::middle);
        let at = |c: &[f64; 2]| {
            let ray = self.optics.camera.bearing(&Pixel::new(c[0], c[1])).ok()?.into_inner();
            self.value(self.shape.cam_from_target(&(ray * distance_m), tilt, direction, 0.0))
        };
        let values = centres.iter().map(at).collect();
        let title = "2σ of the camera's position with the target's centre at this pixel".to_string();
        let note = format!(
            "{distance_m:.2} m away, tilted by {:.0}°; hatched: not whole in the image, ambiguous, or too nearly frontal",
            tilt.to_degrees()
        );
        Some(HeatMap {
            title,
            notes: vec![note],
            figure: Figure::Length,
            under,
            columns,
            values,
            control_points: Vec::new(),
            lines: Vec::new(),
        })
    }

    /// Returns a map over a plane through the target: the camera is in the plane of the target's front normal (up in the image) and its x axis
    /// (`along_x`) or y axis, and looks at the target's centre.
    pub fn around(&self, along_x: bool) -> HeatMap {
        let far = self.volume.distance_m[1];
        let (least_m, greatest_m) = ([-far, -0.08 * far], [far, 1.02 * far]);
        let (columns, centres) = cells(least_m, greatest_m);
        let near = 0.5 * self.volume.distance_m[0];
        let at = |c: &[f64; 2]| {
            let distance_m = c[0].hypot(c[1]);
            let tilt = c[0].abs().atan2(c[1]);
            let direction = match (along_x, c[0] < 0.0) {
                (true, false) => 0.0,
                (true, true) => std::f64::consts::PI,
                (false, minus) => std::f64::consts::FRAC_PI_2 * if minus { -1.0 } else { 1.0 },
            };
            let is_meant = near < distance_m && distance_m <= far && tilt < 80f64.to_radians();
            is_meant.then(|| {
                self.value(self.shape.cam_from_target(&(Vector3::z() * distance_m), tilt, direction, 0.0))
            })?
        };
        let values = centres.iter().map(at).collect();
        let axis = if along_x { "x" } else { "y" };
        let control_points = self.outline(along_x);
        HeatMap {
            title: format!("2σ of the camera's position if it stands here, over the target's {axis} axis"),
            notes: vec![
                "up: along the front normal, looking at the target's centre".into(),
                "hatched: out of sight, ambiguous, or too nearly frontal".into(),
            ],
            figure: Figure::Length,
            under: Under::Plan {
                least_m,
                greatest_m,
                axes: [if along_x { "x m" } else { "y m" }, "front m"],
            },
            columns,
            values,
            control_points: Vec::new(),
            lines: control_points,
        }
    }

    /// Returns the target's extent along the axis, about its centre.
    fn outline(&self, along_x: bool) -> Vec<[[f64; 2]; 2]> {
        let k = if along_x { 0 } else { 1 };
        let centre = self.shape.centre()[k];
        let along = || self.shape.points.iter().map(|p| p.position[k] - centre);
        let (low, high) = (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
        vec![[[low, 0.0], [high, 0.0]]]
    }
}
