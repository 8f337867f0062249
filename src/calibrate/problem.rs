//! The input of a solve.

use crate::capture::photograph::Photograph;
use crate::scene::Scene;
use std::sync::Arc;

/// A scene and its photographs.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Geometry and cameras. Camera sizes equal those of `photographs`.
    pub scene: Arc<Scene>,
    /// One photograph per camera, at the working resolution.
    pub photographs: Vec<Arc<Photograph>>,
}

impl Problem {
    /// Number of pixels of all photographs.
    pub fn pixels(&self) -> usize {
        self.photographs.iter().map(|p| p.pixels.len()).sum()
    }

    /// Frame and pixel of an index over the pixels of all photographs; `None` beyond the last.
    pub fn locate(&self, mut index: usize) -> Option<(usize, usize)> {
        for (frame, photograph) in self.photographs.iter().enumerate() {
            match index.checked_sub(photograph.pixels.len()) {
                None => return Some((frame, index)),
                Some(rest) => index = rest,
            }
        }
        None
    }
}
