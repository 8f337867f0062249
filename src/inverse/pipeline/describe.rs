//! Converts the fitted unknowns to an estimate, with remarks on what is not determined.

use crate::inverse::estimate::{Estimate, ObjectEstimate, Outside};
use crate::inverse::fit::prior::ALBEDO_DEVIATION;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use crate::math::color::luminance;
use crate::transport::environment::directions;
use crate::transport::sun::Sun;
use crate::transport::surroundings::Surroundings;
use glam::{DVec3, Vec3};
use std::f32::consts::PI;

/// Standard error above which an albedo counts as undetermined.
const UNKNOWN_ALBEDO: f32 = 0.2 * ALBEDO_DEVIATION;
/// Relative standard error above which an emission counts as undetermined.
const UNKNOWN_EMISSION: f32 = 0.5;
/// Lamps that fewer pixels see get a remark.
const FEW_PIXELS: u64 = 19;

/// Relative difference in radiance, and difference of an albedo from one, below which a wall may be confused with a lamp.
const WHITE: f32 = 0.01;

const LAMP: &str = "its own light hides what it reflects; emission is all that leaves it";
const LAMP_OF_FEW_PIXELS: &str = "its own light hides what it reflects; emission is all that leaves it; only a few pixels see it";
const SATURATED: &str = "all photographs of it are saturated; its emission is the least that they show, and nothing tells that it is more";
const UNSEEN: &str = "no photograph sees it; its emission is inferred from its effect on others";

impl Pipeline<'_, '_> {
    /// The estimate by unknowns, standard errors and lobes alone.
    pub(super) fn fitted_estimate(&self) -> Estimate {
        let typical = self.typical_albedo();
        // Without any source, photographs are also explained by albedos of one in arbitrary light.
        let dark = self.unknowns.emission.iter().all(|&e| e == Vec3::ZERO);
        let sourceless = self.sky.is_none() && dark;
        let objects = 0..self.problem.scene.objects.len();
        Estimate {
            objects: objects
                .map(|k| self.object_estimate(k, typical, sourceless))
                .collect(),
            outside: self.outside_light(),
            ..Default::default()
        }
    }

    /// The estimate of one object, given the room's typical albedo and whether no source of light was found.
    fn object_estimate(&self, k: usize, typical: Vec3, sourceless: bool) -> ObjectEstimate {
        let (albedo, albedo_stderr) = (self.unknowns.albedo[k], self.errors.albedo[k]);
        let mut object = ObjectEstimate {
            albedo,
            albedo_stderr,
            emission: self.unknowns.emission[k],
            // File formats have no infinity.
            emission_stderr: self.errors.emission[k].min(Vec3::splat(f32::MAX)),
            seen_pixels: self.gbuffer.seen[k],
            roughness: self.lobes[k].map(|lobe| lobe.roughness),
            specular: self.lobes[k].map(|lobe| lobe.specular.x),
            ..Default::default()
        };
        if !self.roles[k].reflects() {
            object.albedo_stderr = Vec3::splat(ALBEDO_DEVIATION);
        }
        let (identifiable, note) = match self.roles[k] {
            Role::Reflector | Role::Glowing if albedo_stderr.max_element() > UNKNOWN_ALBEDO => {
                object.albedo = shrunk(albedo, albedo_stderr, typical);
                let note = "too few paths through its pixels meet light to tell its albedo";
                (false, note)
            }
            Role::Reflector | Role::Glowing if sourceless => {
                (false, "no source was found of the light that it reflects")
            }
            Role::Reflector | Role::Glowing => return object,
            Role::Emitter => {
                object.albedo = Vec3::ZERO;
                if is_unknown(object.emission, object.emission_stderr) {
                    (false, "the photographs hardly tell how much light it gives")
                } else if object.seen_pixels < FEW_PIXELS {
                    (true, LAMP_OF_FEW_PIXELS)
                } else {
                    (true, LAMP)
                }
            }
            Role::Saturated => {
                object.albedo = Vec3::ZERO;
                (false, SATURATED)
            }
            Role::Unseen => (false, UNSEEN),
            Role::Dark => (false, "no photograph sees it; its albedo is assumed"),
        };
        object.identifiable = identifiable;
        object.albedo_identifiable = false;
        object.note = note.to_owned();
        object
    }

    /// The light from outside as a map; `None` if it is black.
    fn outside_light(&self) -> Option<Outside> {
        let (unknowns, grid, sky) = (&self.unknowns, self.outside, self.sky.as_ref());
        let emission = |surface: u32| unknowns.emission[surface as usize];
        let elsewhere = |direction| emission(grid.surface(direction));
        let [width, height] = sky.map_or([grid.width, grid.height], |sky| sky.map().size());
        // On a box, light of one point is not that of one direction: a window sends the sky's light down and the ground's up.
        let boxed = grid.surroundings != Surroundings::Far;
        let filled = |towards: Option<Vec3>| -> Vec<Vec3> {
            match sky {
                Some(sky) => sky.filled(towards, |from| emission(grid.excess(from)), elsewhere),
                None => directions([width, height]).map(elsewhere).collect(),
            }
        };
        let pixels = filled(boxed.then_some(-grid.up));
        let above = (boxed && sky.is_some()).then(|| filled(Some(grid.up)));
        let sun = grid.sun.map(|direction| Sun {
            direction,
            irradiance: emission(grid.sun_surface()) * PI,
        });
        let sun = sun.filter(|sun| sun.irradiance != Vec3::ZERO);
        let shines = |pixels: &[Vec3]| pixels.iter().any(|&p| p != Vec3::ZERO);
        let any = shines(&pixels) || above.as_deref().is_some_and(shines) || sun.is_some();
        any.then_some(Outside {
            width: width as u32,
            height: height as u32,
            pixels,
            above,
            surroundings: grid.surroundings,
            sun,
            openings: sun.and(sky).and_then(MeasuredOutside::openings),
        })
    }

