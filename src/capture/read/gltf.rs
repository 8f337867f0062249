//! Reads glTF and GLB: every node with a mesh becomes an object. Transforms are applied in f64; materials are ignored.

use crate::capture::read::RawMesh;
use crate::capture::read::confine::Confine;
use crate::capture::read::gltf_file::{self, Buffer, numbers};
use crate::capture::read::gltf_scene;
use crate::error::{Error, Result};
use ::gltf::accessor::Dimensions::{Scalar, Vec2 as Two, Vec3 as Three, Vec4 as Four};
use ::gltf::{Node, Primitive, Semantic};
use glam::{DMat4, DVec2, DVec3, Vec2, Vec3};
use std::path::Path;

/// Reads the default scene (or the first, or all nodes where there is none).
pub fn read(path: &Path, confine: &Confine) -> Result<RawMesh> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, &e))?;
    let broken = |problem: String| Error::file(path, problem, "export the mesh again");
    let gltf = gltf_file::parse(path, &bytes)?;
    drop(bytes);
    let folder = path.parent().unwrap_or(Path::new("."));
    let buffers = gltf_file::buffers(&gltf, path, &|place, name| {
        let file = confine.file_from(folder, place, name)?;
        std::fs::read(&file).map_err(|e| Error::io(&file, &e))
    })?;

    let mut raw = RawMesh {
        has_objects: true,
        ..RawMesh::default()
    };
    for (node, to_world) in gltf_scene::nodes(&gltf, &buffers).map_err(broken)? {
        add_node(&mut raw, &node, &to_world, &buffers).map_err(broken)?;
    }
    Ok(raw)
}

fn add_node(
    raw: &mut RawMesh,
    node: &Node,
    to_world: &DMat4,
    buffers: &[Buffer],
) -> std::result::Result<(), String> {
    let Some(mesh) = node.mesh() else {
        return Ok(());
    };
    if node.skin().is_some() {
        raw.warnings.push(format!(
            "nodes[{}] has a skin, which is not applied: it is taken as its mesh was modelled",
            node.index()
        ));
    }
    let object = raw.mesh.objects.len() as u32;
    let before = raw.mesh.triangles.len();
    for primitive in mesh.primitives() {
        if let Err(problem) = add_primitive(raw, &primitive, to_world, buffers) {
            return Err(format!("meshes[{}]: {problem}", mesh.index()));
        }
    }
    if raw.mesh.triangles.len() == before {
        return Ok(());
    }
    raw.mesh.object_of.resize(raw.mesh.triangles.len(), object);
    let name = node.name().or(mesh.name()).unwrap_or_default();
    raw.mesh.objects.push(match name {
        "" => format!("node {}", node.index()),
        name => name.to_owned(),
    });
    Ok(())
}

fn add_primitive(
    raw: &mut RawMesh,
    primitive: &Primitive,
    to_world: &DMat4,
    buffers: &[Buffer],
) -> std::result::Result<(), String> {
    let mesh = &mut raw.mesh;
    let Some(accessor) = primitive.get(&Semantic::Positions) else {
        return Ok(());
    };
    let (positions, _) = numbers(&accessor, buffers, &[Three])?;
    let first = u32::try_from(mesh.positions.len()).map_err(|_| "more than 2³² vertices")?;
    let scale = to_world.x_axis.length().max(to_world.y_axis.length());
    for p in positions.chunks_exact(3).map(DVec3::from_slice) {
        let rounding = p.abs().max_element() * scale * f64::from(f32::EPSILON) * 0.25;
        raw.rounding = raw.rounding.max(rounding);
        mesh.positions.push(to_world.transform_point3(p));
    }
    let count = mesh.positions.len() as u32 - first;

    // All attributes must have as many elements as the positions.
    for semantic in [Semantic::Colors(0), Semantic::TexCoords(0)] {
        if let Some(other) = primitive.get(&semantic)
            && other.count() != accessor.count()
        {
            let [found, wanted] = [other.count(), accessor.count()];
            return Err(format!("{found} of {semantic:?} for {wanted} positions"));
        }
    }

    // Colours and texture coordinates, if this or an earlier primitive has them; missing ones are white and zero.
    let colors = match primitive.get(&Semantic::Colors(0)) {
        Some(accessor) => {
            let (values, components) = numbers(&accessor, buffers, &[Three, Four])?;
            let color = |c: &[f64]| DVec3::from_slice(c).as_vec3();
            values.chunks_exact(components).map(color).collect()
        }
        None => Vec::new(),
    };
    if !colors.is_empty() || !mesh.vertex_colors.is_empty() {
        mesh.vertex_colors.resize(first as usize, Vec3::ONE);
        mesh.vertex_colors.extend(colors);
        mesh.vertex_colors.resize(mesh.positions.len(), Vec3::ONE);
    }
    let uvs: Vec<Vec2> = match primitive.get(&Semantic::TexCoords(0)) {
        Some(accessor) => {
            let (values, _) = numbers(&accessor, buffers, &[Two])?;
            let uv = |uv: &[f64]| DVec2::from_slice(uv).as_vec2();
            values.chunks_exact(2).map(uv).collect()
        }
        None => Vec::new(),
    };

    let indices: Vec<u32> = match primitive.indices() {
        Some(accessor) => {
            let (values, _) = numbers(&accessor, buffers, &[Scalar])?;
            if let Some(bad) = values.iter().find(|&&i| i < 0.0 || i >= f64::from(count)) {
                return Err(format!("an index {bad} is beyond its {count} vertices"));
            }
            values.iter().map(|&i| i as u32).collect()
        }
        None => (0..count).collect(),
    };
    let mirrored = to_world.determinant() < 0.0;
    let before = mesh.triangles.len();
    let triangles = gltf_scene::triangles(primitive.mode(), &indices);
    if triangles.is_none() {
        let mode = primitive.mode();
        raw.warnings
            .push(format!("a primitive of {mode:?} was left out"));
    }
    for [a, b, c] in triangles.unwrap_or_default() {
        let local = if mirrored { [a, c, b] } else { [a, b, c] };
        if !uvs.is_empty() || !mesh.corner_uvs.is_empty() {
            mesh.corner_uvs
                .resize(mesh.triangles.len(), [Vec2::ZERO; 3]);
            let uv = |i: u32| uvs.get(i as usize).copied().unwrap_or_default();
            mesh.corner_uvs.push(local.map(uv));
        }
        mesh.triangles.push(local.map(|i| first + i));
    }
    if mesh.triangles.len() == before {
        mesh.positions.truncate(first as usize);
        mesh.vertex_colors.truncate(first as usize);
    }
    Ok(())
}
