//! WGS 84: geographic, Earth-centred (ECEF) and UTM coordinates, and local frames in which a solver works with metres near zero.
//!
//! Derivation: docs/math/georeference.md.

use super::system::{CoordinateSystem, Zone};
use crate::core::Point;
use geodesy::prelude::{Context, Coor3D, CoordinateTuple, Ellipsoid, Fwd, GeoCart, Inv, Minimal, OpHandle};
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

/// Semi-major axis, m, and flattening of WGS 84.
const WGS_84: (f64, f64) = (6_378_137.0, 1.0 / 298.257_223_563);
/// Step to the north with which the convergence of a grid is computed, degrees: 100 m.
const STEP_DEG: f64 = 1e-3;

/// A position on WGS 84.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Geographic {
    /// Degrees north of the equator.
    pub lat_deg: f64,
    /// Degrees east of Greenwich.
    pub lon_deg: f64,
    /// Metres above the ellipsoid, or above what the heights of the input are above.
    pub height_m: f64,
}

impl Geographic {
    /// Returns the Earth-centred position, m.
    pub fn ecef(&self) -> Vector3<f64> {
        let ellipsoid = Ellipsoid::new(WGS_84.0, WGS_84.1);
        let x = ellipsoid.cartesian(&Coor3D::geo(self.lat_deg, self.lon_deg, self.height_m));
        Vector3::new(x[0], x[1], x[2])
    }

    /// Returns the position at an Earth-centred one.
    pub fn of_ecef(x: &Vector3<f64>) -> Self {
        let ellipsoid = Ellipsoid::new(WGS_84.0, WGS_84.1);
        let found = ellipsoid.geographic(&Coor3D::raw(x.x, x.y, x.z));
        Geographic { lat_deg: found[1].to_degrees(), lon_deg: found[0].to_degrees(), height_m: found[2] }
    }

    /// Returns the rotation whose columns are east, north and up here, in Earth-centred axes: georeference.md eq. (2).
    pub fn ecef_from_enu(&self) -> Matrix3<f64> {
        let (sin_lat, cos_lat) = self.lat_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = self.lon_deg.to_radians().sin_cos();
        Matrix3::new(
            -sin_lon,
            -sin_lat * cos_lon,
            cos_lat * cos_lon, //
            cos_lon,
            -sin_lat * sin_lon,
            cos_lat * sin_lon, //
            0.0,
            cos_lat,
            sin_lat,
        )
    }
}

/// The projection of a UTM zone.
pub struct Utm {
    context: Minimal,
    operator: OpHandle,
}

impl Utm {
    /// Prepares the projection; `None` for a zone that does not exist.
    pub fn new(zone: Zone) -> Option<Self> {
        let mut context = Minimal::new();
        let south = if zone.is_south { " south" } else { "" };
        let operator = context.op(&format!("utm zone={} ellps=WGS84{south}", zone.number)).ok()?;
        Some(Utm { context, operator })
    }

    /// Returns easting and northing, m; `None` far outside the zone.
    pub fn project(&self, at: &Geographic) -> Option<[f64; 2]> {
        let mut x = [Coor3D::geo(at.lat_deg, at.lon_deg, at.height_m)];
        self.context.apply(self.operator, Fwd, &mut x).ok()?;
        let [x] = x;
        (x[0].is_finite() && x[1].is_finite()).then_some([x[0], x[1]])
    }

    /// Returns the position at an easting and northing; `None` where there is none.
    pub fn unproject(&self, [easting_m, northing_m]: [f64; 2], height_m: f64) -> Option<Geographic> {
        let mut x = [Coor3D::raw(easting_m, northing_m, height_m)];
        self.context.apply(self.operator, Inv, &mut x).ok()?;
        let [x] = x;
        let (lon, lat) = x.xy();
        (lon.is_finite() && lat.is_finite()).then_some(Geographic {
            lat_deg: lat.to_degrees(),
            lon_deg: lon.to_degrees(),
            height_m,
        })
    }

