//! Tables as CSV (RFC 4180).

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use serde::Serialize;
use std::io;
use std::path::Path;
use std::sync::Arc;

/// A table under construction.
#[derive(Debug, Clone)]
pub struct Table {
    /// Its lines, or why a row could not be written.
    lines: std::result::Result<Vec<u8>, Arc<io::Error>>,
}

impl Table {
    /// A table with a header line: the names of its columns, with commas between them.
    pub fn new(header: &str) -> Self {
        Self {
            lines: Ok(format!("{header}\n").into_bytes()),
        }
    }

    /// Appends a row: a tuple of texts and numbers, where an array is a cell for each element and `None` is an empty cell.
    pub fn row(&mut self, cells: impl Serialize) {
        if let Ok(lines) = &mut self.lines {
            match line(cells, false) {
                Ok(line) => lines.extend(line),
                Err(error) => self.lines = Err(Arc::new(error)),
            }
        }
    }

    /// Writes the table.
    ///
    /// # Errors
    /// A row holds something else than texts and numbers, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        match &self.lines {
            Ok(lines) => write_bytes(path, lines),
            Err(error) => Err(Error::io(path, error)),
        }
    }
}

/// A row as a line, after the names of its fields if `header`.
///
/// # Errors
/// The row holds something else than texts and numbers.
pub fn line(row: impl Serialize, header: bool) -> io::Result<Vec<u8>> {
    let mut lines = csv::WriterBuilder::new()
        .has_headers(header)
        .from_writer(Vec::new());
    lines.serialize(row)?;
    lines.into_inner().map_err(csv::IntoInnerError::into_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_and_numbers_come_back_exactly() {
        let mut table = Table::new("name,x,n,held_out");
        table.row(("a \"b\", c", 0.1f32, 7, None::<f64>));
        table.row(("d", 1e-17, 8, Some(2.5)));
        let expected = "name,x,n,held_out\n\"a \"\"b\"\", c\",0.1,7,\nd,1e-17,8,2.5\n";
        assert_eq!(table.lines.expect("rows of cells"), expected.as_bytes());
    }

    #[test]
    fn a_row_that_is_no_list_of_cells_is_refused_when_the_table_is_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut table = Table::new("x");
        table.row(std::collections::BTreeMap::from([("x", 1)]));
        table.row((1,));
        let path = folder.path().join("x.csv");
        assert!(table.write(&path).is_err() && !path.exists());
    }
}
