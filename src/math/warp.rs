//! Maps from the unit square to the domains that light transport samples, with their densities.

use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, PI};

/// Unit disk, uniform in area (Shirley and Chiu 1997, concentric).
#[inline]
pub fn concentric_disk(u: [f32; 2]) -> Vec2 {
    let a = 2.0 * u[0] - 1.0;
    let b = 2.0 * u[1] - 1.0;
    if a == 0.0 && b == 0.0 {
        return Vec2::ZERO;
    }
    let (r, phi) = if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else {
        (b, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (a / b))
    };
    Vec2::new(r * phi.cos(), r * phi.sin())
}

/// Local direction on the upper hemisphere, density cosθ/π per solid angle.
#[inline]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let d = concentric_disk(u);
    let z = (1.0 - d.length_squared()).max(0.0).sqrt();
    Vec3::new(d.x, d.y, z)
}

/// Density of [`cosine_hemisphere`] per solid angle; zero below the horizon.
#[inline]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// Direction on the sphere, density 1/(4π) per solid angle.
#[inline]
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let r = (1.0 - z * z).max(0.0).sqrt();
    let phi = 2.0 * PI * u[1];
    Vec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// Barycentric weights (b1, b2) of a point uniform in area on a triangle; b0 = 1 − b1 − b2.
///
/// Heitz 2019, "A Low-Distortion Map Between Triangle and Square": neighbouring u stay neighbours.
#[inline]
pub fn uniform_triangle(u: [f32; 2]) -> [f32; 2] {
    let [mut x, mut y] = u;
    if y > x {
        x *= 0.5;
        y -= x;
    } else {
        y *= 0.5;
        x -= y;
    }
    [x, y]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use crate::math::stats;

    /// Chi-square with equal-probability cells; critical value of 63 degrees of freedom at 1e-4.
    fn chi_square(cell_of: impl Fn([f32; 2]) -> usize) -> f64 {
        let mut stream = Stream::new(11, 0, 0, 0);
        let mut cells = [0u32; 64];
        for _ in 0..128_000 {
            cells[cell_of(stream.uniform2()).min(63)] += 1;
        }
        stats::chi_square(&cells)
    }

    fn azimuth_cell(x: f32, y: f32) -> usize {
        (((y.atan2(x) + PI) / (2.0 * PI)) * 8.0).min(7.0) as usize
    }

    #[test]
    fn cosine_hemisphere_has_its_stated_density() {
        // The cumulative distribution of cosθ/π over cosθ is 1 − cos²θ.
        let chi2 = chi_square(|u| {
            let w = cosine_hemisphere(u);
            azimuth_cell(w.x, w.y) * 8 + ((1.0 - w.z * w.z) * 8.0).min(7.0) as usize
        });
        assert!(chi2 < 113.5, "{chi2}");
        assert!((cosine_hemisphere_pdf(0.5) - 0.5 / PI).abs() < 1e-7);
        assert_eq!(cosine_hemisphere_pdf(-0.5), 0.0);
    }

    #[test]
    fn uniform_sphere_has_its_stated_density() {
        let chi2 = chi_square(|u| {
            let w = uniform_sphere(u);
            azimuth_cell(w.x, w.y) * 8 + ((w.z + 1.0) * 4.0).min(7.0) as usize
        });
        assert!(chi2 < 113.5, "{chi2}");
    }

    #[test]
    fn uniform_triangle_is_uniform_in_area() {
        // 8 × 8 cells: strips of equal area in b1, then equal parts of the strip in b2.
        let chi2 = chi_square(|u| {
            let [b1, b2] = uniform_triangle(u);
            assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0 + 1e-6);
            let strip = ((1.0 - (1.0 - b1).powi(2)) * 8.0).min(7.0) as usize;
            let within = (b2 / (1.0 - b1).max(1e-9) * 8.0).min(7.0) as usize;
            strip * 8 + within
        });
        assert!(chi2 < 113.5, "{chi2}");
    }
}
