//! trade.json, trade.csv and trade.png.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::table::{Cell, Table};
use crate::study::trade::curve::{Curve, Point};
use crate::study::trade::plot;
use crate::study::trade::record::Trade;
use std::path::Path;

/// The file with all data.
const JSON: &str = "trade.json";
/// Largest trade.json that is read, in bytes.
const MAX_BYTES: u64 = 1 << 28;

/// Columns of trade.csv; the last three are constant.
const COLUMNS: &str = "curve,preset,seconds,error,error_low,error_high,reported_error,rays,iterations,pareto,measure,threads,cpu";

impl Trade {
    /// Writes trade.json, trade.csv and trade.png into a folder.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        plot::plot(self).write(&folder.join("trade.png"))?;
        self.table().write(&folder.join("trade.csv"))?;
        let path = folder.join(JSON);
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| Error::file(&path, error, "nothing was written there"))?;
        write_bytes(&path, text.as_bytes())
    }

    /// Reads trade.json from a folder; `None` if it does not exist.
    ///
    /// # Errors
    /// The file cannot be read or is no trade.json of this version.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(JSON);
        let length = match path.metadata() {
            Ok(metadata) => metadata.len(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::io(&path, &error)),
        };
        let measure_again = "measure again with relit trade";
        if length > MAX_BYTES {
            return Err(Error::file(&path, "is too long", measure_again));
        }
        let bytes = std::fs::read(&path).map_err(|error| Error::io(&path, &error))?;
        let trade = serde_json::from_slice(&bytes);
        let trade = trade.map_err(|error| Error::file(&path, error, measure_again))?;
        Ok(Some(trade))
    }

    /// The table, one row for each point.
    pub fn table(&self) -> Table {
        let mut table = Table::new(COLUMNS);
        for curve in &self.curves {
            for point in &curve.points {
                table.row(&self.row(curve, point));
            }
        }
        table
    }

    fn row(&self, curve: &Curve, point: &Point) -> [Cell; 13] {
        [
            curve.name.as_str().into(),
            curve.settings.preset.word().into(),
            point.seconds.into(),
            point.error.into(),
            point.spread.map(|s| s[0]).into(),
            point.spread.map(|s| s[1]).into(),
            point.reported.into(),
            point.rays.into(),
            point.iterations.into(),
            u64::from(point.pareto).into(),
            self.measure.label().into(),
            (self.machine.threads as u64).into(),
            self.machine.cpu.as_str().into(),
        ]
    }
}
