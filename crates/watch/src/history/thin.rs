//! Thins rows with age: every frame, then one row per minute, then one per hour, then none. Events are kept for good.

use super::columns::{self, Written};
use super::join::join;
use super::rows::{Span, StoredRow};
use super::store::{Store, unix_s, write};
use super::{HistoryError, schema};
use rusqlite::{Transaction, params};
use std::collections::BTreeMap;

/// The retention and resolution of rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Retention {
    /// Every frame, this long; seconds.
    pub full_s: f64,
    /// Then a row a minute until this age, seconds.
    pub minutes_s: f64,
    /// Then a row an hour until this age, seconds; older ones go.
    pub keep_s: f64,
    /// Size of the file, bytes, beyond which the oldest rows are thinned early.
    pub largest_bytes: Option<u64>,
}

impl Default for Retention {
    /// A week of frames, three months of minutes, three years of hours.
    fn default() -> Self {
        const DAY_S: f64 = 86_400.0;
        Retention {
            full_s: 7.0 * DAY_S,
            minutes_s: 90.0 * DAY_S,
            keep_s: 1100.0 * DAY_S,
            largest_bytes: None,
        }
    }
}

/// Minutes or hours joined in one transaction, for which writers wait.
const BUCKETS: usize = 10;
/// Pages given back to the disk at a time.
const PAGES: i64 = 2000;

impl Store {
    /// Combines or removes some of the rows that are old enough; returns true while there is more to do. Age is counted back from the newest row
    /// of each pair, unless that is in the future: a recording of another year is thinned by its own clock.
    ///
    /// # Errors
    /// The errors of `append`.
    pub fn thin(&mut self, keep: &Retention) -> Result<bool, HistoryError> {
        self.thin_some(keep).map_err(|e| HistoryError::of(&self.path, &e))
    }

    fn thin_some(&mut self, keep: &Retention) -> rusqlite::Result<bool> {
        let pairs = self.all_pairs()?;
        let mut is_more = false;
        for pair in &pairs {
            let Some(newest_s) = self.newest_s(*pair)? else { continue };
            is_more |= self.join(*pair, Span::Frame, newest_s - keep.full_s)?;
            is_more |= self.join(*pair, Span::Minute, newest_s - keep.minutes_s)?;
            is_more |= self.forget(*pair, newest_s - keep.keep_s)?;
        }
        if !is_more && keep.largest_bytes.is_some_and(|most| self.used_bytes().is_ok_and(|used| most < used))
        {
            is_more = self.press(&pairs)?;
        }
        self.give_back()?;
        Ok(is_more)
    }

    /// Each step frees one page: the statement must be run to its end.
    fn give_back(&mut self) -> rusqlite::Result<()> {
        let mut vacuum = self.connection.prepare(&format!("PRAGMA incremental_vacuum({PAGES})"))?;
        let mut pages = vacuum.query([])?;
        while pages.next()?.is_some() {}
        Ok(())
    }

    fn all_pairs(&self) -> rusqlite::Result<Vec<i64>> {
        let mut select = self.connection.prepare("SELECT id FROM pair")?;
        select.query_map([], |row| row.get(0))?.collect()
    }

    fn newest_s(&self, pair: i64) -> rusqlite::Result<Option<f64>> {
        let select = "SELECT max(t_s) FROM frame WHERE pair = ?1 AND span_s = ?2";
        let newest = |span: Span| {
            let found = self.connection.query_row(select, params![pair, span.seconds()], |row| row.get(0));
            found.map(|t_s: Option<f64>| t_s.map(|t_s| (t_s + span.seconds()).min(unix_s())))
        };
        Ok([newest(Span::Frame)?, newest(Span::Minute)?, newest(Span::Hour)?]
            .into_iter()
            .flatten()
            .reduce(f64::max))
    }

    /// Bytes in use: pages waiting to be given back do not count.
    fn used_bytes(&self) -> rusqlite::Result<u64> {
        let number = |pragma| schema::number(&self.connection, pragma);
        Ok(((number("page_count")? - number("freelist_count")?) * number("page_size")?) as u64)
    }

