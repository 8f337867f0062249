//! Writes the files of an insertion and of a relit photograph.

use crate::compose::backdrop::Backdrop;
use crate::compose::insert::Layers;
use crate::error::Result;
use crate::export::compare::write_row;
use crate::export::exr::{Layer, Precision, write_layers, write_rgb};
use crate::export::picture::write_png;
use crate::math::picture::Picture;
use exr::prelude::FlatSamples;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Writes PREFIX.composite.{exr,png}, PREFIX.naive.{exr,png}, PREFIX.delta.exr, PREFIX.layers.exr and PREFIX.compare.png, which
/// shows the photograph, both naive pictures and the composite. Returns the paths.
///
/// `naive` is lit by harmonics of the photographs, `naive_estimate` by those of the estimate.
///
/// # Errors
/// A file cannot be written.
pub fn write_insertion(
    prefix: &Path,
    backdrop: &Backdrop,
    (composite, layers): (&Picture, Layers),
    naive: &Picture,
    naive_estimate: &Picture,
) -> Result<Vec<PathBuf>> {
    let file = |ending: &str| with_ending(prefix, ending);
    let exposure = backdrop.shown_at;
    let mut written = Vec::new();

    for (name, picture) in [("composite", composite), ("naive", naive)] {
        let exr = file(&format!(".{name}.exr"));
        write_rgb(&exr, picture, Precision::Float)?;
        let png = file(&format!(".{name}.png"));
        write_png(&png, picture, exposure)?;
        written.extend([exr, png]);
    }

    let delta = file(".delta.exr");
    write_rgb(&delta, &layers.delta, Precision::Float)?;
    let all = file(".layers.exr");
    let rgb = |name: &str, picture: &Picture| Layer::rgb(name, picture, Precision::Float);
    write_layers(
        &all,
        composite.width,
        composite.height,
        vec![
            rgb("with", &layers.with),
            rgb("without", &layers.without),
            Layer::single("alpha", "A", FlatSamples::F32(layers.alpha)),
            rgb("delta", &layers.delta),
            rgb("shadow", &layers.shadow),
            Layer::single("depth", "Z", FlatSamples::F32(layers.depth)),
            Layer::single("object id", "id", FlatSamples::U32(layers.object)),
        ],
    )?;

    let compare = file(".compare.png");
    write_row(
        &compare,
        &[
            ("photograph", &backdrop.photograph),
            ("naive", naive),
            ("naive (estimate)", naive_estimate),
            ("composite", composite),
        ],
        exposure,
    )?;
    written.extend([delta, all, compare]);
    Ok(written)
}

/// Writes PREFIX.relit.{exr,png}, the relit photograph of a backdrop. Returns the paths.
///
/// # Errors
/// A file cannot be written.
pub fn write_relit(prefix: &Path, backdrop: &Backdrop) -> Result<[PathBuf; 2]> {
    let exr = with_ending(prefix, ".relit.exr");
    write_rgb(&exr, &backdrop.photograph, Precision::Float)?;
    let png = with_ending(prefix, ".relit.png");
    write_png(&png, &backdrop.photograph, backdrop.shown_at)?;
    Ok([exr, png])
}

/// A path with more letters at its end.
pub fn with_ending(prefix: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(prefix);
    name.push(ending);
    PathBuf::from(name)
}
