//! From the binary hierarchy to nodes of eight children and groups of four triangles.

use crate::scene::bvh::binary::{Binary, Grain, LARGEST_LEAF};
use crate::scene::bvh::pages::Pages;
use crate::scene::bvh::split::{Bounds, Primitive};
use crate::scene::bvh::{Bvh, Child, GROUP, Group, InstructionSet, Node, Tree, WIDTH, binary};
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Reverse;

/// Subtrees of more primitives than this, and than a fraction of all, are built and laid out side by side.
const ALONE: usize = 8192;
/// See [`ALONE`].
const FRACTIONS: usize = 64;

pub(super) fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> Bvh {
    let corners = |triangle: u32| triangles[triangle as usize].map(|i| positions[i as usize]);
    let mut primitives = primitives(triangles.len(), corners);
    let grain = Grain {
        alone: alone(primitives.len()),
        largest_leaf: LARGEST_LEAF,
    };
    let binary = if primitives.is_empty() {
        Vec::new()
    } else {
        binary::build(&mut primitives, grain)
    };
    lay_out(&corners, &primitives, &binary, triangles.len())
}

/// [`Bvh::from_tree`].
pub(super) fn adopt(positions: &[Vec3], triangles: &[[u32; 3]], tree: &Tree) -> Bvh {
    let corners = |triangle: u32| triangles[triangle as usize].map(|i| positions[i as usize]);
    let (primitives, binary) = binary::adopt(tree, &|t| Primitive::of(t, corners(t)));
    lay_out(&corners, &primitives, &binary, triangles.len())
}

/// The boxes of triangles, without what can never be hit and would spoil them.
pub(super) fn primitives(count: usize, corners: impl Fn(u32) -> [Vec3; 3]) -> Vec<Primitive> {
    (0..count as u32)
        .map(|triangle| (triangle, corners(triangle)))
        .filter(|(_, c)| c.iter().all(|v| v.is_finite()))
        .map(|(triangle, c)| Primitive::of(triangle, c))
        .collect()
}

/// Size from which a subtree is worth a task of its own.
pub(super) fn alone(primitives: usize) -> usize {
    ALONE.max(primitives / FRACTIONS)
}

fn lay_out<C: Fn(u32) -> [Vec3; 3] + Sync>(
    corners: &C,
    primitives: &[Primitive],
    binary: &[Binary],
    triangles: usize,
) -> Bvh {
    let mut bvh = Bvh {
        nodes: Pages::new(Vec::new()),
        groups: Pages::new(Vec::new()),
        stack_size: 0,
        triangles,
        instructions: InstructionSet::widest(),
    };
    if binary.is_empty() {
        return bvh;
    }
    // Boxes grow by the rounding of the largest coordinate, so that rays within their faces meet them.
    let bounds = binary[0].bounds;
    let largest = bounds.low.abs().max(bounds.high.abs()).max_element();
    let layout = Layout {
        corners,
        primitives,
        binary,
        margin: largest * 2.0 * f32::EPSILON,
        alone: alone(primitives.len()) as u32,
    };
    let tree = layout.subtree(0);
    bvh.nodes = Pages::new(tree.nodes);
    bvh.groups = Pages::new(tree.groups);
    bvh.stack_size = tree.stack;
    bvh
}

/// What is laid out eight wide.
struct Layout<'a, C> {
    corners: &'a C,
    primitives: &'a [Primitive],
    binary: &'a [Binary],
    margin: f32,
    alone: u32,
}

/// Nodes and groups of a subtree, counted from its own start; the first node is its root.
#[derive(Default)]
struct Subtree {
    nodes: Vec<Node>,
    groups: Vec<Group>,
    /// Entries that a traversal's stack can need.
    stack: usize,
}

