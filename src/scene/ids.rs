//! Id buffers: the triangle that each pixel sees.

/// Marks pixels that see no triangle.
pub const NOTHING: u32 = u32::MAX;

/// The triangle seen by the centre of each pixel.
#[derive(Debug, Clone)]
pub struct IdBuffers {
    /// For each frame, row by row from the top left, a triangle's index or [`NOTHING`].
    pub triangles: Vec<Vec<u32>>,
    /// For each object, the number of pixels that see its front.
    pub front_pixels: Vec<u64>,
    /// For each object, the number of pixels that see its back.
    pub back_pixels: Vec<u64>,
}

impl IdBuffers {
    /// The number of pixels that see an object, from either side.
    pub fn seen_pixels(&self, object: usize) -> u64 {
        self.front_pixels[object] + self.back_pixels[object]
    }

    /// The number of pixels of a frame that see the mesh.
    pub fn pixels_on_mesh(&self, frame: usize) -> u64 {
        let seen = self.triangles[frame].iter().filter(|&&t| t != NOTHING);
        seen.count() as u64
    }
}
