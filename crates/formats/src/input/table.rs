//! CSV files with a header line: columns by name in any order, every complaint with its line.

use super::{Rows, nearest, open_table, rows_of_bytes};
use crate::FileError;
use std::cell::Cell;
use std::path::{Path, PathBuf};

/// Rows accepted in one file; more is a job for a batch tool.
const MAX_ROWS: usize = 5_000_000;

/// A file whose header has been read.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    header: Vec<String>,
    reader: csv::Reader<Rows>,
    mark: Separator,
    decimal: Cell<Option<char>>,
}

/// What separates the cells. Spreadsheets of countries that write decimal commas separate cells by semicolons or tabs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separator {
    /// As documents say; the numbers have decimal points.
    Comma,
    /// Semicolons; the numbers may have decimal commas, as below tabs and bars.
    Semicolon,
    /// Tabs.
    Tab,
    /// Bars.
    Bar,
}

impl Separator {
    /// Returns what separates the cells below a header whose names are `header` when it is cut at commas.
    pub fn of_header(header: &[impl AsRef<[u8]>]) -> Self {
        let is_in = |mark: &Separator, only: &[u8]| only.contains(&mark.byte());
        match header {
            [only] => [Separator::Semicolon, Separator::Tab, Separator::Bar]
                .into_iter()
                .find(|mark| is_in(mark, only.as_ref())),
            _ => None,
        }
        .unwrap_or(Separator::Comma)
    }

    /// Returns the byte between two cells.
    pub const fn byte(self) -> u8 {
        match self {
            Separator::Comma => b',',
            Separator::Semicolon => b';',
            Separator::Tab => b'\t',
            Separator::Bar => b'|',
        }
    }

    /// Returns the number of a cell: where cells are not separated by commas, a comma is its decimal point.
    pub fn number(self, text: &str) -> Option<f64> {
        match self {
            Separator::Comma => text.parse().ok(),
            _ => text.replacen(',', ".", 1).parse().ok(),
        }
    }

    /// What a file is read as, where that is not what documents say; none of commas.
    const fn remark(self) -> Option<&'static str> {
        match self {
            Separator::Comma => None,
            Separator::Semicolon => Some(
                "cells are separated by semicolons, and a comma in a number is read as its decimal point",
            ),
            Separator::Tab => {
                Some("cells are separated by tabs, and a comma in a number is read as its decimal point")
            }
            Separator::Bar => {
                Some("cells are separated by bars, and a comma in a number is read as its decimal point")
            }
        }
    }
}

/// The remark about a table whose cells are not separated by commas, or whose header has units in brackets; none of others, and of what cannot be
/// opened twice.
pub fn how_read(path: impl AsRef<Path>) -> Option<String> {
    let path = path.as_ref();
    let is_file = std::fs::metadata(path).is_ok_and(|found| found.is_file());
    let table = is_file.then(|| Table::open(path, "").ok())??;
    let named = |column: &String| Some(format!("column `{column}` is read as `{}`", with_unit(column)?));
    let remarks: Vec<String> = table
        .mark
        .remark()
        .map(str::to_owned)
        .into_iter()
        .chain(table.header.iter().filter_map(named))
        .collect();
    (!remarks.is_empty()).then(|| remarks.join("; "))
}

/// The remark of [`how_read`] behind the file's name, for jobs with several files.
pub fn how_file_is_read(path: impl AsRef<Path>) -> Option<String> {
    let path = path.as_ref();
    how_read(path).map(|remark| format!("{}: {remark}", path.display()))
}

/// One row below the header.
#[derive(Debug)]
pub struct TableRow<'a> {
    /// Line in the file, counted from 1.
    pub line: u64,
    path: &'a Path,
    header: &'a [String],
    record: &'a csv::StringRecord,
    mark: Separator,
    /// The decimal mark of the numbers so far.
    decimal: &'a Cell<Option<char>>,
}

impl Table {
    /// Opens a file, its cells separated by commas, semicolons, tabs or bars; `wanted` is the beginning of a header, for the complaint about an empty file.
    ///
    /// # Errors
    /// A file that cannot be read, is empty, or names a column twice.
    pub fn open(path: impl AsRef<Path>, wanted: &str) -> Result<Self, FileError> {
        let path = path.as_ref();
        Self::opened(path, wanted, || open_table(path))
    }

