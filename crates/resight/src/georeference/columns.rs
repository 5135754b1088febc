//! The columns with which a table states positions: metres of a frame of one's own, latitude and longitude, or easting and northing.

use super::earth::{Geographic, LocalFrame, Utm};
use super::system::{CoordinateSystem, Zone};
use crate::FileError;
use crate::input::table::{Table, TableRow};

/// Points farther apart than this are hardly those of one camera, m.
const FARTHEST_M: f64 = 100_000.0;
/// Larger heights are hardly heights, m.
const HIGHEST_M: f64 = 100_000.0;
/// The eastings that UTM uses, m.
const EASTINGS_M: std::ops::RangeInclusive<f64> = 100_000.0..=900_000.0;
/// The northings that UTM uses, m.
const NORTHINGS_M: std::ops::RangeInclusive<f64> = 0.0..=10_000_000.0;
/// The latitudes that UTM covers, degrees.
const UTM_LATITUDES_DEG: std::ops::RangeInclusive<f64> = -80.5..=84.5;

/// Columns that hold what is needed in another unit or under another name, what is needed, and how to get there.
const MISTAKEN: [(&str, &str, &str); 17] = [
    ("lat_rad", "lat_deg", "multiply by 180/π"),
    ("lon_rad", "lon_deg", "multiply by 180/π"),
    ("lat", "lat_deg", "it states no unit; rename it where it is in degrees"),
    ("latitude", "lat_deg", "it states no unit; rename it where it is in degrees"),
    ("latitude_deg", "lat_deg", "rename it"),
    ("lon", "lon_deg", "it states no unit; rename it where it is in degrees"),
    ("lng", "lon_deg", "it states no unit; rename it where it is in degrees"),
    ("longitude", "lon_deg", "it states no unit; rename it where it is in degrees"),
    ("longitude_deg", "lon_deg", "rename it"),
    ("easting", "easting_m", "it states no unit; rename it where it is in metres"),
    ("northing", "northing_m", "it states no unit; rename it where it is in metres"),
    ("easting_ft", "easting_m", FEET),
    ("northing_ft", "northing_m", FEET),
    ("height_ft", "height_m", FEET),
    ("height", "height_m", "it states no unit; rename it where it is in metres"),
    ("altitude_m", "height_m", "rename it"),
    ("elevation_m", "height_m", "rename it"),
];
const FEET: &str = "multiply international feet by 0.3048, US survey feet by 1200/3937; grids in feet need their own conversion";

/// The columns of positions, and the frame in which a solver has them: its origin is the first row.
pub struct PositionColumns {
    kind: Kind,
    columns: [usize; 3],
    zone: Option<usize>,
    /// Line and text of the first zone.
    first_zone: Option<(u64, Zone)>,
    stated: Option<CoordinateSystem>,
    frame: Option<LocalFrame>,
    projection: Option<Utm>,
    /// The largest |latitude| and |longitude| so far, degrees.
    most_deg: [f64; 2],
    farthest_m: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Metres,
    Geographic,
    Projected,
}

