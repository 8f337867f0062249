//! Reads transforms.json of Nerfstudio, instant-ngp, Polycam and Record3D.
//!
//! Supports more than a capture's own transforms.json: k3 to k6 and fisheye lenses, intrinsics for another resolution than the
//! photographs', file names without an extension, mask files, `applied_transform`, and depth to fuse a mesh from.

use crate::capture::import::folder::Folder;
use crate::capture::import::geometry;
use crate::capture::import::matrix::matrix_of_rows;
use crate::capture::import::{AppliedTransform, ImportOptions, Scan};
use crate::capture::read::fields::Fields;
use crate::capture::read::{image, lens, pose};
use crate::capture::scan::ImportedFrame;
use crate::capture::scan::depth::{self, DepthImage};
use crate::capture::scan::lens::{Lens, Model};
use crate::error::{Error, Result};
use glam::{DMat4, DVec2, DVec4};
use serde_json::Value;
use std::path::PathBuf;

/// Names of the file, in order of preference.
const NAMES: [&str; 2] = ["transforms.json", "transforms_train.json"];
const EXTENSIONS: [&str; 5] = ["", ".png", ".jpg", ".jpeg", ".exr"];
/// Default metres per unit of depth.
const DEPTH_UNIT: f64 = 0.001;

pub fn is_here(folder: &Folder) -> bool {
    folder.first(&NAMES).is_some()
}

pub fn read(folder: &Folder, options: &ImportOptions) -> Result<Scan> {
    let name = folder.first(&NAMES).unwrap_or(NAMES[0]);
    let value = folder.json(name)?;
    let place = folder.path(name).display().to_string();
    let shared = Fields::new(format!("{place}: "), &value)?;
    let list = shared.frames()?;

    let mut scan = Scan {
        up: shared.vector("up")?,
        ..Scan::default()
    };
    if name != NAMES[0] {
        scan.remarks.push(format!(
            "frames: those of {name}; other splits are left out"
        ));
    }
    scan.mesh = match shared.text("mesh_path")? {
        Some(mesh) => Some(folder.file(&shared.place("mesh_path"), mesh)?),
        None => geometry::find(folder, &[""], &mut scan.remarks)?,
    };
    let to_mesh = to_mesh_coordinates(&shared, options, &mut scan)?;
    scan.up = scan.up.map(|up| to_mesh.transform_vector3(up));
    let mut lost_frames = 0;
    for (index, entry) in list.iter().enumerate() {
        let fields = Fields::new(format!("{place}: frames[{index}]."), entry)?;
        match frame(folder, [&shared, &fields], &to_mesh)? {
            Some(frame) => scan.frames.push(frame),
            None => lost_frames += 1,
        }
    }
    if lost_frames > 0 {
        scan.remarks.push(format!(
            "{lost_frames} frames left out: their pose is not finite"
        ));
    }
    scan.remark_on_resampled();
    if value.get("fisheye_crop_radius").is_some() {
        scan.remarks.push("fisheye_crop_radius is not read".into());
    }
    Ok(scan)
}

/// The transform from the poses' coordinates to the mesh's: the inverse of `applied_transform` where it is undone, or none.
fn to_mesh_coordinates(shared: &Fields, options: &ImportOptions, scan: &mut Scan) -> Result<DMat4> {
    let Some(applied) = shared.matrix("applied_transform")? else {
        return Ok(DMat4::IDENTITY);
    };
    let place = shared.place("applied_transform");
    let wrong = |problem: &str| Error::new(&place, problem, "correct the field");
    let rows = matrix_of_rows(&applied).ok_or_else(|| wrong("is not a 3×4 or 4×4 matrix"))?;
    if rows == DMat4::IDENTITY {
        return Ok(rows);
    }
    if !(rows.is_finite() && rows.determinant().abs() > 1e-9) {
        return Err(wrong("is singular"));
    }
    // A mesh that the file names and a fused mesh share the poses' coordinates.
    let same_coordinates =
        options.mesh.is_none() && (scan.mesh.is_none() || shared.get("mesh_path").is_some());
    let undo = match options.applied_transform {
        AppliedTransform::Undo => true,
        AppliedTransform::Keep => false,
        AppliedTransform::Guess => !same_coordinates,
    };
    let (remark, to_mesh) = if undo {
        let remark = "applied_transform is undone: the mesh is taken to have the coordinates from before it; --applied-transform keep overrides";
        (remark, rows.inverse())
    } else {
        let remark = "applied_transform is kept: mesh and poses are taken to share its coordinates; --applied-transform undo overrides";
        (remark, DMat4::IDENTITY)
    };
    scan.remarks.push(remark.into());
    Ok(to_mesh)
}

