//! Blocks of voxels.

use glam::{DVec3, IVec3, Vec3};

/// Voxels along an edge of a block.
pub const SIDE: i32 = 8;
/// Voxels of a block.
pub const VOLUME: usize = (SIDE * SIDE * SIDE) as usize;

/// The field at a voxel's centre.
#[derive(Debug, Clone, Copy, Default)]
pub struct Voxel {
    /// Weighted mean signed distance to the surface in units of the truncation distance, positive in front of it.
    pub distance: f32,
    /// Sum of weights; 0 where nothing was measured.
    pub weight: f32,
    /// Weighted mean linear colour.
    pub color: Vec3,
    /// Sum of the colour's weights.
    pub color_weight: f32,
}

/// A cube of voxels.
pub struct Block {
    /// Position in units of blocks; the lowest voxel is at `SIDE` times it.
    pub at: IVec3,
    /// x fastest, then y, then z.
    pub voxels: Box<[Voxel; VOLUME]>,
}

impl Block {
    /// A block without measurements.
    pub fn new(at: IVec3) -> Self {
        Self {
            at,
            voxels: Box::new([Voxel::default(); VOLUME]),
        }
    }

    pub const fn bytes() -> usize {
        size_of::<Self>() + VOLUME * size_of::<Voxel>()
    }

    /// Index of a voxel from its coordinates within the block, each below [`SIDE`].
    pub fn index(inside: IVec3) -> usize {
        (inside.x + SIDE * (inside.y + SIDE * inside.z)) as usize
    }

    /// The position of a voxel in the whole grid.
    pub fn voxel(&self, index: usize) -> IVec3 {
        let i = index as i32;
        self.at * SIDE + IVec3::new(i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE))
    }
}

/// The block that contains a point, for voxels of `edge` metres; `None` where coordinates are too large for the grid.
pub fn block_at(point: DVec3, edge: f64) -> Option<IVec3> {
    let at = (point / (edge * f64::from(SIDE))).floor();
    (at.abs().max_element() < f64::from(1 << 24)).then(|| at.as_ivec3())
}
