//! Reads 7-Scenes (Shotton et al. 2013) and 3DMatch: `frame-N.color.png`, `frame-N.depth.png`, `frame-N.pose.txt`.
//!
//! Poses are 4×4 camera-to-world matrices with OpenCV's axes; depth is in millimetres, with 65535 for missing depth. 3DMatch adds
//! `camera-intrinsics.txt`, a 3×3 matrix; 7-Scenes states a focal length of 585 pixels at 640 × 480.

use crate::capture::import::folder::{Folder, inside};
use crate::capture::import::matrix::{pose_of_rows, rows};
use crate::capture::import::rgbd::{
    Frames, depth_size, opencv_camera, opencv_lens, photograph_size,
};
use crate::capture::import::{ImportOptions, Scan};
use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};

const POSE: &str = ".pose.txt";
const INTRINSICS: [&str; 2] = ["camera-intrinsics.txt", "intrinsics.txt"];
const INVALID: u16 = 65535;

pub fn is_here(folder: &Folder) -> Result<bool> {
    for sequence in sequences(folder)? {
        if folder.names(&sequence)?.iter().any(|n| n.ends_with(POSE)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The folder itself and its subfolders `seq-NN`.
fn sequences(folder: &Folder) -> Result<Vec<String>> {
    let inner = folder.names("")?;
    let inner = inner
        .into_iter()
        .filter(|name| name.starts_with("seq-") && folder.has_folder(name));
    Ok(std::iter::once(String::new()).chain(inner).collect())
}

pub fn read(folder: &Folder, options: &ImportOptions) -> Result<Scan> {
    let mut frames = Frames::new(0.001, Some(INVALID));
    for sequence in sequences(folder)? {
        for name in folder.names(&sequence)? {
            let Some(stem) = name.strip_suffix(POSE) else {
                continue;
            };
            let stem = inside(&sequence, stem);
            let either = |kind: &str, ends: &[&str]| -> Result<String> {
                let names = ends.iter().map(|end| format!("{stem}.{kind}.{end}"));
                names.clone().find(|n| folder.has(n)).ok_or_else(|| {
                    Error::file(
                        &folder.path(&format!("{stem}.{kind}.{}", ends[0])),
                        "is missing, though the frame has a pose",
                        "copy the file, or delete the frame's pose",
                    )
                })
            };
            let color = either("color", &["png", "jpg", "jpeg"])?;
            let depth = either("depth", &["png", "pgm"])?;
            let pose_name = inside(&sequence, &name);
            let place = folder.path(&pose_name).display().to_string();
            let pose = pose_of_rows(&place, &rows(folder, &pose_name)?)?;
            let file = |name: &str| folder.file(&place, name);
            frames.add(pose, [&color, &depth], file, |remarks| {
                cameras(folder, &color, &depth, options, remarks)
            })?;
        }
    }
    Ok(frames.scan())
}

/// The colour and the depth camera; depth is assumed to be registered to colour.
fn cameras(
    folder: &Folder,
    color: &str,
    depth: &str,
    options: &ImportOptions,
    remarks: &mut Vec<String>,
) -> Result<[Lens; 2]> {
    let size = photograph_size(folder, color)?;
    let lens = match (options.intrinsics, folder.first(&INTRINSICS)) {
        (Some(given), _) => opencv_lens(size, given),
        (None, Some(name)) => {
            remarks.push(format!("intrinsics: {name}"));
            opencv_camera(folder, name, size)?
        }
        (None, None) => {
            let focal = 585.0 * f64::from(size[0]) / 640.0;
            remarks.push(format!(
                "intrinsics: a focal length of {focal} pixels and the middle of the image, as 7-Scenes states; --intrinsics overrides"
            ));
            Lens::plain(size, [focal; 2], size.map(|side| f64::from(side) * 0.5))
        }
    };
    remarks.push("depth is taken to be seen by the colour camera".into());
    Ok([lens, lens.resized(depth_size(folder, depth)?)])
}
