//! A table as the kernel reads it: columns of numbers, names and lists, borrowed where they lie. Arrow and NumPy both come to this.

use crate::FleetError;
pub use crate::arrays::numbers;
use crate::arrays::{lists, names};
use crate::layout::{Layout, PointColumns};
use arrow_array::builder::{Float64Builder, ListBuilder};
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, StringArray};
use arrow_schema::{DataType, Field, Schema};
use std::borrow::Cow;
use std::sync::Arc;

/// One column.
#[derive(Debug, Clone)]
pub enum Column<'a> {
    /// A number a row; NaN where it is missing.
    Numbers(Cow<'a, [f64]>),
    /// A name a row.
    Names {
        /// The different ones.
        names: Vec<String>,
        /// Which of them each row has; one that is not there: the name is missing.
        rows: Cow<'a, [u32]>,
    },
    /// Numbers of each row, side by side.
    Lists {
        /// All of them.
        values: Cow<'a, [f64]>,
        /// Where each row begins, and the end.
        offsets: Cow<'a, [usize]>,
    },
    /// A column that is not read.
    Unused,
}

impl<'a> Column<'a> {
    /// Of Arrow; a column of names may hold whole numbers.
    pub fn of_array(array: &'a dyn Array, is_name: bool) -> Self {
        match array.data_type() {
            _ if is_name => {
                let (names, rows) = names(array);
                Column::Names { names, rows: rows.into() }
            }
            DataType::List(_) | DataType::LargeList(_) | DataType::FixedSizeList(_, _) => {
                let (values, offsets) = lists(array);
                Column::Lists { values, offsets: offsets.into() }
            }
            _ => Column::Numbers(numbers(array)),
        }
    }

    /// Those of a batch that are used.
    pub fn of_batch(batch: &'a RecordBatch, layout: &Layout) -> Vec<Self> {
        let used = layout.read();
        let of = |(i, array): (usize, &'a ArrayRef)| match used.binary_search(&i) {
            Ok(_) => Column::of_array(array.as_ref(), i == layout.camera || Some(i) == layout.view),
            Err(_) => Column::Unused,
        };
        batch.columns().iter().enumerate().map(of).collect()
    }

    /// Rows; none where the column is not read.
    pub fn rows(&self) -> Option<usize> {
        match self {
            Column::Numbers(values) => Some(values.len()),
            Column::Names { rows, .. } => Some(rows.len()),
            Column::Lists { offsets, .. } => Some(offsets.len().saturating_sub(1)),
            Column::Unused => None,
        }
    }

    /// Numbers of a column that holds them.
    pub fn numbers(&self) -> &[f64] {
        if let Column::Numbers(values) = self { values } else { &[] }
    }

    /// As Arrow; what is missing is null.
    pub fn array(&self, rows: usize) -> ArrayRef {
        match self {
            Column::Numbers(values) => {
                Arc::new(values.iter().map(|x| Some(*x).filter(|x| !x.is_nan())).collect::<Float64Array>())
            }
            Column::Names { names, rows } => {
                let name = |row: &u32| names.get(*row as usize).map(String::as_str);
                Arc::new(rows.iter().map(name).collect::<StringArray>())
            }
            Column::Lists { values, offsets } => {
                let mut builder = ListBuilder::new(Float64Builder::new());
                for range in offsets.windows(2) {
                    builder.values().append_slice(values.get(range[0]..range[1]).unwrap_or(&[]));
                    builder.append(true);
                }
                Arc::new(builder.finish())
            }
            Column::Unused => arrow_array::new_null_array(&DataType::Null, rows),
        }
    }

    fn kind(&self) -> DataType {
        match self {
            Column::Numbers(_) => DataType::Float64,
            Column::Names { .. } => DataType::Utf8,
            Column::Lists { .. } => DataType::List(Arc::new(Field::new_list_field(DataType::Float64, true))),
            Column::Unused => DataType::Null,
        }
    }
}

/// Columns with their names, all of one length.
#[derive(Debug, Clone)]
pub struct Columns<'a> {
    /// Names of the columns.
    pub names: Vec<String>,
    /// What they hold.
    pub columns: Vec<Column<'a>>,
    /// How many rows there are.
    pub rows: usize,
}

impl<'a> Columns<'a> {
    /// Of named columns.
    ///
    /// # Errors
    /// `Columns` where they are not of one length, or a list's rows run beyond its numbers.
    pub fn new(named: Vec<(String, Column<'a>)>) -> Result<Self, FleetError> {
        let (names, columns): (Vec<String>, Vec<Column>) = named.into_iter().unzip();
        let lengths = || names.iter().zip(columns.iter().map(Column::rows));
        let first = lengths().find_map(|(name, n)| Some((name, n?)));
        let rows = first.map_or(0, |(_, n)| n);
        if let Some((name, n)) = lengths().find_map(|(name, n)| Some((name, n?)).filter(|(_, n)| *n != rows))
        {
            let first = first.map_or("", |(name, _)| name);
            let reason = format!("column `{name}` has {n} rows and `{first}` has {rows}; as many are needed");
            return Err(FleetError::Columns(reason));
        }
        for (name, column) in names.iter().zip(&columns) {
            let Column::Lists { values, offsets } = column else { continue };
            let rises = offsets.windows(2).all(|w| w[0] <= w[1]);
            if !rises || offsets.last().is_none_or(|end| values.len() < *end) {
                let reason = format!(
                    "the rows of column `{name}` begin at numbers that fall, or end behind its {} numbers",
                    values.len()
                );
                return Err(FleetError::Columns(reason));
            }
        }
        Ok(Columns { names, columns, rows })
    }

    /// What Arrow would call them.
    pub fn schema(&self) -> Schema {
        let field = |(name, column): (&String, &Column)| Field::new(name, column.kind(), true);
        Schema::new(self.names.iter().zip(&self.columns).map(field).collect::<Vec<_>>())
    }

    /// A copy as Arrow.
    ///
    /// # Errors
    /// None for columns of one length.
    pub fn record_batch(&self) -> Result<RecordBatch, FleetError> {
        let arrays = self.columns.iter().map(|column| column.array(self.rows)).collect();
        Ok(RecordBatch::try_new(Arc::new(self.schema()), arrays)?)
    }
}

/// The names of a column, row by row.
pub fn text(array: &dyn Array) -> Vec<Option<String>> {
    let (names, rows) = names(array);
    rows.iter().map(|row| names.get(*row as usize).cloned()).collect()
}

/// The slices of several columns of numbers.
pub(crate) fn slices<'a>(columns: &'a [Column], which: &[usize]) -> Vec<&'a [f64]> {
    which.iter().map(|i| columns[*i].numbers()).collect()
}

/// Whether a row is a point of a view.
pub(crate) fn is_of_points(layout: &Layout) -> bool {
    matches!(layout.points, PointColumns::Points { .. })
}
