//! Units that are hardly meant: remarks on the first rows of views, and on the times of all.

use crate::FleetState;
use crate::assess::unit_of_time;
use crate::columns::{Column, slices};
use crate::layout::PointColumns;
use crate::source::{Source, explain_file};
use crate::words::of_other_unit;
use resight::core::Point;
use resight::formats::plausible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// What the columns and the first row of a file should be looked at for; nothing of a file that cannot be read, which the run reports.
pub(crate) fn of_views(path: &Path) -> Vec<String> {
    let names = || explain_file(path).ok().map(|(columns, _)| columns.columns);
    let names = catch_unwind(AssertUnwindSafe(names)).ok().flatten().unwrap_or_default();
    let unused = names.iter().filter(|(_, _, used)| used.is_empty());
    let other = unused.filter_map(|(name, _, _)| of_other_unit(name)).next();
    let points = catch_unwind(AssertUnwindSafe(|| first_points(path))).ok().flatten();
    let points = points.and_then(|points| plausible::of_points(&points));
    let shown = path.display();
    other.into_iter().chain(points).map(|remark| format!("{shown}: {remark}")).collect()
}

/// The points that the first row states, metres.
fn first_points(path: &Path) -> Option<Vec<Point>> {
    let source = Source::open(path).ok()?;
    let layout = source.view_layout();
    let (flat, list) = match &layout.points {
        PointColumns::Flat { points_m, .. } => (points_m.clone()?, None),
        PointColumns::Lists { points_m, .. } => (Vec::new(), Some((*points_m)?)),
        PointColumns::Points { .. } => return None,
    };
    let batch = source.stream().ok()?.next()?.ok()?;
    let columns = Column::of_batch(&batch, &layout);
    let numbers: Vec<f64> = match list.map(|list| &columns[list]) {
        Some(Column::Lists { values, offsets }) => values.get(*offsets.first()?..*offsets.get(1)?)?.to_vec(),
        Some(_) => return None,
        None => slices(&columns, &flat).into_iter().filter_map(|column| column.first().copied()).collect(),
    };
    Some(numbers.chunks_exact(3).map(|x| Point::new(x[0], x[1], x[2])).collect())
}

/// A remark where most times are no seconds.
pub(crate) fn of_times(state: &FleetState) -> Option<String> {
    let mut last: Vec<f64> = state.spans().into_iter().filter_map(|(_, span)| Some(span?.1)).collect();
    last.sort_by(f64::total_cmp);
    let middle = *last.get(last.len() / 2)?;
    unit_of_time(middle).map(|remark| format!("the times are about {middle:.3e} s: {remark}"))
}
