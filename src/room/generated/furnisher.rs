//! The elements of generated rooms: shell, lamps, furniture, and views.

use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::room::cameras::View;
use crate::room::furniture::woodwork;
use crate::room::shape::Modeller;
use crate::transport::environment::Environment;
use crate::transport::material::Material;
use glam::{DAffine3, DVec2, DVec3, Vec3};
use std::sync::Arc;

/// First key of a room's random numbers; differs from those of solvers.
const ROOM_KEY: u64 = 0x726f_6f6d;
/// Attempts at finding a free place before giving up.
const ATTEMPTS: u32 = 40;
/// Distance of cameras from furniture and walls in metres.
const MARGIN: f64 = 0.25;
/// Range of the cameras' height above the floor in metres.
pub const EYE_HEIGHT: [f64; 2] = [1.0, 1.8];

/// A horizontal rectangle that objects can stand on.
#[derive(Debug, Clone, Copy)]
pub struct Support {
    /// Its centre, with its sides along x and z.
    pub place: DAffine3,
    /// Half its sides in metres.
    pub half: DVec2,
    /// Largest height of an object on it in metres.
    pub headroom: f64,
}

/// Builds a generated room.
pub struct Furnisher {
    pub stream: Stream,
    pub modeller: Modeller,
    pub materials: Vec<Material>,
    /// Width, height and depth in metres; the floor is y = 0, with its centre at the origin.
    pub size: DVec3,
    /// Occupied circles on the floor: centre and radius in metres.
    pub occupied: Vec<(DVec2, f64)>,
    /// Tops of furniture.
    pub supports: Vec<Support>,
    pub views: Vec<View>,
    pub outside: Option<Arc<Environment>>,
    pub samples: u32,
}

impl Furnisher {
    /// An empty room whose size is drawn from (seed, family).
    pub fn new(seed: u64, family: u64) -> Self {
        let mut furnisher = Self {
            stream: Stream::new(seed, ROOM_KEY, family, 0),
            modeller: Modeller::default(),
            materials: Vec::new(),
            size: DVec3::ZERO,
            occupied: Vec::new(),
            supports: Vec::new(),
            views: Vec::new(),
            outside: None,
            samples: 0,
        };
        let width = furnisher.scaled(2.4, 8.0);
        let height = furnisher.between(2.3, 3.6);
        furnisher.size = DVec3::new(width, height, furnisher.scaled(2.4, 8.0));
        furnisher
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.stream.uniform_f64()
    }

