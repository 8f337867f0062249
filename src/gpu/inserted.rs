//! The caller's description of an inserted object.

use crate::transport::material::Material;
use glam::Vec3;

/// An inserted object in scene coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Inserted<'a> {
    /// Corners of each triangle.
    pub corners: &'a [[Vec3; 3]],
    /// Unit geometric normal of each triangle's front.
    pub normals: &'a [Vec3],
    /// Unit shading normals at the corners; empty where there are none.
    pub corner_normals: &'a [[Vec3; 3]],
    /// Factors on the albedo at the corners; empty where there are none.
    pub corner_colors: &'a [[Vec3; 3]],
    /// For each triangle, an index into `materials`.
    pub material_of: &'a [u32],
    /// Materials; emission is ignored.
    pub materials: &'a [Material],
}
