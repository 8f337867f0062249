//! A hierarchy of two children a node, for other traversals than the processor's and from other builders.

use crate::scene::bvh::binary::{Binary, Grain};
use crate::scene::bvh::build::{alone, primitives};
use crate::scene::bvh::{GROUP, binary};
use glam::Vec3;

/// A node of a [`Tree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeNode {
    /// Lowest coordinates of what lies below.
    pub low: Vec3,
    /// Highest coordinates of what lies below.
    pub high: Vec3,
    /// The first of its triangles in [`Tree::order`], or of its two children, which lie side by side.
    pub first: u32,
    /// Number of its triangles; 0 where it has children.
    pub count: u32,
}

/// A binary hierarchy over triangles. Its first node is its root; it has none where there are no triangles.
#[derive(Debug, Clone, Default)]
pub struct Tree {
    /// The nodes, children behind their parents.
    pub nodes: Vec<TreeNode>,
    /// Triangles in the order of the leaves.
    pub order: Vec<u32>,
}

impl Tree {
    /// The hierarchy over triangles by their corners, at most four in a leaf. Those with corners that are not finite are left out.
    pub fn new(corners: &[[Vec3; 3]]) -> Self {
        let mut primitives = primitives(corners.len(), |triangle| corners[triangle as usize]);
        if primitives.is_empty() {
            return Self::default();
        }
        let grain = Grain {
            alone: alone(primitives.len()),
            largest_leaf: GROUP,
        };
        let binary = binary::build(&mut primitives, grain);
        let mut tree = Self {
            nodes: Vec::with_capacity(binary.len()),
            order: primitives.iter().map(|p| p.triangle).collect(),
        };
        tree.nodes.push(node(&binary[0]));
        // Nodes whose children are still to be placed.
        let mut open = vec![(0, 0)];
        while let Some((place, index)) = open.pop() {
            let from: &Binary = &binary[index];
            if from.is_leaf() {
                continue;
            }
            let children = [index + 1, index + from.right as usize];
            let first = tree.nodes.len();
            tree.nodes[place].first = first as u32;
            tree.nodes[place].count = 0;
            tree.nodes
                .extend(children.map(|child| node(&binary[child])));
            open.push((first + 1, children[1]));
            open.push((first, children[0]));
        }
        tree
    }

    /// Inner nodes above the deepest leaf: the entries that a traversal's stack can need.
    pub fn depth(&self) -> u32 {
        let mut deepest = 0;
        let mut open = vec![(0, 0)];
        while let Some((index, above)) = open.pop() {
            let Some(node) = self.nodes.get(index as usize) else {
                continue;
            };
            deepest = deepest.max(above);
            if node.count == 0 {
                open.extend([node.first, node.first + 1].map(|child| (child, above + 1)));
            }
        }
        deepest
    }
}

/// A node as if it were a leaf.
fn node(from: &Binary) -> TreeNode {
    TreeNode {
        low: from.bounds.low.into(),
        high: from.bounds.high.into(),
        first: from.first,
        count: from.count,
    }
}
