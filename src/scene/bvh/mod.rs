//! The hierarchy over triangles: topology by obvhs, laid out eight wide, traversed here.
//!
//! A hit does not depend on the hierarchy: among equally near triangles the lowest index wins, and every
//! instruction set does the same arithmetic in the same order (no fused multiply-add).

mod build;
mod lanes;
mod traverse;

use crate::scene::geometry::{Hit, Ray};
use glam::Vec3;

/// Children of a node and triangles of a group.
const WIDTH: usize = 8;

/// Eight child boxes, plane by plane: rows are min x, max x, min y, max y, min z, max z.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
struct Node {
    planes: [[f32; WIDTH]; 6],
    children: [Child; WIDTH],
}

/// A node's child: empty, an inner node, or a run of triangle groups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Child(u32);

impl Child {
    const EMPTY: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;
    /// Bits for the number of groups of a leaf, minus one.
    const COUNT_BITS: u32 = 4;
    const MAX_GROUPS: usize = 1 << Self::COUNT_BITS;

    fn inner(node: usize) -> Self {
        Self(node as u32)
    }

    fn leaf(first: usize, groups: usize) -> Self {
        Self(Self::LEAF | (first as u32) << Self::COUNT_BITS | (groups - 1) as u32)
    }

    fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    fn groups(self) -> std::ops::Range<usize> {
        let first = ((self.0 & !Self::LEAF) >> Self::COUNT_BITS) as usize;
        first..first + 1 + (self.0 & ((1 << Self::COUNT_BITS) - 1)) as usize
    }
}

/// Eight triangles: coordinates by corner, axis and lane. Unused lanes repeat a triangle.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
struct Group {
    corners: [[[f32; WIDTH]; 3]; 3],
    triangles: [u32; WIDTH],
}

/// Which arithmetic the traversal uses; all give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstructionSet {
    /// Arrays of eight, on any processor.
    Portable,
    /// 256-bit vectors (x86-64).
    Avx2,
}

impl InstructionSet {
    /// The widest one that this processor has.
    pub fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Portable
    }
}

/// Bounding volume hierarchy, eight children a node, with its own copy of the triangles.
pub struct Bvh {
    nodes: Vec<Node>,
    groups: Vec<Group>,
    /// Entries that a traversal's stack can need.
    stack_size: usize,
    triangles: usize,
    instructions: InstructionSet,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "Bvh({} triangles, {} nodes)",
            self.triangles,
            self.nodes.len()
        )
    }
}

impl Bvh {
    /// Builds the hierarchy of a mesh. Triangles with corners that are not finite are never hit.
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        build::build(positions, triangles)
    }

    /// The same hierarchy, traversed with another instruction set (which the processor must have; else portable).
    #[must_use]
    pub fn with_instructions(mut self, instructions: InstructionSet) -> Self {
        let available = instructions == InstructionSet::widest();
        self.instructions = if available {
            instructions
        } else {
            InstructionSet::Portable
        };
        self
    }

    /// The nearest hit with t in (t_min, t_max), or none.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        traverse::intersect(self, ray)
    }

    /// Whether there is any hit with t in (t_min, t_max).
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        traverse::occluded(self, ray)
    }
}
