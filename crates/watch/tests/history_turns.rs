//! The history of a camera that goes by natural landmarks: turns are kept as numbers, and age as honestly as poses, apart from them.

use crate::history_support::{
    FOR_EVER, cells, every, file, frames, is_mean_of, is_mean_turn_of, keep, open, rotations, rows, thin,
};
use resight_watch::history::export::{Table, export};
use resight_watch::history::{FrameRow, History, Selection, Span, StoredRow};
use std::path::Path;

#[test]
fn a_stored_turn_is_the_turn_that_came() {
    let path = file("turn-round-trip");
    let stored = rotations(every(0.1, 0.0, 3.0), "steady", 1);
    open(&path).append(&stored, &[]).expect("stored");
    let read = rows(&path);
    assert_eq!(read.len(), stored.len());
    for (row, frame) in read.iter().zip(&stored) {
        assert_eq!((row.rotated, &row.reason), (frame.rotated, &frame.reason));
        assert_eq!((row.rotations, row.readings), (u64::from(frame.rotated.is_some()), 0));
        assert_eq!((row.measured, row.rotation_summary), (None, None));
    }
    let history = History::open(&path).expect("a history");
    let summary = history.pairs().expect("a summary").remove(0);
    assert_eq!(
        (summary.states[0].frames, summary.states[0].rotations, summary.states[0].readings),
        (30, 27, 0)
    );
}

/// A target seen every other half second, and landmarks in between: two means, each of its own frames.
#[test]
fn a_minute_keeps_poses_and_turns_apart() {
    let path = file("turn-minute");
    let poses = frames(every(1.0, 0.0, 120.0), "steady", 2);
    let rotated = rotations(every(1.0, 0.5, 90.5), "steady", 3);
    let mut store = open(&path);
    store.append(&poses, &[]).expect("stored");
    store.append(&rotated, &[]).expect("stored");
    store.append(&frames(every(1.0, 500.0, 501.0), "steady", 4), &[]).expect("stored");
    thin(&mut store, &keep(60.0, FOR_EVER, FOR_EVER));
    let read = rows(&path);
    let minutes: Vec<&StoredRow> = read.iter().filter(|row| row.span == Span::Minute).collect();
    let counts = |row: &&StoredRow| (row.t_s, row.frames, row.readings, row.rotations);
    assert_eq!(minutes.iter().map(counts).collect::<Vec<_>>(), [(0.0, 120, 54, 54), (60.0, 90, 54, 27)]);
    for minute in minutes {
        let within = |frame: &&FrameRow| (minute.t_s..minute.t_s + 60.0).contains(&frame.t_s);
        is_mean_of(minute, &poses.iter().filter(within).collect::<Vec<_>>(), 1e-9);
        is_mean_turn_of(minute, &rotated.iter().filter(within).collect::<Vec<_>>(), 1e-9);
        assert_eq!(minute.reason, None);
    }
}

/// Minutes of different numbers of turns, some of none: the hour weighs each by its turns, not by its frames or its poses.
#[test]
fn an_hour_of_minutes_is_the_mean_of_its_turns() {
    let path = file("turn-hour");
    let rotated: Vec<FrameRow> = [(0.0, 900.0, 5.0), (900.0, 1200.0, 1.0), (2400.0, 3600.0, 7.0)]
        .into_iter()
        .flat_map(|(from_s, to_s, period_s)| {
            rotations(every(period_s, from_s, to_s), "steady", 5 + from_s as u64)
        })
        .collect();
    let poses = frames(every(2.0, 600.5, 3000.5), "steady", 6);
    let mut store = open(&path);
    store.append(&rotated, &[]).expect("stored");
    store.append(&poses, &[]).expect("stored");
    store.append(&frames(every(1.0, 9000.0, 9001.0), "steady", 7), &[]).expect("stored");
    thin(&mut store, &keep(60.0, FOR_EVER, FOR_EVER));
    assert!(50 < rows(&path).len(), "minutes come first");
    thin(&mut store, &keep(60.0, 3600.0, FOR_EVER));
    let read = rows(&path);
    assert_eq!(read.iter().map(|row| row.span).collect::<Vec<_>>(), [Span::Hour, Span::Frame]);
    assert_eq!(read[0].frames, (rotated.len() + poses.len()) as u64);
    is_mean_turn_of(&read[0], &rotated.iter().collect::<Vec<_>>(), 5e-3);
    is_mean_of(&read[0], &poses.iter().collect::<Vec<_>>(), 5e-3);
}

