//! Tables with one row for each solved room, such as rooms.csv.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::table::line;
use crate::room::generated::Family;
use crate::study::families::Plan;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;

/// A room that was solved, as a row of a table.
pub trait RoomRow: Default + Serialize + DeserializeOwned {
    /// How it was solved.
    fn solve(&self) -> Solve<'_>;

    /// Its family and seed.
    fn room(&self) -> (Family, u64);
}

/// Program version, name of the preset, width and height of the photographs.
pub type Solve<'a> = (&'a str, &'a str, [u32; 2]);

/// Comparison of a solved room with its truth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The program's version.
    pub relit: String,
    /// Name of the preset.
    pub preset: String,
    /// Width of the photographs in pixels.
    pub width: u32,
    /// Height of the photographs in pixels.
    pub height: u32,
    /// The room's family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// Seconds of solving, without generating and loading.
    pub seconds: f64,
    /// Objects scored for their albedo.
    pub objects: u64,
    /// Mean absolute error of albedo over scored objects and RGB.
    pub albedo_mae: Option<f64>,
    /// Median over scored objects of the relative error over RGB.
    pub albedo_rel_median: Option<f64>,
    /// Peak signal-to-noise ratio in dB against the true albedo pictures.
    pub albedo_psnr: Option<f64>,
    /// True lamps, whether or not photographs see them.
    pub lamps_true: u64,
    /// True lamps whose emission was found within a factor of two.
    pub lamps_found: u64,
    /// Objects without emission that were given more than 1 % of the largest emission.
    pub lamps_false: u64,
    /// Number of albedos (object and channel) with a reported standard error.
    pub albedos: u64,
    /// Fraction of them within one standard error of the truth.
    pub coverage_1: Option<f64>,
    /// Fraction of them within two standard errors.
    pub coverage_2: Option<f64>,
    /// Rays of the solve.
    pub rays: u64,
    /// The factor between found and true albedos that scored objects share: their median, weighted by pixels.
    pub albedo_factor: Option<f64>,
}

impl RoomRow for Row {
    fn solve(&self) -> Solve<'_> {
        (&self.relit, &self.preset, [self.width, self.height])
    }

    fn room(&self) -> (Family, u64) {
        (self.family, self.seed)
    }
}

/// The rows of a table, which grows row by row.
#[derive(Debug)]
pub struct Rows<R> {
    path: PathBuf,
    rows: Vec<R>,
}

impl<R: RoomRow> Rows<R> {
    /// Reads a table, which may be absent. Removes an incomplete last line.
    ///
    /// # Errors
    /// The file cannot be read or written, or is another table.
    pub fn open(path: PathBuf) -> Result<Self> {
        let io = |error: std::io::Error| Error::io(&path, &error);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(io(error)),
        };
        let another = |line: usize| {
            Error::new(
                format!("{}:{line}", path.display()),
                "is no row of this program's table of rooms",
                "name another folder with --out",
            )
        };
        let header = line(R::default(), true).map_err(io)?;
        let header = header.split_inclusive(|&byte| byte == b'\n').next();
        let header = header.unwrap_or_default();
        let end = bytes.iter().rposition(|&byte| byte == b'\n');
        let whole = &bytes[..end.map_or(0, |end| end + 1)];
        let is_ours = match whole {
            [] => header.starts_with(&bytes),
            whole => whole.starts_with(header),
        };
        if !is_ours {
            return Err(another(1));
        }
        let rows = csv::Reader::from_reader(whole)
            .deserialize()
            .enumerate()
            .map(|(index, row)| row.map_err(|_| another(index + 2)))
            .collect::<Result<_>>()?;
        if whole.len() < bytes.len() {
            write_bytes(&path, whole)?;
        }
        Ok(Self { path, rows })
    }

    /// The row of a room that was solved according to a plan.
    pub fn find(&self, plan: &Plan, family: Family, seed: u64) -> Option<&R> {
        let mut rows = self.rows.iter();
        rows.find(|row| row.solve() == plan.solve() && row.room() == (family, seed))
    }

    /// The rows of the plan's program version, preset and size.
    pub fn of<'a>(&'a self, plan: &'a Plan) -> impl Iterator<Item = &'a R> {
        (self.rows.iter()).filter(|row| row.solve() == plan.solve())
    }

    /// Appends a row, also to the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, row: R) -> Result<()> {
        let io = |error: std::io::Error| Error::io(&self.path, &error);
        if let Some(folder) = self.path.parent() {
            std::fs::create_dir_all(folder).map_err(io)?;
        }
        let mut file = OpenOptions::new()
            .append(true)
            .create(true)
            .open(&self.path)
            .map_err(io)?;
        let is_new = file.metadata().map_err(io)?.len() == 0;
        let bytes = line(&row, is_new).map_err(io)?;
        file.write_all(&bytes).map_err(io)?;
        file.sync_data().map_err(io)?;
        self.rows.push(row);
        Ok(())
    }
}
