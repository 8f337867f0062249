//! Lobes from a mirror's to the widest, seen from above and at 1e-7 rad over the horizon.

use glam::{DVec3, Vec3};
use relit::math::rng::Stream;
use relit::math::stats::pearson_deviate;
use relit::transport::bsdf::Bsdf;
use relit::transport::material::Lobe;
use std::f64::consts::{FRAC_PI_2, TAU};

const ROUGHNESSES: [f32; 6] = [1e-4, 1e-3, 1e-2, 0.1, 0.4, 1.0];
/// Angles over the horizon, in radians.
const HEIGHTS: [f64; 6] = [1e-7, 1e-5, 1e-3, 0.1, 0.8, FRAC_PI_2];

fn glossy(albedo: f32, roughness: f32, specular: f32) -> Bsdf {
    Bsdf {
        albedo: Vec3::splat(albedo),
        lobe: Some(Lobe {
            roughness,
            specular: Vec3::splat(specular),
        }),
    }
}

fn from(height: f64, turn: f64) -> Vec3 {
    let (sin, cos) = height.sin_cos();
    DVec3::new(cos * turn.cos(), cos * turn.sin(), sin).as_vec3()
}

#[test]
fn nothing_is_nan_and_no_energy_is_made() {
    for roughness in ROUGHNESSES {
        for specular in [0.0, 0.04, 0.5, 1.0] {
            for height in HEIGHTS {
                let bsdf = glossy(1.0, roughness, specular);
                let wo = from(height, 0.3);
                let what = format!("α {roughness}, F0 {specular}, {height:e} rad");
                let (mut sum, mut squares) = (0.0f64, 0.0f64);
                let n = 4_000;
                for index in 0..n {
                    let mut stream = Stream::new(101, 0, 0, index);
                    let drawn = bsdf.sample(wo, stream.uniform(), stream.uniform2());
                    let Some(s) = drawn else { continue };
                    for v in [s.weight, bsdf.eval(wo, s.wi)] {
                        assert!(v.is_finite(), "{what}: {s:?}");
                    }
                    assert!(s.pdf > 0.0 && s.pdf.is_finite(), "{what}: {s:?}");
                    assert!(s.weight.min_element() >= 0.0, "{what}: {s:?}");
                    sum += f64::from(s.weight.x);
                    squares += f64::from(s.weight.x).powi(2);
                }
                // One-sided test at four standard errors.
                let mean = sum / n as f64;
                let error = ((squares / n as f64 - mean * mean).max(0.0) / n as f64).sqrt();
                assert!(mean < 1.0 + 4.0 * error + 1e-4, "{what}: {mean} ± {error}");
            }
        }
    }
}

/// Slopes of half vectors in units of the roughness, where a lobe of any roughness is a few wide: chi-square of samples
/// against the density, cell by cell. The lobe alone (the base and its samples are another's test): specular 1.
#[test]
fn samples_follow_the_density_in_the_lobes_own_units() {
    let (mut tests, mut worst) = (0, f64::NEG_INFINITY);
    for roughness in ROUGHNESSES {
        for height in HEIGHTS {
            let z = deviate(roughness, from(height, 0.0));
            println!("α {roughness}, {height:e} rad: z {z:.2}");
            tests += 1;
            worst = worst.max(z);
            // One in 10⁵.
            assert!(z < 4.27, "α {roughness}, {height:e} rad: z {z}");
        }
    }
    assert_eq!(tests, 36);
    println!("largest z of {tests}: {worst:.2}");
}

const RINGS: usize = 8;
const SECTORS: usize = 16;
const FINE: usize = 24;

/// A direction in f64, of unit length: its largest component follows from the other two.
fn unit(v: Vec3) -> DVec3 {
    let mut v = v.as_dvec3();
    let axis = v.abs().max_position();
    let rest = v.length_squared() - v[axis] * v[axis];
    v[axis] = v[axis].signum() * (1.0 - rest).max(0.0).sqrt();
    v
}

/// Cell of a half vector's slope s over α in polar coordinates: rings of equal angle atan |s|, sectors of equal azimuth.
fn cell(alpha: f64, wo: Vec3, wi: Vec3) -> usize {
    let h = unit(wo) + unit(wi);
    let (x, y) = (h.x / h.z / alpha, h.y / h.z / alpha);
    let ring = x.hypot(y).atan() / FRAC_PI_2 * RINGS as f64;
    let sector = (y.atan2(x) / TAU).rem_euclid(1.0) * SECTORS as f64;
    (ring as usize).min(RINGS - 1) * SECTORS + (sector as usize).min(SECTORS - 1)
}

fn deviate(roughness: f32, wo: Vec3) -> f64 {
    let bsdf = glossy(0.0, roughness, 1.0);
    let alpha = f64::from(roughness);
    let n = 40_000u32;
    let lost = RINGS * SECTORS;
    let mut observed = vec![0.0; lost + 1];
    for index in 0..n {
        let mut stream = Stream::new(102, 0, 0, u64::from(index));
        let drawn = bsdf.sample(wo, stream.uniform(), stream.uniform2());
        observed[drawn.map_or(lost, |s| cell(alpha, wo, s.wi))] += 1.0;
    }
    // ∫ pdf dωi over each cell: dωi = 4 (wo·h) dωh, dωh = cos³θh α² ds, ds = tan ψ / cos² ψ dψ dφ.
    let mut expected = vec![0.0; lost + 1];
    let exact = unit(wo);
    let (rings, sectors) = (RINGS * FINE, SECTORS * FINE);
    for i in 0..rings {
        for j in 0..sectors {
            let psi = (i as f64 + 0.5) / rings as f64 * FRAC_PI_2;
            let phi = (j as f64 + 0.5) / sectors as f64 * TAU;
            let slope = alpha * psi.tan();
            let h = DVec3::new(slope * phi.cos(), slope * phi.sin(), 1.0).normalize_or_zero();
            let cosine = exact.dot(h);
            let wi = (h * (2.0 * cosine) - exact).normalize_or_zero();
            if cosine <= 0.0 || wi.z <= 0.0 {
                continue;
            }
            let area =
                psi.tan() / psi.cos().powi(2) * FRAC_PI_2 / rings as f64 * TAU / sectors as f64;
            let density = f64::from(bsdf.pdf(wo, wi.as_vec3()));
            expected[i / FINE * SECTORS + j / FINE] +=
                density * 4.0 * cosine * h.z.powi(3) * alpha * alpha * area * f64::from(n);
        }
    }
    let inside: f64 = expected.iter().sum();
    let integral = inside / f64::from(n);
    assert!(integral < 1.001, "the density integrates to {integral}");
    expected[lost] = (f64::from(n) - inside).max(0.0);
    pearson_deviate(&observed, &expected, 50.0)
}
