//! Reads known correspondences from a CSV file and solves for the pose of each view.

use crate::answer::{PoseAnswer, Status};
use crate::core::locate::Method;
use crate::core::{Camera, Correspondence, Lens, Pixel, Point};
use crate::formats::plausible::of_pixels;
use crate::georeference::columns::PositionColumns;
use crate::georeference::features::{NamedPosition, on_earth};
use crate::georeference::{CoordinateSystem, Features, Ground, LocalFrame, georeferenced_pose};
use crate::input::table::{Table, TableRow, how_read};
use crate::locate::{
    LARGEST, NamedLine, NamedPoint, PointsOptions, is_contradicted_by_priors, locate_lines_and_points,
    locate_points, outside_field,
};
use crate::report::words::below_one_level;
use crate::{Error, FileError};
use nalgebra::{Unit, Vector3};
use resight_core::line::{ImageLine, LineCorrespondence};
use std::collections::HashMap;
use std::path::Path;

/// Solves for the poses of a table of points.
#[derive(Debug, Clone)]
pub struct TableLocator {
    /// The camera; `None` if the columns `xn, yn` are undistorted coordinates on the plane z = 1.
    camera: Option<Camera>,
    /// Default standard deviation of a row, and whether the caller stated it.
    sigma: (f64, bool),
    options: PointsOptions,
    /// Remarks about coordinates of the table that are implausible in metres.
    sizes: Vec<String>,
    /// The remark about a table whose cells are not separated by commas.
    how_read: Option<String>,
    /// Where the points are on the Earth, if that is stated.
    frame: Option<LocalFrame>,
}

/// Solves for the poses of a table of points: columns `x_m, y_m, z_m, u_px, v_px`, and optionally `view`, `id`, `sigma_px` (of u and v; else 0.5
/// px), `sigma_m` (of x, y, z; else exact). Instead of `x_m, y_m, z_m` there may be `lat_deg, lon_deg, height_m` or `easting_m, northing_m,
/// height_m` ([`read_table`]). Returns one answer per view, in file order.
///
/// # Errors
/// What is wrong with the file, and in which line. Numbers from which no pose can be computed are reported in the view's answer.
pub fn locate_table(
    file: impl AsRef<Path>,
    camera: &Camera,
    options: &PointsOptions,
) -> Result<Vec<PoseAnswer>, Error> {
    let file = file.as_ref();
    let table = read_table(file, false, None)?;
    let locator = TableLocator::new(Some(camera.clone()), None, options.clone()).for_table(file, &table);
    let located = |view| {
        let mut answer = locator.locate(view);
        answer.remarks.extend(locator.remarks());
        answer
    };
    Ok(table.views.iter().map(located).collect())
}

/// Returns the unit of a camera's image coordinates, and the standard deviation of u and v that is assumed where none is stated.
pub fn unit_and_sigma(camera: &Camera) -> (&'static str, f64) {
    match &camera.lens {
        Lens::Photogrammetric(model) => ("unit of f", model.table().f / 2000.0),
        _ => ("px", 0.5),
    }
}

impl TableLocator {
    /// Creates a locator; `sigma` is the default standard deviation of u and v (without a camera, of xn and yn).
    pub fn new(camera: Option<Camera>, sigma: Option<f64>, options: PointsOptions) -> Self {
        let (image_unit, assumed) = camera.as_ref().map_or(("normalized", 5e-4), unit_and_sigma);
        let options = PointsOptions { image_unit, ..options };
        let sigma = (sigma.unwrap_or(assumed), sigma.is_some());
        TableLocator { camera, sigma, options, sizes: Vec::new(), how_read: None, frame: None }
    }

    /// Adds the remarks about the whole table: where sizes are implausible in metres, an answer that would be `ok` is `implausible`.
    pub fn for_table(self, path: &Path, table: &PointsTable) -> Self {
        let sizes = match &table.frame {
            Some(_) => table.implausible.clone(),
            None => unit_remarks(&table.views),
        };
        let rows = table.views.iter().flat_map(|view| &view.rows);
        let size = self.camera.as_ref().and_then(|camera| camera.size);
        let of_pixels = of_pixels(rows.map(|row| Pixel::from(row.image)), size);
        let sizes = sizes.into_iter().chain(of_pixels).collect();
        TableLocator { sizes, how_read: how_read(path), frame: table.frame.clone(), ..self }
    }

