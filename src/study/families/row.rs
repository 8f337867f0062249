//! rooms.csv: one row for each solved room.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::table::{Cell, Table};
use crate::room::generated::Family;
use crate::study::families::Plan;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

const COLUMNS: &str = "relit,preset,width,height,family,seed,seconds,objects,albedo_mae,albedo_rel_median,albedo_psnr,\
    lamps_true,lamps_found,lamps_false,albedos,coverage_1,coverage_2,rays,albedo_factor";
/// Number of [`COLUMNS`].
const COUNT: usize = 19;

/// Comparison of a solved room with its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The program's version.
    pub relit: String,
    /// Name of the preset.
    pub preset: String,
    /// Width and height of the photographs in pixels.
    pub size: [u32; 2],
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

impl Row {
    /// Whether the row has the plan's program version, preset and size.
    pub fn belongs_to(&self, plan: &Plan) -> bool {
        self.relit == env!("CARGO_PKG_VERSION")
            && self.preset == plan.preset.word()
            && self.size == plan.size
    }

    fn cells(&self) -> [Cell; COUNT] {
        [
            self.relit.as_str().into(),
            self.preset.as_str().into(),
            u64::from(self.size[0]).into(),
            u64::from(self.size[1]).into(),
            self.family.name().into(),
            self.seed.into(),
            self.seconds.into(),
            self.objects.into(),
            self.albedo_mae.into(),
            self.albedo_rel_median.into(),
            self.albedo_psnr.into(),
            self.lamps_true.into(),
            self.lamps_found.into(),
            self.lamps_false.into(),
            self.albedos.into(),
            self.coverage_1.into(),
            self.coverage_2.into(),
            self.rays.into(),
            self.albedo_factor.into(),
        ]
    }

    /// Parses a line; `None` if it is incomplete.
    fn parse(line: &str) -> Option<Self> {
        let fields: Vec<&str> = line.split(',').collect();
        let fields: [&str; COUNT] = fields.try_into().ok()?;
        let optional = |text: &str| match text {
            "" => Some(None),
            text => text.parse::<f64>().ok().map(Some),
        };
        let whole = |index: usize| fields[index].parse::<u64>().ok();
        Some(Self {
            relit: fields[0].to_owned(),
            preset: fields[1].to_owned(),
            size: [fields[2].parse().ok()?, fields[3].parse().ok()?],
            family: Family::of_name(fields[4])?,
            seed: whole(5)?,
            seconds: fields[6].parse().ok()?,
            objects: whole(7)?,
            albedo_mae: optional(fields[8])?,
            albedo_rel_median: optional(fields[9])?,
            albedo_psnr: optional(fields[10])?,
            lamps_true: whole(11)?,
            lamps_found: whole(12)?,
            lamps_false: whole(13)?,
            albedos: whole(14)?,
            coverage_1: optional(fields[15])?,
            coverage_2: optional(fields[16])?,
            rays: whole(17)?,
            albedo_factor: optional(fields[18])?,
        })
    }
}

/// The rows of a folder's rooms.csv, which grows row by row.
#[derive(Debug)]
pub struct Rows {
    path: PathBuf,
    rows: Vec<Row>,
}

impl Rows {
    /// Reads rooms.csv, or creates it. Removes an incomplete last line.
    ///
    /// # Errors
    /// The file cannot be read or written, or is another table.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join("rooms.csv");
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(Error::io(&path, &error)),
        };
        let mut table = Table::new(COLUMNS);
        let mut rows = Vec::new();
        if !text.is_empty() {
            let another = |line: usize| {
                Error::new(
                    format!("{}:{line}", path.display()),
                    "is no row of this program's table of rooms",
                    "name another folder with --out",
                )
            };
            let mut lines = text.split_inclusive('\n').enumerate();
            let header = lines.next().map(|(_, line)| line.trim_end());
            if header != Some(COLUMNS) {
                return Err(another(1));
            }
            for (index, line) in lines {
                match Row::parse(line.trim_end()).filter(|_| line.ends_with('\n')) {
                    Some(row) => rows.push(row),
                    None if !line.ends_with('\n') => {}
                    None => return Err(another(index + 1)),
                }
            }
        }
        for row in &rows {
            table.row(&row.cells());
        }
        if table.as_str() != text {
            write_bytes(&path, table.as_str().as_bytes())?;
        }
        Ok(Self { path, rows })
    }

    /// Whether a room has been solved according to a plan.
    pub fn holds(&self, plan: &Plan, family: Family, seed: u64) -> bool {
        self.of(plan)
            .any(|row| row.family == family && row.seed == seed)
    }

    /// The rows that belong to a plan.
    pub fn of<'a>(&'a self, plan: &'a Plan) -> impl Iterator<Item = &'a Row> {
        self.rows.iter().filter(|row| row.belongs_to(plan))
    }

    /// Appends a row, also to the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, row: Row) -> Result<()> {
        let line = Table::line(&row.cells());
        let io = |error: std::io::Error| Error::io(&self.path, &error);
        let mut file = OpenOptions::new()
            .append(true)
            .open(&self.path)
            .map_err(io)?;
        file.write_all(line.as_bytes()).map_err(io)?;
        file.sync_data().map_err(io)?;
        self.rows.push(row);
        Ok(())
    }
}
