//! Results of a study, and their files: NAME.csv, NAME.png, NAME.md and others.

use crate::error::Result;
use crate::export::compare::write_grid;
use crate::export::plot::Plot;
use crate::export::table::Table;
use crate::math::picture::Picture;
use std::path::Path;

/// Results of a study. The first string of each pair is a suffix to the study's name in the file name, such as `-rays`,
/// or empty.
#[derive(Debug, Clone, Default)]
pub struct Findings {
    /// What was run, in sentences.
    pub how: String,
    /// Every value measured.
    pub tables: Vec<(&'static str, Table)>,
    /// Plots of the values.
    pub plots: Vec<(&'static str, Plot)>,
    /// Table of the most important values.
    pub summary: Summary,
    /// Conclusions, each of a sentence or two.
    pub seen: Vec<String>,
    /// Pictures side by side.
    pub pictures: Vec<(&'static str, Grid)>,
}

/// A grid of pictures with captions, all at the same exposure.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Pictures in a row.
    pub columns: usize,
    /// Exposure for display.
    pub exposure: f32,
    /// Captions and pictures.
    pub pictures: Vec<(String, Picture)>,
}

impl Grid {
    /// Writes the grid as a PNG.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let pictures = self.pictures.iter().map(|(name, p)| (name.as_str(), p));
        write_grid(
            path,
            &pictures.collect::<Vec<_>>(),
            self.columns,
            self.exposure,
        )
    }
}

/// A small table of text.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    /// Column titles, with ` | ` between them.
    pub columns: &'static str,
    /// Rows, one text for each column.
    pub rows: Vec<Vec<String>>,
}

impl Summary {
    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &str| format!("| {cells} |\n");
        let rule = vec!["---"; self.columns.split(" | ").count()];
        let rows: String = self.rows.iter().map(|row| line(&row.join(" | "))).collect();
        line(self.columns) + &line(&rule.join(" | ")) + &rows
    }
}

/// Formats a number with three significant digits.
pub fn brief(value: f64) -> String {
    match value.abs() {
        size if size == 0.0 || !size.is_finite() => value.to_string(),
        size if (1e-4..1e4).contains(&size) => {
            let digits = (2 - size.log10().floor() as i32).max(0) as usize;
            format!("{value:.digits$}")
        }
        _ => format!("{value:.2e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::brief;

    #[test]
    fn numbers_keep_three_digits() {
        let texts = [0.0123456, 123.456, 0.5, 1234.5, 1.5e-7, 0.0, f64::NAN].map(brief);
        assert_eq!(
            texts,
            ["0.0123", "123", "0.500", "1234", "1.50e-7", "0", "NaN"]
        );
    }
}
