//! RGB-D folders: colour, 16-bit depth, a pose per frame, intrinsics.

pub mod open3d;
pub mod scannet;
pub mod seven_scenes;
pub mod tum;

use crate::capture::import::folder::Folder;
use crate::capture::import::matrix::rows;
use crate::capture::read::image;
use crate::capture::scan::depth;
use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};
use std::path::Path;

/// Usual names of folders of colour images.
const COLOR_FOLDERS: [&str; 5] = ["color", "rgb", "image", "images", "colour"];

/// The size of a photograph inside the folder, by its header.
fn photograph_size(folder: &Folder, name: &str) -> Result<[u32; 2]> {
    let header = image::header(&folder.existing(name)?)?;
    Ok([header.width, header.height])
}

/// The size of a depth image inside the folder, by its header.
fn depth_size(folder: &Folder, name: &str) -> Result<[u32; 2]> {
    depth::size(&folder.existing(name)?)
}

/// The lens of fx, fy, cx, cy in OpenCV's convention, with pixel centres at integers; captures have them at half-integers.
fn opencv_lens(size: [u32; 2], [fx, fy, cx, cy]: [f64; 4]) -> Lens {
    Lens::plain(size, [fx, fy], [cx + 0.5, cy + 0.5])
}

/// The lens of a file with OpenCV's matrix of intrinsics.
fn opencv_camera(folder: &Folder, name: &str, size: [u32; 2]) -> Result<Lens> {
    let k = rows(folder, name)?;
    let lens = opencv_lens(size, [k[0][0], k[1][1], k[0][2], k[1][2]]);
    possible(lens, &folder.path(name))
}

/// Refuses an impossible lens from the file at `path`.
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

/// Adds a remark about frames whose tracking was lost.
fn remark_on_lost(count: usize, remarks: &mut Vec<String>) {
    if count > 0 {
        remarks.push(format!(
            "{count} frames left out: their pose is not finite (tracking was lost)"
        ));
    }
}