    /// Returns the remarks about the whole table, which apply to every answer.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        self.sizes.iter().chain(&self.how_read).cloned()
    }

    /// Returns the cameras of the answers, the ground that their images show, and the points of the table, as features of a map. `answers` are
    /// those of the table's views, in order.
    ///
    /// # Errors
    /// A table whose points have no latitude and longitude.
    pub fn features(
        &self,
        table: &PointsTable,
        answers: &[PoseAnswer],
        ground: &Ground,
    ) -> Result<Features, Error> {
        let frame = on_earth(table.frame.as_ref())?;
        let mut features = Features::default();
        let mut named = HashMap::new();
        for (view, answer) in table.views.iter().zip(answers) {
            let points: Vec<Point> = view.rows.iter().map(|row| Point::from(row.x_in_target)).collect();
            features.add_view(frame, answer, &points, self.camera.as_ref(), ground)?;
            for (row, x_in_local) in view.rows.iter().zip(points) {
                // A point of several views is one feature.
                if named.insert((&row.name, x_in_local.map(f64::to_bits)), ()).is_none() {
                    let sigma_m = row.sigma_m.map(|sigma_m| [sigma_m; 3]);
                    features
                        .add_points(frame, [NamedPosition { name: row.name.clone(), x_in_local, sigma_m }])?;
                }
            }
        }
        Ok(features)
    }

    /// Solves for the pose of one view.
    pub fn locate(&self, view: &PointsView) -> PoseAnswer {
        let normalized = Camera::normalized();
        let camera = self.camera.as_ref().unwrap_or(&normalized);
        let PointsOptions { image_unit, .. } = self.options;
        let mut answer = match self.solve(view, camera) {
            Ok(answer) => answer,
            Err(reason) => {
                let answer = PoseAnswer::without_pose(view.name.clone(), Status::Error, reason);
                return PoseAnswer { n_points: view.rows.len(), image_unit, ..answer };
            }
        };
        if is_contradicted_by_priors(&answer) {
            // The message names the only prior of this command by its flags.
            answer.verdict.message =
                "--gravity and --target-down contradict the points, which agree with their sigmas without them; check both \
                 directions and --gravity-sigma-deg before using this pose"
                    .into();
        }
        answer.verdict = answer.verdict.with_sizes(&self.sizes);
        answer.remarks.extend(below_the_points(view, &answer));
        answer.georeference = self.frame.as_ref().zip(answer.estimate.as_ref()).map(|(frame, estimate)| {
            georeferenced_pose(frame, &estimate.cam_from_target, &estimate.covariance)
        });
        answer.remarks.extend(self.frame.as_ref().and_then(of_unknown_grid));
        let is_assumed = !self.sigma.1 && view.rows.iter().any(|row| row.sigma.is_none());
        if is_assumed && answer.estimate.is_some() {
            let flag = if self.camera.is_none() { "--sigma-normalized" } else { "--sigma-px" };
            answer.verdict.message +=
                &format!("; σ {} {image_unit} is assumed, state yours with {flag}", self.sigma.0);
        }
        answer
    }

    fn solve(&self, view: &PointsView, camera: &Camera) -> Result<PoseAnswer, String> {
        let points = view.rows.iter().filter(|row| row.line_end.is_none()).map(|row| self.point(row, camera));
        let points = points.collect::<Result<Vec<_>, String>>();
        let points = points.map_err(|reason| self.with_causes(reason, view, camera))?;
        let ends = view.rows.iter().filter_map(|row| Some((row, row.line_end.as_ref()?)));
        let lines = ends.map(|(row, end)| self.line(row, end, camera)).collect::<Result<Vec<_>, String>>()?;
        Ok(match lines.as_slice() {
            [] => locate_points(&view.name, &points, camera, &self.options),
            lines => locate_lines_and_points(&view.name, &points, lines, camera, &self.options),
        })
    }

    /// Adds what is likely wrong to a reason why points cannot be used, where that is a pixel outside the field of the lens.
    fn with_causes(&self, reason: String, view: &PointsView, camera: &Camera) -> String {
        let outside = || view.rows.iter().find_map(|row| camera.bearing(&Pixel::from(row.image)).err());
        let without_bearing = |row: &Row| {
            let [sigma_px, sigma_m] = self.checked(row).ok()?;
            let (x_in_target, pixel) = (Point::from(row.x_in_target), Pixel::from(row.image));
            let bearing = Vector3::z_axis();
            Some(Correspondence { x_in_target, pixel, bearing, sigma_px, covariance_px2: None, sigma_m })
        };
        let is_line = view.rows.iter().any(|row| row.line_end.is_some());
        let seen: Option<Vec<Correspondence>> = view.rows.iter().map(without_bearing).collect();
        let label = |i: usize| format!("point {}", view.rows[i].name);
        let plain = seen.filter(|_| !is_line && self.options.estimate_focal.is_none());
        let causes = plain.and_then(|seen| outside_field(&outside()?, &seen, camera, label));
        causes.map_or_else(|| reason.clone(), |causes| format!("{causes}; {reason}"))
    }

    /// Applies the checks of points to both ends.
    fn line(&self, row: &Row, end: &LineEnd, camera: &Camera) -> Result<NamedLine, String> {
        let at = |reason: &str| format!("line {}: {reason}", row.line);
        let PointsOptions { method, robust_threshold_px, estimate_focal, .. } = &self.options;
        if *method != Method::Auto || robust_threshold_px.is_some() || estimate_focal.is_some() {
            let reason = "this row is a line (x2_m is filled), which only method auto solves, without --robust and --estimate-focal";
            return Err(at(reason));
        }
        if row.sigma_m.is_some_and(|sigma_m| sigma_m != 0.0) {
            return Err(at(
                "column `sigma_m` is for points; the lines of a target are taken as exact, leave it empty",
            ));
        }
        let second = Row { x_in_target: end.x_in_target, image: end.image, line_end: None, ..row.clone() };
        let [first, second] = [self.correspondence(row, camera)?, self.correspondence(&second, camera)?];
        let along = second.x_in_target - first.x_in_target;
        let direction_in_target = Unit::try_new(along, 1e-9).ok_or_else(|| {
            at("the two points of the line are one in the target; two different ones are needed")
        })?;
        let seen = ImageLine::new(camera, [first.pixel, second.pixel], first.sigma_px).map_err(|_| {
            at("the two points of the line are one in the image; two that are far apart are needed")
        })?;
        let seen = LineCorrespondence { point_in_target: Some(first.x_in_target), direction_in_target, seen };
        Ok(NamedLine { name: row.name.clone(), line: Some(row.line), seen })
    }

    fn point(&self, row: &Row, camera: &Camera) -> Result<NamedPoint, String> {
        let seen = self.correspondence(row, camera)?;
        Ok(NamedPoint { name: row.name.clone(), line: Some(row.line), seen })
    }

    fn correspondence(&self, row: &Row, camera: &Camera) -> Result<Correspondence, String> {
        let [sigma, sigma_m] = self.checked(row)?;
        Correspondence::new(camera, Point::from(row.x_in_target), Pixel::from(row.image), sigma)
            .map(|c| Correspondence { sigma_m, ..c })
            .map_err(|reason| format!("line {}: {reason}", row.line))
    }

    /// Returns the standard deviations of a row, pixel and position, where its numbers can be used.
    fn checked(&self, row: &Row) -> Result<[f64; 2], String> {
        let [u, v] = if self.camera.is_none() { ["xn", "yn"] } else { ["u_px", "v_px"] };
        let cells = [("x_m", row.x_in_target[0]), ("y_m", row.x_in_target[1]), ("z_m", row.x_in_target[2])];
        let cells = cells.into_iter().chain([(u, row.image[0]), (v, row.image[1])]);
        let (sigma, sigma_m) = (row.sigma.unwrap_or(self.sigma.0), row.sigma_m.unwrap_or(0.0));
        for (column, x) in cells.chain([("sigma_px", sigma), ("sigma_m", sigma_m)]) {
            if LARGEST < x.abs() {
                return Err(format!(
                    "line {}: column `{column}` is {x:e}; the largest number accepted is {LARGEST:e}, check the unit",
                    row.line
                ));
            }
            if !x.is_finite() {
                return Err(format!(
                    "line {}: column `{column}` is {x}; remove the row or correct it",
                    row.line
                ));
            }
        }
        if sigma <= 0.0 {
            return Err(format!("line {}: column `sigma_px` is {sigma}; it must be positive", row.line));
        }
        if sigma_m < 0.0 {
            return Err(format!("line {}: column `sigma_m` is {sigma_m}; it must not be negative", row.line));
        }
        if 0.0 < sigma_m && self.options.method == Method::Wang2004 {
            let reason =
                "method wang2004 is the printed procedure, which takes the points as exact; use auto";
            return Err(format!("line {}: column `sigma_m` is {sigma_m}, but {reason}", row.line));
        }
        Ok([sigma, sigma_m])
    }
}