    /// Opens as `open` does, from bytes in memory; `path` is used in messages only.
    ///
    /// # Errors
    /// As of `open`.
    pub fn of_bytes(path: impl AsRef<Path>, bytes: &[u8], wanted: &str) -> Result<Self, FileError> {
        Self::opened(path.as_ref(), wanted, || Ok(rows_of_bytes(bytes)))
    }

    fn opened(
        path: &Path,
        wanted: &str,
        open: impl Fn() -> Result<Rows, FileError>,
    ) -> Result<Self, FileError> {
        let table = Self::separated_by(Separator::Comma, path, wanted, open()?)?;
        let table = match Separator::of_header(&table.header) {
            Separator::Comma => table,
            other => Self::separated_by(other, path, wanted, open()?)?,
        };
        let is_duplicate =
            |(i, name): &(usize, &String)| !name.is_empty() && table.header[..*i].contains(name);
        match table.header.iter().enumerate().find(is_duplicate) {
            Some((_, name)) => {
                let hint = table.no_header(wanted).map(|hint| format!("; {hint}")).unwrap_or_default();
                Err(table.complaint(format!("column `{name}` appears twice{hint}")))
            }
            None => Ok(table),
        }
    }

    fn separated_by(mark: Separator, path: &Path, wanted: &str, rows: Rows) -> Result<Self, FileError> {
        let mut builder = csv::ReaderBuilder::new();
        builder.delimiter(mark.byte()).trim(csv::Trim::All).comment(Some(b'#'));
        let mut reader = builder.from_reader(rows);
        let header = reader.headers().map_err(|e| complaint(path, 1, &e))?;
        if header.is_empty() {
            let reason = format!("the file is empty; a header line {wanted},… is needed");
            return Err(FileError::new(path, reason));
        }
        let header = header.iter().map(|name| name.trim_start_matches('\u{feff}').to_string()).collect();
        Ok(Table { path: path.to_path_buf(), header, reader, mark, decimal: Cell::new(None) })
    }

    /// What is wrong with the header.
    pub fn complaint(&self, reason: impl Into<String>) -> FileError {
        FileError::at_line(&self.path, 1, reason)
    }

    /// The names of the columns.
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// Where a column is; capitals do not matter where no other column differs by them, and `x (m)` is `x_m`.
    pub fn find(&self, name: &str) -> Option<usize> {
        let position = |is_it: &dyn Fn(&String) -> bool| self.header.iter().position(is_it);
        position(&|column| column == name)
            .or_else(|| position(&|column| column.eq_ignore_ascii_case(name)))
            .or_else(|| position(&|column| with_unit(column).is_some_and(|column| column == name)))
    }

    /// Where a column is that must be there. `hint` says more about a missing one; else a column of a similar name is offered.
    ///
    /// # Errors
    /// The columns that there are.
    pub fn need(&self, name: &str, hint: Option<&str>) -> Result<usize, FileError> {
        self.find(name).ok_or_else(|| {
            let similar = || {
                if let Some(hint) = other_unit(name, &self.header) {
                    return format!("; {hint}");
                }
                if let Some(hint) = self.no_header(name).or_else(|| in_other_words(name, &self.header)) {
                    return format!("; {hint}");
                }
                let nearest = nearest(name, self.header.iter().cloned());
                nearest.map(|n| format!("; did you mean `{n}` to be `{name}`?")).unwrap_or_default()
            };
            let hint = hint.map_or_else(similar, |hint| format!(" ({hint})"));
            let columns = self.header.join(",");
            self.complaint(format!("no column `{name}`; the columns are {columns}{hint}"))
        })
    }

