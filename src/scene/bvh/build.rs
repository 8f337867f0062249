//! Lays out the binary hierarchy as nodes of eight children and groups of four triangles.

use crate::scene::bvh::binary::{Binary, MAX_LEAF, parallel_above};
use crate::scene::bvh::pages::Pages;
use crate::scene::bvh::split::{Bounds, Primitive};
use crate::scene::bvh::{Bvh, Child, GROUP, Group, InstructionSet, Node, WIDTH, binary};
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Reverse;

impl Bvh {
    /// Builds the hierarchy of a mesh. Triangles with non-finite corners are never hit.
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let corners = |triangle: u32| triangles[triangle as usize].map(|i| positions[i as usize]);
        let mut primitives = primitives(triangles.len(), corners);
        let binary = binary::build(&mut primitives, MAX_LEAF);
        lay_out(&corners, &primitives, &binary, triangles.len())
    }

    /// The hierarchy of a mesh from another builder's binary tree, collapsed at minimum cost. A triangle may be in several leaves.
    pub fn from_tree(positions: &[Vec3], triangles: &[[u32; 3]], tree: &Tree) -> Self {
        let corners = |triangle: u32| triangles[triangle as usize].map(|i| positions[i as usize]);
        let (primitives, binary) = binary::from_tree(tree, &|t| Primitive::of(t, corners(t)));
        lay_out(&corners, &primitives, &binary, triangles.len())
    }
}

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

/// A binary hierarchy over triangles, to exchange with the graphics card and with other builders. The first node is the root; without
/// triangles there are no nodes.
#[derive(Debug, Clone, Default)]
pub struct Tree {
    /// The nodes, children after parents.
    pub nodes: Vec<TreeNode>,
    /// Triangles in the order of the leaves.
    pub order: Vec<u32>,
}

impl Tree {
    /// Builds the hierarchy over triangles, with at most four per leaf. Triangles with non-finite corners are left out.
    pub fn new(corners: &[[Vec3; 3]]) -> Self {
        let mut primitives = primitives(corners.len(), |triangle| corners[triangle as usize]);
        let binary = binary::build(&mut primitives, GROUP);
        let Some(root) = binary.first() else {
            return Self::default();
        };
        let mut tree = Self {
            nodes: Vec::with_capacity(binary.len()),
            order: primitives.iter().map(|p| p.triangle).collect(),
        };
        tree.nodes.push(leaf(root));
        // (Index in the tree, index in the binary hierarchy) of nodes whose children are not placed yet.
        let mut pending = vec![(0, 0)];
        while let Some((place, index)) = pending.pop() {
            let from: &Binary = &binary[index];
            if from.is_leaf() {
                continue;
            }
            let children = [index + 1, index + from.right as usize];
            let first = tree.nodes.len();
            tree.nodes[place].first = first as u32;
            tree.nodes[place].count = 0;
            tree.nodes
                .extend(children.map(|child| leaf(&binary[child])));
            pending.push((first + 1, children[1]));
            pending.push((first, children[0]));
        }
        tree
    }

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

/// A node as a leaf over all its primitives.
fn leaf(from: &Binary) -> TreeNode {
    TreeNode {
        low: from.bounds.low.into(),
        high: from.bounds.high.into(),
        first: from.first,
        count: from.count,
    }
}

/// The bounding boxes of all triangles with finite corners.
fn primitives(count: usize, corners: impl Fn(u32) -> [Vec3; 3]) -> Vec<Primitive> {
    (0..count as u32)
        .map(|triangle| (triangle, corners(triangle)))
        .filter(|(_, c)| c.iter().all(|v| v.is_finite()))
        .map(|(triangle, c)| Primitive::of(triangle, c))
        .collect()
}

fn lay_out<C: Fn(u32) -> [Vec3; 3] + Sync>(
    corners: &C,
    primitives: &[Primitive],
    binary: &[Binary],
    triangles: usize,
) -> Bvh {
    let tree = binary.first().map_or_else(Subtree::default, |root| {
        // Enlarge boxes by the rounding error of the largest coordinate, so that rays within their faces hit them.
        let largest = root.bounds.low.abs().max(root.bounds.high.abs());
        let layout = Layout {
            corners,
            primitives,
            binary,
            margin: largest.max_element() * 2.0 * f32::EPSILON,
            parallel_above: parallel_above(primitives.len()) as u32,
        };
        layout.subtree(0)
    });
    Bvh {
        nodes: Pages::new(tree.nodes),
        groups: Pages::new(tree.groups),
        stack_size: tree.stack,
        triangles,
        instructions: InstructionSet::widest(),
    }
}

struct Layout<'a, C> {
    corners: &'a C,
    primitives: &'a [Primitive],
    binary: &'a [Binary],
    margin: f32,
    parallel_above: u32,
}

/// Nodes and groups of a subtree, with indices relative to it; the first node is its root.
#[derive(Default)]
struct Subtree {
    nodes: Vec<Node>,
    groups: Vec<Group>,
    /// Maximum number of stack entries of a traversal.
    stack: usize,
}

impl Subtree {
    /// Appends another subtree; returns the reference to its root.
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
        if self.binary[root].count <= self.parallel_above {
            self.place(root, 0, &mut tree);
            return tree;
        }
        // Lay the children out in parallel and append them in order.
        tree.nodes.push(Node::empty());
        let children = self.children(root);
        let stacked = children.len() - 1;
        let parts = children.par_iter().map(|&child| self.subtree(child));
        let parts: Vec<Subtree> = parts.collect();
        for (lane, (child, part)) in children.into_iter().zip(parts).enumerate() {
            tree.stack = tree.stack.max(stacked + part.stack);
            let reference = tree.append(part);
            tree.nodes[0].set(lane, reference, &self.binary[child].bounds, self.margin);
        }
        tree
    }

    /// Lays out a binary node and its subtree; `stacked` stack entries are in use when it is visited.
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

    /// The binary nodes that become a wide node's children, by descending number of triangles.
    fn children(&self, root: usize) -> Vec<usize> {
        let mut children = binary::wide_children(self.binary, root);
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
    /// A node whose boxes no ray hits.
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
