//! The common factor between light and albedos, if saturated lamps leave it open.

use crate::inverse::emitters::lamp_albedo;
use crate::inverse::fit::linear::{Descended, descend};
use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::{albedo_scale, model_error};
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use crate::math::color::luminance;
use glam::Vec3;
use std::collections::BTreeMap;

/// The light counts as measured if lamps that are seen unsaturated give more than this fraction of its power.
const MEASURED: f64 = 0.5;

impl Pipeline<'_, '_> {
    /// Multiplies all albedos of a scan by the most likely factor ([`albedo_scale`]), and fits the lamps again with these albedos held
    /// fixed. `found` is the fit of the parameters in `free`; its unknowns are the present ones.
    pub(super) fn scale_albedos(&mut self, found: &Descended, free: &[usize], prior: &Prior) {
        let Some(factor) = self.albedo_factor() else {
            return;
        };
        let mut scaled = found.unknowns.clone();
        let mut held = BTreeMap::new();
        for k in self.surfaces_in_view() {
            scaled.albedo[k] = (scaled.albedo[k] * factor).min(Vec3::ONE);
            held.insert(k, scaled.albedo[k]);
        }
        // Direct light stays the same: a start close to the result.
        for emission in &mut scaled.emission {
            *emission /= factor;
        }
        let prior = prior.clone().with_held(held);
        let clusters = found.clusters.clone();
        let fitted = descend(clusters, &found.unknowns, &scaled, free, &prior);
        lamp_albedo::leave_out(&mut self.unknowns, &self.roles);
        self.unscaled = Some(std::mem::replace(&mut self.unknowns, fitted.unknowns));
    }

    /// The factor; `None` if the light is measured, or if the user fixed any value.
    fn albedo_factor(&self) -> Option<f32> {
        let given = self.monitor.known.objects().next().is_some();
        if !self.problem.scene.scanned || self.open || given || self.is_light_measured() {
            return None;
        }
        let (mut sum, mut area) = (0.0, 0.0);
        for k in self.surfaces_in_view() {
            let size = self.problem.scene.objects[k].area;
            sum += size * f64::from(self.unknowns.albedo[k].element_sum()) / 3.0;
            area += size;
        }
        let error = model_error::relative(self.model_variance);
        (sum > 0.0).then(|| albedo_scale::likeliest(sum / area, error) as f32)
    }

    /// Whether lamps that are seen unsaturated give most of the power.
    fn is_light_measured(&self) -> bool {
        let mut shown = vec![[0u64; 2]; self.roles.len()];
        for cluster in &self.clusters {
            let saturated = usize::from(cluster.censored.any());
            shown[cluster.object as usize][saturated] += cluster.pixels.len() as u64;
        }
        let (mut measured, mut all) = (0.0, 0.0);
        for (k, object) in self.problem.scene.objects.iter().enumerate() {
            let power = object.area * f64::from(luminance(self.unknowns.emission[k]));
            all += power;
            if self.roles[k] == Role::Emitter && shown[k][0] > shown[k][1] {
                measured += power;
            }
        }
        measured > MEASURED * all
    }

    /// Seen surfaces that reflect.
    fn surfaces_in_view(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k].reflects() && self.gbuffer.seen[k] > 0)
    }
}