    /// What the first line is instead of a header; none where it may be one.
    fn no_header(&self, wanted: &str) -> Option<String> {
        let (first, is_only) = (self.header.first()?.as_str(), self.header.len() == 1);
        let is_number = |cell: &&String| cell.parse::<f64>().is_ok();
        if first.starts_with(['{', '[', '<']) || first.contains(" = ") || first.starts_with("%YAML") {
            return Some(format!("this is no table: one is CSV, with a header line that names `{wanted}`"));
        }
        if is_only && first.split_whitespace().any(|word| word.eq_ignore_ascii_case(wanted)) {
            return Some("separate the cells by commas instead of blanks".to_owned());
        }
        (self.header.len() < 2 * self.header.iter().filter(is_number).count()).then(|| {
            format!("they are numbers: write a header line with the names of the columns, `{wanted}` among them, above them")
        })
    }

    /// Hands every row on.
    ///
    /// # Errors
    /// The first that `done` returns; a torn row; no row, or too many.
    pub fn each<E: From<FileError>>(
        self,
        mut done: impl FnMut(TableRow<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.each_or_torn(|row| done(row?))
    }

    /// Hands every row on, and what is wrong with those that have more or fewer cells than the header, or are no text.
    ///
    /// # Errors
    /// The first that `done` returns; a file that cannot be read on; no row, or too many.
    pub fn each_or_torn<E: From<FileError>>(
        mut self,
        mut done: impl FnMut(Result<TableRow<'_>, FileError>) -> Result<(), E>,
    ) -> Result<(), E> {
        let (path, mut n) = (self.path.as_path(), 0);
        let mut record = csv::StringRecord::new();
        loop {
            let is_row = self.reader.read_record(&mut record);
            // The reader stands behind the end of the row's line; where it began may be a comment or an empty line above it.
            let line = self.reader.position().line().saturating_sub(1);
            let is_read = !matches!(&is_row, Err(reason) if reason.is_io_error());
            let is_row = is_row.map_err(|reason| complaint(path, line, &reason));
            let row = match is_row {
                Ok(false) => break,
                Ok(true) => {
                    let (header, record, decimal) = (&self.header, &record, &self.decimal);
                    Ok(TableRow { line, path, header, record, mark: self.mark, decimal })
                }
                Err(reason) if is_read => Err(reason),
                Err(reason) => return Err(reason.into()),
            };
            if MAX_ROWS <= n {
                return Err(FileError::new(path, format!("more than {MAX_ROWS} rows; split the file")).into());
            }
            n += 1;
            done(row)?;
        }
        if n == 0 {
            return Err(FileError::new(path, "no rows below the header").into());
        }
        Ok(())
    }
}

impl TableRow<'_> {
    /// The cell's text; none where it is empty.
    pub fn text(&self, column: usize) -> Option<&str> {
        self.record.get(column).filter(|text| !text.is_empty())
    }

    /// The cell's number.
    ///
    /// # Errors
    /// What the cell holds instead.
    pub fn number(&self, column: usize) -> Result<f64, FileError> {
        let text = self.record.get(column).unwrap_or("");
        let shown: String = text.chars().take(40).collect();
        let mark = text.chars().find(|letter| matches!(letter, '.' | ','));
        let other = self.decimal.get().zip(mark).filter(|(known, mark)| known != mark);
        if self.mark != Separator::Comma
            && let Some((known, mark)) = other
        {
            // "1,234" beside "0.5" is a little more than one, or than a thousand.
            return Err(self.complaint(column, &format!(
                "is `{shown}`, with `{mark}`, though numbers above have `{known}` as their decimal point; write one of the two throughout, and no marks between thousands"
            )));
        }
        self.decimal.set(self.decimal.get().or(mark));
        self.mark.number(text).ok_or_else(|| match text {
            "" => self.complaint(column, "is empty; a number is needed"),
            _ => self.complaint(column, &format!("is `{shown}`, which is not a number{}", marks(text))),
        })
    }

    /// The same where the column is there and the cell is filled.
    ///
    /// # Errors
    /// As of `number`.
    pub fn optional_number(&self, column: Option<usize>) -> Result<Option<f64>, FileError> {
        column.filter(|i| self.text(*i).is_some()).map(|i| self.number(i)).transpose()
    }

    /// `FILE:LINE: column `c` …`.
    pub fn complaint(&self, column: usize, what: &str) -> FileError {
        let name = self.header.get(column).map_or("", String::as_str);
        self.complaint_of(&format!("column `{name}` {what}"))
    }

    /// `FILE:LINE: …`.
    pub fn complaint_of(&self, what: &str) -> FileError {
        FileError::at_line(self.path, self.line as usize, what)
    }
}

/// Words and signs for a number that is not there.
const NOTHING: [&str; 10] = ["na", "n/a", "#n/a", "none", "null", "nil", "-", "--", "?", "missing"];

/// The way out for a cell that is no number.
fn marks(text: &str) -> &'static str {
    let is_number = |text: &str| text.parse::<f64>().is_ok();
    let digits = text.replace([',', '\'', '’', ' ', '\u{a0}', '_'], "");
    // An exponent is part of a number: `3e2`.
    let unit =
        text.trim_end_matches(|letter: char| letter.is_alphabetic() || matches!(letter, '°' | '%' | '"'));
    if digits != text && is_number(&digits) {
        "; write a decimal point, and no marks between thousands"
    } else if NOTHING.iter().any(|word| text.eq_ignore_ascii_case(word)) {
        "; a point that was not seen has no row: leave the row out"
    } else if is_number(&text.replace(['−', '–', '‒'], "-")) {
        "; write the minus of the keyboard, `-`"
    } else if unit != text && is_number(unit.trim_end()) {
        "; write the number alone, in the unit that the column's name states"
    } else if text.split_once('/').is_some_and(|(a, b)| is_number(a.trim()) && is_number(b.trim())) {
        "; write a fraction as a decimal number"
    } else if is_several(text) {
        "; write one number into each cell, under a column of its own"
    } else {
        ""
    }
}

