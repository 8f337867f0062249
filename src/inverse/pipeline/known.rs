//! Holds known values fixed through all changes of roles and all fits.

use crate::inverse::known::Pinned;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use glam::Vec3;

impl Pipeline<'_, '_> {
    pub(super) fn emission_is_known(&self, object: usize) -> bool {
        self.monitor.known.object(object).emission.is_some()
    }

    /// Sets the roles and values of objects with known values, with standard errors of zero.
    pub(super) fn hold(&mut self) {
        for (k, pinned) in self.monitor.known.objects() {
            if k >= self.problem.scene.objects.len() {
                continue;
            }
            let role = role_under(pinned, self.roles[k]);
            if role != self.roles[k] && role == Role::Emitter {
                self.unknowns.albedo[k] = Vec3::ZERO;
            }
            if !role.emits() {
                self.unknowns.emission[k] = Vec3::ZERO;
            }
            self.roles[k] = role;
            if let Some(albedo) = pinned.albedo {
                (self.unknowns.albedo[k], self.errors.albedo[k]) = (albedo, Vec3::ZERO);
            }
            if let Some(emission) = pinned.emission {
                (self.unknowns.emission[k], self.errors.emission[k]) = (emission, Vec3::ZERO);
            }
        }
    }

    /// Sets known values in the estimate, with a note on each.
    pub(super) fn describe_known(&mut self) {
        for (k, pinned) in self.monitor.known.objects() {
            let Some(object) = self.estimate.objects.get_mut(k) else {
                continue;
            };
            if let Some(albedo) = pinned.albedo {
                (object.albedo, object.albedo_stderr) = (albedo, Vec3::ZERO);
                object.albedo_identifiable = true;
            }
            if let Some(emission) = pinned.emission {
                (object.emission, object.emission_stderr) = (emission, Vec3::ZERO);
            }
            pinned.words().clone_into(&mut object.note);
        }
    }
}

/// The role, according to the photographs and under known values: a known emission decides whether the object emits, and with a
/// known albedo it reflects.
pub(super) fn role_under(pinned: Pinned, role: Role) -> Role {
    let emits = pinned.emission.map(|emission| emission != Vec3::ZERO);
    match (emits, role) {
        (Some(false), Role::Emitter | Role::Glowing) => Role::Reflector,
        (Some(false), Role::Unseen) => Role::Dark,
        (Some(true), Role::Dark) => Role::Unseen,
        (Some(true), Role::Reflector) | (_, Role::Emitter) if pinned.albedo.is_some() => {
            Role::Glowing
        }
        (Some(true), Role::Reflector) => Role::Emitter,
        _ => role,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_decides_the_role() {
        let [dark, light] = [Vec3::ZERO, Vec3::splat(3.0)].map(Some);
        let grey = Some(Vec3::splat(0.5));
        for (albedo, emission, role, wanted) in [
            (None, None, Role::Emitter, Role::Emitter),
            (None, dark, Role::Emitter, Role::Reflector),
            (None, dark, Role::Glowing, Role::Reflector),
            (None, dark, Role::Unseen, Role::Dark),
            (None, light, Role::Reflector, Role::Emitter),
            (None, light, Role::Dark, Role::Unseen),
            (None, light, Role::Glowing, Role::Glowing),
            (grey, None, Role::Emitter, Role::Glowing),
            (grey, None, Role::Reflector, Role::Reflector),
            (grey, light, Role::Reflector, Role::Glowing),
            (grey, dark, Role::Emitter, Role::Reflector),
        ] {
            assert_eq!(role_under(Pinned { albedo, emission }, role), wanted);
        }
    }
}
