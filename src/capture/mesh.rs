//! Triangles grouped in objects.

use glam::{DVec3, Vec2, Vec3};

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
