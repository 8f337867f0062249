//! Strip plot of the rooms of each family: albedo error, and coverage of two standard errors.

use crate::export::strips::{Panel, Strips};
use crate::room::generated::Family;
use crate::study::families::row::Row;
use crate::study::families::summary::Summary;

/// Probability of a normal deviate within two standard deviations.
const TWO_DEVIATIONS: f64 = 0.954_5;

/// The plot of a summary and its rows.
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