/// One correspondence.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Line in the file, counted from 1.
    pub line: u64,
    /// Column `id`, or the row's number within its view.
    pub name: String,
    /// Columns `x_m, y_m, z_m`, or the position in the frame of the table.
    pub x_in_target: [f64; 3],
    /// Columns `u_px, v_px` or `xn, yn`.
    pub image: [f64; 2],
    /// Column `sigma_px`, where the cell is filled.
    pub sigma: Option<f64>,
    /// Column `sigma_m`, where the cell is filled.
    pub sigma_m: Option<f64>,
    /// Columns `x2_m, y2_m, z2_m, u2_px, v2_px` (without a camera `xn2, yn2`), where they are filled: the row is a line.
    pub line_end: Option<LineEnd>,
}

/// A second point of a line, and a second point of its image; the two need not correspond.
#[derive(Debug, Clone, PartialEq)]
pub struct LineEnd {
    /// On the line in the target.
    pub x_in_target: [f64; 3],
    /// On its image.
    pub image: [f64; 2],
}

/// The rows of one view, in file order.
#[derive(Debug, Clone, PartialEq)]
pub struct PointsView {
    /// Column `view`, or the file's name.
    pub name: String,
    /// At least one.
    pub rows: Vec<Row>,
}

/// The views of a table, and where its points are on the Earth.
#[derive(Debug, Clone, PartialEq)]
pub struct PointsTable {
    /// In the order of first appearance.
    pub views: Vec<PointsView>,
    /// The frame of the points, where their columns are latitude and longitude or easting and northing; its origin is the first row.
    pub frame: Option<LocalFrame>,
    /// What is implausible about positions on the Earth.
    pub implausible: Vec<String>,
}

