//! Writes an imported scan as a capture: images, mesh.ply, transforms.json.

use crate::capture::import::{DepthImage, Import, ImportedFrame, Lens};
use crate::capture::orientation::Orientation;
use crate::capture::photograph::Photograph;
use crate::capture::read::image;
use crate::error::{Error, Result};
use crate::export::capture::{Entry, write_entries};
use crate::export::new_folder::NewFolder;
use crate::export::{ply, resample};
use rayon::prelude::*;
use std::path::Path;

/// Writes a capture into a new or empty folder, atomically; see [`NewFolder`].
///
/// Copies photographs whose lens the capture format supports, and resamples others to a pinhole. A mask becomes the alpha of a
/// PNG or EXR. Depth is written where it is registered to the photograph.
///
/// # Errors
/// The folder is not empty, an image is broken, or a file cannot be written.
pub fn write(folder: &Path, import: &Import) -> Result<()> {
    let staging = NewFolder::new(folder)?;
    let frames = import.frames.par_iter().enumerate();
    let entries: Result<Vec<Entry>> = frames
        .map(|(index, frame)| write_frame(staging.path(), index, frame))
        .collect();
    let mesh = staging.path().join("mesh.ply");
    ply::write_mesh(&mesh, &import.mesh, import.has_objects)?;
    write_entries(staging.path(), &entries?, "mesh.ply", import.up)?;
    staging.commit()
}

/// Writes a frame's images and returns its entry in transforms.json.
fn write_frame(folder: &Path, index: usize, frame: &ImportedFrame) -> Result<Entry> {
    let name = format!("images/{index:05}");
    let ending = if frame.lens.fits_a_capture() && frame.mask.is_none() {
        let header = image::header(&frame.photograph)?;
        let k = &frame.lens.pinhole;
        if (header.width, header.height) != (k.width, k.height) {
            let problem = format!(
                "is {}×{} pixels, but its camera {}×{}",
                header.width, header.height, k.width, k.height
            );
            let remedy = "use photographs of the camera's size";
            return Err(Error::file(&frame.photograph, problem, remedy));
        }
        let ending = frame.photograph.extension();
        let ending = ending.map(|e| e.to_string_lossy().to_ascii_lowercase());
        let ending = (ending.filter(|e| e.chars().all(|c| c.is_ascii_alphanumeric())))
            .unwrap_or_else(|| "png".into());
        copy(&frame.photograph, &folder.join(format!("{name}.{ending}")))?;
        ending
    } else {
        let (path, upright) = (&frame.photograph, Orientation::default());
        let (mut photograph, _) = image::read(path, upright, &frame.lens.pinhole, None)?;
        if let Some(mask) = &frame.mask {
            apply_mask(&mut photograph, mask, &frame.lens)?;
        }
        if !frame.lens.fits_a_capture() {
            photograph = resample::photograph(&photograph, &frame.lens);
        }
        resample::write_photograph(&folder.join(&name), &photograph)?.to_owned()
    };
    let depth = match &frame.depth {
        Some(depth) if depth.is_registered_to(&frame.lens) => {
            let name = format!("depth/{index:05}.png");
            write_depth(&folder.join(&name), depth)?;
            Some((name, depth.metres_per_unit))
        }
        _ => None,
    };
    Ok(Entry {
        file_path: format!("{name}.{ending}"),
        intrinsics: frame.lens.intrinsics(),
        pose: frame.pose,
        exposure: frame.exposure,
        depth,
    })
}

/// Copies a depth image, or rewrites it if its values or lens have to change.
fn write_depth(path: &Path, depth: &DepthImage) -> Result<()> {
    let is_png = depth.path.extension().is_some_and(|e| e == "png");
    if is_png && depth.invalid.is_none() && depth.lens.fits_a_capture() {
        return copy(&depth.path, path);
    }
    let mut values = depth.raw()?;
    if !depth.lens.fits_a_capture() {
        values = resample::depth(&values, &depth.lens);
    }
    let k = &depth.lens.pinhole;
    resample::write_depth(path, [k.width, k.height], values)
}

/// Marks pixels as unusable where the mask is dark: below one half in sRGB, 0.2 linear.
fn apply_mask(photograph: &mut Photograph, path: &Path, lens: &Lens) -> Result<()> {
    let (mask, _) = image::read(path, Orientation::default(), &lens.pinhole, None)?;
    let count = photograph.pixels.len();
    photograph.usable.resize(count, true);
    for (usable, value) in photograph.usable.iter_mut().zip(&mask.pixels) {
        *usable &= value.max_element() > 0.2;
    }
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, &e))?;
    }
    let mut source = std::fs::File::open(from).map_err(|e| Error::io(from, &e))?;
    let mut target = std::fs::File::create(to).map_err(|e| Error::io(to, &e))?;
    std::io::copy(&mut source, &mut target).map_err(|e| Error::io(to, &e))?;
    Ok(())
}