    /// Draws a log-uniform number.
    pub fn scaled(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.stream.uniform_f64())
    }

    /// Draws an integer from `low` to `high`, both included.
    pub fn count(&mut self, low: usize, high: usize) -> usize {
        low + self.stream.below(high + 1 - low)
    }

    /// Draws a colour whose largest channel is `value`; the others are smaller by a factor of down to 1 − `saturation`.
    pub fn color(&mut self, value: f64, saturation: f64) -> Vec3 {
        let channel = |f: &mut Self| 1.0 - f.between(0.0, saturation);
        let color = Vec3::from([(); 3].map(|()| channel(self) as f32));
        color / color.max_element() * value as f32
    }

    /// Adds an object with a material.
    pub fn object(&mut self, name: &str, material: Material, shapes: impl FnOnce(&mut Modeller)) {
        self.modeller.object(name);
        self.materials.push(material);
        shapes(&mut self.modeller);
    }

    /// Adds a diffuse object of random colour with its largest channel from `low` to `high`.
    pub fn plain(&mut self, name: &str, [low, high]: [f64; 2], shapes: impl FnOnce(&mut Modeller)) {
        let value = self.between(low, high);
        let saturation = self.between(0.0, 0.8);
        let albedo = self.color(value, saturation);
        self.object(name, Material::diffuse(albedo, Vec3::ZERO), shapes);
    }

    /// Adds floor, ceiling and walls; the walls are one object, two or four.
    pub fn shell(&mut self) {
        self.shell_with(|m, _, [corner, u, v]| m.grid(corner, u, v, 4, 4));
    }

    /// The same, but `wall` builds each wall from its index (north, south, west, east), corner and two sides.
    pub fn shell_with(&mut self, wall: impl Fn(&mut Modeller, usize, [DVec3; 3])) {
        let walls = walls(self.size);
        let [[low, width, _], [high, ..], [_, _, depth], _] = walls;
        self.plain("floor", [0.05, 0.7], |m| m.grid(low, depth, width, 4, 4));
        self.plain("ceiling", [0.5, 0.92], |m| {
            m.grid(high, -width, -depth, 4, 4)
        });
        let together = [1, 2, 4][self.stream.below(3)];
        for (index, group) in walls.chunks(together).enumerate() {
            self.plain(&format!("wall-{index}"), [0.15, 0.92], |m| {
                for (within, &sides) in group.iter().enumerate() {
                    wall(m, index * together + within, sides);
                }
            });
        }
    }

    /// Adds one to five lamps, dim or bright.
    pub fn lamps(&mut self) {
        let brightness = self.scaled(0.3, 300.0);
        for index in 0..self.count(1, 5) {
            self.lamp(index, brightness);
        }
    }

    /// Draws an emitting material of about the given luminance.
    pub fn luminous(&mut self, brightness: f64) -> Material {
        let value = brightness * self.scaled(0.3, 3.0);
        let color = self.color(1.0, 0.6);
        let emission = color * (value as f32 / luminance(color));
        let value = self.between(0.0, 0.8);
        let albedo = self.color(value, 0.3);
        Material::diffuse(albedo, emission)
    }

    /// Adds a lamp: a panel below the ceiling, a hanging box, or a lantern on the floor.
    pub fn lamp(&mut self, index: usize, brightness: f64) {
        let material = self.luminous(brightness);
        let name = format!("lamp-{index}");
        match self.count(0, 2) {
            0 => {
                let half = [0, 2].map(|axis| self.scaled(0.08, 0.35) * self.size[axis] * 0.5);
                let at = self.place(half[0].max(half[1]));
                let center = DVec3::new(at.x, self.size.y - 0.03, at.y);
                let corner = center - DVec3::new(half[0], 0.0, half[1]);
                let (u, v) = (DVec3::X * 2.0 * half[0], DVec3::Z * 2.0 * half[1]);
                self.object(&name, material, |m| m.grid(corner, u, v, 2, 2));
            }
            1 => {
                let half = DVec3::from([(); 3].map(|()| self.scaled(0.05, 0.2)));
                let at = self.place(half.x.max(half.z));
                let below = self.between(0.1, 0.6) + half.y;
                let center = DVec3::new(at.x, self.size.y - below, at.y);
                self.object(&name, material, |m| {
                    m.rounded_box(center, half, 0.0, 0);
                });
            }
            _ => {
                let radius = self.scaled(0.06, 0.2);
                let height = self.between(0.3, 1.2);
                let at = self.free(radius).unwrap_or_else(|| self.place(radius));
                let stand = DAffine3::from_translation(DVec3::new(at.x, 0.0, at.y));
                self.object(&name, material, |m| {
                    m.placed(stand, |m| m.lathe(&[[radius, 0.0], [radius, height]], 12));
                });
            }
        }
    }

    /// Adds up to fourteen boxes, cylinders and tables that do not overlap.
    pub fn furniture(&mut self) {
        for index in 0..self.count(2, 14) {
            let radius = self.scaled(0.12, 0.6);
            let height = self.scaled(0.15, 1.5);
            let Some(at) = self.free(radius) else {
                continue;
            };
            let turn = DAffine3::from_rotation_y(self.between(0.0, std::f64::consts::TAU));
            let place = DAffine3::from_translation(DVec3::new(at.x, 0.0, at.y)) * turn;
            let aspect = self.between(0.3, 0.95);
            let half = DVec3::new(aspect, 0.0, (1.0 - aspect * aspect).sqrt()) * radius;
            let kind = self.count(0, 2);
            self.plain(&format!("piece-{index}"), [0.03, 0.9], |m| {
                m.placed(place, |m| match kind {
                    0 => {
                        let half = half + DVec3::Y * height * 0.5;
                        m.rounded_box(DVec3::Y * height * 0.5, half, 0.02, 1);
                    }
                    1 => m.lathe(&[[radius, 0.0], [radius, height]], 16),
                    _ => woodwork::table(m, 2.0 * half.x, 2.0 * half.z, height),
                });
            });
            let top = match kind {
                1 => DVec2::splat(radius * std::f64::consts::FRAC_1_SQRT_2),
                _ => DVec2::new(half.x, half.z) - 0.02,
            };
            self.supports.push(Support {
                place: place * DAffine3::from_translation(DVec3::Y * height),
                half: top,
                headroom: self.size.y - height,
            });
        }
    }

    /// Adds `low` to `high` views from free places at eye level to random points in the room.
    pub fn look_around(&mut self, low: usize, high: usize) {
        for _ in 0..self.count(low, high) {
            let eye = self.eye();
            let fraction = DVec3::from([(); 3].map(|()| self.between(-0.5, 0.5)));
            let target = fraction * self.size + DVec3::Y * self.size.y * 0.5;
            self.look(eye, target);
        }
    }

    /// Draws a free place at eye level.
    pub fn eye(&mut self) -> DVec3 {
        let at = self.free_point(MARGIN).unwrap_or_default();
        DVec3::new(at.x, self.between(EYE_HEIGHT[0], EYE_HEIGHT[1]), at.y)
    }

    /// Adds a view from `eye` to `target`.
    pub fn look(&mut self, eye: DVec3, target: DVec3) {
        // A level camera is not defined for looking straight up or down.
        let ahead = (eye - target).with_y(0.0).length() > 0.2;
        let target = if ahead { target } else { target + DVec3::X };
        self.views.push(View::towards(eye, target));
    }

    /// Turns each view that looks up as far down.
    pub fn look_down(&mut self) {
        for view in &mut self.views {
            let (eye, mut ahead) = (view.pose.center, -view.pose.rotation.z_axis);
            ahead.y = -ahead.y.abs();
            *view = View::towards(eye, eye + ahead);
        }
    }

    /// Draws the samples per pixel of the photographs, hence their noise.
    pub fn expose(&mut self, low: f64, high: f64) {
        self.samples = self.scaled(low, high) as u32;
    }

    /// Draws a point on the floor at least `radius` from the walls, if the room is large enough.
    pub fn place(&mut self, radius: f64) -> DVec2 {
        let reach = (DVec2::new(self.size.x, self.size.z) * 0.5 - radius - 0.05).max(DVec2::ZERO);
        DVec2::from(reach.to_array().map(|reach| self.between(-reach, reach)))
    }

    /// Draws a point on the floor whose circle of `radius` is free.
    pub fn free_point(&mut self, radius: f64) -> Option<DVec2> {
        let tried: Vec<DVec2> = (0..ATTEMPTS).map(|_| self.place(radius)).collect();
        tried.into_iter().find(|at| {
            let clear = |(center, other): &(DVec2, f64)| at.distance(*center) > radius + other;
            self.occupied.iter().all(clear)
        })
    }

    /// Draws a free point and occupies its circle.
    pub fn free(&mut self, radius: f64) -> Option<DVec2> {
        let at = self.free_point(radius)?;
        self.occupied.push((at, radius));
        Some(at)
    }
}

/// Corner and two sides of each wall of a room: north, south, west and east.
pub fn walls(size: DVec3) -> [[DVec3; 3]; 4] {
    let half = size * 0.5;
    let low = DVec3::new(-half.x, 0.0, -half.z);
    let high = DVec3::new(half.x, size.y, half.z);
    let [width, height, depth] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * size);
    [
        [low, width, height],
        [high, -height, -width],
        [low, height, depth],
        [high, -depth, -height],
    ]
}
