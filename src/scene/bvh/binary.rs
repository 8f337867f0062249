//! A binary hierarchy, top-down by the surface area heuristic, and the cheapest way to open it eight wide.

use crate::scene::bvh::split::{Bounds, Primitive, Split};
use crate::scene::bvh::{GROUP, Tree, WIDTH};

/// Leaves hold at most this many triangles.
pub(super) const LARGEST_LEAF: usize = 4 * GROUP;

/// A node of the binary hierarchy; the left child follows it in the list.
pub(super) struct Binary {
    pub bounds: Bounds,
    /// The first of its primitives.
    pub first: u32,
    /// How many primitives lie below.
    pub count: u32,
    /// How far behind this node the right child is; zero for a leaf.
    pub right: u32,
    /// Least cost of the subtree as at most 1, 2, … 7 children of a wide node (Ylitie, Karras and Laine 2017).
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

/// How far a hierarchy is built.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grain {
    /// Ranges of more primitives are built side by side.
    pub alone: usize,
    /// Leaves hold at most this many triangles, or one group.
    pub largest_leaf: usize,
}

/// The hierarchy over primitives, which it reorders.
pub(super) fn build(primitives: &mut [Primitive], grain: Grain) -> Vec<Binary> {
    let mut nodes = Vec::new();
    grow(primitives, 0, grain, &mut nodes);
    nodes
}

fn grow(primitives: &mut [Primitive], first: usize, grain: Grain, nodes: &mut Vec<Binary>) {
    let bounds = Bounds::of(primitives);
    let count = primitives.len();
    let node = nodes.len();
    nodes.push(Binary::leaf(bounds, first, count));
    if count <= GROUP {
        return;
    }
    let middle = Split::best(primitives).partition(primitives);
    let (left, right) = primitives.split_at_mut(middle);
    let second = if count > grain.alone {
        let (left, right) = rayon::join(
            || {
                let mut nodes = Vec::new();
                grow(left, first, grain, &mut nodes);
                nodes
            },
            || {
                let mut nodes = Vec::new();
                grow(right, first + middle, grain, &mut nodes);
                nodes
            },
        );
        nodes.extend(left);
        let second = nodes.len();
        nodes.extend(right);
        second
    } else {
        grow(left, first, grain, nodes);
        let second = nodes.len();
        grow(right, first + middle, grain, nodes);
        second
    };

    join(node, second, grain.largest_leaf, nodes);
}

/// Makes a node that was added as a leaf an inner one, where its children, the second of them at `second`, cost less.
fn join(node: usize, second: usize, largest_leaf: usize, nodes: &mut [Binary]) {
    let (half_area, leaf) = (nodes[node].bounds.half_area(), nodes[node].costs[0]);
    // Visiting a node costs as much as testing a group.
    let cost = |slots: usize| best_split(&nodes[node + 1], &nodes[second], slots).1;
    let inner = half_area + cost(WIDTH);
    if nodes[node].count as usize <= largest_leaf && leaf <= inner {
        return;
    }
    let mut costs = [inner; WIDTH - 1];
    for slots in 2..WIDTH {
        costs[slots - 1] = costs[slots - 2].min(cost(slots));
    }
    nodes[node].right = (second - node) as u32;
    nodes[node].costs = costs;
}

/// The same from another builder's tree, with the primitives in the order of its leaves; `boxed` is a triangle as a primitive.
pub(super) fn adopt(
    tree: &Tree,
    boxed: &impl Fn(u32) -> Primitive,
) -> (Vec<Primitive>, Vec<Binary>) {
    let (mut primitives, mut nodes) = (Vec::new(), Vec::new());
    if !tree.nodes.is_empty() {
        take(tree, 0, boxed, &mut primitives, &mut nodes);
    }
    (primitives, nodes)
}

fn take(
    tree: &Tree,
    index: usize,
    boxed: &impl Fn(u32) -> Primitive,
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
        primitives.extend(triangles.iter().map(|&t| boxed(t)));
        nodes.push(Binary::leaf(bounds, first, primitives.len() - first));
        return;
    }
    nodes.push(Binary::leaf(bounds, first, 0));
    take(tree, below, boxed, primitives, nodes);
    let second = nodes.len();
    take(tree, below + 1, boxed, primitives, nodes);
    let count = primitives.len() - first;
    nodes[node] = Binary::leaf(bounds, first, count);
    if count > GROUP {
        join(node, second, LARGEST_LEAF, nodes);
    } else {
        nodes.truncate(node + 1);
    }
}

/// How many of the slots the left child gets at least cost, and the cost.
fn best_split(left: &Binary, right: &Binary, slots: usize) -> (usize, f32) {
    (1..slots)
        .map(|fraction| {
            let cost = left.costs[fraction - 1] + right.costs[slots - fraction - 1];
            (fraction, cost)
        })
        .fold((1, f32::INFINITY), |best, next| {
            if next.1 < best.1 { next } else { best }
        })
}

/// The children that a wide node has in place of a binary one: at most eight, at least cost.
pub(super) fn open(nodes: &[Binary], node: usize) -> Vec<usize> {
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
        // More slots than pay are left empty.
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
