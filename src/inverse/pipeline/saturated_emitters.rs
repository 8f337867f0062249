//! Emitters whose photographs are saturated: whether what they light tells how bright they are.

use crate::inverse::emitters::classify::least_emission;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::misfit::Misfit;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::Role;
use crate::math::color::luminance;
use glam::Vec3;

/// Emission over the least that photographs show, above which an emitter is tested.
const BRIGHTER: f32 = 10.0;
/// Least relative rise of the squared error of all other objects when a lamp is held at that least emission, and the rise in
/// standard errors.
const RISE: f64 = 0.1;
const RISE_ERRORS: f64 = 3.0;

impl Pipeline<'_, '_> {
    /// Holds saturated emitters of a scan at the least emission that their photographs show, unless other objects are explained
    /// clearly worse then. A saturated surface beside a window may otherwise be given the light of the window. Emitters that are
    /// furthest above what their photographs show come first. Returns the names of those that are held.
    pub(super) fn hold_saturated(&mut self, cache: &PathCache) -> Result<Vec<String>> {
        let mut held = Vec::new();
        if !self.problem.scene.scanned {
            return Ok(held);
        }
        let least = least_emission(cache, &self.unknowns, &self.roles);
        let mut doubtful: Vec<(f32, usize, Vec3)> = (least.into_iter().enumerate())
            .filter_map(|(k, least)| {
                let least = least?;
                let excess = luminance(self.unknowns.emission[k]) / luminance(least);
                let is_free = self.roles[k] == Role::Emitter && !self.emission_is_known(k);
                (is_free && excess > BRIGHTER).then_some((excess, k, least))
            })
            .collect();
        doubtful.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, k, least) in doubtful {
            let free = self.found();
            let before = Misfit::beside(cache, &self.unknowns, k);
            self.roles[k] = Role::Saturated;
            self.unknowns.emission[k] = least;
            let fitted = self.fit(cache)?;
            self.take(&fitted);
            self.weigh(cache)?;
            let after = Misfit::beside(cache, &self.unknowns, k);
            let is_lamp = after.mean() > (1.0 + RISE) * before.mean()
                && after.fall_in_errors(&before) > RISE_ERRORS;
            if is_lamp {
                self.go_back_to(free);
            } else {
                held.push(self.problem.scene.objects[k].name.clone());
            }
        }
        Ok(held)
    }

    /// Sets saturated emitters free, to test them anew.
    pub(super) fn free_saturated(&mut self) {
        for role in &mut self.roles {
            if *role == Role::Saturated {
                *role = Role::Emitter;
            }
        }
    }
}
