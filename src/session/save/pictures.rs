//! Pictures of each frame: the render, and maps of the estimate as seen by the camera.

use crate::error::Result;
use crate::export::exr::{Precision, write_rgb};
use crate::export::falsecolor::{write_magnitude, write_signed};
use crate::export::picture::{percentile_exposure, write_png};
use crate::math::picture::Picture;
use crate::render::Pictures;
use crate::scene::camera::Camera;
use crate::session::light::path_options;
use crate::session::save::results::Results;
use crate::session::save::staging::Staging;
use crate::session::view::difference;
use crate::session::view::hits::Hits;
use crate::transport::denoise::guides;
use rayon::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

/// Folder of the pictures within the results.
pub use crate::export::overwrite::VIEWS as FOLDER;
pub use crate::session::save::results::Frames;
/// Kinds of pictures of each frame.
pub const KINDS: [&str; 6] = ["render", "albedo", "emission", "error", "stderr", "seen"];

/// Total number of paths of all pictures, ...
const PATHS: u64 = 4_000_000;
/// ... within this range of samples per pixel.
const SAMPLES: (u64, u64) = (4, 64);

/// Writes a picture for viewing to a file.
type Show<'a> = &'a (dyn Fn(&Path) -> Result<()> + Sync);

/// Renders and writes the pictures of the chosen frames, `views/NNN.KIND.{exr,png}`. Only `render.png` is denoised.
pub(super) fn write(staging: &mut Staging, results: &Results) -> Result<()> {
    let capture = &results.capture;
    let chosen = results.views.chosen(capture.scene.cameras.len());
    let cameras = chosen.into_iter().map(|index| {
        let camera = capture.full_camera(index)?;
        Ok((index, camera.shrunk(results.views.long_side())))
    });
    let cameras: Vec<(usize, Camera)> = cameras.collect::<Result<_>>()?;
    let sizes = cameras.iter().map(|(_, camera)| &camera.intrinsics);
    let pixels: u64 = sizes
        .map(|k| u64::from(k.width) * u64::from(k.height))
        .sum();
    let samples = (PATHS / pixels.max(1)).clamp(SAMPLES.0, SAMPLES.1) as u32;
    let (scene, estimate) = (&capture.scene, results.edited());
    let lit = estimate.lit(scene);
    let mut renders = Pictures::new(&results.renderer, &lit);
    let options = path_options(&results.settings);
    for (index, camera) in cameras {
        let (photograph, shown_at) = capture.sized_photograph(index, &camera)?;

        // The denoiser estimates the noise from two independent renders.
        let [a, b] = [0, 1].map(|half| {
            let key = (results.settings.seed.wrapping_add(half), index as u64);
            renders.film(&camera, &options, key, samples / 2).picture()
        });
        let halves = a.pixels.iter().zip(&b.pixels);
        let mut render = Picture {
            pixels: halves.map(|(a, b)| (*a + *b) * 0.5).collect(),
            ..photograph
        };
        let mut clean = match results.denoiser {
            Some(denoiser) => denoiser.denoise(&a, &b, &guides(&lit, &camera)),
            None => render.clone(),
        };
        // In the photograph's values, so that the photograph can be subtracted.
        let exposure = estimate.exposure(index);
        let saturation = capture.frame(index)?.1.saturation;
        for picture in [&mut render, &mut clean] {
            exposure.apply(&camera.intrinsics, saturation, picture);
        }
        let error = difference(&render, &photograph);
        let hits = Hits::new(scene, &camera);
        let albedo = hits.albedo(scene, &lit.materials);
        let emission = hits.emission(scene, &camera, &estimate);
        let stderr = hits.stderr(scene, &estimate);
        let seen = hits.seen(scene, &estimate);

        let emission_at = percentile_exposure(&emission.pixels);
        let shown: [Show<'_>; 6] = [
            &|path| write_png(path, &clean, shown_at),
            &|path| write_png(path, &albedo, 1.0),
            &|path| write_png(path, &emission, emission_at),
            &|path| write_signed(path, &error, "radiance"),
            &|path| write_magnitude(path, &stderr, "albedo"),
            &|path| write_magnitude(path, &seen, "pixels"),
        ];
        let pictures = [&render, &albedo, &emission, &error, &stderr, &seen];
        let mut path =
            |kind: &str, ending: &str| staging.file(format!("{FOLDER}/{index:03}.{kind}.{ending}"));
        let paths = KINDS.map(|kind| Ok([path(kind, "exr")?, path(kind, "png")?]));
        let paths: Vec<[PathBuf; 2]> = paths.into_iter().collect::<Result<_>>()?;
        let files = paths.par_iter().zip(pictures).zip(shown);
        files.try_for_each(|(([exr, png], picture), show)| {
            write_rgb(exr, picture, Precision::Float)?;
            show(png)
        })?;
    }
    Ok(())
}

/// The pictures of an earlier run in a folder of results.
pub fn earlier(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join(FOLDER)).into_iter().flatten();
    let names = entries.flatten().map(|entry| entry.file_name());
    let names = names.filter(|name| name.to_str().is_some_and(is_picture));
    names.map(|name| Path::new(FOLDER).join(name)).collect()
}

/// Whether a file is named NNN.KIND.exr or NNN.KIND.png.
fn is_picture(name: &str) -> bool {
    let parts: Vec<&str> = name.split('.').collect();
    matches!(parts[..], [number, kind, "exr" | "png"]
        if number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit()) && KINDS.contains(&kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_spread_evenly_and_never_more_than_there_are() {
        assert_eq!(Frames::AtMost(3).chosen(7), [0, 2, 4]);
        assert_eq!(Frames::AtMost(16).chosen(5), [0, 1, 2, 3, 4]);
        assert_eq!(Frames::AtMost(0).chosen(5), [0; 0]);
        assert_eq!(Frames::All.chosen(3), [0, 1, 2]);
    }

    #[test]
    fn only_our_own_pictures_count_as_earlier_ones() {
        assert!(is_picture("000.render.exr") && is_picture("1234.seen.png"));
        let others = "notes.txt 000.render.jpg 00.render.png abc.render.png 000.mine.png";
        for other in others.split(' ') {
            assert!(!is_picture(other), "{other}");
        }
    }
}
