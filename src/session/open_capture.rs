//! An open capture: what is solved and shown.

use crate::calibrate::alignment::Alignment;
use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::scene::Scene;
use crate::session::command::{OpenOptions, Source};
use std::sync::Arc;

/// An open capture.
#[derive(Debug)]
pub struct OpenCapture {
    /// Where it comes from.
    pub source: Source,
    /// Options it was read with.
    pub options: OpenOptions,
    /// Hash of the mesh, the cameras and the photographs.
    pub hash: String,
    /// The capture itself, with cameras at the photographs' full size.
    pub capture: Arc<Capture>,
    /// Display name.
    pub name: String,
    /// Geometry and cameras.
    pub scene: Arc<Scene>,
    /// Photographs at the working resolution, one a camera.
    pub photographs: Vec<Arc<Photograph>>,
    /// Summary, one fact a line.
    pub summary: Vec<String>,
    /// Warnings about the capture.
    pub warnings: Vec<String>,
    /// How well the photographs agree with the mesh, if that was checked.
    pub alignment: Option<Alignment>,
}
