//! The 3D view: the mesh under a camera that orbits and flies, with the photographs' cameras around it.

pub mod coloring;
pub mod gpu;
pub mod lasso;
pub mod orbit;
pub mod overlay;
pub mod pane;
pub mod surface;
pub mod view;

/// What tests of the 3D view share.
#[cfg(test)]
pub mod tests {
    use crate::capture::camera::{Intrinsics, Pose};
    use crate::capture::mesh::Mesh;
    use crate::capture::photograph::{Encoding, Photograph, PhotographSource};
    use crate::capture::{Capture, Frame};
    use crate::scene::Scene;
    use glam::{DMat3, DVec3, Vec3};
    use std::sync::Arc;

    /// A floor and a wall of two triangles each, and a camera in front of them.
    pub fn scene() -> Scene {
        let photograph = Photograph {
            width: 8,
            height: 6,
            pixels: vec![Vec3::splat(0.5); 48],
            usable: Vec::new(),
            encoding: Encoding::Linear,
            saturation: Vec3::INFINITY,
            limits: Vec::new(),
        };
        let corner = |x, y, z| DVec3::new(x, y, z);
        let capture = Capture {
            name: "corner".into(),
            folder: None,
            segmentation: None,
            mesh: Mesh {
                positions: vec![
                    corner(-1.0, 0.0, 1.0),
                    corner(1.0, 0.0, 1.0),
                    corner(1.0, 0.0, -1.0),
                    corner(-1.0, 0.0, -1.0),
                    corner(1.0, 2.0, -1.0),
                    corner(-1.0, 2.0, -1.0),
                ],
                triangles: vec![[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]],
                object_of: vec![0, 0, 1, 1],
                objects: vec!["floor".into(), "wall".into()],
                ..Mesh::default()
            },
            frames: vec![Frame {
                intrinsics: Intrinsics {
                    width: 8,
                    height: 6,
                    fx: 6.0,
                    fy: 6.0,
                    cx: 4.0,
                    cy: 3.0,
                    distortion: [0.0; 4],
                },
                pose: Pose {
                    rotation: DMat3::from_rotation_x(-0.3),
                    center: corner(0.1, 1.5, 3.0),
                },
                exposure: None,
                photograph: PhotographSource::Memory(Arc::new(photograph)),
                depth: None,
            }],
            up: DVec3::Y,
            warnings: Vec::new(),
        };
        Scene::new(&capture).expect("a scene")
    }
}
