//! The BSDF: a diffuse base under an optional rough specular lobe.
//!
//! Directions are unit vectors pointing away from the surface, in the local frame whose z axis is the normal on the
//! side of `wo`.

use crate::math::warp;
use crate::transport::material::Lobe;
use crate::transport::microfacet::{Microfacet, reflect_on_visible_normal};
use glam::{DVec3, Vec3};
use std::f64::consts::FRAC_1_PI;

/// Lower limit of roughness: mirrors are rendered as very narrow lobes.
pub const MIN_ROUGHNESS: f32 = 1e-4;

/// The material of one surface point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bsdf {
    /// Diffuse reflectance, in [0, 1] per channel.
    pub albedo: Vec3,
    /// Rough specular lobe, if any.
    pub lobe: Option<Lobe>,
}

/// A sampled direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfSample {
    /// Unit direction, above the horizon.
    pub wi: Vec3,
    /// f(wo, wi) cosθi / pdf.
    pub weight: Vec3,
    /// Pdf of `wi` per solid angle, positive.
    pub pdf: f32,
}

impl Bsdf {
    /// f(wo, wi) cosθi; zero where either direction is at or below the horizon.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Vec3::ZERO;
        }
        let Some(lobe) = self.lobe else {
            return self.albedo * warp::cosine_hemisphere_pdf(wi.z);
        };
        let base = self.albedo.as_dvec3() * lobe.base(wo, wi);
        (base + lobe.reflected(wo, wi)).as_vec3()
    }

    /// Pdf per solid angle of [`Bsdf::sample`]; zero at or below the horizon.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return 0.0;
        }
        let base = warp::cosine_hemisphere_pdf(wi.z);
        let Some(lobe) = self.lobe else { return base };
        let p = lobe.fraction(wo);
        (p * lobe.pdf(wo, wi) + (1.0 - p) * f64::from(base)) as f32
    }

    /// Samples a direction: `choice` selects lobe or base, `u` the direction.
    ///
    /// `None` if `wo` is at or below the horizon, or if the lobe reflects below it: the sample contributes zero.
    #[inline]
    pub fn sample(&self, wo: Vec3, choice: f32, u: [f32; 2]) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let wi = match &self.lobe {
            Some(lobe) if f64::from(choice) < lobe.fraction(wo) => lobe.sample(wo, u),
            _ => warp::cosine_hemisphere(u),
        };
        let pdf = self.pdf(wo, wi);
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        let weight = match self.lobe {
            Some(_) => self.eval(wo, wi) / pdf,
            None => self.albedo,
        };
        Some(BsdfSample { wi, weight, pdf })
    }
}

/// The lobe and the base under it, for directions above the horizon.
impl Lobe {
    /// f(wo, wi) cosθi of the lobe itself.
    #[inline]
    pub fn reflected(&self, wo: Vec3, wi: Vec3) -> DVec3 {
        let microfacet = Microfacet::new(alpha(self), wo, wi);
        microfacet.fresnel(self.specular.as_dvec3()) * microfacet.eval()
    }

    /// f(wo, wi) cosθi of the diffuse base under the lobe, for unit albedo.
    #[inline]
    pub fn base(&self, wo: Vec3, wi: Vec3) -> DVec3 {
        (DVec3::ONE - self.specular.as_dvec3()) * coupling(wo, wi)
    }

    /// Pdf per solid angle of [`Lobe::sample`].
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f64 {
        Microfacet::new(alpha(self), wo, wi).pdf()
    }

    /// Samples a direction of the lobe; it may point below the horizon, where it contributes zero.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        reflect_on_visible_normal(alpha(self), wo, u)
    }

    /// Probability of sampling the lobe: an upper bound of the fraction of light that it reflects to `wo`, averaged over channels.
    #[inline]
    pub fn fraction(&self, wo: Vec3) -> f64 {
        let specular = f64::from(self.specular.element_sum() / 3.0);
        specular + (1.0 - specular) * reflected(f64::from(wo.z))
    }
}

/// Upper bound over all roughnesses of the fraction of light from all directions that a lobe with this reflectance along the normal
/// reflects: F0 + (1 − F0) times the cosine-weighted mean of `reflected`.
pub fn hemispherical_reflectance(specular: f32) -> f32 {
    specular + (1.0 - specular) * (1.0 - unreflected_mean()) as f32
}

/// Slope of the fit (1 − slope · cosθ)⁵ to a rough lobe's reflectance; 1 is Schlick's curve.
pub const COUPLING_SLOPE: f64 = 0.85;

