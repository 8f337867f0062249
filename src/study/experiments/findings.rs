//! What a study found, as files: NAME.csv, NAME.png, NAME.md and what belongs to them.

use crate::error::Result;
use crate::export::atomic::write_bytes;
use crate::export::compare::write_grid;
use crate::export::plot::Plot;
use crate::export::table::Table;
use crate::math::picture::Picture;
use crate::study::experiments::Study;
use crate::study::machine::Machine;
use std::path::{Path, PathBuf};

/// What a study found. The first string of each pair is added to the study's name in the file's: empty, or `-rays`.
#[derive(Debug, Clone, Default)]
pub struct Findings {
    /// What was run on what, in sentences.
    pub how: String,
    /// Every value measured.
    pub tables: Vec<(&'static str, Table)>,
    /// The values as pictures.
    pub plots: Vec<(&'static str, Plot)>,
    /// The few values that matter.
    pub summary: Summary,
    /// What was seen, each a sentence or two.
    pub seen: Vec<String>,
    /// Pictures side by side.
    pub pictures: Vec<(&'static str, Grid)>,
}

/// Pictures with captions in rows, all at one exposure.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Pictures a row.
    pub columns: usize,
    /// Factor from linear values to what is shown.
    pub exposure: f32,
    /// Each with its caption.
    pub pictures: Vec<(String, Picture)>,
}

impl Grid {
    /// An empty grid.
    pub fn new(columns: usize) -> Self {
        Self {
            columns,
            exposure: 1.0,
            pictures: Vec::new(),
        }
    }

    fn write(&self, path: &Path) -> Result<()> {
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
    /// Its head.
    pub columns: Vec<&'static str>,
    /// Its rows, one text a column.
    pub rows: Vec<Vec<String>>,
}

impl Findings {
    /// Writes everything into a folder; the paths written.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, study: &Study, folder: &Path) -> Result<Vec<PathBuf>> {
        let file =
            |suffix: &str, ending: &str| folder.join(format!("{}{suffix}.{ending}", study.name));
        let mut written = Vec::new();
        for (suffix, table) in &self.tables {
            written.push(file(suffix, "csv"));
            table.write(&file(suffix, "csv"))?;
        }
        for (suffix, plot) in &self.plots {
            written.push(file(suffix, "png"));
            plot.write(&file(suffix, "png"))?;
        }
        for (suffix, grid) in &self.pictures {
            written.push(file(suffix, "png"));
            grid.write(&file(suffix, "png"))?;
        }
        written.push(file("", "md"));
        write_bytes(&file("", "md"), self.markdown(study).as_bytes())?;
        Ok(written)
    }

    /// The study in words, for people.
    pub fn markdown(&self, study: &Study) -> String {
        let mut text = format!("# {}\n\n{}\n\n", study.name, study.question);
        text += &format!("{} Machine: {}.\n\n", self.how, Machine::here().words());
        text += &self.summary.markdown();
        text += "\n## Seen\n\n";
        for sentence in &self.seen {
            text += &format!("* {sentence}\n");
        }
        text += "\n";
        let plots = self.plots.iter().map(|(suffix, _)| suffix);
        for suffix in plots.chain(self.pictures.iter().map(|(suffix, _)| suffix)) {
            text += &format!("![{0}{suffix}]({0}{suffix}.png)\n\n", study.name);
        }
        let tables: Vec<String> = (self.tables.iter())
            .map(|(suffix, _)| format!("[{0}{suffix}.csv]({0}{suffix}.csv)", study.name))
            .collect();
        text + &format!("Every value: {}\n", tables.join(", "))
    }
}

impl Summary {
    fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let head: Vec<String> = self.columns.iter().map(|&c| c.to_owned()).collect();
        let rule = vec!["---".to_owned(); head.len()];
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        line(&head) + &line(&rule) + &rows
    }
}

/// A number in three digits.
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