    /// Area-weighted mean of the determined albedos; 0.5 if there are none.
    fn typical_albedo(&self) -> Vec3 {
        let mut sum = DVec3::ZERO;
        let mut area = 0.0;
        for (k, object) in self.problem.scene.objects.iter().enumerate() {
            let known = self.roles[k] == Role::Reflector
                && self.errors.albedo[k].max_element() <= UNKNOWN_ALBEDO;
            if known && luminance(self.unknowns.albedo[k]).is_finite() {
                sum += self.unknowns.albedo[k].as_dvec3() * object.area;
                area += object.area;
            }
        }
        if area > 0.0 {
            (sum / area).as_vec3()
        } else {
            Vec3::splat(0.5)
        }
    }
}

/// Marks white walls and lamps of equal radiance as not identifiable. Between white surfaces all radiance approaches that of the
/// lamp, as in a furnace, so a reflector with an albedo of about one and the radiance of a lamp may be the lamp instead.
/// `brightness` is the mean of each object's brightest channel over its pixels.
pub fn flag_white(estimate: &mut Estimate, brightness: &[f32]) {
    let objects = &mut estimate.objects;
    let lamps: Vec<usize> = (0..objects.len())
        .filter(|&k| objects[k].emission.max_element() > 0.0 && objects[k].seen_pixels > 0)
        .collect();
    let mut doubtful: Vec<usize> = Vec::new();
    for k in 0..objects.len() {
        let white = (objects[k].albedo + objects[k].albedo_stderr).max_element() > 1.0 - WHITE;
        let is_similar = |lamp: usize| (brightness[k] / brightness[lamp] - 1.0).abs() < WHITE;
        let similar: Vec<usize> = (lamps.iter().copied())
            .filter(|&lamp| lamp != k && is_similar(lamp))
            .collect();
        if white && !similar.is_empty() {
            doubtful.push(k);
            doubtful.extend(similar);
        }
    }
    for k in doubtful {
        objects[k].identifiable = false;
        objects[k].albedo_identifiable = false;
        "white surfaces show as much light as a lamp does: which of them gives it cannot be told"
            .clone_into(&mut objects[k].note);
    }
}

/// Whether an emission is undetermined, by its errors relative to its brightest channel.
fn is_unknown(emission: Vec3, stderr: Vec3) -> bool {
    stderr.max_element() > UNKNOWN_EMISSION * emission.max_element()
}

/// An uncertain albedo shrunk to the room's typical one: the mean of both by the inverse variances of fit and prior.
fn shrunk(albedo: Vec3, stderr: Vec3, typical: Vec3) -> Vec3 {
    let variance = stderr * stderr / (ALBEDO_DEVIATION * ALBEDO_DEVIATION);
    let fraction = (variance + Vec3::ONE).recip();
    albedo * fraction + typical * (Vec3::ONE - fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_albedo_that_is_hardly_known_is_drawn_to_the_typical_one() {
        let typical = Vec3::splat(0.4);
        let at = |stderr| shrunk(Vec3::ZERO, Vec3::splat(stderr), typical).x;
        assert!(at(UNKNOWN_ALBEDO) < 0.02);
        assert!((at(ALBEDO_DEVIATION) - 0.2).abs() < 1e-6);
        assert!((at(f32::INFINITY) - 0.4).abs() < 1e-6);
    }

    #[test]
    fn a_white_wall_as_bright_as_the_lamp_is_flagged_with_it_and_a_grey_or_darker_one_is_not() {
        let object = |albedo: f32, emission: f32| ObjectEstimate {
            albedo: Vec3::splat(albedo),
            emission: Vec3::splat(emission),
            seen_pixels: 100,
            ..Default::default()
        };
        let identifiable = |albedo: f32, brightness: f32| {
            let mut estimate = Estimate {
                objects: vec![object(0.0, 2.0), object(albedo, 0.0), object(0.5, 0.0)],
                ..Default::default()
            };
            flag_white(&mut estimate, &[2.0, brightness, 1.0]);
            assert!(estimate.objects[2].identifiable);
            [0, 1].map(|k| estimate.objects[k].identifiable)
        };
        assert_eq!(identifiable(0.999, 1.995), [false; 2]);
        assert_eq!(identifiable(0.999, 1.9), [true; 2]);
        assert_eq!(identifiable(0.9, 1.995), [true; 2]);
    }
}
