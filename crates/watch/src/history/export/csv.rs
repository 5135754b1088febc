//! Writes CSV: a header with units, numbers with all digits, empty cells for missing values.

use super::Sheet;
use super::cells::{Cell, Table};
use std::fs::File;
use std::io::BufWriter;

struct Lines {
    writer: csv::Writer<BufWriter<File>>,
}

pub(super) fn open(table: Table, file: File) -> std::io::Result<Box<dyn Sheet>> {
    let mut writer = csv::Writer::from_writer(BufWriter::new(file));
    writer.write_record(table.columns().iter().map(|(name, _)| name))?;
    Ok(Box::new(Lines { writer }))
}

impl Sheet for Lines {
    fn row(&mut self, cells: Vec<Cell>) -> std::io::Result<()> {
        let text = |cell: Cell| match cell {
            Cell::Text(text) => text,
            Cell::Whole(number) => number.to_string(),
            Cell::Real(number) => number.to_string(),
            Cell::Empty => String::new(),
        };
        Ok(self.writer.write_record(cells.into_iter().map(text))?)
    }

    fn finish(mut self: Box<Self>) -> std::io::Result<()> {
        self.writer.flush()
    }
}
