//! The card's hierarchy: the binary one as buffers.

use crate::scene::bvh::Tree;
use glam::Vec3;

/// Nodes and the order of the triangles in their leaves.
#[derive(Debug, Default)]
pub(super) struct Hierarchy {
    /// Two entries per node: low corner and first child or triangle; high corner and number of triangles (0 in inner nodes). The
    /// second child follows the first.
    pub nodes: Vec<[u32; 4]>,
    /// Triangle indices in the order of the leaves.
    pub order: Vec<u32>,
    /// Maximum number of stack entries of a traversal.
    pub stack_size: u32,
}

impl Hierarchy {
    /// The hierarchy over triangles; those with non-finite corners are left out.
    pub fn new(corners: &[[Vec3; 3]]) -> Self {
        let tree = Tree::new(corners);
        let Some(root) = tree.nodes.first() else {
            // One box that no ray hits.
            let (low, high) = (Vec3::splat(f32::MAX), Vec3::splat(-f32::MAX));
            return Self {
                nodes: vec![word(low, 0), word(high, 1)],
                order: Vec::new(),
                stack_size: 1,
            };
        };
        // Enlarge boxes by the rounding error of the largest coordinate, so that rays within their faces hit them.
        let margin = root.low.abs().max(root.high.abs()).max_element() * 2.0 * f32::EPSILON;
        let nodes = tree.nodes.iter().flat_map(|node| {
            [
                word(node.low - margin, node.first),
                word(node.high + margin, node.count),
            ]
        });
        Self {
            nodes: nodes.collect(),
            stack_size: tree.depth().max(1),
            order: tree.order,
        }
    }
}

/// A vector and a number in one word of the shader.
pub(super) fn word(v: Vec3, w: u32) -> [u32; 4] {
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
        let hierarchy = Hierarchy::new(&corners);
        let mut seen = vec![0; corners.len()];
        let mut open = vec![0usize];
        while let Some(node) = open.pop() {
            let [low, high] = [0, 1].map(|half| hierarchy.nodes[2 * node + half]);
            let point = |e: [u32; 4]| Vec3::from_array([0, 1, 2].map(|c| f32::from_bits(e[c])));
            let first = low[3] as usize;
            if high[3] == 0 {
                open.extend([first, first + 1]);
                continue;
            }
            for slot in first..first + high[3] as usize {
                let triangle = hierarchy.order[slot] as usize;
                seen[triangle] += 1;
                for corner in corners[triangle] {
                    assert!(corner.cmpge(point(low)).all() && corner.cmple(point(high)).all());
                }
            }
        }
        assert!(seen[..500].iter().all(|&n| n == 1) && seen[500] == 0);
        assert!(hierarchy.stack_size < 40);
        assert!(Hierarchy::new(&[]).order.is_empty());
    }
}