/// Whether a cell holds the numbers of several columns: `(640.5, 480.2)`, `640.5x480.2`.
fn is_several(text: &str) -> bool {
    let inner = text.trim_matches(['(', ')', '[', ']', '{', '}']);
    let mut numbers = inner.split([',', ';', ' ', 'x']).filter(|number| !number.is_empty()).peekable();
    numbers.peek().is_some() && numbers.all(|number| number.parse::<f64>().is_ok())
}

/// The name of a column whose unit stands in brackets or behind a slash, as ours are written; none of others: `x [m]` is `x_m`.
fn with_unit(column: &str) -> Option<String> {
    let (stem, unit) = match column.strip_suffix([')', ']']) {
        Some(rest) => rest.split_once(['(', '['])?,
        None => column.split_once('/')?,
    };
    let (stem, unit) = (stem.trim_end_matches([' ', '_']), unit.trim());
    let is_word = |word: &str| !word.is_empty() && word.bytes().all(|b| b.is_ascii_alphabetic() || b == b'_');
    const UNITS: [&str; 11] = ["m", "mm", "cm", "km", "in", "ft", "px", "rad", "deg", "s", "ms"];
    let unit = unit.to_lowercase();
    (is_word(stem) && UNITS.contains(&unit.as_str())).then(|| format!("{}_{unit}", stem.to_lowercase()))
}

/// Of a missing column: one that other programs and languages call otherwise.
fn in_other_words(name: &str, header: &[String]) -> Option<String> {
    const WORDS: [(&str, &[&str]); 5] = [
        ("u_px", &["col", "column", "spalte", "colonne", "columna", "colonna", "pixel_x", "image_x", "px"]),
        ("v_px", &["row", "line", "zeile", "ligne", "fila", "riga", "pixel_y", "image_y", "py"]),
        ("x_m", &["easting", "east", "rechtswert", "ostwert", "est"]),
        ("y_m", &["northing", "north", "hochwert", "nordwert", "nord"]),
        ("z_m", &["elevation", "height", "altitude", "höhe", "hoehe", "hauteur", "altura", "quota"]),
    ];
    let (_, words) = WORDS.iter().find(|(known, _)| *known == name)?;
    let stem = |column: &String| {
        let column = column.to_lowercase();
        column.split(['(', '[', '/']).next().unwrap_or_default().trim_end_matches([' ', '_']).to_owned()
    };
    let there = header.iter().find(|column| words.contains(&stem(column).as_str()))?;
    Some(format!("`{there}` seems to be it: call it `{name}`"))
}

