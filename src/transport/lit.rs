//! A scene with materials and lights, one material per object.

use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray};
use crate::transport::emitters::{Emitters, powers};
use crate::transport::environment::Environment;
use crate::transport::material::Material;
use crate::transport::world::{EmitterSample, SurfacePoint, World};
use std::sync::Arc;

/// A scene, its materials and its light.
#[derive(Debug, Clone)]
pub struct LitScene {
    /// Geometry.
    pub scene: Arc<Scene>,
    /// One per object.
    pub materials: Vec<Material>,
    /// Emitter sampling, weighted by area × luminance of emission.
    pub emitters: Emitters,
    /// Environment light.
    pub outside: Option<Arc<Environment>>,
}

impl LitScene {
    /// A lit scene; `materials` has one entry per object.
    pub fn new(
        scene: Arc<Scene>,
        materials: Vec<Material>,
        outside: Option<Arc<Environment>>,
    ) -> Self {
        let weights = powers(&scene, materials.iter().map(|m| m.emission));
        let emitters = Emitters::new(&scene, &weights);
        Self {
            scene,
            materials,
            emitters,
            outside,
        }
    }

    /// The surface point of a hit.
    #[inline]
    pub fn surface(&self, hit: &Hit) -> SurfacePoint {
        let object = self.scene.object_of[hit.triangle as usize];
        let material = &self.materials[object as usize];
        let normal = self.scene.normals[hit.triangle as usize];
        SurfacePoint {
            point: self.scene.point(hit),
            corners: self.scene.corners(hit.triangle),
            normal,
            shading_normal: normal,
            albedo: material.albedo_at(hit),
            emission: material.emission,
            lobe: material.lobe,
            object,
            triangle: hit.triangle,
            t: hit.t,
        }
    }
}

impl World for LitScene {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<SurfacePoint> {
        self.scene.intersect(ray).map(|hit| self.surface(&hit))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded(ray)
    }

    fn sample_emitter(&self, choice: f64, u: [f32; 2]) -> Option<EmitterSample> {
        let (object, sample) = self.emitters.sample(&self.scene, choice, u)?;
        Some(EmitterSample {
            point: sample.point,
            corners: self.scene.corners(sample.triangle),
            normal: self.scene.normals[sample.triangle as usize],
            radiance: self.materials[object as usize].emission,
            pdf: self.emitters.pdf(object),
            object,
        })
    }

    fn emitter_pdf(&self, surface: &SurfacePoint) -> f32 {
        self.emitters.pdf(surface.object)
    }

    fn has_emitters(&self) -> bool {
        !self.emitters.is_dark()
    }

    fn environment(&self) -> Option<&Environment> {
        self.outside.as_deref()
    }
}
