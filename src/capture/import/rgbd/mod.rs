//! RGB-D folders: colour, 16-bit depth, a pose a frame, intrinsics.

pub mod open3d;
pub mod scannet;
pub mod seven_scenes;
pub mod tum;

use crate::capture::import::depth;
use crate::capture::import::folder::Folder;
use crate::capture::import::lens::Lens;
use crate::capture::read::image;
use crate::error::{Error, Result};
use std::path::Path;

/// The names of the folders that colour images lie in, as programs write them.
const COLOR_FOLDERS: [&str; 5] = ["color", "rgb", "image", "images", "colour"];

/// The size of a photograph inside the folder, by its header.
fn photograph_size(folder: &Folder, name: &str) -> Result<[u32; 2]> {
    let path = folder.path(name);
    let file = folder.file(&path.display().to_string(), name)?;
    let header = image::header(&file)?;
    Ok([header.width, header.height])
}

/// The size of a depth image inside the folder, by its header.
fn depth_size(folder: &Folder, name: &str) -> Result<[u32; 2]> {
    let path = folder.path(name);
    let file = folder.file(&path.display().to_string(), name)?;
    depth::size(&file)
}

/// A lens of fx, fy, cx, cy with pixel centres at whole numbers, as OpenCV has them; captures have them at halves.
fn opencv_lens(size: [u32; 2], [fx, fy, cx, cy]: [f64; 4]) -> Lens {
    Lens::plain(size, [fx, fy], [cx + 0.5, cy + 0.5])
}

/// Refuses a camera file whose lens cannot be.
///
/// # Errors
/// A number is not finite, or a focal length not positive.
fn possible(lens: Lens, path: &Path) -> Result<Lens> {
    match lens.is_possible() {
        true => Ok(lens),
        false => Err(Error::file(
            path,
            "holds an impossible focal length or principal point",
            "correct the intrinsics",
        )),
    }
}

/// What is said of frames whose pose is lost.
fn lost(count: usize, said: &mut Vec<String>) {
    if count > 0 {
        said.push(format!(
            "{count} frames left out: their pose is not finite (tracking was lost)"
        ));
    }
}
