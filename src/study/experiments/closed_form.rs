//! Photographs in closed form, of one convex reflector under black lamps.
//!
//! Such a reflector receives light only from the lamps. Its radiance is ρE/π with Lambert's irradiance from polygons (Baum,
//! Rushmeier and Winget 1989, "Improving Radiosity Solutions Through the Use of Analytically Determined Form-Factors"). Pixels
//! are clipped against the visible edges, and each part is integrated by Gauss–Legendre quadrature.

use crate::capture::camera::{Intrinsics, Pose};
use crate::capture::photograph::Photograph;
use crate::inverse::unknowns::Unknowns;
use crate::room::Room;
use crate::room::cameras::cameras;
use crate::room::linear_photograph;
use crate::study::experiments::box_room;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_1_PI;
use std::ops::{Add, Mul, Sub};

/// Gauss–Legendre points and weights on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// Near clipping distance in metres.
const NEAR: f64 = 1e-3;

/// A triangle of the room.
struct Facet {
    corners: [DVec3; 3],
    normal: DVec3,
    albedo: DVec3,
    emission: DVec3,
}

/// Mean radiance over each pixel of each of the room's cameras.
///
/// Only valid for a room of one convex object and lamps of albedo zero, none of which occludes another.
pub fn photographs(room: &Room, size: [u32; 2]) -> Vec<Photograph> {
    let facets = facets(room);
    let emits = |facet: &&Facet| facet.emission != DVec3::ZERO;
    let lamps: Vec<&Facet> = facets.iter().filter(emits).collect();
    cameras(&room.views, size)
        .iter()
        .map(|(lens, pose)| {
            let mut pixels = vec![DVec3::ZERO; (size[0] * size[1]) as usize];
            for facet in &facets {
                if (pose.center - facet.corners[0]).dot(facet.normal) > 0.0 {
                    add(facet, &lamps, lens, pose, &mut pixels);
                }
            }
            linear_photograph(size, pixels.iter().map(|sum| sum.as_vec3()).collect())
        })
        .collect()
}

fn facets(room: &Room) -> Vec<Facet> {
    let Unknowns { albedo, emission } = box_room::truth(room);
    let mesh = &room.mesh;
    (mesh.triangles.iter().zip(&mesh.object_of))
        .map(|(corners, &object)| {
            let corners = corners.map(|corner| mesh.positions[corner as usize]);
            let [a, b, c] = corners;
            Facet {
                corners,
                normal: (b - a).cross(c - a).normalize_or_zero(),
                albedo: albedo[object as usize].as_dvec3(),
                emission: emission[object as usize].as_dvec3(),
            }
        })
        .collect()
}

/// Adds a facet's radiance to the pixels that it covers.
fn add(facet: &Facet, lamps: &[&Facet], lens: &Intrinsics, pose: &Pose, pixels: &mut [DVec3]) {
    // Clip the facet to the near plane and project it, with the orientation that `cut` needs.
    let local = |point: DVec3| pose.rotation.transpose() * (point - pose.center);
    let front = cut(&facet.corners, |p| -local(p).z - NEAR);
    if front.len() < 3 {
        return;
    }
    let project = |point: &DVec3| {
        let p = local(*point);
        DVec2::new(lens.cx - lens.fx * p.x / p.z, lens.cy + lens.fy * p.y / p.z)
    };
    let mut outline: Vec<DVec2> = front.iter().map(project).collect();
    if (outline[1] - outline[0]).perp_dot(outline[2] - outline[0]) < 0.0 {
        outline.reverse();
    }
    let (low, high) = (outline.iter())
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), &p| {
            (l.min(p), h.max(p))
        });
    let last = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let (low, high) = (low.floor().max(DVec2::ZERO), high.ceil().min(last));

    // The parts of the lamps in front of the facet's plane.
    let in_front =
        |lamp: &&&Facet| cut(&lamp.corners, |p| (p - facet.corners[0]).dot(facet.normal));
    let seen: Vec<(DVec3, Vec<DVec3>)> = (lamps.iter())
        .filter(|_| facet.albedo != DVec3::ZERO)
        .map(|lamp| (lamp.emission, in_front(&lamp)))
        .filter(|(_, polygon)| polygon.len() > 2)
        .collect();
    for (x, y) in (low.y as u32..high.y as u32)
        .flat_map(|y| (low.x as u32..high.x as u32).map(move |x| (x, y)))
    {
        let corner = DVec2::new(f64::from(x), f64::from(y));
        let mut part = vec![
            corner,
            corner + DVec2::X,
            corner + DVec2::ONE,
            corner + DVec2::Y,
        ];
        for (i, &a) in outline.iter().enumerate() {
            let b = outline[(i + 1) % outline.len()];
            part = cut(&part, |p| (b - a).perp_dot(p - a));
        }
        let radiance = |at: DVec2| {
            let local = DVec3::new((at.x - lens.cx) / lens.fx, (lens.cy - at.y) / lens.fy, -1.0);
            let direction = pose.rotation * local;
            let t =
                (facet.corners[0] - pose.center).dot(facet.normal) / direction.dot(facet.normal);
            let point = pose.center + direction * t;
            let arriving = seen
                .iter()
                .map(|(emission, lamp)| *emission * irradiance(point, facet.normal, lamp));
            facet.emission + facet.albedo * arriving.sum::<DVec3>() * FRAC_1_PI
        };
        pixels[(y * lens.width + x) as usize] += integrate(&part, radiance);
    }
}