/// Of a missing column with a unit: the column that holds it in another unit, and what to divide by, or the one that states no unit.
fn other_unit(name: &str, header: &[String]) -> Option<String> {
    const UNITS: [(&str, &str, &str); 7] = [
        ("_m", "_mm", "divide by 1000"),
        ("_m", "_cm", "divide by 100"),
        ("_m", "_in", "multiply by 0.0254"),
        ("_m", "_ft", "multiply by 0.3048"),
        ("_m", "_km", "multiply by 1000"),
        ("_rad", "_deg", "multiply by pi/180"),
        ("_s", "_ms", "divide by 1000"),
    ];
    const NAMES: [(&str, &str); 4] =
        [("_m", "metres"), ("_px", "pixels"), ("_rad", "radians"), ("_s", "seconds")];
    let is_degrees = |column: &&String| {
        ["lat", "lon", "lng", "latitude", "longitude"].iter().any(|name| column.eq_ignore_ascii_case(name))
    };
    if let (true, Some(degrees)) = (name.ends_with("_m"), header.iter().find(is_degrees)) {
        return Some(format!("`{degrees}` is an angle: project latitude and longitude to metres (UTM, say)"));
    }
    let without = NAMES.iter().find_map(|(unit, words)| {
        let stem = name.strip_suffix(unit)?;
        let there = header.iter().find(|column| column.eq_ignore_ascii_case(stem))?;
        Some(format!("`{there}` states no unit: call it `{name}` where it is in {words}"))
    });
    let in_another = UNITS.iter().find_map(|(unit, other, change)| {
        let there = format!("{}{other}", name.strip_suffix(unit)?);
        let is_it =
            |column: &&String| **column == there || with_unit(column).is_some_and(|column| column == there);
        let there = header.iter().find(is_it)?;
        Some(format!("`{there}` is in another unit: {change}, and call it `{name}`"))
    });
    in_another.or(without)
}