impl Subtree {
    /// Appends another subtree and returns where its root is now.
    fn append(&mut self, other: Self) -> Child {
        let (nodes, groups) = (self.nodes.len(), self.groups.len());
        self.groups.extend(other.groups);
        self.nodes.extend(other.nodes.into_iter().map(|mut node| {
            for child in &mut node.rows[Node::CHILDREN] {
                *child = Child(*child).moved(nodes, groups).0;
            }
            node
        }));
        Child::inner(nodes)
    }
}

impl<C: Fn(u32) -> [Vec3; 3] + Sync> Layout<'_, C> {
    fn subtree(&self, root: usize) -> Subtree {
        let mut tree = Subtree::default();
        if self.binary[root].count <= self.alone {
            self.place(root, 0, &mut tree);
            return tree;
        }
        // Lay the children out side by side and append them in order.
        tree.nodes.push(Node::empty());
        let children = self.children(root);
        let stacked = children.len() - 1;
        let parts: Vec<Subtree> = children
            .par_iter()
            .map(|&child| self.subtree(child))
            .collect();
        for (lane, (child, part)) in children.into_iter().zip(parts).enumerate() {
            tree.stack = tree.stack.max(stacked + part.stack);
            let reference = tree.append(part);
            tree.nodes[0].set(lane, reference, &self.binary[child].bounds, self.margin);
        }
        tree
    }

    /// Adds a node for a binary one, and all below it; `stacked` stack entries are in use where it is visited.
    fn place(&self, root: usize, stacked: usize, tree: &mut Subtree) -> Child {
        let index = tree.nodes.len();
        tree.nodes.push(Node::empty());
        let children = self.children(root);
        let stacked = stacked + children.len() - 1;
        tree.stack = tree.stack.max(stacked);
        for (lane, child_index) in children.into_iter().enumerate() {
            let child = &self.binary[child_index];
            let reference = if child.is_leaf() {
                let first = child.first as usize;
                let primitives = &self.primitives[first..first + child.count as usize];
                self.leaf(primitives, &mut tree.groups)
            } else {
                self.place(child_index, stacked, tree)
            };
            tree.nodes[index].set(lane, reference, &child.bounds, self.margin);
        }
        Child::inner(index)
    }

    /// The binary nodes that become a wide one's children, those with the most triangles first.
    fn children(&self, root: usize) -> Vec<usize> {
        let mut children = binary::open(self.binary, root);
        children.sort_by_key(|&child| Reverse(self.binary[child].count));
        children
    }

    /// Stores a leaf's triangles in groups; unused lanes repeat the last triangle.
    fn leaf(&self, primitives: &[Primitive], groups: &mut Vec<Group>) -> Child {
        let start = groups.len();
        for chunk in primitives.chunks(GROUP) {
            let mut group = Group {
                corners: [[[0; GROUP]; 4]; 3],
            };
            for lane in 0..GROUP {
                let triangle = chunk[lane.min(chunk.len() - 1)].triangle;
                group.corners[0][Group::TRIANGLES][lane] = triangle;
                for (rows, position) in group.corners.iter_mut().zip((self.corners)(triangle)) {
                    for axis in 0..3 {
                        rows[axis][lane] = position[axis].to_bits();
                    }
                }
            }
            groups.push(group);
        }
        Child::leaf(start, groups.len() - start)
    }
}

impl Node {
    /// A node whose boxes no ray meets.
    fn empty() -> Self {
        let (low, high) = (
            [f32::INFINITY.to_bits(); WIDTH],
            [f32::NEG_INFINITY.to_bits(); WIDTH],
        );
        let children = [Child::EMPTY.0; WIDTH];
        Self {
            rows: [low, high, low, high, low, high, children, [0; WIDTH]],
        }
    }

    fn set(&mut self, lane: usize, child: Child, bounds: &Bounds, margin: f32) {
        self.rows[Self::CHILDREN][lane] = child.0;
        for axis in 0..3 {
            self.rows[2 * axis][lane] = (bounds.low[axis] - margin).to_bits();
            self.rows[2 * axis + 1][lane] = (bounds.high[axis] + margin).to_bits();
        }
    }
}
