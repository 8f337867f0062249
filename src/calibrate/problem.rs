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