/// One frame; `None` if its pose is not finite.
fn frame(
    folder: &Folder,
    [shared, fields]: [&Fields; 2],
    to_mesh: &DMat4,
) -> Result<Option<ImportedFrame>> {
    let photograph = photograph(folder, fields)?;
    let header = image::header(&photograph)?;
    let lens = camera([shared, fields], [header.width, header.height])?;

    let place = fields.place("transform_matrix");
    let refuse = |problem: &str| pose::refused(&place, problem);
    let rows = fields
        .matrix("transform_matrix")?
        .as_deref()
        .and_then(matrix_of_rows)
        .ok_or_else(|| refuse("is not a 3×4 or 4×4 matrix"))?;
    let rows = *to_mesh * rows;
    if !rows.is_finite() {
        return Ok(None);
    }
    let row = |r: DVec4| r.to_array().to_vec();
    let rows: Vec<Vec<f64>> = (0..3).map(|i| row(rows.row(i))).collect();
    let (pose, _) = pose::from_rows(&rows).map_err(|problem| refuse(&problem))?;

    let file = |field: &str| -> Result<Option<PathBuf>> {
        let name = fields.text(field)?;
        name.map(|name| folder.file(&fields.place(field), name))
            .transpose()
    };
    let mask = file("mask_path")?;
    let number =
        |name: &str| -> Result<Option<f64>> { Ok(fields.number(name)?.or(shared.number(name)?)) };
    let depth = match file("depth_file_path")? {
        Some(path) => {
            let lens = lens.resized(depth::size(&path)?);
            let unit = number("depth_unit_scale_factor")?.unwrap_or(DEPTH_UNIT);
            Some(DepthImage::new(path, lens, unit))
        }
        None => None,
    };
    Ok(Some(ImportedFrame {
        photograph,
        lens,
        pose,
        exposure: number("exposure")?,
        mask,
        depth,
    }))
}

/// The photograph's file, with an extension added if needed.
fn photograph(folder: &Folder, fields: &Fields) -> Result<PathBuf> {
    let place = fields.place("file_path");
    let name = fields
        .text("file_path")?
        .ok_or_else(|| Error::new(&place, "is absent", "name the photograph"))?
        .replace('\\', "/");
    let names = EXTENSIONS.map(|extension| format!("{name}{extension}"));
    let found = names
        .iter()
        .find(|name| folder.path(name).is_file())
        .unwrap_or(&names[0]);
    folder.file(&place, found)
}

/// The lens of a frame. The pinhole fields are read as those of a capture; distortion is read here.
fn camera([shared, frame]: [&Fields; 2], size: [u32; 2]) -> Result<Lens> {
    let number = |name: &str| -> Result<f64> {
        Ok(frame.number(name)?.or(shared.number(name)?).unwrap_or(0.0))
    };
    let model = frame.or(shared, "camera_model").text("camera_model")?;
    let model = model.map(str::to_ascii_uppercase);
    let flagged = |fields: &Fields| fields.get("is_fisheye").and_then(Value::as_bool);
    let is_fisheye = flagged(frame).or(flagged(shared)) == Some(true);
    let mut k = [0.0; 6];
    for (name, k) in ["k1", "k2", "k3", "k4", "k5", "k6"].into_iter().zip(&mut k) {
        *k = number(name)?;
    }
    let p = [number("p1")?, number("p2")?];
    let fisheye = Model::Fisheye([k[0], k[1], k[2], k[3]]);
    let model = match model.as_deref() {
        Some("OPENCV_FISHEYE" | "FISHEYE") => fisheye,
        _ if is_fisheye => fisheye,
        None | Some("PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV") => {
            // k4 of Nerfstudio belongs to another polynomial than OpenCV's.
            if k[3..].iter().any(|&k| k != 0.0) {
                return Err(Error::new(
                    frame.place("k4"),
                    "coefficients beyond k3 are not supported with this lens model",
                    "refit the lens with k1 k2 p1 p2, or name it FULL_OPENCV",
                ));
            }
            Model::Rational { k, p }
        }
        Some("FULL_OPENCV") => Model::Rational { k, p },
        Some(other) => {
            return Err(Error::new(
                frame.place("camera_model"),
                format!("the lens model {other:?} is not supported"),
                "undistort the photographs to PINHOLE or OPENCV first",
            ));
        }
    };

    // Scale focal lengths and principal point to the photograph's resolution.
    let stated =
        |name: &str| -> Result<Option<u32>> { Ok(frame.count(name)?.or(shared.count(name)?)) };
    let scale = match (stated("w")?, stated("h")?) {
        (Some(w), Some(h)) if [w, h] != size => {
            let x = f64::from(size[0]) / f64::from(w);
            let y = f64::from(size[1]) / f64::from(h);
            if (x / y - 1.0).abs() > 0.01 {
                return Err(Error::new(
                    frame.place("w"),
                    format!(
                        "the camera has {w}×{h} pixels, the photograph {}×{}: another shape",
                        size[0], size[1]
                    ),
                    "correct the intrinsics or use photographs of the camera's shape",
                ));
            }
            DVec2::new(x, y)
        }
        _ => DVec2::ONE,
    };
    let plain = Lens {
        pinhole: lens::pinhole(shared, frame, size, scale, &mut Vec::new())?,
        model: Model::Brown([0.0; 4]),
    };
    Ok(plain.with(model))
}
