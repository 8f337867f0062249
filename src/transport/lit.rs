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

    /// Samples a point on an emitter from one uniform number for the choice and two for the point. `None` if nothing emits.
    pub fn sample_emitter(&self, choice: f64, u: [f32; 2]) -> Option<EmitterSample> {
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

    /// Probability of sampling an emitter of the mesh rather than the environment.
    pub fn emitter_fraction(&self) -> f32 {
        match (&self.outside, self.emitters.is_dark()) {
            (None, _) => 1.0,
            (Some(_), true) => 0.0,
            (Some(_), false) => 0.5,
        }
    }
}

impl World for LitScene {
    #[inline]
    fn lit(&self) -> &LitScene {
        self
    }

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<SurfacePoint> {
        self.scene.intersect(ray).map(|hit| self.surface(&hit))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded(ray)
    }
}
