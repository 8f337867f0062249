//! Reads Wavefront OBJ with tobj: every `o` or `g` is an object; equal names are one object. Material files are not opened.

use crate::capture::read::RawMesh;
use crate::capture::read::fields::without_bom;
use crate::error::{Error, Result};
use crate::say::listed;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::collections::HashMap;
use std::path::Path;

/// The name tobj gives to faces before the first `o` or `g`.
const UNNAMED: &str = "unnamed_object";

/// Reads an OBJ file; polygons become fans of triangles.
pub fn read(path: &Path) -> Result<RawMesh> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, &e))?;
    // Tolerate comments and names in other encodings than UTF-8.
    let text = String::from_utf8_lossy(without_bom(&bytes));
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let mut rest = text.as_bytes();
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut rest, &options, no_materials).map_err(|e| {
        let read = &text.as_bytes()[..text.len() - rest.len()];
        let line = read.iter().filter(|&&byte| byte == b'\n').count();
        let problem = match e {
            tobj::LoadError::FaceVertexOutOfBounds
            | tobj::LoadError::FaceTexCoordOutOfBounds
            | tobj::LoadError::FaceNormalOutOfBounds
            | tobj::LoadError::FaceColorOutOfBounds => {
                format!("{e}, in the object that ends before line {line}")
            }
            _ => format!("line {line}: {e}"),
        };
        Error::file(path, problem, "repair the mesh")
    })?;

    let mut raw = RawMesh::default();
    let mesh = &mut raw.mesh;
    let colored = models.iter().any(|m| !m.mesh.vertex_color.is_empty());
    let textured = models.iter().any(|m| !m.mesh.texcoords.is_empty());
    let mut objects = HashMap::new();
    let mut repeated: Vec<String> = Vec::new();
    for model in models {
        let part = model.mesh;
        if part.indices.is_empty() {
            continue;
        }
        let first = u32::try_from(mesh.positions.len()).map_err(|_| too_large(path))?;
        let known = objects.get(&model.name).copied();
        let object = known.unwrap_or(mesh.objects.len() as u32);
        if known.is_none() {
            objects.insert(model.name.clone(), object);
            mesh.objects.push(model.name);
        } else if !repeated.contains(&model.name) {
            repeated.push(model.name);
        }
        mesh.positions
            .extend(part.positions.chunks_exact(3).map(DVec3::from_slice));
        if u32::try_from(mesh.positions.len()).is_err() {
            return Err(too_large(path));
        }
        let corners = |indices: &[u32]| [indices[0], indices[1], indices[2]];
        let triangles = part.indices.chunks_exact(3).map(corners);
        mesh.triangles
            .extend(triangles.map(|t| t.map(|i| first + i)));
        mesh.object_of.resize(mesh.triangles.len(), object);
        if colored {
            let color = |c: &[f64]| DVec3::from_slice(c).as_vec3();
            mesh.vertex_colors
                .extend(part.vertex_color.chunks_exact(3).map(color));
            mesh.vertex_colors.resize(mesh.positions.len(), Vec3::ONE);
        }
        if textured {
            let uvs: Vec<Vec2> = (part.texcoords.chunks_exact(2))
                .map(|uv| DVec2::from_slice(uv).as_vec2())
                .collect();
            let uv = |i: u32| uvs.get(i as usize).copied().unwrap_or_default();
            let corners = part.texcoord_indices.chunks_exact(3).map(corners);
            mesh.corner_uvs.extend(corners.map(|t| t.map(uv)));
            mesh.corner_uvs
                .resize(mesh.triangles.len(), [Vec2::ZERO; 3]);
        }
    }
    if !repeated.is_empty() {
        raw.warnings.push(format!(
            "{} repeated and taken as one object each: {}; rename them to keep them apart",
            match repeated.len() {
                1 => "one name is".to_owned(),
                n => format!("{n} names are"),
            },
            listed(&repeated)
        ));
    }
    raw.has_objects = mesh.objects.iter().any(|name| name != UNNAMED);
    Ok(raw)
}

fn too_large(path: &Path) -> Error {
    Error::file(path, "has more than 2³² vertices", "make the mesh smaller")
}