/// Clips a convex polygon to where a linear function is not negative (Sutherland and Hodgman 1974).
fn cut<P>(polygon: &[P], inside: impl Fn(P) -> f64) -> Vec<P>
where
    P: Copy + Add<Output = P> + Sub<Output = P> + Mul<f64, Output = P>,
{
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (at_a, at_b) = (inside(a), inside(b));
        if at_a >= 0.0 {
            kept.push(a);
        }
        if (at_a >= 0.0) != (at_b >= 0.0) {
            kept.push(a + (b - a) * (at_a / (at_a - at_b)));
        }
    }
    kept
}

/// ∫ cosθ dω over a polygon in front of a point, for unit radiance: ½ Σ θᵢ n · (rᵢ × rᵢ₊₁) / |rᵢ × rᵢ₊₁|.
fn irradiance(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let edge = |i: usize| {
        let a = (polygon[i] - point).normalize_or_zero();
        let b = (polygon[(i + 1) % polygon.len()] - point).normalize_or_zero();
        let cross = a.cross(b);
        let length = cross.length();
        if length > 0.0 {
            length.atan2(a.dot(b)) * normal.dot(cross) / length
        } else {
            0.0
        }
    };
    // A lamp's front has clockwise corners seen from the point; its back emits nothing.
    (-0.5 * (0..polygon.len()).map(edge).sum::<f64>()).max(0.0)
}

/// Integral over a convex polygon, by triangles; each is a square with one side collapsed to a corner.
fn integrate(polygon: &[DVec2], value: impl Fn(DVec2) -> DVec3) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for i in 1..polygon.len().max(2) - 1 {
        let [a, b, c] = [polygon[0], polygon[i], polygon[i + 1]];
        let twice = (b - a).perp_dot(c - a).abs();
        for ((u, wu), (v, wv)) in GAUSS.iter().flat_map(|&p| GAUSS.map(|q| (p, q))) {
            sum += value(a + (b.lerp(c, v) - a) * u) * (twice * u * wu * wv);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Form factor from a patch to a parallel a × b rectangle at unit distance above one of its corners.
    fn corner_factor(a: f64, b: f64) -> f64 {
        let term = |a: f64, b: f64| {
            let root = (1.0 + a * a).sqrt();
            a / root * (b / root).atan()
        };
        (term(a, b) + term(b, a)) / (2.0 * std::f64::consts::PI)
    }

    #[test]
    fn irradiance_is_the_form_factor_and_what_lies_behind_the_patch_is_cut_away() {
        // Facing down, so its corners are clockwise from below.
        let lamp = [
            [0.0, 1.0, 0.0],
            [2.0, 1.0, 0.0],
            [2.0, 1.0, 3.0],
            [0.0, 1.0, 3.0],
        ]
        .map(DVec3::from);
        let found = irradiance(DVec3::ZERO, DVec3::Y, &lamp) * FRAC_1_PI;
        assert!((found - corner_factor(2.0, 3.0)).abs() < 1e-14, "{found}");
        let back: Vec<DVec3> = lamp.iter().rev().copied().collect();
        assert_eq!(irradiance(DVec3::ZERO, DVec3::Y, &back), 0.0);

        // An upright patch below a lamp that extends on both sides of its plane receives light only from the half in front.
        let wide = lamp.map(|p| p - DVec3::X);
        let seen = cut(&wide, |p| p.x);
        let half = lamp.map(|p| DVec3::new(p.x.min(1.0), p.y, p.z));
        let [seen, half] = [&seen[..], &half].map(|l| irradiance(DVec3::ZERO, DVec3::X, l));
        assert!(half > 0.1 && (seen - half).abs() < 1e-14, "{seen} {half}");
    }

    #[test]
    fn polynomials_over_cut_squares_are_integrated_exactly() {
        let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let lower = cut(&square, |p| 1.0 - p.x - p.y);
        // ∫ x² y over the triangle x + y < 1 is 1/60.
        let found = integrate(&lower, |p| DVec3::splat(p.x * p.x * p.y));
        assert!((found.x - 1.0 / 60.0).abs() < 1e-15, "{found}");
    }
}
