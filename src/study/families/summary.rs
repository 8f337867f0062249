//! Statistics over the rooms of each family: rooms.json, a table, and a strip plot.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::strips::{Panel, Strips};
use crate::math::stats::quantile;
use crate::room::generated::Family;
use crate::study::families::Plan;
use crate::study::families::row::Row;
use crate::study::machine::Machine;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Probability of a normal deviate within two standard deviations.
const TWO_DEVIATIONS: f64 = 0.954_5;

/// Which end of a figure is the worst.
#[derive(Clone, Copy)]
enum Worst {
    Largest,
    Smallest,
    /// The factor farthest from 1.
    Farthest,
}

/// A figure of a row: name, value, and worst end.
type Figure = (&'static str, fn(&Row) -> Option<f64>, Worst);

const FIGURES: [Figure; 11] = [
    ("seconds", |r| Some(r.seconds), Worst::Largest),
    ("albedo_mae", |r| r.albedo_mae, Worst::Largest),
    ("albedo_rel_median", |r| r.albedo_rel_median, Worst::Largest),
    ("albedo_psnr", |r| r.albedo_psnr, Worst::Smallest),
    ("lamps_found", Row::found, Worst::Smallest),
    (
        "lamps_false",
        |r| Some(r.lamps_false as f64),
        Worst::Largest,
    ),
    ("objects", |r| Some(r.objects as f64), Worst::Smallest),
    ("coverage_1", |r| r.coverage_1, Worst::Smallest),
    ("coverage_2", |r| r.coverage_2, Worst::Smallest),
    ("rays", |r| Some(r.rays as f64), Worst::Largest),
    ("albedo_factor", |r| r.albedo_factor, Worst::Farthest),
];

impl Row {
    /// Fraction of the lamps that were found; `None` without lamps.
    fn found(&self) -> Option<f64> {
        (self.lamps_true > 0).then(|| self.lamps_found as f64 / self.lamps_true as f64)
    }
}

/// Quantiles of a figure over the rooms that have it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// Number of rooms.
    pub n: usize,
    /// 10 % quantile.
    pub q10: f64,
    /// Median.
    pub q50: f64,
    /// 90 % quantile.
    pub q90: f64,
    /// The worst value: the largest error, time or number of false lamps; the factor farthest from 1; otherwise the smallest.
    pub worst: f64,
}

/// Statistics of one family.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OfFamily {
    /// Number of rooms.
    pub n: usize,
    /// True lamps in all rooms.
    pub lamps_true: u64,
    /// Lamps that were found.
    pub lamps_found: u64,
    /// Rooms with a false lamp.
    pub rooms_with_false_lamps: usize,
    /// Number of albedos with reported errors in all rooms.
    pub albedos: u64,
    /// Fractions of them within one and two standard errors.
    pub coverage: Option<[f64; 2]>,
    /// Root mean square over rooms of the logarithm of the factor that their albedos share.
    pub common_error: Option<f64>,
    /// Quantiles of each figure over rooms.
    pub figures: BTreeMap<&'static str, Quantiles>,
}

/// Content of rooms.json.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// The program's version.
    pub relit: String,
    /// The preset of every solve.
    pub preset: String,
    /// Width and height of the photographs in pixels.
    pub size: [u32; 2],
    /// The machine of the last measurement.
    pub machine: Machine,
    /// Statistics by family name.
    pub families: BTreeMap<&'static str, OfFamily>,
}

/// Summarizes rows that belong to a plan.
pub fn summarize<'a>(plan: &Plan, rows: impl Iterator<Item = &'a Row>) -> Summary {
    let mut families: BTreeMap<&'static str, Vec<&Row>> = BTreeMap::new();
    for row in rows {
        families.entry(row.family.name()).or_default().push(row);
    }
    Summary {
        relit: env!("CARGO_PKG_VERSION").to_owned(),
        preset: plan.preset.word().to_owned(),
        size: plan.size,
        machine: Machine::here(),
        families: (families.into_iter())
            .map(|(name, rows)| (name, OfFamily::of(&rows)))
            .collect(),
    }
}

impl OfFamily {
    fn of(rows: &[&Row]) -> Self {
        let sum = |value: fn(&Row) -> u64| rows.iter().map(|row| value(row)).sum::<u64>();
        let albedos = sum(|row| row.albedos);
        let within = |value: fn(&Row) -> Option<f64>| {
            let counts = rows
                .iter()
                .map(|row| value(row).unwrap_or(0.0) * row.albedos as f64);
            counts.sum::<f64>() / albedos as f64
        };
        let logarithms = rows.iter().filter_map(|row| row.albedo_factor).map(f64::ln);
        let squares: Vec<f64> = logarithms.map(|l| l * l).collect();
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        let figures = FIGURES.iter().filter_map(|&(name, value, worst)| {
            let mut values: Vec<f64> = rows.iter().filter_map(|row| value(row)).collect();
            Some((name, Quantiles::of(&mut values, worst)?))
        });
        Self {
            n: rows.len(),
            lamps_true: sum(|row| row.lamps_true),
            lamps_found: sum(|row| row.lamps_found),
            rooms_with_false_lamps: rows.iter().filter(|row| row.lamps_false > 0).count(),
            albedos,
            coverage: (albedos > 0).then(|| [within(|r| r.coverage_1), within(|r| r.coverage_2)]),
            common_error: (!squares.is_empty()).then(|| mean.sqrt()),
            figures: figures.collect(),
        }
    }
}

