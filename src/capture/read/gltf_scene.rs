//! The nodes of a glTF scene with their world transforms, and the triangles of primitives.

use crate::capture::read::gltf_file::Buffer;
use glam::{DMat4, DQuat, DVec3};
use gltf::mesh::Mode;
use gltf::scene::Transform;
use gltf::{Accessor, Gltf, Mesh, Node, Semantic};
use std::collections::BTreeMap;

/// Vertices that a scene may always have; beyond, as many as the buffers have bytes: small files could share meshes without end.
const MIN_VERTEX_LIMIT: usize = 1 << 25;

/// The nodes of the default scene (or the first, or all nodes where there is none), parents before their children, each
/// with its world transform, composed in f64.
///
/// # Errors
/// As a phrase: the nodes form no tree, or instances of meshes exceed the limit of vertices, the larger of the bytes of `buffers`
/// and [`MIN_VERTEX_LIMIT`].
pub fn nodes<'a>(gltf: &'a Gltf, buffers: &[Buffer]) -> Result<Vec<(Node<'a>, DMat4)>, String> {
    // Shared buffers count once.
    let distinct: BTreeMap<*const u8, usize> =
        buffers.iter().map(|b| (b.as_ptr(), b.len())).collect();
    let bytes: usize = distinct.values().sum();
    let limit = bytes.max(MIN_VERTEX_LIMIT);
    let mut vertices = 0_usize;
    let mut visited = vec![false; gltf.nodes().len()];
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let mut stack: Vec<(Node, DMat4)> = match &scene {
        Some(scene) => scene.nodes().map(|n| (n, DMat4::IDENTITY)).collect(),
        None => roots(gltf).map(|n| (n, DMat4::IDENTITY)).collect(),
    };
    stack.reverse();
    let mut nodes = Vec::new();
    while let Some((node, parent)) = stack.pop() {
        if std::mem::replace(&mut visited[node.index()], true) {
            return Err(format!(
                "nodes[{}] is its own ancestor or has two parents",
                node.index()
            ));
        }
        // Counts beyond the buffers' bytes are refused when the accessor is read.
        let count = |accessor: Option<Accessor>| accessor.map_or(0, |a| a.count().min(bytes));
        for primitive in node.mesh().iter().flat_map(Mesh::primitives) {
            let positions = count(primitive.get(&Semantic::Positions));
            vertices += 1 + positions.max(count(primitive.indices()));
            if vertices > limit {
                return Err(format!(
                    "its nodes instance meshes to more than {limit} vertices"
                ));
            }
        }
        let to_world = parent * matrix(&node.transform());
        let first = stack.len();
        stack.extend(node.children().map(|child| (child, to_world)));
        stack[first..].reverse();
        nodes.push((node, to_world));
    }
    Ok(nodes)
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
            // A zero quaternion is no rotation; others may be off unit length by rounding.
            let rotation = match rotation.length() > 0.0 {
                true => rotation.normalize(),
                false => DQuat::IDENTITY,
            };
            DMat4::from_scale_rotation_translation(
                DVec3::from_array(scale.map(f64::from)),
                rotation,
                DVec3::from_array(translation.map(f64::from)),
            )
        }
    }
}

/// The triangles of a list, strip or fan, all with the same winding; `None` for points and lines.
pub fn triangles(mode: Mode, indices: &[u32]) -> Option<Vec<[u32; 3]>> {
    let triangles = match mode {
        Mode::Triangles => (indices.chunks_exact(3))
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
        Mode::TriangleStrip => (indices.windows(3).enumerate())
            .map(|(i, t)| match i % 2 {
                0 => [t[0], t[1], t[2]],
                _ => [t[0], t[2], t[1]],
            })
            .collect(),
        Mode::TriangleFan => (indices.windows(2).skip(1))
            .map(|t| [indices[0], t[0], t[1]])
            .collect(),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => return None,
    };
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_are_lists_with_the_same_winding() {
        let unrolled = |mode, indices: &[u32]| triangles(mode, indices).expect("triangles");
        let list = unrolled(Mode::Triangles, &[0, 1, 2, 2, 1, 3, 9, 9]);
        assert_eq!(list, [[0, 1, 2], [2, 1, 3]]);
        let strip = unrolled(Mode::TriangleStrip, &[0, 1, 2, 3, 4]);
        assert_eq!(strip, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        let fan = unrolled(Mode::TriangleFan, &[7, 1, 2, 3]);
        assert_eq!(fan, [[7, 1, 2], [7, 2, 3]]);
        for mode in [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan] {
            assert!(unrolled(mode, &[]).is_empty() && unrolled(mode, &[1, 2]).is_empty());
        }
        assert_eq!(triangles(Mode::LineStrip, &[0, 1, 2]), None);
    }
}