    /// Returns the heading of true north less that of grid north seen clockwise: a true heading is the grid heading plus this, rad.
    pub fn convergence_rad(&self, at: &Geographic) -> Option<f64> {
        let towards_pole = if at.lat_deg < 0.0 { STEP_DEG } else { -STEP_DEG };
        let near = self.project(&Geographic { lat_deg: at.lat_deg + towards_pole, ..*at })?;
        let [e, n] = self.project(at)?;
        let north = [near[0] - e, near[1] - n].map(|x| x * towards_pole.signum());
        Some(-north[0].atan2(north[1]))
    }
}

/// A frame in which given points have coordinates near zero: x east, y north, z up, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalFrame {
    /// The system in which the points were given.
    pub system: CoordinateSystem,
    origin: Origin,
}

#[derive(Debug, Clone, PartialEq)]
enum Origin {
    /// East, north and up of this place: true metres.
    Earth { at: Geographic, in_ecef: Vector3<f64>, ecef_from_enu: Matrix3<f64> },
    /// Easting, northing and height: the axes of the grid, and its metres.
    Grid([f64; 3]),
}

impl LocalFrame {
    /// Creates the frame of east, north and up at a place.
    pub fn at(system: CoordinateSystem, at: Geographic) -> Self {
        let origin = Origin::Earth { at, in_ecef: at.ecef(), ecef_from_enu: at.ecef_from_enu() };
        LocalFrame { system, origin }
    }

    /// Creates a frame with the axes of a grid; `origin_m` is easting, northing and height.
    pub fn of_grid(name: Option<String>, origin_m: [f64; 3]) -> Self {
        LocalFrame { system: CoordinateSystem::Grid(name), origin: Origin::Grid(origin_m) }
    }

    /// Returns the origin on the Earth; `None` for a grid whose place is unknown.
    pub fn origin(&self) -> Option<Geographic> {
        match &self.origin {
            Origin::Earth { at, .. } => Some(*at),
            Origin::Grid(_) => None,
        }
    }

    /// Returns easting, northing and height of the origin in a grid; `None` for a frame on the Earth.
    pub fn grid_origin_m(&self) -> Option<[f64; 3]> {
        match self.origin {
            Origin::Grid(origin_m) => Some(origin_m),
            Origin::Earth { .. } => None,
        }
    }

    /// Returns the local position of a place on the Earth: georeference.md eq. (3).
    pub fn local(&self, at: &Geographic) -> Option<Point> {
        match &self.origin {
            Origin::Earth { in_ecef, ecef_from_enu, .. } => {
                Some(ecef_from_enu.tr_mul(&(at.ecef() - in_ecef)))
            }
            Origin::Grid(_) => None,
        }
    }

    /// Returns the place on the Earth of a local position; `None` in a grid whose place is unknown.
    pub fn geographic(&self, x: &Point) -> Option<Geographic> {
        match &self.origin {
            Origin::Earth { in_ecef, ecef_from_enu, .. } => {
                Some(Geographic::of_ecef(&(in_ecef + ecef_from_enu * x)))
            }
            Origin::Grid(_) => None,
        }
    }

    /// Returns easting, northing and height of a local position; `None` where the points were given as latitude and longitude.
    pub fn grid_m(&self, x: &Point) -> Option<[f64; 3]> {
        match (&self.origin, &self.system) {
            (Origin::Grid(origin), _) => Some([0, 1, 2].map(|i| origin[i] + x[i])),
            (Origin::Earth { .. }, CoordinateSystem::Utm(zone)) => {
                let at = self.geographic(x)?;
                let [easting_m, northing_m] = Utm::new(*zone)?.project(&at)?;
                Some([easting_m, northing_m, at.height_m])
            }
            (Origin::Earth { .. }, _) => None,
        }
    }

    /// Returns the rotation from the frame's axes to east, north and up at a local position, because north differs from place to place.
    pub fn enu_from_local(&self, x: &Point) -> Matrix3<f64> {
        match (&self.origin, self.geographic(x)) {
            (Origin::Earth { ecef_from_enu, .. }, Some(here)) => here.ecef_from_enu().tr_mul(ecef_from_enu),
            _ => Matrix3::identity(),
        }
    }
}
