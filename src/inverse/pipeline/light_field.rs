//! The first stage: each object fitted to its measured irradiance.

use crate::calibrate::measured_radiance::MeasuredRadiance;
use crate::inverse::fit::prior::ExpectedAlbedo;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::outside::LightField;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use crate::math::color::luminance;
use crate::transport::emitters::Emitters;
use glam::Vec3;

/// Assumed relative error of albedo by the light field's limited resolution at edges, until full paths replace it.
const LIGHT_FIELD_BIAS: f32 = 0.01;
/// Least standard deviation of the prior of an albedo.
const MIN_DEVIATION: f32 = 1e-3;

impl Pipeline<'_, '_> {
    /// First stage: paths end at measured radiance, so that each object's albedo is nearly a linear fit of its own.
    pub(super) fn light_field(&mut self) -> Result {
        let started = self.monitor.seconds();
        self.monitor.phase("gathering light from the photographs");
        let measured = MeasuredRadiance::new(self.problem, &self.gbuffer);

        // Light samples are drawn in proportion to area × squared photographed radiance.
        let scene = &self.problem.scene;
        let bright: Vec<f64> = (scene.objects.iter().zip(&measured.object_means))
            .map(|(object, mean)| {
                mean.map_or(0.0, |m| object.area * f64::from(luminance(m)).powi(2))
            })
            .collect();
        let lights = Emitters::new(scene, &self.explore(bright));
        let paths = self.budget.light_field_paths;
        let (cache, limit) = self.stored(&lights, Some(&measured), 0, paths)?;

        // First without outside light, then, if rays leave the mesh, with it.
        self.monitor.phase("telling lamps from walls");
        self.tell_lamps(&cache, Role::Dark)?;
        self.monitor
            .progress
            .seconds_to_first_estimate
            .get_or_insert(self.monitor.seconds());
        let why = format!(
            "each object fitted to the light that the photographs measured around it; {} give light{limit}",
            self.lamps()
        );
        self.record("light field", started, true, why)?;
        self.light_from_outside(LightField {
            cache: &cache,
            lights: &lights,
            measured: &measured,
        })?;
        self.expect_of_albedo();
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// With outside light, sets the prior of albedos from the light field, which measures all irradiance. Full paths have only a
    /// coarse map of the outside light, and albedos would drift to compensate its errors.
    pub(super) fn expect_of_albedo(&mut self) {
        if !self.open {
            return;
        }
        let mut expected = ExpectedAlbedo::unknown(self.roles.len(), &self.gbuffer.seen);
        for (k, role) in self.roles.iter().enumerate() {
            if *role == Role::Reflector {
                let deviation = &mut expected.deviation[k];
                *deviation = self.errors.albedo[k].clamp(Vec3::splat(MIN_DEVIATION), *deviation);
                expected.mean[k] = self.unknowns.albedo[k];
            }
        }
        self.prior.albedo = expected;
    }

    /// Fits all seen objects as reflectors, then settles which emit. Outside light is fitted if `outside` is [`Role::Unseen`].
    pub(super) fn tell_lamps(&mut self, cache: &PathCache, outside: Role) -> Result {
        self.unknowns = Unknowns::new(self.roles.len());
        self.robust = RobustWeights::even(self.roles.len());
        // Seen lamps first: while they are white walls, unseen objects and the outside would be given light to explain them.
        for out_of_sight in [Role::Dark, Role::Unseen] {
            for (k, role) in self.roles.iter_mut().enumerate() {
                match self.gbuffer.seen.get(k) {
                    Some(0) => *role = out_of_sight,
                    Some(_) if out_of_sight == Role::Dark => *role = Role::Reflector,
                    Some(_) => {}
                    None if out_of_sight == Role::Dark => *role = Role::Dark,
                    None => *role = outside,
                }
            }
            self.hold();
            let fitted = self.fit(cache)?;
            self.settle_roles(cache, fitted)?;
        }
        self.weigh(cache)?;
        for (error, albedo) in self.errors.albedo.iter_mut().zip(&self.unknowns.albedo) {
            *error = (*error * *error + *albedo * *albedo * (LIGHT_FIELD_BIAS * LIGHT_FIELD_BIAS))
                .powf(0.5);
        }
        self.test_dark(cache);
        Ok(())
    }

    fn lamps(&self) -> usize {
        self.roles.iter().filter(|r| r.emits()).count()
    }
}
