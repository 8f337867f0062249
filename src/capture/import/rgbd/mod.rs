//! RGB-D folders: colour, 16-bit depth, a pose per frame, intrinsics.

pub mod open3d;
pub mod scannet;
pub mod seven_scenes;
pub mod tum;

use crate::capture::camera::Pose;
use crate::capture::import::Scan;
use crate::capture::import::folder::Folder;
use crate::capture::import::matrix::rows;
use crate::capture::read::image;
use crate::capture::scan::{DepthImage, ImportedFrame, Lens, depth};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

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
///
/// A principal point of exactly half the size was not calibrated: who writes it means the middle of the picture, which is half a
/// pixel from there in OpenCV's convention.
fn opencv_lens(size: [u32; 2], [fx, fy, cx, cy]: [f64; 4]) -> Lens {
    let middle = size.map(|side| f64::from(side) * 0.5);
    let principal = match [cx, cy] == middle {
        true => middle,
        false => [cx + 0.5, cy + 0.5],
    };
    Lens::plain(size, [fx, fy], principal)
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

/// The frames of a video as they are read, all with the cameras of the first.
struct Frames {
    scan: Scan,
    /// Metres per unit of depth, and a value besides 0 that marks missing depth.
    depth_values: (f64, Option<u16>),
    /// The colour and the depth camera.
    lenses: Option<[Lens; 2]>,
    /// Frames without a finite pose.
    lost: usize,
}

impl Frames {
    fn new(metres_per_unit: f64, invalid: Option<u16>) -> Self {
        Self {
            scan: Scan {
                is_video: true,
                ..Scan::default()
            },
            depth_values: (metres_per_unit, invalid),
            lenses: None,
            lost: 0,
        }
    }

    /// Adds a frame, unless its pose is not finite. `file` finds the files of its photograph and its depth image; `cameras` gives
    /// both cameras for the first frame, and may add remarks.
    fn add(
        &mut self,
        pose: Option<Pose>,
        [color, depth]: [&str; 2],
        file: impl Fn(&str) -> Result<PathBuf>,
        cameras: impl FnOnce(&mut Vec<String>) -> Result<[Lens; 2]>,
    ) -> Result<()> {
        let Some(pose) = pose else {
            self.lost += 1;
            return Ok(());
        };
        let [lens, depth_lens] = match self.lenses {
            Some(known) => known,
            None => *self.lenses.insert(cameras(&mut self.scan.remarks)?),
        };
        let photograph = file(color)?;
        let (unit, invalid) = self.depth_values;
        let depth = DepthImage {
            invalid,
            ..DepthImage::new(file(depth)?, depth_lens, unit)
        };
        let frame = ImportedFrame::new(photograph, lens, pose, Some(depth));
        self.scan.frames.push(frame);
        Ok(())
    }

    /// The scan, with a remark about frames whose tracking was lost.
    fn scan(mut self) -> Scan {
        if self.lost > 0 {
            self.scan.remarks.push(format!(
                "{} frames left out: their pose is not finite (tracking was lost)",
                self.lost
            ));
        }
        self.scan
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_the_size_is_the_middle_and_calibrated_points_are_at_pixel_centres() {
        let principal = |cx, cy| {
            let pinhole = opencv_lens([640, 480], [525.0, 525.0, cx, cy]).pinhole;
            [pinhole.cx, pinhole.cy]
        };
        assert_eq!(principal(320.0, 240.0), [320.0, 240.0]);
        assert_eq!(principal(319.5, 239.5), [320.0, 240.0]);
        assert_eq!(principal(320.0, 241.0), [320.5, 241.5]);
    }
}
