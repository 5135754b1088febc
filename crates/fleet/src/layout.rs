//! Which columns of a table are what: views in rows of flat columns, in rows of lists, or one row a point.

use crate::FleetError;
use arrow_schema::{DataType, Schema};
use resight::input::nearest;
use serde::Serialize;

/// How the points of a view are laid out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PointColumns {
    /// A row a view: `u0_px, v0_px, u1_px, …`, and `x0_m, y0_m, z0_m, …` where the rows state points.
    Flat {
        /// Two columns a point.
        pixels: Vec<usize>,
        /// Three columns a point; none: the cameras state them.
        points_m: Option<Vec<usize>>,
    },
    /// A row a view: lists `points_px` of `u, v` and `points_m` of `x, y, z`, of any length.
    Lists {
        /// Numbers, or pairs.
        pixels: usize,
        /// Numbers, or triples; none: the cameras state them.
        points_m: Option<usize>,
    },
    /// A row a point, the points of a view one after the other: `x_m, y_m, z_m, u_px, v_px`, as `solve` reads them.
    Points {
        /// `u_px, v_px`.
        pixels: [usize; 2],
        /// `x_m, y_m, z_m`.
        points_m: [usize; 3],
    },
}

/// Which column is what, by number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Layout {
    /// The camera's name.
    pub camera: usize,
    /// When the image was taken.
    pub time: Option<usize>,
    /// The view's name, which is handed on.
    pub view: Option<usize>,
    /// Standard deviation of every pixel coordinate.
    pub sigma_px: Option<usize>,
    /// The points.
    pub points: PointColumns,
}

/// What `explain` says of a table.
#[derive(Debug, Clone, Serialize)]
pub struct Columns {
    /// Every column: name, type in Arrow's terms, and its use; empty where it is not used.
    pub columns: Vec<(String, String, String)>,
    /// What is missing, in sentences.
    pub missing: Vec<String>,
    /// What is used; none where something is missing.
    pub layout: Option<Layout>,
}

/// Names of the column of times; the first that there is counts.
const TIMES: [&str; 4] = ["time_s", "time", "timestamp", "ts"];

/// Looks for the columns of views.
pub fn explain(schema: &Schema) -> Columns {
    let mut missing = Vec::new();
    let layout = find(schema, &mut missing);
    let used = layout.as_ref().map(uses).unwrap_or_default();
    let columns = schema.fields().iter().enumerate().map(|(i, field)| {
        let what = used.iter().find(|(column, _)| *column == i).map(|(_, what)| what.clone());
        (field.name().clone(), type_name(field.data_type()), what.unwrap_or_default())
    });
    Columns { columns: columns.collect(), missing, layout }
}

impl Layout {
    /// The columns of views in a table.
    ///
    /// # Errors
    /// `Columns`: which are missing or of another type, and which there are.
    pub fn of(schema: &Schema) -> Result<Self, FleetError> {
        let mut missing = Vec::new();
        find(schema, &mut missing).ok_or_else(|| {
            let there: Vec<&str> =
                schema.fields().iter().map(|field| field.name().as_str()).take(40).collect();
            FleetError::Columns(format!("{}; the columns are {}", missing.join("; "), there.join(", ")))
        })
    }

    /// Columns that are read, in their order.
    pub fn read(&self) -> Vec<usize> {
        let mut columns: Vec<usize> = uses(self).into_iter().map(|(column, _)| column).collect();
        columns.sort_unstable();
        columns
    }
}

fn find(schema: &Schema, missing: &mut Vec<String>) -> Option<Layout> {
    let at = |name: &str| schema.index_of(name).ok();
    let camera = at("camera");
    if camera.is_none() {
        missing.push(no_column(schema, "camera", "the camera's name, text or a whole number"));
    }
    let points = points(schema, missing);
    let time = TIMES.iter().find_map(|name| at(name));
    let (view, sigma_px) = (at("view"), at("sigma_px"));
    let layout = Layout { camera: camera?, time, view, sigma_px, points: points? };
    check_types(schema, &layout, missing);
    missing.is_empty().then_some(layout)
}

fn points(schema: &Schema, missing: &mut Vec<String>) -> Option<PointColumns> {
    let at = |name: &str| schema.index_of(name).ok();
    if at("u0_px").is_some() {
        return flat(schema, missing);
    }
    if let Some(pixels) = at("points_px") {
        return Some(PointColumns::Lists { pixels, points_m: at("points_m") });
    }
    let names = ["u_px", "v_px", "x_m", "y_m", "z_m"];
    if names.iter().all(|name| at(name).is_none()) {
        missing.push(
            "no points: a row a view needs u0_px,v0_px,u1_px,… or a list points_px; a row a point needs x_m,y_m,z_m,u_px,v_px".into(),
        );
        return None;
    }
    for name in names.iter().filter(|name| at(name).is_none()) {
        missing.push(no_column(schema, name, "of a row a point"));
    }
    let [u, v, x, y, z] = names.map(at);
    Some(PointColumns::Points { pixels: [u?, v?], points_m: [x?, y?, z?] })
}

