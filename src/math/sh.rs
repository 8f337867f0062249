//! Real spherical harmonics up to degree 2: nine coefficients represent irradiance to about one per cent
//! (Ramamoorthi and Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps").

use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Radiance over directions as nine RGB coefficients of the real, orthonormal basis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Harmonics {
    /// Coefficients in the order (l, m) = (0,0), (1,−1), (1,0), (1,1), (2,−2), …, (2,2).
    pub coefficients: [DVec3; 9],
}

/// The nine basis functions at a unit direction.
pub fn basis(direction: Vec3) -> [f64; 9] {
    let DVec3 { x, y, z } = direction.as_dvec3();
    let linear = (3.0 / (4.0 * PI)).sqrt();
    let mixed = (15.0 / (4.0 * PI)).sqrt();
    [
        (1.0 / (4.0 * PI)).sqrt(),
        linear * y,
        linear * z,
        linear * x,
        mixed * x * y,
        mixed * y * z,
        (5.0 / (16.0 * PI)).sqrt() * (3.0 * z * z - 1.0),
        mixed * x * z,
        0.5 * mixed * (x * x - y * y),
    ]
}

impl Harmonics {
    /// Adds radiance from a unit direction over a solid angle (for one of n random directions: 1 / (n · pdf)).
    pub fn add(&mut self, direction: Vec3, radiance: Vec3, solid_angle: f64) {
        let weighted = radiance.as_dvec3() * solid_angle;
        for (coefficient, value) in self.coefficients.iter_mut().zip(basis(direction)) {
            *coefficient += weighted * value;
        }
    }

    /// Irradiance on a surface with a unit normal: the coefficients convolved with the clamped cosine, whose factors
    /// are π, 2π/3 and π/4 for l = 0, 1, 2. Clamped to zero, since the truncated series can be negative.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        const FACTORS: [f64; 9] = {
            let (a, b, c) = (PI, 2.0 * PI / 3.0, PI / 4.0);
            [a, b, b, b, c, c, c, c, c]
        };
        let mut sum = DVec3::ZERO;
        for ((coefficient, factor), value) in
            self.coefficients.iter().zip(FACTORS).zip(basis(normal))
        {
            sum += *coefficient * (factor * value);
        }
        sum.max(DVec3::ZERO).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use crate::math::warp;

    /// Directions and solid angles of a midpoint rule in cosθ and φ.
    fn sphere() -> impl Iterator<Item = (Vec3, f64)> {
        let n = 128;
        (0..n * 2 * n).map(move |i| {
            let z = (f64::from(i / (2 * n)) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let phi = (f64::from(i % (2 * n)) + 0.5) / f64::from(n) * PI;
            let r = (1.0 - z * z).sqrt();
            let d = DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3();
            (d, 4.0 * PI / f64::from(2 * n * n))
        })
    }

    #[test]
    fn the_basis_is_orthonormal() {
        let mut products = [[0.0; 9]; 9];
        for (d, solid_angle) in sphere() {
            let values = basis(d);
            for (row, a) in products.iter_mut().zip(values) {
                for (sum, b) in row.iter_mut().zip(values) {
                    *sum += a * b * solid_angle;
                }
            }
        }
        for (i, row) in products.iter().enumerate() {
            for (j, &product) in row.iter().enumerate() {
                let want = f64::from(u8::from(i == j));
                assert!((product - want).abs() < 1e-3, "{i} {j}: {product}");
            }
        }
    }

    #[test]
    fn irradiance_has_its_closed_forms() {
        let light = Vec3::new(0.48, -0.6, 0.64);
        let (mut sky, mut lamp) = (Harmonics::default(), Harmonics::default());
        for (d, solid_angle) in sphere() {
            // Radiance 2 + 3 cosθ about a direction: irradiance 2π + 2π cosθ exactly.
            sky.add(d, Vec3::splat(2.0 + 3.0 * d.dot(light)), solid_angle);
        }
        // A distant lamp of unit irradiance: the first three Legendre terms of the clamped cosine.
        lamp.add(light, Vec3::ONE, 1.0);
        let mut stream = Stream::new(1, 0, 0, 0);
        for _ in 0..100 {
            let n = warp::uniform_sphere(stream.uniform2());
            let cos = f64::from(n.dot(light));
            let want = 2.0 * PI + 2.0 * PI * cos;
            assert!((f64::from(sky.irradiance(n).x) - want).abs() < 2e-3);
            let want = 0.25 + 0.5 * cos + 5.0 / 32.0 * (3.0 * cos * cos - 1.0);
            assert!((f64::from(lamp.irradiance(n).y) - want.max(0.0)).abs() < 1e-6);
        }
    }
}
