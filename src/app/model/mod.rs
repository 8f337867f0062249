//! The 3D view: the mesh under a camera that orbits and flies, with the photographs' cameras around it.

pub mod coloring;
pub(super) mod gpu;
pub(super) mod lasso;
pub(super) mod orbit;
pub(super) mod overlay;
pub(super) mod pane;
pub(super) mod surface;
pub(super) mod view;

/// What tests of the 3D view share.
#[cfg(test)]
pub mod tests {
    use crate::capture::mesh::Mesh;
    use crate::room::Room;
    use crate::room::cameras::View;
    use crate::scene::Scene;
    use crate::transport::material::Material;
    use glam::{DVec3, Vec3};
    use std::sync::Arc;

    /// A floor and a wall of two triangles each, and a camera in front of them.
    pub fn scene() -> Arc<Scene> {
        let floor = [
            [-1.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 0.0, -1.0],
            [-1.0, 0.0, -1.0],
        ];
        let wall = [[1.0, 2.0, -1.0], [-1.0, 2.0, -1.0]];
        let room = Room {
            name: "corner".into(),
            mesh: Mesh {
                positions: floor.into_iter().chain(wall).map(DVec3::from).collect(),
                triangles: vec![[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]],
                object_of: vec![0, 0, 1, 1],
                objects: vec!["floor".into(), "wall".into()],
                ..Mesh::default()
            },
            materials: vec![Material::diffuse(Vec3::splat(0.5), Vec3::ZERO); 2],
            views: View::all(&[[[0.1, 1.5, 3.0], [0.1, 1.5, 0.0]]]),
        };
        room.lit([8, 6]).expect("a scene").scene
    }
}
