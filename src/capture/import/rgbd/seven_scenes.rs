//! Reads 7-Scenes (Shotton et al. 2013) and 3DMatch: `frame-N.color.png`, `frame-N.depth.png`, `frame-N.pose.txt`.
//!
//! Poses are 4×4 camera-to-world matrices with OpenCV's axes; depth is in millimetres, with 65535 for missing depth. 3DMatch adds
//! `camera-intrinsics.txt`, a 3×3 matrix; 7-Scenes states a focal length of 585 pixels at 640 × 480.

use crate::capture::import::folder::Folder;
use crate::capture::import::matrix::{pose_of_rows, rows};
use crate::capture::import::reader::{ImportOptions, Scan};
use crate::capture::import::rgbd::{
    depth_size, opencv_lens, photograph_size, possible, remark_on_lost,
};
use crate::capture::scan::ImportedFrame;
use crate::capture::scan::depth::DepthImage;
use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};

/// Suffix of a pose file's name.
const POSE: &str = ".pose.txt";
/// Names of 3DMatch's intrinsics.
const INTRINSICS: [&str; 2] = ["camera-intrinsics.txt", "intrinsics.txt"];
/// Depth value for missing depth.
const INVALID: u16 = 65535;

/// Whether a folder has this layout.
///
/// # Errors
/// The folder cannot be read.
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

/// Reads the frames of all sequences.
///
/// # Errors
/// A frame lacks its photograph or depth image, or a file is broken.
pub fn read(folder: &Folder, options: &ImportOptions) -> Result<Scan> {
    let mut scan = Scan {
        is_video: true,
        ..Scan::default()
    };
    let mut lenses: Option<[Lens; 2]> = None;
    let mut left_out = 0;
    for sequence in sequences(folder)? {
        let prefix = match sequence.as_str() {
            "" => String::new(),
            name => format!("{name}/"),
        };
        for name in folder.names(&sequence)? {
            let Some(stem) = name.strip_suffix(POSE) else {
                continue;
            };
            let stem = format!("{prefix}{stem}");
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
            let pose_name = format!("{prefix}{name}");
            let path = folder.path(&pose_name);
            let rows = rows(&path, &folder.text(&pose_name)?)?;
            let Some(pose) = pose_of_rows(&path.display().to_string(), &rows)? else {
                left_out += 1;
                continue;
            };
            let [lens, depth_lens] = match lenses {
                Some(known) => known,
                None => {
                    *lenses.insert(cameras(folder, &color, &depth, options, &mut scan.remarks)?)
                }
            };
            let photograph = folder.file(&path.display().to_string(), &color)?;
            let depth = DepthImage {
                path: folder.file(&path.display().to_string(), &depth)?,
                lens: depth_lens,
                metres_per_unit: 0.001,
                invalid: Some(INVALID),
            };
            scan.frames
                .push(ImportedFrame::new(photograph, lens, pose, Some(depth)));
        }
    }
    remark_on_lost(left_out, &mut scan.remarks);
    Ok(scan)
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
            let k = rows(&folder.path(name), &folder.text(name)?)?;
            remarks.push(format!("intrinsics: {name}"));
            let lens = opencv_lens(size, [k[0][0], k[1][1], k[0][2], k[1][2]]);
            possible(lens, &folder.path(name))?
        }
        (None, None) => {
            let focal = 585.0 * f64::from(size[0]) / 640.0;
            remarks.push(format!(
                "intrinsics: a focal length of {focal} pixels and the middle of the image, as 7-Scenes states; --intrinsics overrides"
            ));
            Lens::plain(
                size,
                [focal; 2],
                [f64::from(size[0]) * 0.5, f64::from(size[1]) * 0.5],
            )
        }
    };
    remarks.push("depth is taken to be seen by the colour camera".into());
    Ok([lens, lens.resized(depth_size(folder, depth)?)])
}
