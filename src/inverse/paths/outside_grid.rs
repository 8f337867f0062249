//! Unmeasured light from outside the mesh as unknowns.

use crate::inverse::paths::Vertex;
use crate::scene::geometry::Ray;
use crate::transport::environment::{direction_of, pixel_of};
use crate::transport::surroundings::Surroundings;
use glam::Vec3;

/// Outside directions as the pixels of a map; each is a surface with an emission. Three more surfaces stand for the sun, and for
/// the excess over the lower bound in directions in which all photographs are saturated: above the horizon and below it, since a
/// window shows the sky from below and the ground from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutsideGrid {
    /// Index of the first pixel's surface.
    pub first: u32,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The scene's unit up vector.
    pub up: Vec3,
    /// Distance of the outside light, for parallax.
    pub surroundings: Surroundings,
    /// The unit direction towards the sun, if one was found.
    pub sun: Option<Vec3>,
}

impl OutsideGrid {
    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Number of surfaces.
    pub fn surfaces(&self) -> usize {
        self.width * self.height + 3
    }

    /// The surface of the excess over lower bounds in a direction.
    pub fn excess(&self, direction: Vec3) -> u32 {
        self.map_end() + u32::from(direction.dot(self.up) > 0.0)
    }

    /// Whether a surface stands for the excess over lower bounds.
    pub fn is_excess(&self, surface: u32) -> bool {
        (self.map_end()..self.sun_surface()).contains(&surface)
    }

    /// The surface after the last pixel's.
    fn map_end(&self) -> u32 {
        self.first + (self.width * self.height) as u32
    }

    /// The surface of the sun. Its emission is the irradiance at normal incidence over π: that of a uniform sky of as much light.
    pub fn sun_surface(&self) -> u32 {
        self.map_end() + 2
    }

    /// The unit direction of the centre of a surface's pixel; `None` for excess and sun.
    pub fn direction(&self, surface: u32) -> Option<Vec3> {
        let pixel = surface.checked_sub(self.first)?;
        (surface < self.map_end()).then(|| direction_of(self.width, self.height, pixel as usize))
    }

    /// The surface of a unit direction of the map.
    pub fn surface(&self, map_direction: Vec3) -> u32 {
        self.first + pixel_of(self.width, self.height, map_direction) as u32
    }

    /// The last vertex of a path that leaves the scene along a ray.
    pub fn vertex(&self, ray: &Ray, weight: f32) -> Vertex {
        let map_direction = self.surroundings.map_direction(ray.origin, ray.direction);
        Vertex {
            emission_weight: weight,
            ..Vertex::on(self.surface(map_direction))
        }
    }
}
