//! What a solve starts from.

use crate::capture::photograph::Photograph;
use crate::scene::Scene;
use std::sync::Arc;

/// A scene and what its photographs measured.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Geometry and cameras. Camera sizes equal those of `photographs`.
    pub scene: Arc<Scene>,
    /// One photograph a camera, at the working resolution.
    pub photographs: Vec<Arc<Photograph>>,
}
