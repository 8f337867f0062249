//! glTF and GLB: every node with a mesh is an object. Transforms are applied in f64; materials are not needed here.

use crate::capture::read::accessor::numbers;
use crate::capture::read::confine::Confine;
use crate::capture::read::gltf_file;
use crate::capture::read::mesh::RawMesh;
use crate::error::{Error, Result};
use ::gltf::accessor::Dimensions::{Scalar, Vec2 as Two, Vec3 as Three, Vec4 as Four};
use ::gltf::mesh::Mode;
use ::gltf::scene::Transform;
use ::gltf::{Gltf, Node, Primitive, Semantic};
use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use std::path::Path;

/// Reads the default scene (or the first, or all nodes where there is none).
///
/// # Errors
/// The file cannot be read or breaks the format, needs an extension that is not supported, names buffers outside the
/// capture's folder, or its nodes form no tree.
pub fn read(path: &Path, confine: &Confine) -> Result<RawMesh> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, &e))?;
    let broken = |problem: String| Error::file(path, problem, "export the mesh again");
    let gltf = gltf_file::parse(path, &bytes)?;
    drop(bytes);
    let buffers = gltf_file::buffers(&gltf, path, confine)?;

    let mut raw = RawMesh {
        has_objects: true,
        ..RawMesh::default()
    };
    let mut visited = vec![false; gltf.nodes().len()];
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let mut stack: Vec<(Node, DMat4)> = match &scene {
        Some(scene) => scene.nodes().map(|n| (n, DMat4::IDENTITY)).collect(),
        None => roots(&gltf).map(|n| (n, DMat4::IDENTITY)).collect(),
    };
    stack.reverse();
    while let Some((node, parent)) = stack.pop() {
        if std::mem::replace(&mut visited[node.index()], true) {
            return Err(broken(format!(
                "nodes[{}] is its own ancestor or has two parents",
                node.index()
            )));
        }
        let to_world = parent * matrix(&node.transform());
        add_node(&mut raw, &node, &to_world, &buffers).map_err(broken)?;
        let first = stack.len();
        stack.extend(node.children().map(|child| (child, to_world)));
        stack[first..].reverse();
    }
    Ok(raw)
}

/// Nodes that are nobody's child.
fn roots(gltf: &Gltf) -> impl Iterator<Item = Node<'_>> {
    let mut child = vec![false; gltf.nodes().len()];
    for node in gltf.nodes() {
        for c in node.children() {
            child[c.index()] = true;
        }
    }
    gltf.nodes().filter(move |node| !child[node.index()])
}

/// A node's transform, composed in f64.
fn matrix(transform: &Transform) -> DMat4 {
    match *transform {
        Transform::Matrix { matrix } => {
            DMat4::from_cols_array_2d(&matrix.map(|c| c.map(f64::from)))
        }
        Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => {
            let rotation = DQuat::from_array(rotation.map(f64::from));
            // A quaternion of no length turns nothing; others may be off by rounding.
            let rotation = if rotation.length() > 0.0 {
                rotation.normalize()
            } else {
                DQuat::IDENTITY
            };
            DMat4::from_scale_rotation_translation(
                DVec3::from_array(scale.map(f64::from)),
                rotation,
                DVec3::from_array(translation.map(f64::from)),
            )
        }
    }
}

/// Adds a node's mesh as an object.
fn add_node(
    raw: &mut RawMesh,
    node: &Node,
    to_world: &DMat4,
    buffers: &[Vec<u8>],
) -> std::result::Result<(), String> {
    let Some(mesh) = node.mesh() else {
        return Ok(());
    };
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

/// Adds the vertices and triangles of a primitive.
fn add_primitive(
    raw: &mut RawMesh,
    primitive: &Primitive,
    to_world: &DMat4,
    buffers: &[Vec<u8>],
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

    // Colours and texture coordinates, where this or an earlier primitive has them.
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
            values
                .chunks_exact(2)
                .map(|uv| Vec2::new(uv[0] as f32, uv[1] as f32))
                .collect()
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
    for [a, b, c] in triangles(primitive.mode(), &indices, &mut raw.warnings) {
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

/// The triangles of a list, strip or fan; points and lines are left out with a warning.
fn triangles(mode: Mode, indices: &[u32], warnings: &mut Vec<String>) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => indices
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, t)| {
                if i % 2 == 0 {
                    [t[0], t[1], t[2]]
                } else {
                    [t[0], t[2], t[1]]
                }
            })
            .collect(),
        Mode::TriangleFan => indices
            .windows(2)
            .skip(1)
            .map(|t| [indices[0], t[0], t[1]])
            .collect(),
        _ => {
            warnings.push(format!("a primitive of {mode:?} was left out"));
            Vec::new()
        }
    }
}
