//! Binary PLY with vertex colours.

use crate::capture::mesh::Mesh;
use crate::error::Result;
use crate::export::atomic::write_atomically;
use crate::export::part::Part;
use glam::{DVec3, Vec3};
use std::fmt::Display;
use std::io::Write;
use std::path::Path;

/// How every file begins.
const FORMAT: &str = "ply\nformat binary_little_endian 1.0";
const COLORS: [&str; 3] = ["red", "green", "blue"];
const CORNERS: &str = "property list uchar int vertex_indices";
const OBJECT_ID: &str = "property int object_id";

/// Writes all parts as one mesh: positions, albedo as linear 8-bit `red green blue`, and for each face its emission and
/// `object_id`, whose names are in the comments. [`crate::capture::read`] reads it back.
///
/// # Errors
/// The file cannot be written.
pub fn write_scene(path: &Path, parts: &[Part]) -> Result<()> {
    let vertices: usize = parts.iter().map(|p| p.positions.len()).sum();
    let faces: usize = parts.iter().map(|p| p.triangles.len()).sum();
    write_atomically(path, |out| {
        writeln!(out, "{FORMAT}")?;
        for (index, part) in parts.iter().enumerate() {
            let name = part.name.replace(char::is_control, "");
            writeln!(out, "comment object_id {index} {name}")?;
        }
        writeln!(out, "element vertex {vertices}")?;
        properties(out, "double", ["x", "y", "z"])?;
        properties(out, "uchar", COLORS)?;
        writeln!(out, "element face {faces}\n{CORNERS}\n{OBJECT_ID}")?;
        let emission = COLORS.map(|color| format!("emission_{color}"));
        properties(out, "float", emission)?;
        writeln!(out, "end_header")?;

        for part in parts {
            for (vertex, position) in part.positions.iter().enumerate() {
                let albedo = part.colors.get(vertex).unwrap_or(&part.estimate.albedo);
                write_position(out, *position)?;
                let linear8 = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
                out.write_all(&albedo.to_array().map(linear8))?;
            }
        }
        let mut first = 0;
        for (index, part) in parts.iter().enumerate() {
            for triangle in &part.triangles {
                write_face(out, triangle.map(|i| i + first))?;
                out.write_all(&(index as i32).to_le_bytes())?;
                write_color(out, part.estimate.emission)?;
            }
            first += part.positions.len() as u32;
        }
        Ok(())
    })
}

/// Writes one part, with linear vertex colours `r g b` where its albedo varies, as Mitsuba's mesh attributes require.
///
/// # Errors
/// The file cannot be written.
pub fn write_part(path: &Path, part: &Part) -> Result<()> {
    write_atomically(path, |out| {
        writeln!(out, "{FORMAT}\nelement vertex {}", part.positions.len())?;
        properties(out, "float", ["x", "y", "z"])?;
        if !part.colors.is_empty() {
            properties(out, "float", ["r", "g", "b"])?;
        }
        let faces = part.triangles.len();
        writeln!(out, "element face {faces}\n{CORNERS}\nend_header")?;
        for (vertex, position) in part.positions.iter().enumerate() {
            write_color(out, position.as_vec3())?;
            if let Some(&color) = part.colors.get(vertex) {
                write_color(out, color)?;
            }
        }
        for &triangle in &part.triangles {
            write_face(out, triangle)?;
        }
        Ok(())
    })
}

/// Writes a mesh: positions in double precision, linear vertex colours as floats, texture coordinates per corner, and, if
/// `with_objects`, each face's `object_id` with the names in comments. [`crate::capture::read`] reads it back.
///
/// # Errors
/// The file cannot be written.
pub fn write_mesh(path: &Path, mesh: &Mesh, with_objects: bool) -> Result<()> {
    let colored = mesh.vertex_colors.len() == mesh.positions.len();
    let textured = mesh.corner_uvs.len() == mesh.triangles.len();
    write_atomically(path, |out| {
        writeln!(out, "{FORMAT}")?;
        if with_objects {
            for (index, name) in mesh.objects.iter().enumerate() {
                let name = name.replace(char::is_control, " ");
                writeln!(out, "comment object_id {index} {name}")?;
            }
        }
        writeln!(out, "element vertex {}", mesh.positions.len())?;
        properties(out, "double", ["x", "y", "z"])?;
        if colored {
            properties(out, "float", COLORS)?;
        }
        writeln!(out, "element face {}\n{CORNERS}", mesh.triangles.len())?;
        if textured {
            writeln!(out, "property list uchar float texcoord")?;
        }
        if with_objects {
            writeln!(out, "{OBJECT_ID}")?;
        }
        writeln!(out, "end_header")?;
        for (index, position) in mesh.positions.iter().enumerate() {
            write_position(out, *position)?;
            if colored {
                write_color(out, mesh.vertex_colors[index])?;
            }
        }
        for (index, &triangle) in mesh.triangles.iter().enumerate() {
            write_face(out, triangle)?;
            if textured {
                out.write_all(&[6])?;
                for v in mesh.corner_uvs[index].iter().flat_map(|uv| uv.to_array()) {
                    out.write_all(&v.to_le_bytes())?;
                }
            }
            if with_objects {
                out.write_all(&mesh.object_of[index].to_le_bytes())?;
            }
        }
        Ok(())
    })
}

fn properties(out: &mut impl Write, kind: &str, names: [impl Display; 3]) -> std::io::Result<()> {
    (names.into_iter()).try_for_each(|name| writeln!(out, "property {kind} {name}"))
}

fn write_position(out: &mut impl Write, position: DVec3) -> std::io::Result<()> {
    out.write_all(position.to_array().map(f64::to_le_bytes).as_flattened())
}

fn write_color(out: &mut impl Write, color: Vec3) -> std::io::Result<()> {
    out.write_all(color.to_array().map(f32::to_le_bytes).as_flattened())
}

fn write_face(out: &mut impl Write, corners: [u32; 3]) -> std::io::Result<()> {
    out.write_all(&[3])?;
    out.write_all(corners.map(u32::to_le_bytes).as_flattened())
}
