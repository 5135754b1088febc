//! The kernel on Arrow: `solve_batch(RecordBatch) -> RecordBatch`, pure, one row a view.

use crate::FleetError;
use crate::answers::{Answers, NUMBERS, upper_triangle};
use crate::arrays::{names, numbers};
use crate::assemble::Assembler;
use crate::cameras::{Cameras, UNKNOWN};
use crate::columns::{Column, Columns, is_of_points, slices};
use crate::layout::{Layout, PointColumns};
use crate::solve::{Numbers, Solver, ViewColumns};
use arrow_array::builder::StringBuilder;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int32Type};
use arrow_array::{Array, ArrayRef, DictionaryArray, Float64Array, Int32Array, RecordBatch, StringArray};
use arrow_buffer::{BooleanBuffer, NullBuffer, ScalarBuffer};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use resight::report::verdict::Status;
use std::sync::Arc;

/// Solved rows with their names and times, before they become Arrow or enter a state.
#[derive(Debug, Clone)]
pub struct SolvedRows {
    /// The different cameras' names.
    pub names: Vec<String>,
    /// Which of them each row has; `UNKNOWN` where it has none.
    pub camera: Vec<u32>,
    /// Seconds; NaN where there is none.
    pub time_s: Vec<f64>,
    /// Names of the views, where there are some.
    pub view: Option<ArrayRef>,
    /// Statuses, poses and reasons.
    pub answers: Answers,
}

/// Poses of the views of a batch, in its order: columns of [`schema`].
///
/// # Errors
/// `Columns` where columns are missing or of another type. What is wrong with a row is in its status.
pub fn solve_batch(batch: &RecordBatch, solver: &Solver) -> Result<RecordBatch, FleetError> {
    let layout = Layout::of(&batch.schema())?;
    if !is_of_points(&layout) {
        return solve_rows(batch, &layout, solver).record_batch();
    }
    let mut views = Assembler::default();
    views.push(batch, &layout);
    views.finish();
    let (batch, layout) = views.take(usize::MAX, &layout)?;
    solve_rows(&batch, &layout, solver).record_batch()
}

/// The same for columns that lie elsewhere, as in NumPy: they are read where they are.
///
/// # Errors
/// As `solve_batch`.
pub fn solve_columns(table: &Columns, solver: &Solver) -> Result<RecordBatch, FleetError> {
    let layout = Layout::of(&table.schema())?;
    if is_of_points(&layout) {
        return solve_batch(&table.record_batch()?, solver);
    }
    solve_views(&table.columns, table.rows, &layout, solver).record_batch()
}

/// The same with columns found beforehand, rows of views only (not a row a point).
pub fn solve_rows(batch: &RecordBatch, layout: &Layout, solver: &Solver) -> SolvedRows {
    solve_views(&Column::of_batch(batch, layout), batch.num_rows(), layout, solver)
}

fn solve_views(columns: &[Column], rows: usize, layout: &Layout, solver: &Solver) -> SolvedRows {
    let (names, camera) = match &columns[layout.camera] {
        Column::Names { names, rows } => (names.clone(), rows.to_vec()),
        _ => (Vec::new(), vec![UNKNOWN; rows]),
    };
    let numbered = numbered(&names, &camera, &solver.cameras);
    let time_s = match layout.time {
        Some(column) => columns[column].numbers().to_vec(),
        None => vec![f64::NAN; rows],
    };
    let sigma_px = layout.sigma_px.map(|column| columns[column].numbers());
    let solve = |pixels: Numbers, points_m: Option<Numbers>| {
        solver.solve(&ViewColumns { camera: &numbered, pixels, points_m, sigma_px })
    };
    let answers = match &layout.points {
        PointColumns::Flat { pixels, points_m } => {
            let points_m = points_m.as_ref().map(|which| slices(columns, which));
            solve(Numbers::Columns(&slices(columns, pixels)), points_m.as_deref().map(Numbers::Columns))
        }
        PointColumns::Lists { pixels, points_m } => {
            solve(listed(&columns[*pixels]), points_m.map(|column| listed(&columns[column])))
        }
        // Rows of points are put together first; on its own each is a view of one point, and says so.
        PointColumns::Points { pixels, points_m } => {
            let points_m = slices(columns, points_m);
            solve(Numbers::Columns(&slices(columns, pixels)), Some(Numbers::Columns(&points_m)))
        }
    };
    let view = layout.view.map(|column| columns[column].array(rows));
    SolvedRows { names, camera, time_s, view, answers }
}

/// Numbers of the cameras in their table, row by row.
fn numbered(names: &[String], rows: &[u32], cameras: &Cameras) -> Vec<u32> {
    let number_of: Vec<u32> = names.iter().map(|name| cameras.number(name).unwrap_or(UNKNOWN)).collect();
    rows.iter().map(|name| number_of.get(*name as usize).copied().unwrap_or(UNKNOWN)).collect()
}

fn listed<'a>(column: &'a Column) -> Numbers<'a> {
    match column {
        Column::Lists { values, offsets } => Numbers::Lists { values, offsets },
        _ => Numbers::Columns(&[]),
    }
}

/// Names of the columns of numbers, in their order, with their units.
pub fn number_names() -> Vec<String> {
    let pose = ["qw", "qx", "qy", "qz", "x_m", "y_m", "z_m"].map(|name| format!("cam_from_target_{name}"));
    let covariance = upper_triangle().map(|(i, j, _)| format!("covariance_{i}{j}"));
    let fit = ["probability", "chi2", "rms_px"].map(String::from);
    pose.into_iter().chain(covariance).chain(fit).collect()
}