impl Quantiles {
    fn of(values: &mut [f64], worst: Worst) -> Option<Self> {
        let [q10, q50, q90] = [0.1, 0.5, 0.9].map(|q| quantile(values, q));
        let [smallest, largest] = [0.0, 1.0].map(|q| quantile(values, q));
        let [smallest, largest] = [smallest?, largest?];
        Some(Self {
            n: values.len(),
            q10: q10?,
            q50: q50?,
            q90: q90?,
            worst: match worst {
                Worst::Smallest => smallest,
                Worst::Farthest if smallest * largest < 1.0 => smallest,
                Worst::Largest | Worst::Farthest => largest,
            },
        })
    }
}

impl Summary {
    /// Writes rooms.json into a folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join("rooms.json");
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| Error::file(&path, error, "nothing was written there"))?;
        write_bytes(&path, text.as_bytes())
    }

    /// A table with a line for each family.
    pub fn words(&self) -> String {
        let [width, height] = self.size;
        let mut text = format!(
            "{} preset, photographs of {width}×{height} pixels, {}\n",
            self.preset,
            self.machine.words()
        );
        text += &format!(
            "{:9}  {:>5}  {:>12}  {:>11}  {:>6}  {:>6}  {:>10}  {:>11}  {:>11}  {:>14}\n",
            "family",
            "rooms",
            "albedo error",
            "worst tenth",
            "factor",
            "PSNR",
            "lamps",
            "false lamps",
            "coverage",
            "seconds"
        );
        for family in Family::ALL {
            if let Some(of) = self.families.get(family.name()) {
                text += &of.line(family.name());
            }
        }
        text
    }
}

impl OfFamily {
    fn line(&self, name: &str) -> String {
        let figure = |name: &str, part: fn(&Quantiles) -> f64, digits: usize| {
            let figure = self.figures.get(name);
            figure.map_or("-".to_owned(), |f| format!("{:.digits$}", part(f)))
        };
        let coverage = self.coverage.map_or("-".to_owned(), |[one, two]| {
            format!("{:.0} / {:.0} %", one * 100.0, two * 100.0)
        });
        format!(
            "{name:9}  {:>5}  {:>12}  {:>11}  {:>6}  {:>6}  {:>10}  {:>11}  {coverage:>11}  {:>14}\n",
            self.n,
            figure("albedo_mae", |f| f.q50, 4),
            figure("albedo_mae", |f| f.q90, 4),
            self.common_error
                .map_or("-".to_owned(), |error| format!("±{:.0} %", error * 100.0)),
            figure("albedo_psnr", |f| f.q50, 1),
            format!("{} / {}", self.lamps_found, self.lamps_true),
            self.rooms_with_false_lamps,
            format!(
                "{} / {}",
                figure("seconds", |f| f.q50, 1),
                figure("seconds", |f| f.worst, 1)
            ),
        )
    }
}

/// The plot of a summary and its rows: albedo error, and coverage of two standard errors.
pub fn plot<'a>(summary: &Summary, rows: impl Iterator<Item = &'a Row>) -> Strips {
    let rows: Vec<&Row> = rows.collect();
    let families = Family::ALL.into_iter().map(Family::name);
    let families: Vec<&str> = families
        .filter(|name| summary.families.contains_key(name))
        .collect();
    let dots = |value: fn(&Row) -> Option<f64>| -> Vec<Vec<f64>> {
        let values = |name: &&str| {
            let rows = rows.iter().filter(|row| row.family.name() == *name);
            rows.filter_map(|row| value(row)).collect()
        };
        families.iter().map(values).collect()
    };
    Strips {
        title: format!(
            "Generated rooms, {} preset: a dot a room, a bar the median",
            summary.preset
        ),
        rows: families.iter().map(|name| (*name).to_owned()).collect(),
        panels: [
            Panel {
                label: "mean absolute error of albedo".to_owned(),
                logarithmic: true,
                values: dots(|row| row.albedo_mae),
                mark: None,
            },
            Panel {
                label: "fraction of albedos within two standard errors".to_owned(),
                logarithmic: false,
                values: dots(|row| row.coverage_2),
                mark: Some(TWO_DEVIATIONS),
            },
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_factor_is_the_one_farthest_from_one() {
        let worst = |values: &[f64], worst| {
            let quantiles = Quantiles::of(&mut values.to_vec(), worst);
            quantiles.map(|q| q.worst)
        };
        assert_eq!(worst(&[0.5, 1.1, 1.6], Worst::Farthest), Some(0.5));
        assert_eq!(worst(&[0.7, 1.1, 1.6], Worst::Farthest), Some(1.6));
        assert_eq!(worst(&[0.5, 1.1, 1.6], Worst::Largest), Some(1.6));
        assert_eq!(worst(&[], Worst::Farthest), None);
    }
}
