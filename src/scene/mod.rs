//! The immutable scene: recentred f32 geometry, objects, hierarchy and cameras.

pub mod bvh;
pub mod camera;
pub mod depth;
pub mod geometry;
pub mod prepare;
pub mod texels;
pub mod visibility;
pub mod winding;

use crate::capture::{Capture, Frame};
use crate::error::{Error, Result};
use bvh::Bvh;
use camera::Camera;
use geometry::{Hit, Ray};
use glam::{DVec3, Vec3};
use std::sync::OnceLock;
use visibility::IdBuffers;

/// Geometry and cameras of a capture, in metres relative to [`Scene::origin`].
#[derive(Debug)]
pub struct Scene {
    /// The capture's coordinates of the scene's origin.
    pub origin: DVec3,
    /// Vertex positions relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from the emitting side.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle, an index into `objects`.
    pub object_of: Vec<u32>,
    /// Unit geometric normal of each triangle's front; zero for zero-area triangles.
    pub normals: Vec<Vec3>,
    /// Area of each triangle in square metres.
    pub areas: Vec<f32>,
    /// The named groups of triangles.
    pub objects: Vec<Object>,
    /// One camera per frame, in frame order.
    pub cameras: Vec<Camera>,
    /// Unit up vector.
    pub up: Vec3,
    /// Diagonal of the bounding box in metres.
    pub diameter: f32,
    /// Whether the mesh is a scan without objects: geometry may be missing nearby.
    pub scanned: bool,
    /// The hierarchy for nearest-hit and any-hit queries.
    pub bvh: Bvh,
    ids: OnceLock<IdBuffers>,
}

/// A named group of triangles sharing parameters in the coarse stage.
#[derive(Debug, Clone)]
pub struct Object {
    /// Its name in the capture.
    pub name: String,
    /// Its triangles, ascending.
    pub triangles: Vec<u32>,
    /// Its area in square metres.
    pub area: f64,
}

impl Scene {
    /// Recentres a capture, rounds it to f32 and builds the hierarchy.
    ///
    /// # Errors
    /// The mesh has no triangle with an area.
    pub fn new(capture: &Capture) -> Result<Self> {
        let mesh = &capture.mesh;
        let refused = |problem| Err(Error::new(&capture.name, problem, "check the mesh file"));
        let (low, high) = mesh.bounds();
        if mesh.triangles.is_empty() || !(high - low).is_finite() {
            return refused("the mesh has no triangles");
        }
        let origin = (low + high) * 0.5;
        let local = |p: &DVec3| (*p - origin).as_vec3();
        let positions: Vec<Vec3> = mesh.positions.iter().map(local).collect();

        // Compute normals and areas in f64, since slivers would lose theirs in f32.
        let mut normals = Vec::with_capacity(mesh.triangles.len());
        let mut areas = Vec::with_capacity(mesh.triangles.len());
        let object = |name: &String| Object {
            name: name.clone(),
            triangles: Vec::new(),
            area: 0.0,
        };
        let mut objects: Vec<Object> = mesh.objects.iter().map(object).collect();
        for (index, (&[a, b, c], &object)) in mesh.triangles.iter().zip(&mesh.object_of).enumerate()
        {
            let corner = |i: u32| positions[i as usize].as_dvec3();
            let cross = (corner(b) - corner(a)).cross(corner(c) - corner(a));
            normals.push(cross.normalize_or_zero().as_vec3());
            areas.push((cross.length() * 0.5) as f32);
            objects[object as usize].triangles.push(index as u32);
            objects[object as usize].area += cross.length() * 0.5;
        }
        if objects.iter().all(|o| o.area == 0.0) {
            return refused("every triangle of the mesh has zero area");
        }

        let camera = |frame: &Frame| Camera::new(&frame.intrinsics, &frame.pose, origin);
        let bvh = Bvh::new(&positions, &mesh.triangles);
        Ok(Self {
            origin,
            positions,
            triangles: mesh.triangles.clone(),
            object_of: mesh.object_of.clone(),
            normals,
            areas,
            objects,
            cameras: capture.frames.iter().map(camera).collect(),
            up: capture.up.as_vec3(),
            diameter: (high - low).length() as f32,
            scanned: capture.segmentation.is_some(),
            bvh,
            ids: OnceLock::new(),
        })
    }

    /// The scene with precomputed id buffers, which must be its own.
    pub fn with_ids(self, ids: IdBuffers) -> Self {
        Self {
            ids: OnceLock::from(ids),
            ..self
        }
    }

    /// The nearest hit along a ray.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.bvh.intersect(ray)
    }

    /// Whether anything lies between the ray's `t_min` and `t_max`.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.bvh.occluded(ray)
    }

    /// The corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|i| self.positions[i as usize])
    }

    /// Ray parameter t of the intersection with a triangle's plane: negative behind the origin, non-finite for parallel rays.
    #[inline]
    pub fn plane_distance(&self, triangle: u32, ray: &Ray) -> f32 {
        let normal = self.normals[triangle as usize];
        let [corner, _, _] = self.corners(triangle);
        normal.dot(corner - ray.origin) / normal.dot(ray.direction)
    }

    /// The point of a hit from its barycentrics (more accurate than origin + t · direction).
    #[inline]
    pub fn point(&self, hit: &Hit) -> Vec3 {
        let [a, b, c] = self.corners(hit.triangle);
        a * (1.0 - hit.b1 - hit.b2) + b * hit.b1 + c * hit.b2
    }
}
