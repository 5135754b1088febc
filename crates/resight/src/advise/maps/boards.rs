//! Maps of possible positions of the next board of a rig.

use super::{cells, image_cells, is_inside};
use crate::advise::heat::{Figure, HeatMap, MapMarker, MapMarkerKind, Under};
use crate::core::advise::board::{RigCamera, RigInformation, RigPlan};
use crate::core::{Pixel, Point, Pose};
use nalgebra::Vector3;

/// The question for each cell: the next board of a rig.
pub struct BoardMaps<'a> {
    /// The rig.
    pub plan: &'a RigPlan<'a>,
    /// The information from the views so far.
    pub so_far: &'a RigInformation,
    /// Names of its cameras.
    pub names: &'a [String],
    /// Boards observed already.
    pub boards: &'a [Pose],
    /// Boards advised, best first.
    pub best: &'a [Pose],
    /// Shortest and longest distance between the cameras and a board.
    pub distance_m: [f64; 2],
}

/// Tilt of the boards in the maps.
const BOARD_TILT_RAD: f64 = 0.5;

impl BoardMaps<'_> {
    /// Returns 2σ of the position of the least certain camera, with a board centred there; `None` where fewer than two cameras see the board.
    fn value(&self, centre_in_rig: &Point) -> Option<f64> {
        let board = self.plan.rig_from_board_at(centre_in_rig, BOARD_TILT_RAD, 0.8, 0.3);
        let (information, _) = self.plan.with(self.so_far, &board)?;
        let cameras = information.cameras()?;
        let all_known = cameras.iter().all(|c| c.is_determined);
        all_known.then(|| 2.0 * cameras.iter().map(|c| c.position_m).fold(0.0, f64::max))
    }

    fn centre(&self, board: &Pose) -> Point {
        board * &self.plan.board.centre()
    }

    /// Returns a map from above: x to the right and z forward of the rig, at the height of the best board.
    pub fn from_above(&self) -> HeatMap {
        let (least_m, greatest_m) = self.floor();
        let y = self.best.first().or(self.boards.first()).map_or(0.0, |b| self.centre(b).y);
        let (columns, grid) = cells(least_m, greatest_m);
        let values = grid.iter().map(|c| self.value(&Point::new(c[0], y, c[1]))).collect();
        let tilt = BOARD_TILT_RAD.to_degrees();
        let notes = vec![
            format!("board at y {y:.2} m, {tilt:.0}° off facing the cameras"),
            "best boards may be higher or lower".into(),
            "hatched: fewer than two cameras see it, or a camera stays unknown".into(),
        ];
        HeatMap {
            title: "2σ of the worst camera's position with the next board here".into(),
            notes,
            figure: Figure::Length,
            under: Under::Plan { least_m, greatest_m, axes: ["x m", "z m"] },
            columns,
            values,
            control_points: self.marks_from_above(),
            lines: Vec::new(),
        }
    }

    /// Returns the box in x and z around the cameras, the points they look at, and the boards.
    fn floor(&self) -> ([f64; 2], [f64; 2]) {
        let far = self.distance_m[1];
        let reach = self.plan.cameras.iter().map(|c| c.cam_from_rig).flat_map(|c| {
            let ahead = c.rotation.tr_mul(&Vector3::z());
            [c.origin(), c.origin() + ahead * far]
        });
        let boards = self.best.iter().chain(self.boards).map(|b| self.centre(b));
        let all: Vec<Point> = reach.chain(boards).collect();
        let bound =
            |k: usize, pick: fn(f64, f64) -> f64, from: f64| all.iter().map(|p| p[k]).fold(from, pick);
        let (low, high, margin) = (f64::INFINITY, f64::NEG_INFINITY, 0.15 * far);
        let least_m = [0, 2].map(|k| bound(k, f64::min, low) - margin);
        (least_m, [0, 2].map(|k| bound(k, f64::max, high) + margin))
    }

    fn marks_from_above(&self) -> Vec<MapMarker> {
        let flat = |p: &Point| [p.x, p.z];
        let seen = self.boards.iter().enumerate().map(|(i, b)| MapMarker {
            at: flat(&self.centre(b)),
            name: format!("seen {}", i + 1),
            kind: MapMarkerKind::Known,
            towards: None,
        });
        let camera = |(c, name): (&RigCamera, &String)| {
            let origin = c.cam_from_rig.origin();
            let ahead = origin + c.cam_from_rig.rotation.tr_mul(&Vector3::z());
            MapMarker {
                at: flat(&origin),
                name: name.clone(),
                kind: MapMarkerKind::Camera,
                towards: Some(flat(&ahead)),
            }
        };
        let cameras = self.plan.cameras.iter().zip(self.names).map(camera);
        seen.chain(cameras).chain(self.best_marks(|p| Some(flat(p)))).collect()
    }

    /// Returns a map over the image of one camera: the board's centre is at the pixel, at the middle distance.
    pub fn over_image(&self, camera: usize) -> Option<HeatMap> {
        let own = self.plan.cameras.get(camera)?;
        let (columns, centres, under) = image_cells(own.camera)?;
        let distance_m = 0.5 * (self.distance_m[0] + self.distance_m[1]);
        let rig_from_cam = own.cam_from_rig.inverse();
        let at = |c: &[f64; 2]| {
            let ray = own.camera.bearing(&Pixel::new(c[0], c[1])).ok()?.into_inner();
            self.value(&(rig_from_cam * (ray * distance_m)))
        };
        let values = centres.iter().map(at).collect();
        let control_points = self.best_marks(|p| {
            let at: [f64; 2] = own.camera.project(&(own.cam_from_rig * *p))?.into();
            is_inside(&under, &at).then_some(at)
        });
        let title = format!(
            "2σ of the worst camera's position with the next board here, image of {}",
            self.names.get(camera)?
        );
        let notes = vec![format!(
            "board {distance_m:.2} m away; hatched: fewer than two cameras see it, or a camera stays unknown"
        )];
        Some(HeatMap {
            title,
            notes,
            figure: Figure::Length,
            under,
            columns,
            values,
            control_points,
            lines: Vec::new(),
        })
    }

    fn best_marks(&self, place: impl Fn(&Point) -> Option<[f64; 2]>) -> Vec<MapMarker> {
        let control_point = |(i, b): (usize, &Pose)| {
            let at = place(&self.centre(b))?;
            Some(MapMarker { at, name: format!("{}", i + 1), kind: MapMarkerKind::Best, towards: None })
        };
        self.best.iter().enumerate().rev().filter_map(control_point).collect()
    }
}
