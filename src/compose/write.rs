//! The files of an insertion.

use crate::compose::insert::Insertion;
use crate::error::Result;
use crate::export::compare::write_row;
use crate::export::exr::{Layer, Precision, Samples, write_layers, write_rgb};
use crate::export::picture::write_png;
use crate::math::picture::Picture;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Writes PREFIX.composite.{exr,png}, PREFIX.naive.{exr,png}, PREFIX.delta.exr, PREFIX.layers.exr and
/// PREFIX.compare.png, which shows photograph, both naive pictures and the composite; returns their paths.
///
/// `naive` is lit by harmonics of the photographs, `naive_estimate` by those of the estimate.
///
/// # Errors
/// A file cannot be written.
pub fn write_insertion(
    prefix: &Path,
    insertion: &Insertion,
    naive: &Picture,
    naive_estimate: &Picture,
) -> Result<Vec<PathBuf>> {
    let file = |ending: &str| {
        let mut name = OsString::from(prefix);
        name.push(ending);
        PathBuf::from(name)
    };
    let exposure = insertion.backdrop().display_exposure();
    let composite = insertion.composite();
    let layers = insertion.layers();
    let mut written = Vec::new();

    // The two results.
    for (name, picture) in [("composite", &composite), ("naive", naive)] {
        let exr = file(&format!(".{name}.exr"));
        write_rgb(&exr, picture, Precision::Float)?;
        let png = file(&format!(".{name}.png"));
        write_png(&png, picture, exposure)?;
        written.extend([exr, png]);
    }

    // What they are made from.
    let delta = file(".delta.exr");
    write_rgb(&delta, &layers.delta, Precision::Float)?;
    let all = file(".layers.exr");
    let rgb = |name: &str, picture: &Picture| Layer::rgb(name, picture, Precision::Float);
    write_layers(
        &all,
        composite.width,
        composite.height,
        &[
            rgb("with", &layers.with),
            rgb("without", &layers.without),
            Layer::single("alpha", "A", Samples::Float(layers.alpha)),
            rgb("delta", &layers.delta),
            Layer::single("depth", "Z", Samples::Float(layers.depth)),
            Layer::single("object id", "id", Samples::Index(layers.object)),
        ],
    )?;

    // All beside the photograph.
    let compare = file(".compare.png");
    write_row(
        &compare,
        &[
            ("photograph", &insertion.backdrop().photograph),
            ("naive", naive),
            ("naive (estimate)", naive_estimate),
            ("composite", &composite),
        ],
        exposure,
    )?;
    written.extend([delta, all, compare]);
    Ok(written)
}