/// As many points as there are columns without a gap.
fn flat(schema: &Schema, missing: &mut Vec<String>) -> Option<PointColumns> {
    let at = |name: String| schema.index_of(&name).ok();
    let count = (0..).take_while(|n| at(format!("u{n}_px")).is_some()).count();
    let mut all = |names: &[&str], unit: &str| -> Option<Vec<usize>> {
        let columns = (0..count).flat_map(|n| names.iter().map(move |name| format!("{name}{n}_{unit}")));
        let found: Vec<Option<usize>> = columns
            .map(|name| {
                let found = at(name.clone());
                if found.is_none() {
                    missing.push(no_column(schema, &name, "which belongs to the others of its kind"));
                }
                found
            })
            .collect();
        found.into_iter().collect()
    };
    let pixels = all(&["u", "v"], "px")?;
    let points_m = if at("x0_m".into()).is_some() { Some(all(&["x", "y", "z"], "m")?) } else { None };
    if count < 3 {
        missing.push(format!("{count} points a view (u0_px … ); 3 or more are needed"));
    }
    Some(PointColumns::Flat { pixels, points_m })
}

fn no_column(schema: &Schema, name: &str, what: &str) -> String {
    let similar = nearest(name, schema.fields().iter().map(|field| field.name().clone()));
    let hint = similar.map(|n| format!("; did you mean `{n}`?")).unwrap_or_default();
    format!("no column `{name}` ({what}){hint}")
}

/// The use of each column that is read.
fn uses(layout: &Layout) -> Vec<(usize, String)> {
    let mut uses = vec![(layout.camera, "the camera's name".to_string())];
    uses.extend(layout.time.map(|i| (i, "time of the image".to_string())));
    uses.extend(layout.view.map(|i| (i, "name of the view, handed on".to_string())));
    uses.extend(layout.sigma_px.map(|i| (i, "standard deviation of u and v, px".to_string())));
    let pixel = |k: usize| format!("{} of point {}, px", ["u", "v"][k % 2], k / 2);
    let place = |k: usize| format!("{} of point {}, metres", ["x", "y", "z"][k % 3], k / 3);
    match &layout.points {
        PointColumns::Flat { pixels, points_m } => {
            uses.extend(pixels.iter().enumerate().map(|(k, i)| (*i, pixel(k))));
            uses.extend(points_m.iter().flatten().enumerate().map(|(k, i)| (*i, place(k))));
        }
        PointColumns::Lists { pixels, points_m } => {
            uses.push((*pixels, "u, v of every point, px".to_string()));
            uses.extend(points_m.map(|i| (i, "x, y, z of every point, metres".to_string())));
        }
        PointColumns::Points { pixels, points_m } => {
            uses.extend(
                pixels.iter().zip(["u", "v"]).map(|(i, name)| (*i, format!("{name} of the point, px"))),
            );
            let places = points_m.iter().zip(["x", "y", "z"]);
            uses.extend(places.map(|(i, name)| (*i, format!("{name} of the point, metres"))));
        }
    }
    uses
}

fn check_types(schema: &Schema, layout: &Layout, missing: &mut Vec<String>) {
    let mut need = |column: usize, needed: &str, is_right: fn(&DataType) -> bool| {
        let field = schema.field(column);
        if !is_right(field.data_type()) {
            missing.push(format!(
                "column `{}` is of type {}; {needed} is needed",
                field.name(),
                type_name(field.data_type())
            ));
        }
    };
    need(layout.camera, "text or a whole number", is_name);
    layout.view.iter().for_each(|i| need(*i, "text or a whole number", is_name));
    layout.time.iter().for_each(|i| need(*i, "seconds or a time stamp", is_time));
    layout.sigma_px.iter().for_each(|i| need(*i, "a number", is_number));
    match &layout.points {
        PointColumns::Flat { pixels, points_m } => {
            pixels.iter().chain(points_m.iter().flatten()).for_each(|i| need(*i, "a number", is_number));
        }
        PointColumns::Lists { pixels, points_m } => {
            [*pixels].iter().chain(points_m).for_each(|i| need(*i, "a list of numbers", is_list));
        }
        PointColumns::Points { pixels, points_m } => {
            pixels.iter().chain(points_m).for_each(|i| need(*i, "a number", is_number));
        }
    }
}

fn is_name(kind: &DataType) -> bool {
    match kind {
        DataType::Dictionary(_, values) => is_name(values),
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => true,
        other => other.is_integer(),
    }
}

fn is_number(kind: &DataType) -> bool {
    kind.is_integer() || matches!(kind, DataType::Float64 | DataType::Float32)
}

fn is_time(kind: &DataType) -> bool {
    is_number(kind) || matches!(kind, DataType::Timestamp(_, _))
}

fn is_list(kind: &DataType) -> bool {
    match kind {
        DataType::List(item) | DataType::LargeList(item) | DataType::FixedSizeList(item, _) => {
            is_number(item.data_type()) || is_list(item.data_type())
        }
        _ => false,
    }
}

/// As Arrow writes it, without the field names inside lists.
fn type_name(kind: &DataType) -> String {
    match kind {
        DataType::List(item) | DataType::LargeList(item) => {
            format!("list of {}", type_name(item.data_type()))
        }
        DataType::FixedSizeList(item, n) => format!("list of {n} {}", type_name(item.data_type())),
        DataType::Dictionary(_, values) => type_name(values),
        other => format!("{other}"),
    }
}
