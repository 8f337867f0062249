//! Triangles grouped in objects.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// An indexed triangle mesh whose triangles each belong to one named object.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertex positions in the capture's coordinates (metres unless the capture says otherwise).
    pub positions: Vec<DVec3>,
    /// Vertex indices, counter-clockwise seen from the emitting (front) side.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle, an index into `objects`.
    pub object_of: Vec<u32>,
    /// Object names, unique, in file order.
    pub objects: Vec<String>,
    /// Linear colour of each vertex, where the file has one; otherwise empty.
    pub vertex_colors: Vec<Vec3>,
    /// Texture coordinates of each triangle's corners, where the file has them; otherwise empty.
    pub corner_uvs: Vec<[Vec2; 3]>,
}

/// Lowest and highest coordinates of points; infinite and reversed where there are none.
pub fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
        (low.min(p), high.max(p))
    })
}

impl Mesh {
    /// Lowest and highest corner of the bounding box; infinite and reversed for a mesh without vertices.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        bounds(self.positions.iter().copied())
    }

    /// For each vertex the lowest index of a vertex at exactly its position.
    pub fn weld(&self) -> Vec<u32> {
        // Adding zero turns −0 into 0, so that equal positions have equal bits.
        let key = |i: u32| {
            (self.positions[i as usize] + DVec3::ZERO)
                .to_array()
                .map(f64::to_bits)
        };
        let mut order: Vec<u32> = (0..self.positions.len() as u32).collect();
        order.par_sort_unstable_by_key(|&i| (key(i), i));
        let mut welded = vec![0; order.len()];
        let mut first = 0;
        for (rank, &i) in order.iter().enumerate() {
            if rank == 0 || key(order[rank - 1]) != key(i) {
                first = i;
            }
            welded[i as usize] = first;
        }
        welded
    }
}