    /// Thins the oldest of the finest rows as if they were old enough; the newest minute of frames is never changed.
    fn press(&mut self, pairs: &[i64]) -> rusqlite::Result<bool> {
        for (span, next) in [(Span::Frame, Span::Minute), (Span::Minute, Span::Hour)] {
            let mut is_more = false;
            for pair in pairs {
                let Some(newest_s) = self.newest_s(*pair)? else { continue };
                let before_s = newest_s - next.seconds();
                is_more |= self.join_until(*pair, span, before_s, 1)?;
            }
            if is_more {
                return Ok(true);
            }
        }
        let mut is_more = false;
        for pair in pairs {
            if let Some(oldest_s) = self.oldest_s(*pair, Span::Hour)? {
                is_more |= self.forget(*pair, oldest_s + Span::Hour.seconds())?;
            }
        }
        Ok(is_more)
    }

    fn join(&mut self, pair: i64, span: Span, before_s: f64) -> rusqlite::Result<bool> {
        self.join_until(pair, span, before_s, BUCKETS)
    }

    /// Joins whole minutes (hours) that lie before a time; true when there was one.
    fn join_until(&mut self, pair: i64, span: Span, before_s: f64, most: usize) -> rusqlite::Result<bool> {
        let into = if span == Span::Frame { Span::Minute } else { Span::Hour };
        let length_s = into.seconds();
        // An hour waits until all its minutes are there.
        let first_s = if span == Span::Minute { self.oldest_s(pair, Span::Frame)? } else { None };
        let before_s = before_s.min(first_s.unwrap_or(before_s));
        for joined_so_far in 0..most {
            let oldest_s = self.oldest_s(pair, span)?.map(|t_s| (t_s / length_s).floor() * length_s);
            let Some(begin_s) = oldest_s.filter(|begin_s| begin_s + length_s <= before_s) else {
                return Ok(0 < joined_so_far);
            };
            write(&mut self.connection, |transaction| join_one(transaction, pair, span, begin_s, into))?;
        }
        Ok(true)
    }

    fn oldest_s(&self, pair: i64, span: Span) -> rusqlite::Result<Option<f64>> {
        let select = "SELECT min(t_s) FROM frame WHERE pair = ?1 AND span_s = ?2";
        self.connection.query_row(select, params![pair, span.seconds()], |row| row.get(0))
    }

    /// Removes hours that ended before a time.
    fn forget(&mut self, pair: i64, before_s: f64) -> rusqlite::Result<bool> {
        let delete = "DELETE FROM frame WHERE pair = ?1 AND span_s = ?2 AND t_s <= ?3";
        let hour_s = Span::Hour.seconds();
        write(&mut self.connection, |transaction| {
            Ok(0 < transaction.execute(delete, params![pair, hour_s, before_s - hour_s])?)
        })
    }
}

/// Combines one minute (or hour): one row for each session and state in it replaces the existing ones.
fn join_one(
    transaction: &Transaction,
    pair: i64,
    span: Span,
    begin_s: f64,
    into: Span,
) -> rusqlite::Result<()> {
    let mut groups: BTreeMap<(i64, String), Vec<StoredRow>> = BTreeMap::new();
    let range = "frame.pair = ?1 AND frame.span_s = ?2 AND frame.t_s >= ?3 AND frame.t_s < ?4";
    let limits = params![pair, span.seconds(), begin_s, begin_s + into.seconds()];
    let select = format!(
        "{} FROM frame JOIN pair ON pair.id = frame.pair WHERE {range} ORDER BY frame.t_s",
        columns::select(schema::VERSION) // A file open for writing has been brought up to date.
    );
    let mut select = transaction.prepare(&select)?;
    for found in select.query_map(limits, columns::row)? {
        let found = found?;
        groups.entry((found.session, found.state.clone())).or_default().push(found);
    }
    transaction.execute(&format!("DELETE FROM frame WHERE {range}"), limits)?;
    let mut insert = transaction.prepare(&Written::statement())?;
    let mut joined = groups.values().filter_map(|rows| join(rows, begin_s, into));
    joined.try_for_each(|row| Written::stored(pair, &row).insert(&mut insert))
}
