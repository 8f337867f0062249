//! The distance of environment light: infinite, as a sky, or on a box around the mesh, for geometry missing from a scan.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Gap between the mesh and the box, relative to the mesh's diagonal: light samples are noisier the closer the box is to a surface.
const GAP: f32 = 0.02;

/// How rays map to directions of the environment map.
///
/// A box is a parallax-corrected environment map: a ray maps to the direction from the box's centre to where it leaves the box.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub enum Surroundings {
    /// Infinitely far: light depends on direction only.
    #[default]
    Far,
    /// The surface of a box in scene coordinates; each point emits the same radiance in all directions.
    Box {
        /// Smallest coordinates.
        min: Vec3,
        /// Largest coordinates.
        max: Vec3,
    },
}

impl Surroundings {
    /// The box around some points with a gap. `None` if they have no finite extent.
    pub fn around(points: impl Iterator<Item = Vec3>) -> Option<Self> {
        let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (min, max) = points.fold(start, |(min, max), p| (min.min(p), max.max(p)));
        let gap = Vec3::splat((max - min).length() * GAP);
        let found = min.is_finite() && max.is_finite() && gap.x > 0.0;
        found.then_some(Self::Box {
            min: min - gap,
            max: max + gap,
        })
    }

    /// The map's unit direction for a ray with a unit direction.
    pub fn map_direction(&self, origin: Vec3, direction: Vec3) -> Vec3 {
        match self.exit(origin, direction) {
            Some(exit) => (exit.point - exit.middle).normalize_or_zero(),
            None => direction,
        }
    }

    /// The unit direction at a point for a direction of the map: the inverse of [`Surroundings::map_direction`].
    pub fn from_map(&self, origin: Vec3, map_direction: Vec3) -> Vec3 {
        let Self::Box { min, max } = *self else {
            return map_direction;
        };
        let middle = (min + max) * 0.5;
        match self.exit(middle, map_direction) {
            Some(exit) => (exit.point - origin).normalize_or_zero(),
            None => map_direction,
        }
    }

    /// Pdf per solid angle at the origin over pdf per solid angle at the map's centre, along a ray.
    pub fn density_ratio(&self, origin: Vec3, direction: Vec3) -> f32 {
        let Some(exit) = self.exit(origin, direction) else {
            return 1.0;
        };
        let from_middle = exit.point - exit.middle;
        // dA = r² dω / cosθ, on the same face for both.
        let r2_middle = from_middle.length_squared();
        let cos_middle = from_middle[exit.axis].abs() / r2_middle.sqrt();
        let cos_origin = direction[exit.axis].abs();
        (cos_middle / r2_middle) * (exit.distance * exit.distance / cos_origin)
    }

    /// The exit of a ray from the box; `None` without a box, and for rays that start outside and lead away.
    fn exit(&self, origin: Vec3, direction: Vec3) -> Option<Exit> {
        let Self::Box { min, max } = *self else {
            return None;
        };
        let ahead = Vec3::select(direction.cmpgt(Vec3::ZERO), max, min) - origin;
        let (mut axis, mut distance) = (0, f32::INFINITY);
        for side in (0..3).filter(|&side| direction[side] != 0.0) {
            let t = ahead[side] / direction[side];
            if t < distance {
                (axis, distance) = (side, t);
            }
        }
        (distance > 0.0 && distance.is_finite()).then(|| Exit {
            point: origin + direction * distance,
            middle: (min + max) * 0.5,
            axis,
            distance,
        })
    }
}

/// The exit point of a ray from a box.
struct Exit {
    point: Vec3,
    /// Centre of the box.
    middle: Vec3,
    /// Normal axis of the exit face.
    axis: usize,
    distance: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use crate::math::stats::Moments;
    use crate::math::warp;

    fn unit_box() -> Surroundings {
        let corners = [Vec3::new(-1.0, -2.0, -3.0), Vec3::new(3.0, 2.0, 1.0)];
        Surroundings::around(corners.into_iter()).expect("points")
    }

    #[test]
    fn a_box_looks_the_same_from_its_middle_as_the_sky_and_moves_from_elsewhere() {
        let surroundings = unit_box();
        let middle = Vec3::new(1.0, 0.0, -1.0);
        let mut stream = Stream::new(3, 0, 0, 0);
        for _ in 0..200 {
            let direction = warp::uniform_sphere(stream.uniform2());
            let same = surroundings.map_direction(middle, direction);
            assert!((same - direction).length() < 1e-5);
            assert!((surroundings.density_ratio(middle, direction) - 1.0).abs() < 1e-4);
            // There and back from any other point.
            let origin = Vec3::new(0.3, -1.5, -2.0);
            let seen = surroundings.from_map(origin, direction);
            let back = surroundings.map_direction(origin, seen);
            assert!((back - direction).length() < 1e-4, "{direction} {back}");
            let far = Surroundings::Far.map_direction(origin, direction);
            assert_eq!(far, direction);
        }
        let moved = surroundings.map_direction(Vec3::new(2.0, 0.0, -1.0), Vec3::Y);
        assert!(moved.x > 0.1 && moved.y < 0.99);
    }

    #[test]
    fn directions_drawn_around_the_middle_have_the_density_stated_around_any_point() {
        let surroundings = unit_box();
        let origin = Vec3::new(2.5, -1.5, 0.5);
        let mut stream = Stream::new(7, 0, 0, 0);
        let n = 200_000;
        // Estimates of ∫ f dω around the origin, f = 1 and (1 + z)².
        let mut found = [Moments::default(); 2];
        for _ in 0..n {
            let map_direction = warp::uniform_sphere(stream.uniform2());
            let wi = surroundings.from_map(origin, map_direction);
            let pdf = surroundings.density_ratio(origin, wi) / (4.0 * std::f32::consts::PI);
            found[0].push(f64::from(1.0 / pdf));
            found[1].push(f64::from((1.0 + wi.z).powi(2) / pdf));
        }
        let sphere = 4.0 * std::f64::consts::PI;
        for (found, exact) in found.iter().zip([sphere, sphere * (1.0 + 1.0 / 3.0)]) {
            // At most one in 15,000 seeds is off by four standard errors.
            let error = (found.variance() / f64::from(n)).sqrt();
            let off = (found.mean - exact) / error;
            println!("{} for {exact}, {off} standard errors", found.mean);
            assert!(off.abs() < 4.0, "{off}");
            assert!(error < 0.03 * exact);
        }
    }

    #[test]
    fn no_points_and_one_point_have_no_box_and_rays_that_lead_away_find_their_direction() {
        assert_eq!(Surroundings::around(std::iter::empty()), None);
        assert_eq!(Surroundings::around([Vec3::ONE].into_iter()), None);
        let spoilt = [Vec3::NAN, Vec3::ONE];
        assert_eq!(Surroundings::around(spoilt.into_iter()), None);
        let away = unit_box().map_direction(Vec3::new(9.0, 0.0, 0.0), Vec3::X);
        assert_eq!(away, Vec3::X);
    }
}
