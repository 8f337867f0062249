//! The state between stages, which a checkpoint stores.

use crate::inverse::fit::errors::StandardErrors;
use crate::inverse::fit::prior::ExpectedAlbedo;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use crate::math::nullable;
use crate::transport::material::Lobe;
use crate::transport::surroundings::Surroundings;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The result of the finished stages.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SolverState {
    stages: u32,
    open: bool,
    #[serde(default)]
    surroundings: Surroundings,
    /// The unit direction towards the sun, if one was found.
    #[serde(default)]
    sun: Option<Vec3>,
    /// Prior of the albedos, which may come from the light field.
    #[serde(default)]
    expected: Option<ExpectedAlbedo>,
    /// Prior of the outside light: mean and standard deviation by direction.
    directions: Vec<(Vec3, Vec3)>,
    roles: Vec<Role>,
    unknowns: Unknowns,
    /// Variance of the model error, relative to reflected radiance.
    #[serde(default)]
    model_variance: f64,
    /// Fraction of the light in the photographs that comes from outside and was not measured there, as the sun is not.
    #[serde(default)]
    outside_share: f64,
    #[serde(deserialize_with = "nullable::all_or_infinity")]
    albedo_errors: Vec<Vec3>,
    #[serde(deserialize_with = "nullable::all_or_infinity")]
    emission_errors: Vec<Vec3>,
    /// Roughness and specular reflectance of each object that has a lobe.
    #[serde(default)]
    lobes: Vec<Option<(f32, f32)>>,
}

impl SolverState {
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
}

impl Pipeline<'_, '_> {
    pub(super) fn state(&self) -> SolverState {
        let lobes = self.lobes.iter();
        SolverState {
            stages: self.stages,
            open: self.open,
            surroundings: self.outside.surroundings,
            sun: self.outside.sun,
            expected: Some(self.prior.albedo.clone()),
            directions: self.prior.directions.clone(),
            roles: self.roles.clone(),
            unknowns: self.unknowns.clone(),
            model_variance: self.model_variance,
            outside_share: self.outside_share,
            albedo_errors: self.errors.albedo.clone(),
            emission_errors: self.errors.emission.clone(),
            lobes: lobes
                .map(|lobe| lobe.map(|l| (l.roughness, l.specular.x)))
                .collect(),
        }
    }

    /// Goes on from a state that [`SolverState::fits`].
    pub(super) fn restore(&mut self, state: SolverState) {
        self.stages = state.stages;
        self.open = state.open;
        self.outside.surroundings = state.surroundings;
        self.outside.sun = state.sun;
        if state.open {
            self.sky = self.measured_outside(state.surroundings);
            self.expect_of_outside();
        }
        if let Some(expected) = state.expected {
            self.prior.albedo = expected;
        }
        self.prior.directions = state.directions;
        self.roles = state.roles;
        self.unknowns = state.unknowns;
        self.model_variance = state.model_variance;
        self.outside_share = state.outside_share;
        self.errors = StandardErrors {
            albedo: state.albedo_errors,
            emission: state.emission_errors,
        };
        for (lobe, stored) in self.lobes.iter_mut().zip(state.lobes) {
            *lobe = stored.map(|(roughness, specular)| Lobe::grey(roughness, specular));
        }
    }
}