impl PositionColumns {
    /// Finds the columns `x_m, y_m, z_m`, `lat_deg, lon_deg, height_m` or `easting_m, northing_m, height_m` of a header. `stated` is the system
    /// of easting and northing where no column `zone` states it.
    ///
    /// # Errors
    /// A column that is missing, or holds another unit; columns of two kinds.
    pub fn of(table: &Table, stated: Option<&CoordinateSystem>) -> Result<Self, FileError> {
        let has = |names: &[&str]| names.iter().any(|name| table.find(name).is_some());
        let mistaken = || MISTAKEN.iter().find(|(name, ..)| table.find(name).is_some());
        let is_own = has(&["x_m", "y_m", "z_m"]);
        let is_geographic = has(&["lat_deg", "lon_deg"]);
        let is_projected = has(&["easting_m", "northing_m"]);
        let kind = match (is_own, is_geographic, is_projected) {
            (false, true, false) => Kind::Geographic,
            (false, false, true) => Kind::Projected,
            (_, false, false) => match mistaken().filter(|_| !is_own) {
                Some(found) => return Err(renamed(table, found)),
                None => Kind::Metres,
            },
            _ => {
                return Err(table.complaint(
                    "positions are given twice; keep x_m,y_m,z_m, or lat_deg,lon_deg,height_m, or easting_m,northing_m,height_m",
                ));
            }
        };
        let names = match kind {
            Kind::Metres => ["x_m", "y_m", "z_m"],
            Kind::Geographic => ["lat_deg", "lon_deg", "height_m"],
            Kind::Projected => ["easting_m", "northing_m", "height_m"],
        };
        let need = |name: &str| match (table.find(name), mistaken().filter(|(_, needed, _)| *needed == name))
        {
            (None, Some(found)) => Err(renamed(table, found)),
            (None, None) if name == "height_m" => table.need(
                name,
                Some("each point needs its height in metres, all above the ellipsoid or all above sea level"),
            ),
            _ => table.need(name, None),
        };
        let columns = [need(names[0])?, need(names[1])?, need(names[2])?];
        if let (Kind::Metres | Kind::Geographic, Some(stated)) = (kind, stated)
            && !(kind == Kind::Geographic && *stated == CoordinateSystem::Geographic)
        {
            return Err(table.complaint(format!(
                "{stated} was stated, but the columns are {}; easting_m,northing_m,height_m are needed",
                names.join(",")
            )));
        }
        if let (Kind::Projected, Some(CoordinateSystem::Geographic)) = (kind, stated) {
            return Err(table.complaint(
                "EPSG:4326 was stated, which has lat_deg,lon_deg, but the columns are easting_m,northing_m",
            ));
        }
        let zone = table.find("zone").filter(|_| kind == Kind::Projected);
        let (stated, most_deg) = (stated.cloned(), [0.0; 2]);
        let (first_zone, frame, projection, farthest_m) = (None, None, None, 0.0);
        Ok(PositionColumns {
            kind,
            columns,
            zone,
            first_zone,
            stated,
            frame,
            projection,
            most_deg,
            farthest_m,
        })
    }

    /// Returns whether positions are on the Earth or in a grid, so that their unit is known.
    pub fn is_georeferenced(&self) -> bool {
        self.kind != Kind::Metres
    }

    /// Returns the position of a row in the frame of the solver.
    ///
    /// # Errors
    /// A cell that is no number, or that its column cannot hold.
    pub fn position(&mut self, cells: &TableRow<'_>) -> Result<[f64; 3], FileError> {
        let [a, b, c] = self.columns;
        let x = [cells.number(a)?, cells.number(b)?, cells.number(c)?];
        if self.kind == Kind::Metres {
            return Ok(x);
        }
        for (column, value) in self.columns.into_iter().zip(x) {
            if !value.is_finite() {
                return Err(cells.complaint(column, &format!("is {value}; remove the row or correct it")));
            }
        }
        if HIGHEST_M < x[2].abs() {
            return Err(
                cells.complaint(c, &format!("is {}; a height in metres, up to 100 km, is needed", x[2]))
            );
        }
        let local = match self.kind {
            Kind::Geographic => self.geographic(x, cells)?,
            _ => self.projected(x, cells)?,
        };
        self.farthest_m = self.farthest_m.max(local[0].hypot(local[1]));
        Ok(local)
    }

    fn geographic(
        &mut self,
        [lat_deg, lon_deg, height_m]: [f64; 3],
        cells: &TableRow<'_>,
    ) -> Result<[f64; 3], FileError> {
        let at = checked(Geographic { lat_deg, lon_deg, height_m })
            .map_err(|reason| cells.complaint_of(&reason))?;
        self.most_deg = [self.most_deg[0].max(lat_deg.abs()), self.most_deg[1].max(lon_deg.abs())];
        Ok(self.local(CoordinateSystem::Geographic, &at))
    }

    fn local(&mut self, system: CoordinateSystem, at: &Geographic) -> [f64; 3] {
        let frame = self.frame.get_or_insert_with(|| LocalFrame::at(system, *at));
        frame.local(at).unwrap_or_default().into()
    }

    fn projected(&mut self, x: [f64; 3], cells: &TableRow<'_>) -> Result<[f64; 3], FileError> {
        let system = self.system(cells)?;
        let CoordinateSystem::Utm(zone) = system else {
            let CoordinateSystem::Grid(name) = system else { return Ok(x) };
            let frame = self.frame.get_or_insert_with(|| LocalFrame::of_grid(name, x));
            let origin_m = frame.grid_origin_m().unwrap_or_default();
            // The difference of two doubles of this size is exact to a few nanometres.
            return Ok([0, 1, 2].map(|i| x[i] - origin_m[i]));
        };
        within_utm([x[0], x[1]]).map_err(|reason| cells.complaint_of(&reason))?;
        if self.projection.is_none() {
            self.projection = Utm::new(zone);
        }
        let at = self.projection.as_ref().and_then(|utm| utm.unproject([x[0], x[1]], x[2]));
        let at = at.filter(|at| UTM_LATITUDES_DEG.contains(&at.lat_deg));
        let at = at
            .ok_or_else(|| cells.complaint_of(&format!("({}, {}) is no place in zone {zone}", x[0], x[1])))?;
        Ok(self.local(CoordinateSystem::Utm(zone), &at))
    }