/// The positions of the columns.
struct Columns {
    image: [usize; 2],
    view: Option<usize>,
    id: Option<usize>,
    sigma: Option<usize>,
    sigma_m: Option<usize>,
    /// The columns of a line's second point.
    end: Option<[usize; 5]>,
}

/// Reads a table (columns `xn, yn` without a camera); rows of one view need not be adjacent. Positions are `x_m, y_m, z_m`; or `lat_deg, lon_deg,
/// height_m` (WGS 84); or `easting_m, northing_m, height_m` in the UTM zone of the column `zone`, else in the system that is `stated`.
///
/// # Errors
/// What is wrong with the file, and in which line.
pub fn read_table(
    path: impl AsRef<Path>,
    normalized: bool,
    stated: Option<&CoordinateSystem>,
) -> Result<PointsTable, FileError> {
    let path = path.as_ref();
    let table = Table::open(path, "x_m,y_m,z_m")?;
    let mut positions = PositionColumns::of(&table, stated)?;
    let columns = columns(&table, normalized)?;
    if columns.end.is_some() && positions.is_georeferenced() {
        return Err(table.complaint(
            "lines (x2_m, …) need x_m,y_m,z_m in one frame of metres, not latitudes or eastings",
        ));
    }
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut views: Vec<PointsView> = Vec::new();
    let mut index = HashMap::new();
    table.each(|cells| {
        let name = match columns.view {
            Some(i) => cells.text(i).unwrap_or_default(),
            None => &file_name,
        };
        let at = *index.entry(name.to_string()).or_insert_with(|| {
            views.push(PointsView { name: name.to_string(), rows: Vec::new() });
            views.len() - 1
        });
        let row = row(&columns, positions.position(&cells)?, &cells, views[at].rows.len())?;
        views[at].rows.push(row);
        Ok::<(), FileError>(())
    })?;
    let (frame, implausible) = positions.finish();
    Ok(PointsTable { views, frame, implausible })
}

