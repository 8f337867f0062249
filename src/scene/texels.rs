//! Texel grids on triangles, without texture coordinates.

use crate::scene::geometry::Hit;

/// Splits each triangle into 4^level congruent sub-triangles (texels).
///
/// Texels are numbered triangle by triangle; a triangle of level `l` has 2^l strips along b2.
#[derive(Debug, Clone, PartialEq)]
pub struct TexelLayout {
    /// Subdivision level of each triangle.
    pub levels: Vec<u8>,
    /// Index of each triangle's first texel, and at the end the number of texels.
    pub first: Vec<u32>,
}

impl TexelLayout {
    /// The layout of the given levels.
    pub fn new(levels: Vec<u8>) -> Self {
        let mut first = Vec::with_capacity(levels.len() + 1);
        let mut next = 0u32;
        for &level in &levels {
            first.push(next);
            next += 1 << (2 * u32::from(level));
        }
        first.push(next);
        Self { levels, first }
    }

    /// Number of texels.
    pub fn len(&self) -> usize {
        self.first.last().copied().unwrap_or(0) as usize
    }

    /// Whether there are no texels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The texel of a hit.
    #[inline]
    pub fn texel(&self, hit: &Hit) -> u32 {
        let triangle = hit.triangle as usize;
        let n = 1u32 << self.levels[triangle];
        if n == 1 {
            return self.first[triangle];
        }
        // Strip `row` along b2 has 2 (n − row) − 1 sub-triangles, alternately upright and inverted.
        let scale = n as f32;
        let row = ((hit.b2 * scale) as u32).min(n - 1);
        let along = hit.b1 * scale;
        let column = (along as u32).min(n - 1 - row);
        let inverted = along.fract() + (hit.b2 * scale).fract() > 1.0 && column + 1 < n - row;
        let before = row * (2 * n - row);
        self.first[triangle] + before + 2 * column + u32::from(inverted)
    }

    /// Barycentric (b1, b2) of a texel's corners, in the triangle's winding; `texel` counts within its triangle.
    pub fn corners(&self, triangle: usize, texel: u32) -> [[f32; 2]; 3] {
        let (x, y, inverted) = self.cell(triangle, texel);
        let corners = match inverted {
            false => [[x, y], [x + 1.0, y], [x, y + 1.0]],
            true => [[x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]],
        };
        let scale = self.texel_size(triangle);
        corners.map(|corner| corner.map(|v| v * scale))
    }

    /// Barycentric (b1, b2) of a texel's centroid; `texel` counts within its triangle.
    pub fn center(&self, triangle: usize, texel: u32) -> [f32; 2] {
        let (x, y, inverted) = self.cell(triangle, texel);
        let third = if inverted { 2.0 / 3.0 } else { 1.0 / 3.0 };
        let scale = self.texel_size(triangle);
        [(x + third) * scale, (y + third) * scale]
    }

    /// Edge of a texel in barycentric units.
    fn texel_size(&self, triangle: usize) -> f32 {
        1.0 / (1u32 << self.levels[triangle]) as f32
    }

    /// Column and row of a texel, and whether it is inverted.
    fn cell(&self, triangle: usize, texel: u32) -> (f32, f32, bool) {
        let n = 1u32 << self.levels[triangle];
        let mut row = 0;
        while row + 1 < n && (row + 1) * (2 * n - row - 1) <= texel {
            row += 1;
        }
        let within = texel - row * (2 * n - row);
        ((within / 2) as f32, row as f32, !within.is_multiple_of(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_is_found_again_from_its_center() {
        let layout = TexelLayout::new(vec![0, 1, 3, 5]);
        assert_eq!(layout.len(), 1 + 4 + 64 + 1024);
        for triangle in 0..4 {
            for texel in 0..1u32 << (2 * layout.levels[triangle]) {
                let [b1, b2] = layout.center(triangle, texel);
                let hit = Hit {
                    t: 1.0,
                    triangle: triangle as u32,
                    b1,
                    b2,
                };
                assert_eq!(layout.texel(&hit), layout.first[triangle] + texel);
                let corners = layout.corners(triangle, texel);
                for axis in 0..2 {
                    let mean = corners.iter().map(|c| c[axis]).sum::<f32>() / 3.0;
                    assert!((mean - [b1, b2][axis]).abs() < 1e-6);
                }
            }
        }
    }
}
