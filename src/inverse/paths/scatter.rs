//! How a stored path scatters where a rough lobe lies over the diffuse base.
//!
//! A path takes either the base, whose albedo is unknown, or the lobe, which is held while albedos are fitted: so each
//! vertex still holds one unknown factor or none, and the rest of its weight is known.

use crate::math::frame::Frame;
use crate::math::warp;
use crate::transport::material::Lobe;
use glam::Vec3;

/// Chance of the lobe at least, and of the base.
const MIN_CHANCE: f64 = 0.1;

/// The part that a path takes at a vertex with a lobe.
pub struct Scattering {
    lobe: Lobe,
    frame: Frame,
    wo: Vec3,
    /// Whether the path takes the lobe.
    pub specular: bool,
    /// Chance of the part taken.
    chance: f64,
}

/// A direction, the weight f cosθ / density of the part taken (the base for unit albedo) over the part's chance, and the
/// density.
pub struct Scattered {
    /// Unit direction in the world.
    pub wi: Vec3,
    /// Weight.
    pub weight: f32,
    /// Density per solid angle.
    pub pdf: f32,
}

impl Scattering {
    /// At a surface seen along `wo` (unit, away from it) whose side has the unit normal; `albedo` is what is believed of
    /// the base, and `choice` uniform.
    pub fn new(lobe: Lobe, normal: Vec3, wo: Vec3, albedo: f32, choice: f32) -> Self {
        let frame = Frame::around(normal);
        let wo = frame.to_local(wo.normalize_or_zero());
        let fraction = lobe.fraction(wo);
        let base = (1.0 - fraction) * f64::from(albedo);
        let chance = fraction / (fraction + base).max(f64::MIN_POSITIVE);
        let chance = chance.clamp(MIN_CHANCE, 1.0 - MIN_CHANCE);
        let specular = f64::from(choice) < chance;
        Self {
            lobe,
            frame,
            wo,
            specular,
            chance: if specular { chance } else { 1.0 - chance },
        }
    }

    /// What is believed to be left of the light after this vertex, its unknown albedo included.
    pub fn believed(&self, albedo: f32) -> f32 {
        let fraction = self.lobe.fraction(self.wo);
        let left = if self.specular {
            fraction
        } else {
            (1.0 - fraction) * f64::from(albedo)
        };
        (left / self.chance) as f32
    }

    /// f cosθ of the part taken over its chance, and the density of [`Scattering::sample`], for a unit direction in the
    /// world.
    pub fn value(&self, wi: Vec3) -> (f32, f32) {
        self.local_value(self.frame.to_local(wi))
    }

    fn local_value(&self, wi: Vec3) -> (f32, f32) {
        if wi.z <= 0.0 || self.wo.z <= 0.0 {
            return (0.0, 0.0);
        }
        let (value, pdf) = if self.specular {
            let value = self.lobe.reflected(self.wo, wi).x;
            (value, self.lobe.pdf(self.wo, wi) as f32)
        } else {
            let value = self.lobe.base(self.wo, wi).x;
            (value, warp::cosine_hemisphere_pdf(wi.z))
        };
        ((value / self.chance) as f32, pdf)
    }

    /// Draws a direction of the part taken; `None` where it carries nothing.
    pub fn sample(&self, u: [f32; 2]) -> Option<Scattered> {
        let local = if self.specular {
            self.lobe.sample(self.wo, u)
        } else {
            warp::cosine_hemisphere(u)
        };
        let (value, pdf) = self.local_value(local);
        (value > 0.0 && pdf > 0.0).then(|| Scattered {
            wi: self.frame.to_world(local),
            weight: value / pdf,
            pdf,
        })
    }
}
