//! A binary hierarchy, to exchange with the graphics card and with other builders.

use glam::Vec3;

/// A node of a [`Tree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeNode {
    /// Lower corner of the bounding box.
    pub low: Vec3,
    /// Upper corner of the bounding box.
    pub high: Vec3,
    /// Leaf: index of its first triangle in [`Tree::order`]. Inner node: index of its first child; the second follows.
    pub first: u32,
    /// Number of triangles; 0 for inner nodes.
    pub count: u32,
}

/// A binary hierarchy over triangles. The first node is the root; without triangles there are no nodes.
#[derive(Debug, Clone, Default)]
pub struct Tree {
    /// The nodes, children after parents.
    pub nodes: Vec<TreeNode>,
    /// Triangles in the order of the leaves.
    pub order: Vec<u32>,
}

impl Tree {
    /// Number of inner nodes above the deepest leaf: the maximum number of stack entries of a traversal.
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
