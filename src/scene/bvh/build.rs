//! From obvhs's binary hierarchy to nodes of eight children and groups of eight triangles.

use super::{Bvh, Child, Group, InstructionSet, Node, WIDTH};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use obvhs::triangle::Triangle;
use std::time::Duration;

/// Above this many triangles the quicker of two presets is used.
const LARGE: usize = 2_000_000;

pub(super) fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> Bvh {
    // Leave out what can never be hit and would spoil the boxes.
    let corners: Vec<[Vec3; 3]> = triangles
        .iter()
        .map(|t| t.map(|i| positions[i as usize]))
        .collect();
    let (indices, primitives): (Vec<u32>, Vec<Triangle>) = corners
        .iter()
        .enumerate()
        .filter(|(_, c)| c.iter().all(|v| v.is_finite()))
        .map(|(i, c)| {
            let [v0, v1, v2] = c.map(Vec3A::from);
            (i as u32, Triangle { v0, v1, v2 })
        })
        .unzip();
    let mut bvh = Bvh {
        nodes: Vec::new(),
        groups: Vec::new(),
        stack_size: 0,
        triangles: triangles.len(),
        instructions: InstructionSet::widest(),
    };
    if primitives.is_empty() {
        return bvh;
    }
    let preset = if primitives.len() > LARGE {
        BvhBuildParams::very_fast_build()
    } else {
        BvhBuildParams::medium_build()
    };
    let binary = build_bvh2_from_tris(&primitives, preset, &mut Duration::default());
    // Boxes grow by the rounding of the largest coordinate, so that rays within their faces meet them.
    let largest = primitives
        .iter()
        .map(|t| t.v0.abs().max(t.v1.abs()).max(t.v2.abs()).max_element())
        .fold(0.0, f32::max);
    let margin = largest * 2.0 * f32::EPSILON;
    let mut layout = Layout {
        binary: &binary,
        indices: &indices,
        corners: &corners,
        margin,
        bvh: &mut bvh,
    };
    layout.run();
    bvh
}

/// The state of laying out one hierarchy.
struct Layout<'a> {
    binary: &'a Bvh2,
    /// Triangle of each primitive.
    indices: &'a [u32],
    corners: &'a [[Vec3; 3]],
    margin: f32,
    bvh: &'a mut Bvh,
}

impl Layout<'_> {
    /// Lays out all nodes, widest first, with an explicit stack: a hierarchy may be deep.
    fn run(&mut self) {
        let root = self.binary.nodes[0];
        self.bvh.nodes.push(Node::empty());
        // Binary node, index of its wide node, stack entries in use when it is visited.
        let mut open = vec![(root, 0usize, 0usize)];
        while let Some((binary, index, stacked)) = open.pop() {
            let children = self.open_children(binary);
            let stacked = stacked + children.len().saturating_sub(1);
            self.bvh.stack_size = self.bvh.stack_size.max(stacked);
            for (lane, child) in children.into_iter().enumerate() {
                let reference = if child.is_leaf() {
                    self.push_leaf(&child)
                } else {
                    self.bvh.nodes.push(Node::empty());
                    open.push((child, self.bvh.nodes.len() - 1, stacked));
                    Child::inner(self.bvh.nodes.len() - 1)
                };
                let node = &mut self.bvh.nodes[index];
                node.children[lane] = reference;
                for axis in 0..3 {
                    node.planes[2 * axis][lane] = child.aabb().min[axis] - self.margin;
                    node.planes[2 * axis + 1][lane] = child.aabb().max[axis] + self.margin;
                }
            }
        }
    }

    /// Up to eight descendants of a binary node: the child of largest surface is opened until there are eight.
    fn open_children(&self, root: Bvh2Node) -> Vec<Bvh2Node> {
        if root.is_leaf() {
            return vec![root];
        }
        let pair = |node: &Bvh2Node| {
            let first = node.first_index as usize;
            [self.binary.nodes[first], self.binary.nodes[first + 1]]
        };
        let mut children = pair(&root).to_vec();
        while children.len() < WIDTH {
            let largest = children
                .iter()
                .enumerate()
                .filter(|(_, c)| !c.is_leaf())
                .max_by(|(_, a), (_, b)| a.aabb().half_area().total_cmp(&b.aabb().half_area()))
                .map(|(i, _)| i);
            let Some(largest) = largest else { break };
            let [left, right] = pair(&children[largest]);
            children[largest] = left;
            children.push(right);
        }
        children
    }

    /// Stores a leaf's triangles in groups of eight; unused lanes repeat the last triangle.
    fn push_leaf(&mut self, leaf: &Bvh2Node) -> Child {
        let first = leaf.first_index as usize;
        let primitives = &self.binary.primitive_indices[first..first + leaf.prim_count as usize];
        let start = self.bvh.groups.len();
        for chunk in primitives.chunks(WIDTH).take(Child::MAX_GROUPS) {
            let mut group = Group {
                corners: [[[0.0; WIDTH]; 3]; 3],
                triangles: [0; WIDTH],
            };
            for lane in 0..WIDTH {
                let primitive = chunk[lane.min(chunk.len() - 1)];
                let triangle = self.indices[primitive as usize];
                group.triangles[lane] = triangle;
                for (corner, position) in self.corners[triangle as usize].iter().enumerate() {
                    for axis in 0..3 {
                        group.corners[corner][axis][lane] = position[axis];
                    }
                }
            }
            self.bvh.groups.push(group);
        }
        Child::leaf(start, self.bvh.groups.len() - start)
    }
}

impl Node {
    /// A node whose boxes no ray meets.
    fn empty() -> Self {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self {
            planes: [low, high, low, high, low, high],
            children: [Child::EMPTY; WIDTH],
        }
    }
}
