//! The triangles of a scene and of inserted objects on the card, in the order of their hierarchy.

use crate::error::Result;
use crate::gpu::buffers::storage;
use crate::gpu::card::Card;
use crate::gpu::layout::{NONE, TRIANGLE_WORDS, WORKGROUP};
use crate::gpu::materials::Inserted;
use crate::scene::Scene;
use crate::scene::bvh::Tree;
use glam::Vec3;

/// Stack sizes are multiples of this, so that few shaders are compiled, ...
const STACK_STEP: u32 = 16;
/// ... up to what fits the memory of a workgroup that every card has: 16,352 bytes of "downlevel" limits.
const MAX_STACK: u32 = 16_352 / (4 * WORKGROUP);

/// Triangles and their hierarchy. The materials of a scene come one per object, then those of each inserted object.
#[derive(Debug)]
pub struct Geometry {
    pub(super) nodes: wgpu::Buffer,
    pub(super) triangles: wgpu::Buffer,
    /// The place of each triangle in `triangles`; [`NONE`] for those that cannot be hit.
    pub(super) slot_of: Vec<u32>,
    /// Maximum number of stack entries of a traversal.
    pub(super) stack_size: u32,
}

impl Geometry {
    /// Builds the hierarchy and uploads both.
    ///
    /// # Errors
    /// They do not fit, or the card failed.
    pub fn new(card: &Card, scene: &Scene, objects: &[Inserted<'_>]) -> Result<Self> {
        let own = scene.triangles.len();
        let mut corners: Vec<[Vec3; 3]> = (0..own as u32).map(|t| scene.corners(t)).collect();
        let mut normals = scene.normals.clone();
        let mut material_of = scene.object_of.clone();
        let mut materials = scene.objects.len() as u32;
        for object in objects {
            corners.extend(object.corners);
            normals.extend(object.normals);
            material_of.extend(object.material_of.iter().map(|m| materials + m));
            materials += object.materials.len() as u32;
        }

        let tree = Tree::new(&corners);
        let stack_size = tree
            .depth()
            .max(1)
            .next_multiple_of(STACK_STEP)
            .min(MAX_STACK);
        if tree.depth() > MAX_STACK {
            return Err(card.failed("the scene's hierarchy is too deep".to_owned()));
        }
        let mut slot_of = vec![NONE; corners.len()];
        let mut triangles = Vec::with_capacity(TRIANGLE_WORDS * corners.len());
        for (slot, &index) in tree.order.iter().enumerate() {
            let t = index as usize;
            slot_of[t] = slot as u32;
            let [a, b, c] = corners[t];
            triangles.push(word(a, index));
            triangles.push(word(b, material_of[t]));
            triangles.push(word(c, u32::from(t >= own)));
            triangles.push(word(normals[t], 0));
        }
        Ok(Self {
            nodes: storage(card, "hierarchy", &nodes(&tree))?,
            triangles: storage(card, "triangles", &triangles)?,
            slot_of,
            stack_size,
        })
    }
}

/// The hierarchy, two entries per node: low corner and first child or triangle; high corner and number of triangles (0 in inner
/// nodes). The second child follows the first. Without triangles, one box that no ray hits.
fn nodes(tree: &Tree) -> Vec<[u32; 4]> {
    let Some(root) = tree.nodes.first() else {
        let corner = Vec3::splat(f32::MAX);
        return vec![word(corner, 0), word(corner, 1)];
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
