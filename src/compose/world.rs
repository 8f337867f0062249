//! The scene with inserted objects, as the path tracer sees it.

use crate::compose::placement::PlacedObject;
use crate::scene::geometry::{Hit, Ray};
use crate::transport::lit::LitScene;
use crate::transport::world::{SurfacePoint, World, towards_viewer};
use glam::Vec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A lit scene with objects in it. Only the scene emits light.
#[derive(Debug)]
pub struct FurnishedScene<'a> {
    lit: &'a LitScene,
    objects: &'a [Arc<PlacedObject>],
    touched: AtomicBool,
}

impl<'a> FurnishedScene<'a> {
    /// A scene with objects; their object indices follow the scene's.
    pub fn new(lit: &'a LitScene, objects: &'a [Arc<PlacedObject>]) -> Self {
        Self {
            lit,
            objects,
            touched: AtomicBool::new(false),
        }
    }

    /// Whether an object has changed the answer to any query since the last call.
    ///
    /// If not, the path would be the same to the bit without the objects.
    pub fn take_touched(&self) -> bool {
        self.touched.swap(false, Ordering::Relaxed)
    }

    /// Whether the first surface along a ray belongs to an inserted object.
    pub fn sees_object(&self, ray: &Ray) -> bool {
        self.nearest_object(ray, ray.t_max).is_some_and(|(_, hit)| {
            let before = Ray {
                t_max: hit.t,
                ..*ray
            };
            !self.lit.scene.occluded(&before)
        })
    }

    /// The nearest object in front of `t_max`.
    fn nearest_object(&self, ray: &Ray, t_max: f32) -> Option<(usize, Hit)> {
        let mut nearest = None;
        let mut ray = Ray { t_max, ..*ray };
        for (index, object) in self.objects.iter().enumerate() {
            if let Some(hit) = object.bvh.intersect(&ray) {
                ray.t_max = hit.t;
                nearest = Some((index, hit));
            }
        }
        nearest
    }

    fn surface(&self, index: usize, hit: &Hit, ray: &Ray) -> SurfacePoint {
        let object = &self.objects[index];
        let triangle = hit.triangle as usize;
        let corners = object.corners[triangle];
        let normal = object.normals[triangle];
        let model = &object.model;
        let material = &model.materials[model.material_of[triangle] as usize];
        let own = object.corner_normals.get(triangle);
        let shading = own.map_or(normal, |n| interpolate(n, hit).normalize_or(normal));
        let colors = model.corner_colors.get(triangle);
        let tint = colors.map_or(Vec3::ONE, |colors| interpolate(colors, hit));
        let back = -ray.direction.normalize_or_zero();
        SurfacePoint {
            point: interpolate(&corners, hit),
            corners,
            normal,
            shading_normal: towards_viewer(shading, normal, back),
            albedo: (material.albedo_at(hit) * tint).clamp(Vec3::ZERO, Vec3::ONE),
            emission: Vec3::ZERO,
            lobe: material.lobe,
            object: (self.lit.scene.objects.len() + index) as u32,
            triangle: hit.triangle,
            t: hit.t,
        }
    }
}

/// Barycentric interpolation of values at a triangle's corners.
#[inline]
fn interpolate(corners: &[Vec3; 3], hit: &Hit) -> Vec3 {
    corners[0] * (1.0 - hit.b1 - hit.b2) + corners[1] * hit.b1 + corners[2] * hit.b2
}

impl World for FurnishedScene<'_> {
    fn lit(&self) -> &LitScene {
        self.lit
    }

    fn intersect(&self, ray: &Ray) -> Option<SurfacePoint> {
        let scene_hit = self.lit.scene.intersect(ray);
        let t_max = scene_hit.map_or(ray.t_max, |hit| hit.t);
        if let Some((index, hit)) = self.nearest_object(ray, t_max) {
            self.touched.store(true, Ordering::Relaxed);
            return Some(self.surface(index, &hit, ray));
        }
        scene_hit.map(|hit| self.lit.surface(&hit))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        if self.lit.scene.occluded(ray) {
            return true;
        }
        let occluded = self.objects.iter().any(|object| object.bvh.occluded(ray));
        if occluded {
            self.touched.store(true, Ordering::Relaxed);
        }
        occluded
    }
}
