//! Reads Open3D's reconstruction system and the Redwood data sets: `color` (or `rgb`, `image`), `depth`, a trajectory, intrinsics.
//!
//! A trajectory is a `.log` file (for each frame a line of three numbers and a 4×4 camera-to-world matrix with OpenCV's axes) or a
//! JSON list of column-major world-to-camera matrices. camera_intrinsic.json holds the 3×3 matrix, column-major.
//! Depth is in millimetres.

use crate::capture::import::folder::Folder;
use crate::capture::import::matrix::{numbers, pose_of_rows};
use crate::capture::import::rgbd::{
    COLOR_FOLDERS, Frames, depth_size, opencv_lens, photograph_size, possible,
};
use crate::capture::import::{ImportOptions, Scan};
use crate::capture::read::fields;
use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};
use glam::{DMat4, DVec4};
use serde_json::Value;

/// Names of intrinsics files, in order of preference.
const INTRINSICS: [&str; 4] = [
    "camera_intrinsic.json",
    "intrinsic.json",
    "camera_primesense.json",
    "scene/camera_intrinsic.json",
];
/// Names of trajectories, in order of preference, before any other `.log`.
const TRAJECTORIES: [&str; 6] = [
    "scene/refined_trajectory.log",
    "scene/trajectory.log",
    "trajectory.log",
    "scene/trajectory.json",
    "trajectory.json",
    "camera_trajectory.json",
];
/// Meshes of the reconstruction system, in order of preference.
const MESHES: [&str; 4] = [
    "scene/color_map_after_optimization.ply",
    "scene/refined_integrated.ply",
    "scene/integrated.ply",
    "integrated.ply",
];

/// A frame's index, and the rows of its camera-to-world matrix.
type PosedFrame = (usize, Vec<Vec<f64>>);

pub fn is_here(folder: &Folder) -> Result<bool> {
    let images = folder.has_folder("depth") && color_folder(folder).is_some();
    Ok(images && trajectory_name(folder)?.is_some())
}

fn color_folder(folder: &Folder) -> Option<&'static str> {
    COLOR_FOLDERS
        .into_iter()
        .find(|name| folder.has_folder(name))
}

fn trajectory_name(folder: &Folder) -> Result<Option<String>> {
    if let Some(name) = folder.first(&TRAJECTORIES) {
        return Ok(Some(name.to_owned()));
    }
    let names = folder.names("")?;
    Ok(names.into_iter().find(|name| name.ends_with(".log")))
}

pub fn read(folder: &Folder, options: &ImportOptions) -> Result<Scan> {
    let mut frames = Frames::new(0.001, None);
    let missing = |name: &str, remedy: &str| Error::file(&folder.path(name), "is missing", remedy);
    let color = color_folder(folder)
        .ok_or_else(|| missing("color", "put the colour images into a folder of this name"))?;
    let colors = images(folder, color, &["png", "jpg", "jpeg"])?;
    let depths = images(folder, "depth", &["png", "pgm"])?;
    if colors.len() != depths.len() {
        return Err(Error::file(
            &folder.path("depth"),
            format!(
                "has {} images, but {color} has {}",
                depths.len(),
                colors.len()
            ),
            "give every photograph its depth image, in the same order",
        ));
    }
    let name = trajectory_name(folder)?
        .ok_or_else(|| missing("trajectory.log", "add the camera trajectory"))?;
    frames.scan.remarks.push(format!("poses: {name}"));
    let place = folder.path(&name).display().to_string();
    let poses = if name.ends_with(".json") {
        from_json(folder, &name)?
    } else {
        from_log(folder, &name)?
    };
    for (index, rows) in poses {
        let (Some(color), Some(depth)) = (colors.get(index), depths.get(index)) else {
            return Err(Error::new(
                &place,
                format!(
                    "has a pose for image {index} (counted from 0), but there are {}",
                    colors.len()
                ),
                "add the images or shorten the trajectory",
            ));
        };
        let pose = pose_of_rows(&format!("{place} frame {index}"), &rows)?;
        let file = |name: &str| folder.file(&place, name);
        frames.add(pose, [color, depth], file, |remarks| {
            let lens = camera(folder, photograph_size(folder, color)?, options, remarks)?;
            Ok([lens, lens.resized(depth_size(folder, depth)?)])
        })?;
    }
    let mut scan = frames.scan();
    if let Some(name) = folder.first(&MESHES) {
        scan.mesh = Some(folder.file(&place, name)?);
    }
    Ok(scan)
}

