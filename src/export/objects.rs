//! The table of objects.

use crate::export::table::{Cell, Table};
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::scene::Scene;

/// A row for each object: estimates, standard errors, and how much it was seen.
pub fn table(scene: &Scene, estimate: &Estimate) -> Table {
    let colors = |name: &str| ["r", "g", "b"].map(|channel| format!("{name}_{channel}"));
    let mut columns = vec!["name".to_owned()];
    for name in ["albedo", "albedo_stderr", "emission", "emission_stderr"] {
        columns.extend(colors(name));
    }
    let rest = [
        "roughness",
        "specular",
        "seen_pixels",
        "triangles",
        "area",
        "identifiable",
        "albedo_identifiable",
        "note",
    ];
    columns.extend(rest.map(str::to_owned));
    let mut table = Table::new(&columns.join(","));

    let unknown = ObjectEstimate::default();
    for (index, object) in scene.objects.iter().enumerate() {
        let known = estimate.objects.get(index).unwrap_or(&unknown);
        let mut row: Vec<Cell> = vec![object.name.as_str().into()];
        for color in [
            known.albedo,
            known.albedo_stderr,
            known.emission,
            known.emission_stderr,
        ] {
            row.extend(color.to_array().map(Cell::from));
        }
        row.extend([
            known.roughness.into(),
            known.specular.into(),
            known.seen_pixels.into(),
            (object.triangles.len() as u64).into(),
            object.area.into(),
            known.identifiable.to_string().as_str().into(),
            known.albedo_identifiable.to_string().as_str().into(),
            known.note.as_str().into(),
        ]);
        table.row(&row);
    }
    table
}