    /// Returns the system of a row, which is that of all.
    fn system(&mut self, cells: &TableRow<'_>) -> Result<CoordinateSystem, FileError> {
        let Some(column) = self.zone else {
            return Ok(self.stated.clone().unwrap_or(CoordinateSystem::Grid(None)));
        };
        let text = cells.text(column).unwrap_or_default();
        let zone: Zone =
            text.parse().map_err(|reason: String| cells.complaint_of(&format!("column `zone`: {reason}")))?;
        let (line, first) = *self.first_zone.get_or_insert((cells.line, zone));
        if first != zone {
            return Err(cells.complaint_of(&format!(
                "zone {zone}, but line {line} is of zone {first}; give all points in one zone, or as lat_deg,lon_deg"
            )));
        }
        match &self.stated {
            Some(stated) if *stated != CoordinateSystem::Utm(zone) => {
                Err(cells.complaint_of(&format!("zone {zone}, but {stated} was stated; leave one out")))
            }
            _ => Ok(CoordinateSystem::Utm(zone)),
        }
    }

    /// Returns the frame, once a row was read, and what is implausible about the positions of all rows.
    pub fn finish(self) -> (Option<LocalFrame>, Vec<String>) {
        let mut remarks = Vec::new();
        let [lat, lon] = self.most_deg;
        if self.kind == Kind::Geographic && lat <= std::f64::consts::FRAC_PI_2 && lon <= std::f64::consts::PI
        {
            remarks.push(format!(
                "all points are within {lat:.3}° of the equator and {lon:.3}° of Greenwich, where there is only sea: are lat_deg and lon_deg in radians? multiply them by 180/π"
            ));
        }
        if FARTHEST_M < self.farthest_m {
            remarks.push(format!(
                "the points are up to {:.0} km apart: are they of different zones, or is one mistyped?",
                1e-3 * self.farthest_m
            ));
        }
        (self.frame, remarks)
    }
}

fn renamed(table: &Table, (found, needed, how): &(&str, &str, &str)) -> FileError {
    table.complaint(format!("column `{found}`: `{needed}` is needed; {how}"))
}

/// Refuses what is no latitude and longitude.
pub(crate) fn checked(at: Geographic) -> Result<Geographic, String> {
    let Geographic { lat_deg, lon_deg, .. } = at;
    if 90.0 < lat_deg.abs() {
        let hint = match lon_deg.abs() <= 90.0 {
            true => "latitude and longitude are exchanged, or easting and northing are given as degrees",
            false => "easting and northing belong into easting_m and northing_m",
        };
        return Err(format!("lat_deg is {lat_deg}, but latitudes are within ±90: {hint}"));
    }
    match lon_deg.abs() <= 360.0 {
        true => Ok(at),
        false => Err(format!("lon_deg is {lon_deg}, but longitudes are within ±180 (or 0 to 360)")),
    }
}

/// Refuses eastings and northings that no UTM zone has.
pub(crate) fn within_utm([easting_m, northing_m]: [f64; 2]) -> Result<(), String> {
    if EASTINGS_M.contains(&easting_m) && NORTHINGS_M.contains(&northing_m) {
        return Ok(());
    }
    let hint = if EASTINGS_M.contains(&northing_m) && NORTHINGS_M.contains(&easting_m) {
        "easting and northing are exchanged"
    } else if EASTINGS_M.contains(&(0.3048 * easting_m)) {
        "they look like feet; metres are needed"
    } else if easting_m.abs() <= 180.0 && northing_m.abs() <= 180.0 {
        "degrees belong into lat_deg and lon_deg"
    } else {
        "they are of another zone or grid"
    };
    Err(format!(
        "easting {easting_m} and northing {northing_m} are outside UTM (100,000 to 900,000 and 0 to 10,000,000 m): {hint}"
    ))
}