fn images(folder: &Folder, inside: &str, ends: &[&str]) -> Result<Vec<String>> {
    let names = folder.names(inside)?;
    let is_image = |name: &String| {
        let lower = name.to_ascii_lowercase();
        lower
            .rsplit_once('.')
            .is_some_and(|(_, end)| ends.contains(&end))
    };
    Ok(names
        .into_iter()
        .filter(is_image)
        .map(|name| format!("{inside}/{name}"))
        .collect())
}

fn from_log(folder: &Folder, name: &str) -> Result<Vec<PosedFrame>> {
    let text = folder.text(name)?;
    let path = folder.path(name);
    let lines: Vec<&str> = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .collect();
    let broken = |index: usize| {
        Error::new(
            format!("{} frame {index}", path.display()),
            "is not a line of three numbers with a 4×4 matrix below",
            "export the trajectory again",
        )
    };
    let mut poses = Vec::new();
    for (index, block) in lines.chunks(5).enumerate() {
        let head = numbers(block[0]).filter(|head| head.len() >= 2);
        let rows: Option<Vec<Vec<f64>>> = block[1..].iter().map(|line| numbers(line)).collect();
        let (Some(head), Some(rows)) = (head, rows) else {
            return Err(broken(index));
        };
        let frame = head[0];
        let whole = (0.0..1e9).contains(&frame) && frame.fract() == 0.0;
        if !whole || rows.len() != 4 || rows.iter().any(|row| row.len() != 4) {
            return Err(broken(index));
        }
        poses.push((frame as usize, rows));
    }
    Ok(poses)
}

fn from_json(folder: &Folder, name: &str) -> Result<Vec<PosedFrame>> {
    let path = folder.path(name);
    let value = folder.json(name)?;
    let broken = |problem: &str| Error::file(&path, problem, "export the trajectory again");
    let list = value.get("parameters").and_then(Value::as_array);
    let list = list.ok_or_else(|| broken("has no list of parameters"))?;
    let pose = |(index, entry): (usize, &Value)| -> Result<PosedFrame> {
        let Some(columns) = column_major(entry.get("extrinsic"), 16) else {
            let problem = format!("parameters[{index}].extrinsic is not a list of 16 numbers");
            return Err(broken(&problem));
        };
        let to_camera = DMat4::from_cols_slice(&columns);
        // A singular matrix counts as a lost frame.
        let to_world = if to_camera.determinant().abs() > 1e-9 {
            to_camera.inverse()
        } else {
            DMat4::NAN
        };
        let row = |r: DVec4| r.to_array().to_vec();
        Ok((index, (0..4).map(|i| row(to_world.row(i))).collect()))
    };
    list.iter().enumerate().map(pose).collect()
}

fn column_major(value: Option<&Value>, count: usize) -> Option<Vec<f64>> {
    fields::numbers(value?).filter(|numbers| numbers.len() == count)
}

fn camera(
    folder: &Folder,
    size: [u32; 2],
    options: &ImportOptions,
    remarks: &mut Vec<String>,
) -> Result<Lens> {
    if let Some(given) = options.intrinsics {
        return Ok(opencv_lens(size, given));
    }
    let Some(name) = folder.first(&INTRINSICS) else {
        remarks.push(
            "intrinsics: Open3D's default for PrimeSense cameras, as there is no camera_intrinsic.json; --intrinsics overrides"
                .into(),
        );
        return Ok(opencv_lens([640, 480], [525.0, 525.0, 319.5, 239.5]).resized(size));
    };
    let path = folder.path(name);
    let value = folder.json(name)?;
    let Some(k) = column_major(value.get("intrinsic_matrix"), 9) else {
        return Err(Error::file(
            &path,
            "intrinsic_matrix is not a list of 9 numbers",
            "write the intrinsics again",
        ));
    };
    let stated = |name: &str| value.get(name).and_then(Value::as_f64);
    for (name, actual) in [("width", size[0]), ("height", size[1])] {
        if stated(name).is_some_and(|n| n != f64::from(actual)) {
            return Err(Error::file(
                &path,
                format!(
                    "{name} does not fit the photographs of {}×{} pixels",
                    size[0], size[1]
                ),
                "correct the intrinsics",
            ));
        }
    }
    possible(opencv_lens(size, [k[0], k[4], k[6], k[7]]), &path)
}
