//! Bounding volume hierarchy over triangles with eight children per node.
//!
//! Hits do not depend on the hierarchy or the processor: of equally near triangles the lowest index wins, and every instruction set
//! does the same arithmetic in the same order (no fused multiply-add).

#![allow(
    unsafe_code,
    reason = "code for wider instruction sets is entered only after these were detected; every block says why it is sound"
)]

mod binary;
mod build;
mod lanes;
mod pages;
mod ray;
mod split;
mod traverse;

use pages::Pages;
use std::hint::select_unpredictable;

pub use build::{Tree, TreeNode};

/// Children per node.
const WIDTH: usize = 8;

/// Triangles per group.
const GROUP: usize = 4;

/// Eight child boxes and children, by descending number of triangles, as bits. Rows: min and max of x, y and z, children, unused.
///
/// Four cache lines. With eight rows, a masked row index needs no bounds check.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Node {
    rows: [[u32; WIDTH]; 8],
}

impl Node {
    const CHILDREN: usize = 6;

    #[inline(always)]
    fn child(&self, lane: usize) -> Child {
        Child(self.rows[Self::CHILDREN][lane & (WIDTH - 1)])
    }
}

/// A node's child: empty, an inner node, or a run of triangle groups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Child(u32);

impl Child {
    const EMPTY: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;
    /// Bits of a leaf's number of groups minus one.
    const COUNT_BITS: u32 = 4;

    fn inner(node: usize) -> Self {
        Self(node as u32)
    }

    fn leaf(first: usize, groups: usize) -> Self {
        Self(Self::LEAF | (first as u32) << Self::COUNT_BITS | (groups - 1) as u32)
    }

    /// The reference shifted by numbers of nodes and groups.
    fn moved(self, nodes: usize, groups: usize) -> Self {
        if self == Self::EMPTY {
            self
        } else if self.is_leaf() {
            Self(self.0 + ((groups as u32) << Self::COUNT_BITS))
        } else {
            Self(self.0 + nodes as u32)
        }
    }

    fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    fn groups(self) -> std::ops::Range<usize> {
        let first = ((self.0 & !Self::LEAF) >> Self::COUNT_BITS) as usize;
        first..first + 1 + (self.0 & ((1 << Self::COUNT_BITS) - 1)) as usize
    }
}

/// Four triangles as bits: rows x, y, z of each corner; the fourth row of the first corner holds the triangle indices.
///
/// Three cache lines. Unused lanes repeat a triangle.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Group {
    corners: [[[u32; GROUP]; 4]; 3],
}

impl Group {
    const TRIANGLES: usize = 3;

    #[inline(always)]
    fn triangle(&self, lane: usize) -> u32 {
        self.corners[0][Self::TRIANGLES][lane & (GROUP - 1)]
    }
}

/// Instruction sets of the traversal, from the narrowest to the widest; all give identical results.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// Arrays of eight, on any processor.
    Portable,
    /// 256-bit vectors (x86-64).
    Avx2,
    /// 256-bit vectors with twice the registers and with mask registers (x86-64).
    Avx512,
}

impl InstructionSet {
    /// The widest instruction set of this processor.
    pub fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("lzcnt")
            && std::arch::is_x86_feature_detected!("popcnt")
        {
            let wide = std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512vl")
                && std::arch::is_x86_feature_detected!("avx512dq")
                && std::arch::is_x86_feature_detected!("avx512bw");
            return if wide { Self::Avx512 } else { Self::Avx2 };
        }
        Self::Portable
    }
}

/// Bounding volume hierarchy, eight children a node, with its own copy of the triangles.
pub struct Bvh {
    nodes: Pages<Node>,
    groups: Pages<Group>,
    /// Maximum number of stack entries of a traversal.
    stack_size: usize,
    triangles: usize,
    instructions: InstructionSet,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (triangles, nodes) = (self.triangles, self.nodes.len());
        write!(f, "Bvh({triangles} triangles, {nodes} nodes)")
    }
}

impl Bvh {
    /// Sets the instruction set of traversals; falls back to portable if the processor lacks it.
    #[must_use]
    pub fn with_instructions(mut self, instructions: InstructionSet) -> Self {
        self.instructions = if instructions <= InstructionSet::widest() {
            instructions
        } else {
            InstructionSet::Portable
        };
        self
    }
}

/// Prefetches a child that will soon be visited. Branch-free, since whether it is a leaf is unpredictable.
#[inline(always)]
fn prefetch(nodes: &[Node], groups: &[Group], child: Child) {
    let node: *const Node = nodes.as_ptr().wrapping_add(child.0 as usize);
    let group: *const Group = groups.as_ptr().wrapping_add(child.groups().start);
    let address = select_unpredictable(child.is_leaf(), group.cast::<u8>(), node.cast());
    lanes::prefetch(address);
}
