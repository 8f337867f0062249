//! Writes a capture folder: transforms.json, mesh.obj, images/NNN.exr, truth.json.

use crate::capture::Capture;
use crate::capture::camera::{Intrinsics, Pose};
use crate::capture::mesh::Mesh;
use crate::capture::read::CAMERAS;
use crate::error::Result;
use crate::export::atomic::{WriteError, write_atomically, write_bytes};
use crate::export::exr::{Precision, write_rgb};
use crate::math::picture::Picture;
use glam::DVec3;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::Path;

/// Writes a capture. Photographs become linear EXR files of radiance. transforms.json is written last, so that a
/// folder that has it is complete.
///
/// # Errors
/// A photograph cannot be read or a file cannot be written.
pub fn write(folder: &Path, capture: &Capture, precision: Precision) -> Result<()> {
    write_mesh(folder, &capture.mesh)?;
    for (index, frame) in capture.frames.iter().enumerate() {
        let photograph = frame.load()?;
        let picture = photograph.picture();
        write_rgb(&folder.join(image_name(index)), &picture, precision)?;
    }
    let cameras = capture.frames.iter().map(|f| (f.intrinsics, f.pose));
    write_transforms(folder, cameras, capture.up)
}

/// Writes mesh.obj.
///
/// # Errors
/// The file cannot be written.
pub fn write_mesh(folder: &Path, mesh: &Mesh) -> Result<()> {
    write_atomically(&folder.join("mesh.obj"), |out| write_obj(out, mesh))
}

/// Writes transforms.json for photographs in images/NNN.exr.
///
/// # Errors
/// The file cannot be written.
pub fn write_transforms(
    folder: &Path,
    cameras: impl Iterator<Item = (Intrinsics, Pose)>,
    up: DVec3,
) -> Result<()> {
    let entry = |(index, (intrinsics, pose))| Entry {
        file_path: image_name(index),
        intrinsics,
        pose,
        exposure: None,
        depth: None,
    };
    let entries: Vec<Entry> = cameras.enumerate().map(entry).collect();
    let text = format!("{:#}\n", transforms(&entries, "mesh.obj", Some(up)));
    write_bytes(&folder.join(CAMERAS), text.as_bytes())
}

/// Writes truth.json (see [`crate::capture::truth::Truth`]) and truth/albedo_NNN.exr, one picture a frame.
///
/// # Errors
/// A file cannot be written.
pub fn write_truth(folder: &Path, truth: &impl Serialize, albedo: &[Picture]) -> Result<()> {
    for (index, picture) in albedo.iter().enumerate() {
        let name = format!("truth/albedo_{index:03}.exr");
        write_rgb(&folder.join(name), picture, Precision::Float)?;
    }
    write_atomically(&folder.join("truth.json"), |out| {
        serde_json::to_writer_pretty(&mut *out, truth)?;
        Ok(out.write_all(b"\n")?)
    })
}

fn image_name(index: usize) -> String {
    format!("images/{index:03}.exr")
}

/// One frame of transforms.json.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The photograph, relative to the folder.
    pub file_path: String,
    /// Its camera.
    pub intrinsics: Intrinsics,
    /// Camera to world.
    pub pose: Pose,
    /// Linear exposure factor, if known.
    pub exposure: Option<f64>,
    /// Depth image relative to the folder, and metres per unit.
    pub depth: Option<(String, f64)>,
}

/// The content of transforms.json. Numbers are written so that they read back to the bit.
pub fn transforms(entries: &[Entry], mesh_path: &str, up: Option<DVec3>) -> Value {
    let shared = entries.first().map(|entry| entry.intrinsics);
    let mut file = Map::new();
    file.insert("camera_model".into(), json!("OPENCV"));
    if let Some(shared) = shared {
        file.extend(lens(&shared));
    }
    file.insert("mesh_path".into(), json!(mesh_path));
    if let Some(up) = up {
        file.insert("up".into(), json!(up.to_array()));
    }
    let frames: Vec<Value> = entries
        .iter()
        .map(|frame| {
            let mut entry = Map::new();
            entry.insert("file_path".into(), json!(frame.file_path));
            if Some(frame.intrinsics) != shared {
                entry.extend(lens(&frame.intrinsics));
            }
            if let Some(exposure) = frame.exposure {
                entry.insert("exposure".into(), json!(exposure));
            }
            if let Some((path, unit)) = &frame.depth {
                entry.insert("depth_file_path".into(), json!(path));
                entry.insert("depth_unit_scale_factor".into(), json!(unit));
            }
            let r = frame.pose.rotation;
            let c = frame.pose.center;
            entry.insert(
                "transform_matrix".into(),
                json!([
                    [r.x_axis.x, r.y_axis.x, r.z_axis.x, c.x],
                    [r.x_axis.y, r.y_axis.y, r.z_axis.y, c.y],
                    [r.x_axis.z, r.y_axis.z, r.z_axis.z, c.z],
                    [0.0, 0.0, 0.0, 1.0]
                ]),
            );
            Value::Object(entry)
        })
        .collect();
    file.insert("frames".into(), Value::Array(frames));
    Value::Object(file)
}

fn lens(k: &Intrinsics) -> impl Iterator<Item = (String, Value)> {
    let [k1, k2, p1, p2] = k.distortion;
    [
        ("w", json!(k.width)),
        ("h", json!(k.height)),
        ("fl_x", json!(k.fx)),
        ("fl_y", json!(k.fy)),
        ("cx", json!(k.cx)),
        ("cy", json!(k.cy)),
        ("k1", json!(k1)),
        ("k2", json!(k2)),
        ("p1", json!(p1)),
        ("p2", json!(p2)),
    ]
    .into_iter()
    .map(|(name, value)| (name.to_owned(), value))
}

/// Writes objects as `o`, texture coordinates per corner, and vertex colours. Positions read back to the bit.
fn write_obj(out: &mut impl Write, mesh: &Mesh) -> std::result::Result<(), WriteError> {
    for (index, p) in mesh.positions.iter().enumerate() {
        match mesh.vertex_colors.get(index) {
            Some(c) => writeln!(out, "v {} {} {} {} {} {}", p.x, p.y, p.z, c.x, c.y, c.z)?,
            None => writeln!(out, "v {} {} {}", p.x, p.y, p.z)?,
        }
    }
    for uv in mesh.corner_uvs.iter().flatten() {
        writeln!(out, "vt {} {}", uv.x, uv.y)?;
    }
    let textured = !mesh.corner_uvs.is_empty();
    let mut triangles_of = vec![Vec::new(); mesh.objects.len()];
    for (triangle, &object) in mesh.object_of.iter().enumerate() {
        triangles_of[object as usize].push(triangle);
    }
    for (name, triangles) in mesh.objects.iter().zip(triangles_of) {
        writeln!(out, "o {}", name.replace(char::is_control, " "))?;
        for triangle in triangles {
            write!(out, "f")?;
            for (corner, vertex) in mesh.triangles[triangle].iter().enumerate() {
                match textured {
                    true => write!(out, " {}/{}", vertex + 1, 3 * triangle + corner + 1)?,
                    false => write!(out, " {}", vertex + 1)?,
                }
            }
            writeln!(out)?;
        }
    }
    Ok(())
}
