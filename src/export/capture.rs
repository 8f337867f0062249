//! Writes a capture folder: transforms.json, mesh.obj, images, truth.json.

use crate::capture::camera::{Intrinsics, Pose};
use crate::capture::mesh::Mesh;
use crate::capture::read::CAMERAS;
use crate::capture::{Capture, Frame};
use crate::error::Result;
use crate::export::atomic::{WriteError, write_atomically, write_bytes};
use crate::export::exr::{Precision, write_rgb};
use crate::export::resample::write_photograph;
use crate::math::picture::Picture;
use glam::{DMat4, DVec3};
use serde::Serialize;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;

/// Writes a capture: photographs as [`write_photograph`] writes them. A folder that has transforms.json is complete.
///
/// # Errors
/// A photograph cannot be read or a file cannot be written.
pub fn write(folder: &Path, capture: &Capture) -> Result<()> {
    write_mesh(folder, &capture.mesh)?;
    let entry = |(index, frame): (usize, &Frame)| {
        let name = image_name(index);
        let ending = write_photograph(&folder.join(&name), &*frame.load()?)?;
        let file_path = format!("{name}.{ending}");
        Ok(Entry::new(file_path, frame.intrinsics, frame.pose))
    };
    let entries: Result<Vec<Entry>> = capture.frames.iter().enumerate().map(entry).collect();
    write_entries(folder, &entries?, "mesh.obj", Some(capture.up))
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
    let entry = |(index, (intrinsics, pose))| {
        Entry::new(format!("{}.exr", image_name(index)), intrinsics, pose)
    };
    let entries: Vec<Entry> = cameras.enumerate().map(entry).collect();
    write_entries(folder, &entries, "mesh.obj", Some(up))
}

/// Writes transforms.json.
///
/// # Errors
/// The file cannot be written.
pub fn write_entries(
    folder: &Path,
    entries: &[Entry],
    mesh_path: &str,
    up: Option<DVec3>,
) -> Result<()> {
    let text = format!("{:#}\n", transforms(entries, mesh_path, up));
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

/// Name of a photograph without its extension.
fn image_name(index: usize) -> String {
    format!("images/{index:03}")
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

impl Entry {
    /// A photograph without depth, of unknown exposure.
    pub fn new(file_path: String, intrinsics: Intrinsics, pose: Pose) -> Self {
        Self {
            file_path,
            intrinsics,
            pose,
            exposure: None,
            depth: None,
        }
    }
}

/// The content of transforms.json. Numbers are written so that they read back to the bit.
fn transforms(entries: &[Entry], mesh_path: &str, up: Option<DVec3>) -> Value {
    let shared = entries.first().map(|entry| entry.intrinsics);
    let mut file = json!({"camera_model": "OPENCV", "mesh_path": mesh_path});
    if let Some(shared) = &shared {
        add_lens(&mut file, shared);
    }
    if let Some(up) = up {
        file["up"] = json!(up.to_array());
    }
    let frame = |frame: &Entry| {
        let matrix = DMat4::from_mat3_translation(frame.pose.rotation, frame.pose.center);
        let rows = matrix.transpose().to_cols_array_2d();
        let mut entry = json!({"file_path": frame.file_path, "transform_matrix": rows});
        if Some(frame.intrinsics) != shared {
            add_lens(&mut entry, &frame.intrinsics);
        }
        if let Some(exposure) = frame.exposure {
            entry["exposure"] = json!(exposure);
        }
        if let Some((path, unit)) = &frame.depth {
            entry["depth_file_path"] = json!(path);
            entry["depth_unit_scale_factor"] = json!(unit);
        }
        entry
    };
    file["frames"] = entries.iter().map(frame).collect();
    file
}

fn add_lens(fields: &mut Value, k: &Intrinsics) {
    fields["w"] = json!(k.width);
    fields["h"] = json!(k.height);
    let names = ["fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"];
    let lens = [k.fx, k.fy, k.cx, k.cy].into_iter().chain(k.distortion);
    for (name, value) in names.into_iter().zip(lens) {
        fields[name] = json!(value);
    }
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