/// Upper bound over all roughnesses of the directional reflectance of a lobe with F0 = 0: Schlick's (1 − cosθ)⁵, flattened
/// because rough lobes reflect more near the normal.
#[inline]
fn reflected(cos_theta: f64) -> f64 {
    (1.0 - COUPLING_SLOPE * cos_theta).powi(5)
}

/// f cosθi of the base for unit albedo, without the factor (1 − F0).
///
/// As in Ashikhmin and Shirley 2000: the base is reduced symmetrically by the lobe's reflectance at both directions and normalised,
/// so that its directional albedo is albedo × (1 − F0) × (1 − reflected(θo)).
#[inline]
pub fn coupling(wo: Vec3, wi: Vec3) -> f64 {
    let (cos_o, cos_i) = (f64::from(wo.z), f64::from(wi.z));
    FRAC_1_PI * cos_i * (1.0 - reflected(cos_o)) * (1.0 - reflected(cos_i)) / unreflected_mean()
}

/// Cosine-weighted mean of 1 − [`reflected`] over the hemisphere.
#[inline]
fn unreflected_mean() -> f64 {
    const A: f64 = COUPLING_SLOPE;
    const B: f64 = 1.0 - A;
    1.0 - (1.0 - B.powi(6) * (1.0 + 6.0 * A)) / (21.0 * A * A)
}

/// The constant factor of [`coupling`].
pub fn coupling_scale() -> f64 {
    FRAC_1_PI / unreflected_mean()
}

/// Radiance of the base at viewing angle cosθ relative to that along the normal; independent of the incident light.
#[inline]
pub fn base_by_view(cos_theta: f32) -> f32 {
    ((1.0 - reflected(f64::from(cos_theta))) / (1.0 - reflected(1.0))) as f32
}

