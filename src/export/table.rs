//! Tables as CSV (RFC 4180).

use crate::error::Result;
use crate::export::atomic::write_bytes;
use std::path::Path;

/// A table under construction.
#[derive(Debug, Clone)]
pub struct Table {
    text: String,
}

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text, quoted where needed.
    Text(String),
    /// A number in its shortest exact form.
    Number(f64),
    /// An integer.
    Whole(u64),
    /// An empty cell.
    Empty,
}

impl Table {
    /// A table with a header line: the names of its columns, with commas between them.
    pub fn new(header: &str) -> Self {
        Self {
            text: format!("{header}\n"),
        }
    }

    /// Appends a row.
    pub fn row(&mut self, cells: &[Cell]) {
        let fields: Vec<String> = cells.iter().map(Cell::field).collect();
        self.text += &(fields.join(",") + "\n");
    }

    /// The table as text.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Writes the table.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_bytes(path, self.text.as_bytes())
    }
}

impl Cell {
    fn field(&self) -> String {
        match self {
            Self::Text(text) if text.contains(['"', ',', '\n', '\r']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Self::Text(text) => text.clone(),
            Self::Number(x) => format!("{x:?}"),
            Self::Whole(n) => n.to_string(),
            Self::Empty => String::new(),
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl From<f32> for Cell {
    fn from(x: f32) -> Self {
        // Through the shortest decimal of the f32, so that 0.1 stays 0.1.
        Self::Number(x.to_string().parse().unwrap_or(f64::from(x)))
    }
}

impl From<u64> for Cell {
    fn from(n: u64) -> Self {
        Self::Whole(n)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_and_numbers_come_back_exactly() {
        let mut table = Table::new("name,x,n,held_out");
        table.row(&[
            "a \"b\", c".into(),
            0.1f32.into(),
            7u64.into(),
            None::<f64>.into(),
        ]);
        table.row(&["d".into(), 1e-17.into(), 8u64.into(), Some(2.5).into()]);
        let expected = "name,x,n,held_out\n\"a \"\"b\"\", c\",0.1,7,\nd,1e-17,8,2.5\n";
        assert_eq!(table.as_str(), expected);
    }
}
