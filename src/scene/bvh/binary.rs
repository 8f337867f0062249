//! Builds a binary hierarchy top-down by the surface area heuristic, and collapses it optimally to eight children per node.

use crate::scene::bvh::build::Tree;
use crate::scene::bvh::split::{Bounds, Primitive, split};
use crate::scene::bvh::{GROUP, WIDTH};

/// Leaves hold at most this many triangles.
pub(super) const MAX_LEAF: usize = 4 * GROUP;

/// A node of the binary hierarchy; the left child follows it in the list.
pub(super) struct Binary {
    pub bounds: Bounds,
    pub first: u32,
    pub count: u32,
    /// Offset from this node to its right child; zero for a leaf.
    pub right: u32,
    /// Minimum cost of the subtree as at most 1, 2, … 7 children of a wide node (Ylitie, Karras and Laine 2017).
    costs: [f32; WIDTH - 1],
}

impl Binary {
    fn leaf(bounds: Bounds, first: usize, count: usize) -> Self {
        Self {
            bounds,
            first: first as u32,
            count: count as u32,
            right: 0,
            costs: [bounds.half_area() * count.div_ceil(GROUP) as f32; WIDTH - 1],
        }
    }

    pub fn is_leaf(&self) -> bool {
        self.right == 0
    }
}

/// Subtrees with more primitives than this, and than 1 / [`TASKS`] of all, are built and laid out in parallel.
const MIN_PARALLEL: usize = 8192;
const TASKS: usize = 64;

/// Number of primitives above which a subtree is a parallel task.
pub(super) fn parallel_above(primitives: usize) -> usize {
    MIN_PARALLEL.max(primitives / TASKS)
}

/// Builds the hierarchy over primitives and reorders them. Leaves hold at most `max_leaf` triangles, or one group.
pub(super) fn build(primitives: &mut [Primitive], max_leaf: usize) -> Vec<Binary> {
    let mut nodes = Vec::new();
    if !primitives.is_empty() {
        let parallel_above = parallel_above(primitives.len());
        grow(primitives, 0, parallel_above, max_leaf, &mut nodes);
    }
    nodes
}

/// Appends the subtree of primitives from `first` on; those of more than `parallel_above` grow in parallel.
fn grow(
    primitives: &mut [Primitive],
    first: usize,
    parallel_above: usize,
    max_leaf: usize,
    nodes: &mut Vec<Binary>,
) {
    let bounds = Bounds::of(primitives);
    let count = primitives.len();
    let node = nodes.len();
    nodes.push(Binary::leaf(bounds, first, count));
    if count <= GROUP {
        return;
    }
    let middle = split(primitives);
    let (left, right) = primitives.split_at_mut(middle);
    let second = if count > parallel_above {
        let grown = |primitives: &mut [Primitive], first: usize| {
            let mut nodes = Vec::new();
            grow(primitives, first, parallel_above, max_leaf, &mut nodes);
            nodes
        };
        let (left, right) = rayon::join(|| grown(left, first), || grown(right, first + middle));
        nodes.extend(left);
        let second = nodes.len();
        nodes.extend(right);
        second
    } else {
        grow(left, first, parallel_above, max_leaf, nodes);
        let second = nodes.len();
        grow(right, first + middle, parallel_above, max_leaf, nodes);
        second
    };

    make_inner_if_cheaper(node, second, max_leaf, nodes);
}

/// Turns a node from a leaf into an inner node if that costs less; `second` is its right child.
fn make_inner_if_cheaper(node: usize, second: usize, max_leaf: usize, nodes: &mut [Binary]) {
    let (half_area, leaf) = (nodes[node].bounds.half_area(), nodes[node].costs[0]);
    // Visiting a node costs as much as testing a group.
    let cost = |slots: usize| best_split(&nodes[node + 1], &nodes[second], slots).1;
    let inner = half_area + cost(WIDTH);
    if nodes[node].count as usize <= max_leaf && leaf <= inner {
        return;
    }
    let mut costs = [inner; WIDTH - 1];
    for slots in 2..WIDTH {
        costs[slots - 1] = costs[slots - 2].min(cost(slots));
    }
    nodes[node].right = (second - node) as u32;
    nodes[node].costs = costs;
}

/// Converts another builder's tree, with the primitives in the order of its leaves; `primitive` gives the primitive of a triangle.
pub(super) fn from_tree(
    tree: &Tree,
    primitive: &impl Fn(u32) -> Primitive,
) -> (Vec<Primitive>, Vec<Binary>) {
    let (mut primitives, mut nodes) = (Vec::new(), Vec::new());
    if !tree.nodes.is_empty() {
        convert(tree, 0, primitive, &mut primitives, &mut nodes);
    }
    (primitives, nodes)
}

fn convert(
    tree: &Tree,
    index: usize,
    primitive: &impl Fn(u32) -> Primitive,
    primitives: &mut Vec<Primitive>,
    nodes: &mut Vec<Binary>,
) {
    let from = &tree.nodes[index];
    let bounds = Bounds {
        low: from.low.into(),
        high: from.high.into(),
    };
    let (node, first) = (nodes.len(), primitives.len());
    let below = from.first as usize;
    if from.count > 0 {
        let triangles = &tree.order[below..below + from.count as usize];
        primitives.extend(triangles.iter().map(|&t| primitive(t)));
        nodes.push(Binary::leaf(bounds, first, primitives.len() - first));
        return;
    }
    nodes.push(Binary::leaf(bounds, first, 0));
    convert(tree, below, primitive, primitives, nodes);
    let second = nodes.len();
    convert(tree, below + 1, primitive, primitives, nodes);
    let count = primitives.len() - first;
    nodes[node] = Binary::leaf(bounds, first, count);
    if count > GROUP {
        make_inner_if_cheaper(node, second, MAX_LEAF, nodes);
    } else {
        nodes.truncate(node + 1);
    }
}

/// The number of slots for the left child at minimum cost, and the cost.
fn best_split(left: &Binary, right: &Binary, slots: usize) -> (usize, f32) {
    (1..slots)
        .map(|left_slots| {
            let cost = left.costs[left_slots - 1] + right.costs[slots - left_slots - 1];
            (left_slots, cost)
        })
        .fold((1, f32::INFINITY), |best, next| {
            if next.1 < best.1 { next } else { best }
        })
}

/// The at most eight children of the wide node that replaces a binary one, at minimum cost.
pub(super) fn wide_children(nodes: &[Binary], node: usize) -> Vec<usize> {
    let mut children = Vec::with_capacity(WIDTH);
    if nodes[node].is_leaf() {
        children.push(node);
    } else {
        split_slots(nodes, node, WIDTH, &mut children);
    }
    children
}

fn split_slots(nodes: &[Binary], node: usize, slots: usize, children: &mut Vec<usize>) {
    let (left, right) = (node + 1, node + nodes[node].right as usize);
    let (first, _) = best_split(&nodes[left], &nodes[right], slots);
    for (child, mut slots) in [(left, first), (right, slots - first)] {
        // Leave slots empty that do not lower the cost.
        let costs = &nodes[child].costs;
        while slots > 1 && costs[slots - 2] <= costs[slots - 1] {
            slots -= 1;
        }
        if slots == 1 {
            children.push(child);
        } else {
            split_slots(nodes, child, slots, children);
        }
    }
}
