//! The GGX lobe (Walter et al. 2007) with height-correlated Smith masking (Heitz 2014) and Schlick's Fresnel term.
//!
//! Arithmetic is f64: a narrow lobe seen at a grazing angle spans more than f32 resolves.

use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// A unit direction in f64, with the largest component recomputed from the other two: its rounding would dominate near the horizon.
fn widen(direction: Vec3) -> DVec3 {
    let mut wide = direction.as_dvec3();
    let axis = wide.abs().max_position();
    let others = wide.length_squared() - wide[axis] * wide[axis];
    wide[axis] = wide[axis].signum() * (1.0 - others).max(0.0).sqrt();
    wide
}

/// The GGX lobe between two directions above the horizon.
#[derive(Debug, Clone, Copy)]
pub struct Microfacet {
    alpha: f64,
    /// Cosines of the two directions.
    cos_o: f64,
    cos_i: f64,
    /// Squared sines of the two directions.
    sin2_o: f64,
    sin2_i: f64,
    /// Denominator of the distribution: sin²θh / α² + cos²θh.
    q: f64,
    /// Schlick's (1 − wo · h)⁵.
    pub schlick: f64,
}

impl Microfacet {
    /// The lobe of roughness α between two local unit directions.
    pub fn new(alpha: f64, wo: Vec3, wi: Vec3) -> Self {
        let (wo, wi) = (widen(wo), widen(wi));
        let h = (wo + wi).normalize_or_zero();
        let sin2_h = h.x * h.x + h.y * h.y;
        Self {
            alpha,
            cos_o: wo.z,
            cos_i: wi.z,
            sin2_o: wo.x * wo.x + wo.y * wo.y,
            sin2_i: wi.x * wi.x + wi.y * wi.y,
            q: sin2_h / (alpha * alpha) + h.z * h.z,
            // Mean of wo · h and wi · h, so that rounding does not break reciprocity.
            schlick: (1.0 - 0.5 * h.dot(wo + wi)).clamp(0.0, 1.0).powi(5),
        }
    }

    /// Density of normals at the half vector.
    #[inline]
    fn distribution(&self) -> f64 {
        1.0 / (PI * self.alpha * self.alpha * self.q * self.q)
    }

    /// Smith's √(cos² + α² sin²) = cosθ (1 + 2Λ).
    #[inline]
    fn smith(&self, cos: f64, sin2: f64) -> f64 {
        (cos * cos + self.alpha * self.alpha * sin2).sqrt()
    }

    /// Schlick's reflectance at the half vector.
    #[inline]
    pub fn fresnel(&self, specular: DVec3) -> DVec3 {
        specular + (DVec3::ONE - specular) * self.schlick
    }

    /// D G₂ cosθi / (4 cosθo cosθi), the lobe's f cosθi without the Fresnel term.
    #[inline]
    pub fn eval(&self) -> f64 {
        let masking = self.cos_i * self.smith(self.cos_o, self.sin2_o)
            + self.cos_o * self.smith(self.cos_i, self.sin2_i);
        0.5 * self.distribution() * self.cos_i / masking
    }

    /// D G₁ / (4 cosθo): the pdf per solid angle of reflection on a visible normal.
    #[inline]
    pub fn pdf(&self) -> f64 {
        0.5 * self.distribution() / (self.cos_o + self.smith(self.cos_o, self.sin2_o))
    }
}

/// Reflects `wo` on a sampled visible normal (Heitz 2018, in the form of Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with
/// Spherical Caps"). The result may point below the horizon.
pub fn reflect_on_visible_normal(alpha: f64, wo: Vec3, u: [f32; 2]) -> Vec3 {
    let wo = widen(wo);
    // Stretch the ellipsoid to a hemisphere.
    let stretched = DVec3::new(alpha * wo.x, alpha * wo.y, wo.z).normalize_or_zero();
    // Sample uniformly the cap of directions that the hemisphere reflects `stretched` to.
    let phi = 2.0 * PI * f64::from(u[0]);
    let z = (1.0 - f64::from(u[1])) * (1.0 + stretched.z) - stretched.z;
    let sin = (1.0 - z * z).max(0.0).sqrt();
    let half = DVec3::new(sin * phi.cos(), sin * phi.sin(), z) + stretched;
    // Back to the ellipsoid.
    let h = DVec3::new(alpha * half.x, alpha * half.y, half.z).normalize_or_zero();
    (h * (2.0 * h.dot(wo)) - wo).normalize_or_zero().as_vec3()
}
