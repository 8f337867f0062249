//! What every mesh reader returns.

use crate::capture::mesh::Mesh;

/// A mesh as a file stores it, before any check.
#[derive(Debug, Default)]
pub struct RawMesh {
    /// Geometry and objects; names may repeat or be empty.
    pub mesh: Mesh,
    /// Whether the file assigns triangles to objects.
    pub has_objects: bool,
    /// Largest rounding error of a position due to the file's number format, in the capture's units.
    pub rounding: f64,
    /// Warnings, without the file's name.
    pub warnings: Vec<String>,
}
