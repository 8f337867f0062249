//! A lit scene with inserted objects in the shader's layout: triangles in the order of the hierarchy, materials, lights.

use crate::gpu::layout::Material as Shared;
use crate::gpu::layout::{Dispatch, NONE};
use crate::gpu::lights::{emitters, environment};
use crate::gpu::materials::{Inserted, Materials};
use crate::scene::bvh::Tree;
use crate::transport::lit::LitScene;
use glam::Vec3;

/// The contents of a scene's storage buffers.
#[derive(Debug)]
pub(super) struct Packed {
    pub nodes: Vec<[u32; 4]>,
    pub triangles: Vec<[u32; 4]>,
    pub materials: Vec<Shared>,
    pub data: Vec<u32>,
    pub emitters: Vec<[u32; 4]>,
    pub environment: Vec<[u32; 4]>,
    /// Maximum number of stack entries of a traversal.
    pub stack_size: u32,
    /// The scene's part of the dispatch parameters; the rest is zero.
    pub dispatch: Dispatch,
}

impl Packed {
    pub fn new(lit: &LitScene, objects: &[Inserted<'_>]) -> Self {
        let scene = &lit.scene;
        let own = scene.triangles.len();
        let mut corners: Vec<[Vec3; 3]> = (0..own as u32).map(|t| scene.corners(t)).collect();
        let mut normals = scene.normals.clone();
        let mut material_of = scene.object_of.clone();
        let mut materials = Materials::new(lit);
        for object in objects {
            let first = materials.insert(object, corners.len() as u32);
            corners.extend(object.corners);
            normals.extend(object.normals);
            material_of.extend(object.material_of.iter().map(|m| first + m));
        }

        let tree = Tree::new(&corners);
        let mut slot_of = vec![NONE; corners.len()];
        let mut triangles = Vec::with_capacity(4 * corners.len());
        for (slot, &index) in tree.order.iter().enumerate() {
            let t = index as usize;
            slot_of[t] = slot as u32;
            let [a, b, c] = corners[t];
            triangles.push(word(a, index));
            triangles.push(word(b, material_of[t]));
            triangles.push(word(c, u32::from(t >= own)));
            triangles.push(word(normals[t], 0));
        }

        let (emitters, objects) = emitters(lit, &slot_of);
        let outside = lit.outside.as_deref();
        let [width, height] = outside.map_or([0; 2], |map| map.size().map(|n| n as u32));
        let dispatch = Dispatch {
            lights: [objects, 0, width, height],
            emitter_fraction: [lit.emitter_fraction(), 0.0, 0.0, 0.0],
            ..Dispatch::default()
        };
        Self {
            nodes: nodes(&tree),
            triangles,
            materials: materials.materials,
            data: materials.data,
            emitters,
            environment: outside.map(environment).unwrap_or_default(),
            stack_size: tree.depth().max(1),
            dispatch,
        }
    }
}

/// The hierarchy, two entries per node: low corner and first child or triangle; high corner and number of triangles (0 in inner
/// nodes). The second child follows the first. Without triangles, one box that no ray hits.
fn nodes(tree: &Tree) -> Vec<[u32; 4]> {
    let Some(root) = tree.nodes.first() else {
        let (low, high) = (Vec3::splat(f32::MAX), Vec3::splat(-f32::MAX));
        return vec![word(low, 0), word(high, 1)];
    };
    // Enlarge boxes by the rounding error of the largest coordinate, so that rays within their faces hit them.
    let margin = root.low.abs().max(root.high.abs()).max_element() * 2.0 * f32::EPSILON;
    let nodes = tree.nodes.iter().flat_map(|node| {
        [
            word(node.low - margin, node.first),
            word(node.high + margin, node.count),
        ]
    });
    nodes.collect()
}

/// A vector and a number in one word of the shader.
fn word(v: Vec3, w: u32) -> [u32; 4] {
    let [x, y, z] = v.to_array().map(f32::to_bits);
    [x, y, z, w]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_triangle_is_in_one_leaf_and_within_its_boxes() {
        let corners: Vec<[Vec3; 3]> = (0..500)
            .map(|i| {
                let x = (i as f32 * 0.618).fract() * 9.0;
                let shift = Vec3::new(x, (i % 7) as f32, (i % 11) as f32);
                [Vec3::ZERO, Vec3::X, Vec3::Y * 0.1].map(|p| p + shift)
            })
            .chain([[Vec3::NAN; 3]])
            .collect();
        let tree = Tree::new(&corners);
        let nodes = nodes(&tree);
        let mut seen = vec![0; corners.len()];
        let mut open = vec![0usize];
        while let Some(node) = open.pop() {
            let [low, high] = [0, 1].map(|half| nodes[2 * node + half]);
            let point = |e: [u32; 4]| Vec3::from_array([0, 1, 2].map(|c| f32::from_bits(e[c])));
            let first = low[3] as usize;
            if high[3] == 0 {
                open.extend([first, first + 1]);
                continue;
            }
            for slot in first..first + high[3] as usize {
                let triangle = tree.order[slot] as usize;
                seen[triangle] += 1;
                for corner in corners[triangle] {
                    assert!(corner.cmpge(point(low)).all() && corner.cmple(point(high)).all());
                }
            }
        }
        assert!(seen[..500].iter().all(|&n| n == 1) && seen[500] == 0);
        assert!(tree.depth() < 40);
        assert!(Tree::new(&[]).order.is_empty());
    }
}
