//! Scattering of stored paths at surfaces with a rough specular lobe over a diffuse base.
//!
//! A path chooses either the base, whose albedo is unknown, or the lobe, which is held fixed. So each vertex has at most one
//! unknown factor, and the rest of its weight is known.

use crate::math::frame::Frame;
use crate::math::warp;
use crate::transport::material::Lobe;
use glam::Vec3;

/// Least probability of choosing the lobe, and of choosing the base.
const MIN_PROBABILITY: f64 = 0.1;

/// The component (lobe or base) that a path chose at a vertex with a lobe.
pub struct Scattering {
    lobe: Lobe,
    frame: Frame,
    wo: Vec3,
    /// Whether the path chose the lobe.
    pub specular: bool,
    /// Probability of the chosen component.
    probability: f64,
}

/// A sampled direction.
pub struct Scattered {
    /// Unit direction in world space.
    pub wi: Vec3,
    /// f cosθ / (pdf × probability) of the chosen component, the base with unit albedo.
    pub weight: f32,
    /// Pdf of the chosen component with respect to solid angle.
    pub pdf: f32,
}

impl Scattering {
    /// Chooses a component for the unit outgoing direction `wo` and the unit normal of that side. `albedo` is the present
    /// estimate of the base's albedo, and `choice` is uniform in [0, 1).
    pub fn new(lobe: Lobe, normal: Vec3, wo: Vec3, albedo: f32, choice: f32) -> Self {
        let frame = Frame::around(normal);
        let wo = frame.to_local(wo.normalize_or_zero());
        let fraction = lobe.fraction(wo);
        let base = (1.0 - fraction) * f64::from(albedo);
        let lobe_probability = fraction / (fraction + base).max(f64::MIN_POSITIVE);
        let lobe_probability = lobe_probability.clamp(MIN_PROBABILITY, 1.0 - MIN_PROBABILITY);
        let specular = f64::from(choice) < lobe_probability;
        Self {
            lobe,
            frame,
            wo,
            specular,
            probability: if specular {
                lobe_probability
            } else {
                1.0 - lobe_probability
            },
        }
    }

    /// Expected throughput of this vertex, with `albedo` for the unknown albedo of the base.
    pub fn expected_throughput(&self, albedo: f32) -> f32 {
        let fraction = self.lobe.fraction(self.wo);
        let reflected = if self.specular {
            fraction
        } else {
            (1.0 - fraction) * f64::from(albedo)
        };
        (reflected / self.probability) as f32
    }

    /// For a unit direction in world space: f cosθ of the chosen component over its probability, and the pdf of
    /// [`Scattering::sample`] with respect to solid angle.
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
        ((value / self.probability) as f32, pdf)
    }

    /// Samples a direction from the chosen component; `None` if its weight is zero.
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
