//! Rays, hits, and offsets of ray origins.

use glam::Vec3;

/// A ray segment: origin + t · direction for t in (t_min, t_max).
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Start.
    pub origin: Vec3,
    /// Direction of any length but zero; t is in units of its length.
    pub direction: Vec3,
    /// Hits at or below this are ignored.
    pub t_min: f32,
    /// Hits at or beyond this are ignored.
    pub t_max: f32,
}

impl Ray {
    /// An unbounded ray.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self {
            origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }

    /// The open segment between two points that were both offset from their surfaces.
    #[inline]
    pub fn between(from: Vec3, to: Vec3) -> Self {
        Self {
            t_max: 1.0,
            ..Self::new(from, to - from)
        }
    }
}

/// Where a ray met a triangle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Hit {
    /// Distance along the ray in units of its direction.
    pub t: f32,
    /// Triangle index.
    pub triangle: u32,
    /// Barycentric weight of the second corner.
    pub b1: f32,
    /// Barycentric weight of the third corner.
    pub b2: f32,
}

/// Bound on the relative error of an interpolated point plus that of the next intersection test.
pub const OFFSET_GAMMA: f32 = 16.0 * (f32::EPSILON * 0.5);

/// Offsets a surface point from its triangle to the side of `w` by the bound on its rounding error.
///
/// The bound is that of a point interpolated from `corners` (Pharr et al., PBR 4ed, section 6.8.4) plus the error of the next
/// intersection test; it scales with the coordinates, so scenes may have any size.
#[inline]
pub fn offset_origin(point: Vec3, normal: Vec3, corners: &[Vec3; 3], w: Vec3) -> Vec3 {
    let magnitude = corners[0].abs().max(corners[1].abs()).max(corners[2].abs());
    let distance = 2.0
        * OFFSET_GAMMA
        * magnitude
            .dot(normal.abs())
            .max(magnitude.max_element() * 0.25);
    let signed = if w.dot(normal) < 0.0 {
        -distance
    } else {
        distance
    };
    point + normal * signed
}