fn columns(table: &Table, normalized: bool) -> Result<Columns, FileError> {
    let other_kind = if normalized { "u_px" } else { "xn" };
    let hint = table.find(other_kind).map(|_| match normalized {
        true => "for columns u_px,v_px leave out --normalized",
        false => "for columns xn,yn add --normalized",
    });
    let [u, v] = if normalized { ["xn", "yn"] } else { ["u_px", "v_px"] };
    let [u2, v2] = if normalized { ["xn2", "yn2"] } else { ["u2_px", "v2_px"] };
    let names = ["x2_m", "y2_m", "z2_m", u2, v2];
    let need = |name: &str| {
        table.need(name, Some("a line has all of x2_m,y2_m,z2_m and two more image coordinates"))
    };
    let end = match names.iter().any(|name| table.find(name).is_some()) {
        true => Some([need(names[0])?, need(names[1])?, need(names[2])?, need(names[3])?, need(names[4])?]),
        false => None,
    };
    Ok(Columns {
        end,
        image: [table.need(u, hint)?, table.need(v, hint)?],
        view: table.find("view"),
        id: table.find("id"),
        sigma: table.find("sigma_px"),
        sigma_m: table.find("sigma_m"),
    })
}

fn row(columns: &Columns, x_in_target: [f64; 3], cells: &TableRow<'_>, n: usize) -> Result<Row, FileError> {
    let [u, v] = columns.image;
    let name = columns.id.and_then(|i| cells.text(i));
    Ok(Row {
        line: cells.line,
        name: name.map_or_else(|| n.to_string(), str::to_string),
        x_in_target,
        image: [cells.number(u)?, cells.number(v)?],
        sigma: cells.optional_number(columns.sigma)?,
        sigma_m: cells.optional_number(columns.sigma_m)?,
        line_end: columns.end.map(|end| line_end(&end, cells)).transpose()?.flatten(),
    })
}

/// Reads the end of a line; `None` where all five cells are empty: the row is a point.
fn line_end(columns: &[usize; 5], cells: &TableRow<'_>) -> Result<Option<LineEnd>, FileError> {
    if columns.iter().all(|i| cells.text(*i).is_none()) {
        return Ok(None);
    }
    let [x, y, z, u, v] = *columns;
    Ok(Some(LineEnd {
        x_in_target: [cells.number(x)?, cells.number(y)?, cells.number(z)?],
        image: [cells.number(u)?, cells.number(v)?],
    }))
}

/// Finds two rows of a view with the same name: corners of one tag, or a mistake.
pub fn repeated_names(views: &[PointsView]) -> Option<String> {
    for view in views {
        let mut seen = std::collections::HashMap::new();
        let is_other = |a: &Row, b: &Row| (a.x_in_target, a.image) != (b.x_in_target, b.image);
        let duplicates = view.rows.iter().find_map(|row| {
            let before = seen.insert(&row.name, row).filter(|before| is_other(before, row))?;
            Some((row, before.line))
        });
        if let Some((row, line)) = duplicates {
            let (view, name, second) = (&view.name, &row.name, row.line);
            return Some(format!(
                "view {view}: lines {line} and {second} both have id `{name}`; right for the corners of one tag, else one is mislabelled"
            )); // The first is reported; a file of tags has thousands.
        }
    }
    None
}

/// Remarks on easting and northing of a grid of which nothing is known.
fn of_unknown_grid(frame: &LocalFrame) -> Option<String> {
    frame.grid_origin_m().map(|_| {
        format!(
            "of the coordinates of `{}` nothing is known here: metres of a rigid frame are assumed, and latitudes are unknown; with a UTM zone (column zone, --crs 33N) the scale of the projection is undone",
            frame.system
        )
    })
}

/// Remarks on points in one plane with the camera on its lower side.
fn below_the_points(view: &PointsView, answer: &PoseAnswer) -> Option<String> {
    let estimate = answer.estimate.as_ref().filter(|_| answer.status() == Status::Ok)?;
    if view.rows.iter().any(|row| row.line_end.is_some()) {
        return None;
    }
    let z_m = view.rows.iter().map(|row| row.x_in_target[2]);
    below_one_level(
        "camera",
        "x_m and y_m are exchanged or v_px is counted upwards",
        z_m,
        estimate.cam_from_target.origin().z,
    )
}

