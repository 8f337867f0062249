//! Reads ScanNet (Dai et al. 2017) as exported from a `.sens` file: `color/N.jpg`, `depth/N.png`, `pose/N.txt`, `intrinsic/`.
//!
//! Poses are 4×4 camera-to-world matrices with OpenCV's axes, all −inf where tracking was lost; depth is in millimetres.
//! `*_vh_clean_2.ply` (or `_vh_clean.ply`) is the reconstructed mesh.

use crate::capture::import::Scan;
use crate::capture::import::folder::Folder;
use crate::capture::import::matrix::{pose_of_rows, rows};
use crate::capture::import::rgbd::{Frames, depth_size, opencv_camera, photograph_size};
use crate::error::Result;
use glam::DMat3;

/// Files of the cameras of both kinds of image.
const COLOR_CAMERA: &str = "intrinsic/intrinsic_color.txt";
const DEPTH_CAMERA: &str = "intrinsic/intrinsic_depth.txt";

pub fn is_here(folder: &Folder) -> bool {
    ["color", "depth", "pose", "intrinsic"]
        .iter()
        .all(|name| folder.has_folder(name))
}

pub fn read(folder: &Folder) -> Result<Scan> {
    let mut frames = Frames::new(0.001, None);
    frames.scan.mesh = mesh(folder)?;
    for name in folder.names("pose")? {
        let Some(stem) = name.strip_suffix(".txt") else {
            continue;
        };
        let pose_name = format!("pose/{name}");
        let place = folder.path(&pose_name).display().to_string();
        let pose = pose_of_rows(&place, &rows(folder, &pose_name)?)?;
        let either = |names: [String; 2]| {
            let [usual, other] = names;
            if folder.has(&other) && !folder.has(&usual) {
                other
            } else {
                usual
            }
        };
        let color = either([format!("color/{stem}.jpg"), format!("color/{stem}.png")]);
        let depth = either([format!("depth/{stem}.png"), format!("depth/{stem}.pgm")]);
        let cameras = |_: &mut Vec<String>| {
            Ok([
                opencv_camera(folder, COLOR_CAMERA, photograph_size(folder, &color)?)?,
                opencv_camera(folder, DEPTH_CAMERA, depth_size(folder, &depth)?)?,
            ])
        };
        let file = |name: &str| folder.file(&place, name);
        frames.add(pose, [&color, &depth], file, cameras)?;
    }
    let mut scan = frames.scan();
    remark_on_extrinsics(folder, &mut scan.remarks)?;
    Ok(scan)
}

/// Adds a remark if the depth and colour cameras have different poses.
fn remark_on_extrinsics(folder: &Folder, remarks: &mut Vec<String>) -> Result<()> {
    for kind in ["color", "depth"] {
        let name = format!("intrinsic/extrinsic_{kind}.txt");
        if !folder.has(&name) {
            continue;
        }
        let m = rows(folder, &name)?;
        let column = |j: usize| glam::DVec3::new(m[0][j], m[1][j], m[2][j]);
        let difference = DMat3::from_cols(column(0), column(1), column(2)) - DMat3::IDENTITY;
        let shift = if m[0].len() == 4 {
            column(3).length()
        } else {
            0.0
        };
        let rotation = difference
            .to_cols_array()
            .iter()
            .fold(0.0, |a: f64, x| a.max(x.abs()));
        if rotation > 1e-3 || shift > 1e-3 {
            remarks.push(format!(
                "{name} is not the identity ({shift:.3} m); depth is taken to be seen from where the colour camera is"
            ));
        }
    }
    Ok(())
}

/// The reconstructed mesh; the simplified one is preferred.
fn mesh(folder: &Folder) -> Result<Option<std::path::PathBuf>> {
    let names = folder.names("")?;
    for end in ["_vh_clean_2.ply", "_vh_clean.ply"] {
        if let Some(name) = names.iter().find(|name| name.ends_with(end)) {
            return folder.existing(name).map(Some);
        }
    }
    Ok(None)
}