/// Each session has a reference image of its own, and a rotation before a sudden motion is none after it.
#[test]
fn turns_of_states_and_sessions_are_not_mixed() {
    let path = file("turn-states");
    open(&path).append(&rotations(every(1.0, 0.0, 20.0), "steady", 8), &[]).expect("stored");
    let mut second = open(&path);
    let (before, after) =
        (rotations(every(1.0, 20.0, 40.0), "steady", 9), rotations(every(1.0, 40.0, 60.0), "drifted", 10));
    second.append(&before, &[]).expect("stored");
    second.append(&after, &[]).expect("stored");
    second.append(&rotations(every(1.0, 500.0, 501.0), "drifted", 11), &[]).expect("stored");
    thin(&mut second, &keep(60.0, FOR_EVER, FOR_EVER));
    let minutes: Vec<StoredRow> = rows(&path).into_iter().filter(|row| row.span == Span::Minute).collect();
    let names: Vec<(i64, &str, u64)> =
        minutes.iter().map(|row| (row.session, row.state.as_str(), row.rotations)).collect();
    assert_eq!(names, [(1, "steady", 18), (2, "drifted", 18), (2, "steady", 18)]);
    is_mean_turn_of(&minutes[1], &after.iter().collect::<Vec<_>>(), 1e-9);
    is_mean_turn_of(&minutes[2], &before.iter().collect::<Vec<_>>(), 1e-9);
}

/// The cells of a table by the names of their columns, row by row.
fn table(path: &Path) -> Vec<impl Fn(&str) -> Option<f64>> {
    let written = path.with_extension("csv");
    let history = History::open(path).expect("a history");
    export(&history, Table::Frames, &Selection::default(), &written).expect("exported");
    let mut rows = cells(&written);
    let names = rows.remove(0);
    let by_name = |row: Vec<Option<String>>| {
        let names = names.clone();
        move |name: &str| {
            let column = names.iter().position(|n| n.as_deref() == Some(name));
            let cell = row[column.unwrap_or_else(|| panic!("no column {name}"))].as_ref();
            cell.map(|text| text.parse().expect("a number"))
        }
    };
    rows.into_iter().map(by_name).collect()
}

const TURN_COLUMNS: [&str; 23] = [
    "turns",
    "n_landmarks",
    "turn_rx_rad",
    "turn_ry_rad",
    "turn_rz_rad",
    "cov_turn_rx_rx_rad2",
    "cov_turn_rx_ry_rad2",
    "cov_turn_rx_rz_rad2",
    "cov_turn_ry_ry_rad2",
    "cov_turn_ry_rz_rad2",
    "cov_turn_rz_rz_rad2",
    "scatter_turn_rx_rx_rad2",
    "scatter_turn_rx_ry_rad2",
    "scatter_turn_rx_rz_rad2",
    "scatter_turn_ry_ry_rad2",
    "scatter_turn_ry_rz_rad2",
    "scatter_turn_rz_rz_rad2",
    "min_turn_rx_rad",
    "min_turn_ry_rad",
    "min_turn_rz_rad",
    "max_turn_rx_rad",
    "max_turn_ry_rad",
    "max_turn_rz_rad",
];

/// Each column by its name; a single frame has no scatter, and what sees nothing has no rotation.
#[test]
fn the_table_names_every_number_of_a_turn() {
    let path = file("turn-table");
    let mut store = open(&path);
    store.append(&rotations(every(1.0, 0.0, 150.0), "steady", 12), &[]).expect("stored");
    thin(&mut store, &keep(60.0, FOR_EVER, FOR_EVER));
    let (read, table) = (rows(&path), table(&path));
    assert_eq!((read.len(), table.len()), (91, 91));
    for (row, cell) in read.iter().zip(&table) {
        let seen: Vec<Option<f64>> = TURN_COLUMNS.iter().map(|name| cell(name)).collect();
        let triangle = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        let mut wanted = vec![Some(row.rotations as f64), row.rotated.map(|t| t.n_landmarks)];
        wanted.extend((0..3).map(|i| row.rotated.map(|t| t.rotation_rad[i])));
        wanted.extend(triangle.map(|place| row.rotated.map(|t| t.covariance_rad2[place])));
        wanted.extend(triangle.map(|place| row.rotation_summary.map(|s| s.scatter_rad2[place])));
        wanted.extend((0..3).map(|i| row.rotation_summary.map(|s| s.least_rad[i])));
        wanted.extend((0..3).map(|i| row.rotation_summary.map(|s| s.most_rad[i])));
        assert_eq!(seen, wanted);
        assert_eq!(cell("qw"), None, "a rotation is no pose");
    }
}
