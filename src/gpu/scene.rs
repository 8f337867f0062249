//! A lit scene with inserted objects in the shader's layout: triangles in the order of the hierarchy, materials, lights.

use crate::gpu::hierarchy::{Hierarchy, word};
use crate::gpu::layout::Material as Shared;
use crate::gpu::layout::{Dispatch, NONE};
use crate::gpu::lights::{Emitters, environment};
use crate::gpu::materials::{Inserted, Materials};
use crate::transport::lit::LitScene;
use crate::transport::path::emitter_fraction;
use glam::Vec3;

/// The contents of a scene's storage buffers.
#[derive(Debug)]
pub(super) struct Packed {
    pub nodes: Vec<[u32; 4]>,
    pub triangles: Vec<[u32; 4]>,
    pub materials: Vec<Shared>,
    pub data: Vec<u32>,
    pub emitters: Vec<[u32; 4]>,
    pub environment: Vec<[u32; 4]>,
    /// Maximum number of stack entries of a traversal.
    pub stack_size: u32,
    /// The scene's part of the dispatch parameters; the rest is zero.
    pub dispatch: Dispatch,
}

impl Packed {
    pub fn new(lit: &LitScene, objects: &[Inserted<'_>]) -> Self {
        let scene = &lit.scene;
        let own = scene.triangles.len();
        let mut corners: Vec<[Vec3; 3]> = (0..own as u32).map(|t| scene.corners(t)).collect();
        let mut normals = scene.normals.clone();
        let mut material_of = scene.object_of.clone();
        let mut materials = Materials::new(lit);
        for object in objects {
            let first = materials.insert(object, corners.len() as u32);
            corners.extend(object.corners);
            normals.extend(object.normals);
            material_of.extend(object.material_of.iter().map(|m| first + m));
        }

        let hierarchy = Hierarchy::new(&corners);
        let mut slot_of = vec![NONE; corners.len()];
        let mut triangles = Vec::with_capacity(4 * corners.len());
        for (slot, &index) in hierarchy.order.iter().enumerate() {
            let t = index as usize;
            slot_of[t] = slot as u32;
            let [a, b, c] = corners[t];
            triangles.push(word(a, index));
            triangles.push(word(b, material_of[t]));
            triangles.push(word(c, u32::from(t >= own)));
            triangles.push(word(normals[t], 0));
        }

        let emitters = Emitters::new(lit, &slot_of);
        let outside = lit.outside.as_deref();
        let [width, height] = outside.map_or([0; 2], |map| map.size().map(|n| n as u32));
        let dispatch = Dispatch {
            lights: [emitters.objects, 0, width, height],
            emitter_fraction: [emitter_fraction(lit), 0.0, 0.0, 0.0],
            ..Dispatch::default()
        };
        Self {
            nodes: hierarchy.nodes,
            triangles,
            materials: materials.materials,
            data: materials.data,
            emitters: emitters.entries,
            environment: outside.map(environment).unwrap_or_default(),
            stack_size: hierarchy.stack_size,
            dispatch,
        }
    }
}