#[inline]
fn alpha(lobe: &Lobe) -> f64 {
    f64::from(lobe.roughness.clamp(MIN_ROUGHNESS, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use crate::math::stats::pearson_deviate;
    use std::f64::consts::PI;

    fn direction(cos_theta: f32, phi: f32) -> Vec3 {
        let sin = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
        Vec3::new(sin * phi.cos(), sin * phi.sin(), cos_theta)
    }

    fn glossy(albedo: f32, roughness: f32, specular: f32) -> Bsdf {
        Bsdf {
            albedo: Vec3::splat(albedo),
            lobe: Some(Lobe::grey(roughness, specular)),
        }
    }

    /// Pearson's test of `sample` against `pdf` over 10 × 20 cells of equal solid angle, one for lost samples.
    fn deviate(bsdf: &Bsdf, wo: Vec3, seed: u64) -> f64 {
        const ROWS: usize = 10;
        const COLUMNS: usize = 20;
        const FINE: usize = 48;
        let n = 100_000u32;
        let mut observed = vec![0f64; ROWS * COLUMNS + 1];
        for sample in 0..n {
            let mut stream = Stream::new(seed, 0, 0, u64::from(sample));
            let drawn = bsdf.sample(wo, stream.uniform(), stream.uniform2());
            let cell = drawn.map_or(ROWS * COLUMNS, |s| {
                let row = ((s.wi.z * ROWS as f32) as usize).min(ROWS - 1);
                let turn = (s.wi.y.atan2(s.wi.x) / (2.0 * std::f32::consts::PI)).rem_euclid(1.0);
                row * COLUMNS + ((turn * COLUMNS as f32) as usize).min(COLUMNS - 1)
            });
            observed[cell] += 1.0;
        }
        let mut expected = vec![0f64; ROWS * COLUMNS + 1];
        let area = 2.0 * PI / (ROWS * COLUMNS * FINE * FINE) as f64;
        for i in 0..ROWS * FINE {
            for j in 0..COLUMNS * FINE {
                let z = (i as f32 + 0.5) / (ROWS * FINE) as f32;
                let turn = (j as f32 + 0.5) / (COLUMNS * FINE) as f32;
                let wi = direction(z, turn * 2.0 * std::f32::consts::PI);
                expected[i / FINE * COLUMNS + j / FINE] +=
                    f64::from(bsdf.pdf(wo, wi)) * area * f64::from(n);
            }
        }
        let integral = expected.iter().sum::<f64>() / f64::from(n);
        assert!(integral < 1.0 + 2e-3, "{integral}");
        expected[ROWS * COLUMNS] = f64::from(n) * (1.0 - integral).max(0.0);
        pearson_deviate(&observed, &expected, 5.0)
    }

    #[test]
    fn the_base_looks_the_same_from_everywhere_but_for_a_factor() {
        let lobe = Lobe::grey(0.3, 0.2);
        for (cos_o, cos_i) in [(0.05, 0.7), (0.4, 0.1), (0.9, 0.95), (1.0, 0.5)] {
            let (wo, wi) = (direction(cos_o, 0.3), direction(cos_i, 2.0));
            let along_normal = lobe.base(Vec3::Z, wi) * f64::from(base_by_view(wo.z));
            assert!((lobe.base(wo, wi) - along_normal).abs().max_element() < 1e-7);
        }
    }

    /// 15 tests at significance 1e-4 each; a narrow lobe at the horizon is too thin for the cells' midpoint rule.
    #[test]
    fn samples_follow_the_density() {
        let mut seed = 0;
        for cos_theta in [1.0, 0.7, 0.2, 1e-3] {
            let wo = direction(cos_theta, 0.4);
            for bsdf in [
                Bsdf {
                    albedo: Vec3::ONE,
                    lobe: None,
                },
                glossy(0.5, 0.1, 0.3),
                glossy(0.5, 0.4, 0.9),
                glossy(0.5, 1.0, 0.6),
            ] {
                seed += 1;
                if cos_theta < 0.01 && bsdf.lobe.is_some_and(|lobe| lobe.roughness < 0.2) {
                    continue;
                }
                // One in 10⁴.
                let z = deviate(&bsdf, wo, seed);
                assert!(z < 3.72, "z = {z} at cos {cos_theta} for {bsdf:?}");
            }
        }
    }

    /// Fraction of light reflected from `wo`, by a midpoint rule over the unit square of each technique.
    fn directional_albedo(bsdf: &Bsdf, wo: Vec3) -> f64 {
        let n = 192;
        let p = bsdf.lobe.map_or(0.0, |lobe| lobe.fraction(wo));
        let mut sum = 0.0;
        for i in 0..n * n {
            let u = [
                ((i / n) as f32 + 0.5) / n as f32,
                ((i % n) as f32 + 0.5) / n as f32,
            ];
            for (choice, fraction) in [(0.0, p), (1.0 - f32::EPSILON, 1.0 - p)] {
                if let Some(sample) = bsdf.sample(wo, choice, u).filter(|_| fraction > 1e-6) {
                    sum += fraction * f64::from(sample.weight.x);
                }
            }
        }
        sum / f64::from(n * n)
    }

    #[test]
    fn no_energy_is_made_and_the_base_returns_its_closed_form() {
        for roughness in [0.05, 0.2, 0.4, 1.0] {
            for specular in [0.0, 0.3, 1.0] {
                for cos_theta in [0.01, 0.4, 0.7, 0.9, 1.0] {
                    let wo = direction(cos_theta, 1.0);
                    let white = directional_albedo(&glossy(1.0, roughness, specular), wo);
                    let black = directional_albedo(&glossy(0.0, roughness, specular), wo);
                    let what = format!("at α {roughness}, F0 {specular}, cos {cos_theta}");
                    assert!(white < 1.001, "{white} {what}");
                    let base =
                        (1.0 - f64::from(specular)) * (1.0 - reflected(f64::from(cos_theta)));
                    let off = (white - black - base).abs();
                    assert!(off < 1e-3, "{white} {black} {base} {what}");
                }
            }
        }
    }

    #[test]
    fn scattering_is_reciprocal_and_weights_are_values_over_densities() {
        let mut stream = Stream::new(5, 0, 0, 0);
        for _ in 0..20_000 {
            let bsdf = glossy(stream.uniform(), stream.uniform(), stream.uniform());
            let wo = warp::cosine_hemisphere(stream.uniform2());
            let wi = warp::cosine_hemisphere(stream.uniform2());
            // f(wo, wi) cosθi · cosθo is symmetric.
            let forward = f64::from(bsdf.eval(wo, wi).x) * f64::from(wo.z);
            let backward = f64::from(bsdf.eval(wi, wo).x) * f64::from(wi.z);
            let off = (forward - backward).abs();
            assert!(off <= 1e-6 * forward.max(backward), "{bsdf:?}");
            if let Some(s) = bsdf.sample(wo, stream.uniform(), stream.uniform2()) {
                let value = bsdf.eval(wo, s.wi);
                assert_eq!(s.pdf, bsdf.pdf(wo, s.wi));
                assert!((s.weight * s.pdf - value).abs().x <= 1e-5 * value.x);
            }
            assert_eq!((bsdf.eval(wo, -wi), bsdf.pdf(wo, -wi)), (Vec3::ZERO, 0.0));
            assert!(bsdf.sample(-wo, 0.5, [0.5; 2]).is_none());
        }
    }
}