/// Remarks on coordinates that are implausible in metres; the whole file is checked, because a unit applies to a column.
fn unit_remarks(views: &[PointsView]) -> Vec<String> {
    let rows = views.iter().flat_map(|view| &view.rows);
    let points = rows.map(|row| (Point::from(row.x_in_target), row.sigma_m.unwrap_or(0.0)));
    crate::formats::plausible::of_uncertain_points(points).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::{CameraMatrix, Pose, Vector6, camera::Pinhole};

    /// Eight points of a room, in round millimetres.
    const ROOM_MM: [[f64; 3]; 8] = [
        [0.0, 0.0, 0.0],
        [3500.0, 0.0, 0.0],
        [3500.0, 2400.0, 0.0],
        [0.0, 2400.0, 0.0],
        [700.0, 300.0, 900.0],
        [2800.0, 1900.0, 1200.0],
        [1700.0, 1200.0, 400.0],
        [400.0, 2100.0, 600.0],
    ];

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 640.0, cy_px: 480.0 };
        Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
    }

    /// The room in a unit of so many metres, seen by the camera.
    fn view(unit_m: f64, sigma_m: Option<f64>) -> PointsView {
        let pose = Pose::exp(&Vector6::new(0.2, -0.3, 0.1, -1.2, -1.0, 6.0));
        let row = |(i, mm): (usize, &[f64; 3])| {
            let x_m = Point::from(*mm) * 1e-3;
            let pixel = camera().project(&(pose * x_m)).expect("in front");
            Row {
                line: i as u64 + 2,
                name: i.to_string(),
                x_in_target: (x_m / unit_m).into(),
                image: [pixel.x, pixel.y],
                sigma: Some(0.3),
                sigma_m,
                line_end: None,
            }
        };
        PointsView { name: "room".into(), rows: ROOM_MM.iter().enumerate().map(row).collect() }
    }

    fn located(view: &PointsView) -> PoseAnswer {
        let locator = TableLocator::new(Some(camera()), None, PointsOptions::default());
        let table = PointsTable { views: vec![view.clone()], frame: None, implausible: Vec::new() };
        locator.for_table("room.csv".as_ref(), &table).locate(view)
    }

    /// Six points of a floor, observed from four metres above it; with x and y exchanged the camera is at the same depth below.
    #[test]
    fn a_camera_below_points_of_one_level_is_remarked_on() {
        let below_from_above = nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0));
        let pose = Pose { rotation: below_from_above, translation: Point::new(0.1, 0.2, 4.0) };
        let floor = [[0.0, 0.0], [1.5, 0.1], [1.4, 1.2], [-0.3, 0.9], [0.6, 0.5], [0.9, -0.4]];
        let seen = |exchanged: bool| {
            let row = |(i, [x, y]): (usize, &[f64; 2])| {
                let pixel = camera().project(&(pose * Point::new(*x, *y, 0.0))).expect("in front");
                let x_in_target = if exchanged { [*y, *x, 0.0] } else { [*x, *y, 0.0] };
                let (line, name, image) = (i as u64 + 2, i.to_string(), [pixel.x, pixel.y]);
                Row { line, name, x_in_target, image, sigma: Some(0.3), sigma_m: None, line_end: None }
            };
            let rows = floor.iter().enumerate().map(row).collect();
            located(&PointsView { name: "floor".into(), rows })
        };
        assert_eq!((seen(false).status(), seen(false).remarks.len()), (Status::Ok, 0));
        let below = seen(true);
        assert_eq!(below.status(), Status::Ok);
        assert!(below.remarks[0].contains("4.00 m below the points"), "{:?}", below.remarks);
    }

    #[test]
    fn points_in_millimetres_are_implausible_and_points_in_metres_are_not() {
        assert_eq!(located(&view(1.0, None)).status(), Status::Ok);
        let answer = located(&view(1e-3, None));
        assert_eq!(answer.status(), Status::Implausible);
        assert!(answer.verdict.message.contains("are they in millimetres ("), "{}", answer.verdict.message);
        assert!(answer.estimate.is_some_and(|e| 1000.0 < e.cam_from_target.origin().norm()));
        // A stated sigma of 0.1 m shows that the lengths are metres.
        assert_eq!(located(&view(1e-3, Some(0.1))).status(), Status::Ok);
    }
}
