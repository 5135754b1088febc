//! Histories written by other versions: an earlier one is read as it is and brought up to date when it is written, a later one is refused.

use crate::history_support::{FOR_EVER, every, file, frames, keep, open, pairs, rotations, rows, thin};
use resight_watch::history::export::{Table, export};
use resight_watch::history::{History, HistoryError, Selection, Span, Store};
use rusqlite::{Connection, params};
use std::path::Path;

/// The tables as version 1 made them, word for word.
const FIRST: &str = "
CREATE TABLE session (
    id INTEGER PRIMARY KEY, began_unix_s REAL NOT NULL, ended_unix_s REAL, program TEXT NOT NULL);
CREATE TABLE pair (
    id INTEGER PRIMARY KEY, camera TEXT NOT NULL, target TEXT NOT NULL, UNIQUE (camera, target));
CREATE TABLE frame (
    id INTEGER PRIMARY KEY, pair INTEGER NOT NULL REFERENCES pair, session INTEGER NOT NULL REFERENCES session,
    t_s REAL NOT NULL, span_s REAL NOT NULL, number INTEGER, frames INTEGER NOT NULL, readings INTEGER NOT NULL,
    state TEXT NOT NULL, n_points REAL NOT NULL, rms_px REAL,
    qw REAL, qx REAL, qy REAL, qz REAL, x_m REAL, y_m REAL, z_m REAL, covariance BLOB, reason TEXT,
    scatter BLOB, least BLOB, most BLOB, most_rms_px REAL);
CREATE INDEX frame_of_pair ON frame (pair, span_s, t_s);
CREATE TABLE event (
    id INTEGER PRIMARY KEY, session INTEGER NOT NULL REFERENCES session, unix_s REAL NOT NULL, t_s REAL,
    camera TEXT, target TEXT, kind TEXT NOT NULL, state TEXT, detail TEXT NOT NULL);
INSERT INTO session VALUES (1, 0, NULL, 'resight');
INSERT INTO pair VALUES (1, 'gate', 'door');
PRAGMA application_id = 0x52534754;
PRAGMA user_version = 1;
";

/// As version 1 wrote a frame.
const INSERT: &str =
    "INSERT INTO frame (pair, session, t_s, span_s, number, frames, readings, state, n_points, rms_px,
    qw, qx, qy, qz, x_m, y_m, z_m, covariance, reason)
    VALUES (1, 1, ?1, 0, 0, 1, 1, 'steady', 4, 0.25, 1, 0, 0, 0, 0.5, 0.25, 2, ?2, NULL)";

fn insert(connection: &Connection, t_s: f64) {
    let covariance: Vec<u8> = (1..22).flat_map(|i| (1e-6 * f64::from(i)).to_le_bytes()).collect();
    connection.execute(INSERT, params![t_s, covariance]).expect("inserted");
}

/// Thirty frames of the first half minute.
fn first(path: &Path) {
    let connection = Connection::open(path).expect("a file");
    connection.execute_batch(FIRST).expect("the tables");
    every(1.0, 0.0, 30.0).for_each(|t_s| insert(&connection, t_s));
}

fn version(path: &Path) -> i64 {
    let connection = Connection::open(path).expect("a file");
    connection.pragma_query_value(None, "user_version", |row| row.get(0)).expect("a number")
}

#[test]
fn an_earlier_version_is_read_and_left_alone() {
    let path = file("version-read");
    first(&path);
    let before = std::fs::read(&path).expect("the file");
    let read = rows(&path);
    assert_eq!(read.len(), 30);
    for row in &read {
        let measured = row.measured.expect("a pose");
        assert_eq!((measured.rms_px, measured.covariance[(5, 5)]), (0.25, 1e-6 * 21.0));
        assert_eq!((row.readings, row.rotations, row.rotated, row.rotation_summary), (1, 0, None, None));
    }
    let history = History::open(&path).expect("a history");
    let summary = history.pairs().expect("a summary").remove(0);
    assert_eq!((summary.states[0].readings, summary.states[0].rotations), (30, 0));
    let table = path.with_extension("csv");
    assert_eq!(export(&history, Table::Frames, &Selection::default(), &table).expect("exported"), 30);
    drop(history);
    assert!(std::fs::read(&path).expect("the file") == before, "who only reads changes nothing");
}

/// What was there stays, turns come beside it, and both age together.
#[test]
fn an_earlier_version_is_brought_up_to_date_when_it_is_written() {
    let path = file("version-write");
    first(&path);
    let older = Connection::open(&path).expect("a program of the earlier version, which has it open");
    let reader = History::open(&path).expect("a history");
    let before = rows(&path);
    let mut store = open(&path);
    assert_eq!((version(&path), rows(&path)), (2, before), "nothing but the columns is new");
    store.append(&rotations(every(1.0, 30.0, 60.0), "steady", 1), &[]).expect("stored");
    insert(&older, 59.5);
    let mut n_turns = 0;
    let take = |row: resight_watch::history::StoredRow| {
        n_turns += row.rotations;
        true
    };
    reader.rows(&Selection::default(), take).expect("rows");
    assert_eq!(n_turns, 27, "a reader that was there before sees them too");
    store.append(&frames(every(1.0, 500.0, 501.0), "steady", 2), &[]).expect("stored");
    thin(&mut store, &keep(60.0, FOR_EVER, FOR_EVER));
    let minutes = rows(&path).into_iter().filter(|row| row.span == Span::Minute);
    let counts: Vec<_> = minutes.map(|row| (row.session, row.frames, row.readings, row.rotations)).collect();
    assert_eq!(counts, [(1, 31, 31, 0), (2, 30, 0, 27)]);
    drop(store);
    open(&path);
    assert_eq!(version(&path), 2, "the columns are added once");
}

#[test]
fn a_later_version_is_refused_and_left_alone() {
    let path = file("version-later");
    drop(open(&path));
    let connection = Connection::open(&path).expect("a file");
    connection.execute_batch("PRAGMA user_version = 3; PRAGMA wal_checkpoint(TRUNCATE)").expect("set");
    let before = std::fs::read(&path).expect("the file");
    let refused = |error: Option<HistoryError>| {
        let words = error.expect("refused").to_string();
        assert!(words.contains("schema version 3, this program knows 2"), "{words}");
    };
    refused(Store::open(&path, &pairs()).err());
    refused(History::open(&path).err());
    assert!(std::fs::read(&path).expect("the file") == before);
}