fn complaint(path: &Path, line: u64, error: &csv::Error) -> FileError {
    let line = Some(line as usize).filter(|_| error.position().is_some());
    let reason = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            // Decimal commas split a number in two.
            let commas =
                if expected_len < len { "; are decimal commas among them? Write points: 0.5" } else { "" };
            let cells = if *len == 1 { "cell" } else { "cells" };
            format!("{len} {cells} where the header has {expected_len}{commas}")
        }
        csv::ErrorKind::Utf8 { .. } => super::NOT_UTF_8.to_string(),
        _ => error.to_string(),
    };
    FileError { path: path.to_path_buf(), line, reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever its lines end in, with comments and empty lines above it: the line of a row is the one an editor shows.
    #[test]
    fn rows_know_their_lines() {
        let path = std::env::temp_dir().join(format!("resight-table-{}.csv", std::process::id()));
        for end in ["\n", "\r\n"] {
            for last in ["", end] {
                let lines = ["a,b", "1,2", "# a comment", "", "3,4", "5,x"];
                std::fs::write(&path, lines.join(end) + last).expect("written");
                let mut seen = Vec::new();
                let table = Table::open(&path, "a,b").expect("a table");
                let done = table.each(|row| {
                    seen.push(row.line);
                    row.number(1).map(|_| ())
                });
                assert_eq!(seen, [2, 5, 6]);
                assert!(done.is_err_and(|reason| reason.to_string().contains(".csv:6: column `b` is `x`")));
            }
        }
        std::fs::write(&path, "a,b\r\n1,2\r\n3\r\n").expect("written");
        let torn = Table::open(&path, "a,b").and_then(|table| table.each(|_| Ok::<(), FileError>(())));
        assert!(torn.is_err_and(|reason| reason.to_string().contains(".csv:3: 1 cell where")));
        std::fs::remove_file(&path).expect("removed");
    }

    /// Semicolons or tabs with decimal commas are read; a number with both marks is none.
    #[test]
    fn tables_of_other_countries_are_read_and_said_to_be() {
        let path = std::env::temp_dir().join(format!("resight-table-country-{}.csv", std::process::id()));
        for (mark, named) in [(";", "semicolons"), ("\t", "tabs"), ("|", "bars")] {
            let lines = ["\u{feff}id|x_m|y (m)", "a|1,5|-0,25", "b|2|3e-1", "c|1.234,5|0"];
            std::fs::write(&path, lines.join("\r\n").replace('|', mark)).expect("written");
            let mut seen = Vec::new();
            let table = Table::open(&path, "x_m,y_m").expect("a table");
            let columns = [table.need("x_m", None).expect("x"), table.need("y_m", None).expect("y")];
            let done = table.each(|row| {
                seen.push([row.number(columns[0])?, row.number(columns[1])?]);
                Ok::<(), FileError>(())
            });
            assert_eq!(seen, [[1.5, -0.25], [2.0, 0.3]]);
            let said = done.expect_err("both marks").to_string();
            assert!(said.contains(":4: column `x_m` is `1.234,5`, with `.`"), "{said}");
            let remark = how_read(&path).expect("a remark");
            assert!(
                remark.contains(named) && remark.ends_with("; column `y (m)` is read as `y_m`"),
                "{remark}"
            );
        }
        std::fs::write(&path, "x_m,y_m\n1,2\n").expect("written");
        assert_eq!(how_read(&path), None);
        std::fs::remove_file(&path).expect("removed");
    }

    /// What spreadsheets of other countries and units make of a table, with the way out.
    #[test]
    fn tables_as_people_save_them_are_named_with_the_way_out() {
        let path = std::env::temp_dir().join(format!("resight-table-people-{}.csv", std::process::id()));
        let refused = |bytes: &[u8]| {
            std::fs::write(&path, bytes).expect("written");
            let table = Table::open(&path, "x_m,y_m").and_then(|table| {
                table.need("x_m", None)?;
                table.each(|_| Ok::<(), FileError>(()))
            });
            table.expect_err("no such table").to_string()
        };
        let utf_16: Vec<u8> = "\u{feff}x_m,y_m\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        for (bytes, wanted) in [
            (utf_16.as_slice(), "UTF-16 text"),
            (b"x_mm,y_mm\n1,2\n", "divide by 1000, and call it `x_m`"),
            (b"x,y\n1,2\n", "`x` states no unit: call it `x_m` where it is in metres"),
            (b"x_m,y_m\n1,5,2,5\n", "decimal commas"),
            (b"PK\x03\x04\0\0xl/workbook.xml", "save it as CSV"),
            (b"X [mm],Y [mm]\n1,2\n", "`X [mm]` is in another unit: divide by 1000, and call it `x_m`"),
            (b"x_ft,y_ft\n1,2\n", "multiply by 0.3048"),
            (b"Rechtswert [m],Hochwert [m]\n1,2\n", "`Rechtswert [m]` seems to be it: call it `x_m`"),
            (b"[{\"x_m\": 0.0, \"y_m\": 1, \"y_m\": 1}]\n", "this is no table"),
            (b"H\xf6he,x_m\n1,2\n", "not UTF-8 text; save the file as UTF-8"),
            (&[0; 300], "a binary or damaged file"),
        ] {
            let said = refused(bytes);
            assert!(said.contains(wanted), "{said}");
        }
        std::fs::remove_file(&path).expect("removed");
    }

    /// A cell that is no number, with the way out.
    #[test]
    fn cells_that_are_no_numbers_have_a_way_out() {
        for (cell, wanted) in [
            ("N/A", "leave the row out"),
            ("-", "leave the row out"),
            ("0.5 m", "the number alone"),
            ("12.5px", "the number alone"),
            ("−0.5", "the minus of the keyboard"),
            ("1,234.5", "no marks between thousands"),
            ("1/8", "a fraction as a decimal number"),
            ("(640.5, 480.2)", "one number into each cell"),
            ("640.5 x 480.2", "one number into each cell"),
        ] {
            assert!(marks(cell).contains(wanted), "{cell}: {}", marks(cell));
        }
        assert_eq!((marks("x"), marks("1/b"), marks("px")), ("", "", ""));
    }
}
