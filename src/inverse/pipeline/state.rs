//! The state between stages, which a checkpoint stores.

use crate::inverse::fit::errors::StandardErrors;
use crate::inverse::fit::prior::{ExpectedAlbedo, Prior};
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use crate::transport::material::Lobe;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The result of the finished stages.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SolverState {
    /// Number of finished stages.
    pub stages: u32,
    /// Whether light comes from outside.
    pub open: bool,
    /// Distance of the outside light.
    #[serde(default)]
    pub surroundings: Surroundings,
    /// The unit direction towards the sun, if one was found.
    #[serde(default)]
    pub sun: Option<Vec3>,
    /// Prior of the albedos, which may come from the light field.
    #[serde(default)]
    pub expected: Option<ExpectedAlbedo>,
    /// Prior of the outside light: mean and standard deviation by direction.
    pub directions: Vec<(Vec3, Vec3)>,
    /// Role of each surface.
    pub roles: Vec<Role>,
    /// Values of all unknowns.
    pub unknowns: Unknowns,
    /// Variance of the model error, relative to reflected radiance.
    #[serde(default)]
    pub model_variance: f64,
    albedo_errors: Vec<[Option<f32>; 3]>,
    emission_errors: Vec<[Option<f32>; 3]>,
    /// Roughness and specular reflectance of each object that has a lobe.
    #[serde(default)]
    lobes: Vec<Option<(f32, f32)>>,
}

impl SolverState {
    /// Stores the result of the stages; infinite errors become `null`.
    pub fn new(
        stages: u32,
        open: bool,
        prior: &Prior,
        roles: &[Role],
        unknowns: &Unknowns,
        errors: &StandardErrors,
        lobes: &[Option<Lobe>],
    ) -> Self {
        let finite = |errors: &[Vec3]| {
            let finite = |e: f32| e.is_finite().then_some(e);
            errors.iter().map(|e| e.to_array().map(finite)).collect()
        };
        Self {
            stages,
            open,
            surroundings: Surroundings::Far,
            sun: None,
            expected: Some(prior.albedo().clone()),
            directions: prior.directions().to_vec(),
            roles: roles.to_vec(),
            unknowns: unknowns.clone(),
            model_variance: 0.0,
            albedo_errors: finite(&errors.albedo),
            emission_errors: finite(&errors.emission),
            lobes: (lobes.iter())
                .map(|lobe| lobe.map(|l| (l.roughness, l.specular.x)))
                .collect(),
        }
    }

    /// Whether the sizes fit this number of surfaces, of which `outside` are outside directions.
    pub fn fits(&self, objects: usize, outside: usize) -> bool {
        self.roles.len() == objects
            && self.directions.len() == outside
            && (self.expected.iter())
                .all(|e| e.mean.len() == objects && e.deviation.len() == objects)
            && self.unknowns.albedo.len() == objects
            && self.unknowns.emission.len() == objects
            && self.albedo_errors.len() == objects
            && self.emission_errors.len() == objects
            && self.lobes.len() <= objects
    }

    /// The lobe of each object that has one.
    pub fn lobes(&self) -> Vec<Option<Lobe>> {
        let lobe = |(roughness, specular): (f32, f32)| Lobe {
            roughness,
            specular: Vec3::splat(specular),
        };
        self.lobes.iter().map(|l| l.map(lobe)).collect()
    }

    /// Standard errors of all parameters.
    pub fn errors(&self) -> StandardErrors {
        let read = |errors: &[[Option<f32>; 3]]| {
            let known = |e: Option<f32>| e.unwrap_or(f32::INFINITY);
            errors
                .iter()
                .map(|e| Vec3::from_array(e.map(known)))
                .collect()
        };
        StandardErrors {
            albedo: read(&self.albedo_errors),
            emission: read(&self.emission_errors),
        }
    }
}