/// Words of column `status`, by key.
const STATUSES: [Status; 6] = [
    Status::Ok,
    Status::Ambiguous,
    Status::Degenerate,
    Status::Inconsistent,
    Status::NotFound,
    Status::Implausible,
];

/// The columns of answers; `view` only where the views have names.
pub fn schema(has_view: bool) -> SchemaRef {
    let dictionary = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let mut fields =
        vec![Field::new("camera", dictionary(), true), Field::new("time_s", DataType::Float64, true)];
    fields.extend(has_view.then(|| Field::new("view", DataType::Utf8, true)));
    fields.push(Field::new("status", dictionary(), false));
    fields.push(Field::new("reason", DataType::Utf8, true));
    fields.push(Field::new("n_points", DataType::Int32, false));
    fields.extend(number_names().into_iter().map(|name| Field::new(name, DataType::Float64, true)));
    Arc::new(Schema::new(fields))
}

impl SolvedRows {
    /// With a column `view` where the others of the output have one, and only then.
    pub fn with_view(mut self, has_view: bool) -> Self {
        let empty = || -> ArrayRef { Arc::new(StringArray::new_null(self.answers.len())) };
        self.view = if has_view { Some(self.view.take().unwrap_or_else(empty)) } else { None };
        self
    }

    /// As Arrow.
    ///
    /// # Errors
    /// `Columns` where Arrow refuses the columns, which are of one length.
    pub fn record_batch(self) -> Result<RecordBatch, FleetError> {
        let SolvedRows { names, camera, time_s, view, answers } = self;
        let has_view = view.is_some();
        let is_there =
            |rows: BooleanBuffer| Some(NullBuffer::new(rows)).filter(|nulls| 0 < nulls.null_count());
        let times = is_there(BooleanBuffer::collect_bool(time_s.len(), |i| time_s[i].is_finite()));
        let poses = is_there(BooleanBuffer::collect_bool(answers.len(), |i| answers.status[i].has_pose()));
        let mut columns: Vec<ArrayRef> = vec![
            dictionary(&camera, names.iter().map(String::as_str)),
            Arc::new(Float64Array::new(ScalarBuffer::from(time_s), times)),
        ];
        columns.extend(view);
        let keys: Vec<u32> = answers.status.iter().map(|status| key(*status)).collect();
        let words = STATUSES.iter().map(|status| status.name()).chain([Status::Error.name()]);
        columns.push(dictionary(&keys, words));
        columns.push(reasons(&answers));
        columns.push(Arc::new(Int32Array::from_iter_values(answers.n_points.iter().map(|n| *n as i32))));
        for values in answers.numbers {
            columns.push(Arc::new(Float64Array::new(ScalarBuffer::from(values), poses.clone())));
        }
        Ok(RecordBatch::try_new(schema(has_view), columns)?)
    }

    /// Answers read back: numbers, statuses and names to the last bit, without the views and the reasons.
    ///
    /// # Errors
    /// `Columns` where one of [`schema`] is missing or of another type.
    pub fn of_record_batch(batch: &RecordBatch) -> Result<Self, FleetError> {
        let column = |name: &str| {
            let found = batch.column_by_name(name);
            found.ok_or_else(|| {
                FleetError::Columns(format!("no column `{name}`; the output of `resight batch` is needed"))
            })
        };
        let (names, camera) = names(column("camera")?);
        let mut answers = Answers::new(batch.num_rows());
        let (words, keys) = self::names(column("status")?);
        let known: Vec<Status> = words.iter().map(|word| status_of(word)).collect();
        for (status, key) in answers.status.iter_mut().zip(&keys) {
            *status = known.get(*key as usize).copied().unwrap_or(Status::Error);
        }
        for (values, name) in answers.numbers.iter_mut().zip(number_names()) {
            let array = column(&name)?;
            if *array.data_type() != DataType::Float64 {
                let reason = format!("column `{name}` is of type {}; Float64 is needed", array.data_type());
                return Err(FleetError::Columns(reason));
            }
            let array = array.as_primitive::<Float64Type>();
            match array.null_count() {
                0 => *values = array.values().to_vec(),
                _ => *values = array.iter().map(|x| x.unwrap_or(0.0)).collect(),
            }
        }
        let time_s = numbers(column("time_s")?).into_owned();
        debug_assert_eq!(answers.numbers.len(), NUMBERS);
        Ok(SolvedRows { names, camera, time_s, view: None, answers })
    }
}

fn key(status: Status) -> u32 {
    STATUSES.iter().position(|known| *known == status).unwrap_or(STATUSES.len()) as u32
}

fn status_of(word: &str) -> Status {
    STATUSES.into_iter().find(|status| status.name() == word).unwrap_or(Status::Error)
}

fn dictionary<'a>(keys: &[u32], words: impl Iterator<Item = &'a str>) -> ArrayRef {
    let keys: Int32Array = keys.iter().map(|key| i32::try_from(*key).ok()).collect();
    let words: ArrayRef = Arc::new(StringArray::from_iter_values(words));
    Arc::new(DictionaryArray::<Int32Type>::new(keys, words))
}

fn reasons(answers: &Answers) -> ArrayRef {
    let mut builder = StringBuilder::with_capacity(answers.len(), 0);
    for row in 0..answers.len() as u32 {
        builder.append_option(answers.reasons.get(&row));
    }
    Arc::new(builder.finish())
}
