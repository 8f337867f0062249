//! Triangles and bounce rays to compare on, all generated.

use glam::{Mat3, Vec3};
use relit::math::rng::Stream;
use relit::math::warp;
use relit::room::Room;
use relit::scene::bvh::Bvh;
use relit::scene::geometry::{Ray, offset_origin};

pub struct Scene {
    pub name: &'static str,
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Where paths start, with directions drawn over the whole sphere.
    pub eyes: Vec<Vec3>,
    /// A horizontal rectangle that shadow rays end on: low and high corner.
    pub lamp: [Vec3; 2],
}

impl Scene {
    /// The built-in room, its triangles split to at most `edge` metres, with spheres, tori and boxes strewn about.
    pub fn room(name: &'static str, edge: f32, clutter: usize) -> Self {
        let room = Room::new();
        let positions: Vec<Vec3> = room.mesh.positions.iter().map(|p| p.as_vec3()).collect();
        let mut scene = Self {
            name,
            positions: Vec::new(),
            triangles: Vec::new(),
            eyes: room
                .views
                .iter()
                .map(|view| view.pose.center.as_vec3())
                .collect(),
            lamp: [Vec3::new(-0.6, 2.5, -0.4), Vec3::new(0.6, 2.5, 0.4)],
        };
        for t in &room.mesh.triangles {
            scene.split(t.map(|i| positions[i as usize]), edge);
        }
        let mut stream = Stream::new(7, 0, 0, 0);
        for index in 0..clutter {
            let mut between = |low: f32, high: f32| low + (high - low) * stream.uniform();
            let center = Vec3::new(between(-2.3, 2.3), between(0.1, 1.2), between(-1.8, 1.8));
            let size = between(0.03, 0.16);
            let turn =
                Mat3::from_rotation_y(between(0.0, 6.0)) * Mat3::from_rotation_x(between(0.0, 6.0));
            let place = |p: Vec3| center + turn * (p * size);
            match index % 3 {
                0 => scene.revolve(32, 48, |u, v| place(sphere(u, v))),
                1 => scene.revolve(48, 32, |u, v| place(torus(u, v))),
                _ => scene.cuboid(place),
            }
        }
        scene
    }

    /// A box of 1 m with two blocks: 36 triangles, as in the Cornell box.
    pub fn small() -> Self {
        let mut scene = Self {
            name: "small box",
            positions: Vec::new(),
            triangles: Vec::new(),
            eyes: vec![Vec3::new(0.0, 0.0, 0.9), Vec3::new(0.3, 0.6, 0.8)],
            lamp: [Vec3::new(-0.25, 0.98, -0.25), Vec3::new(0.25, 0.98, 0.25)],
        };
        scene.cuboid(|p| p);
        let turn = Mat3::from_rotation_y(0.3);
        scene.cuboid(|p| turn * (p * Vec3::new(0.3, 0.6, 0.3)) + Vec3::new(-0.35, -0.4, -0.3));
        scene.cuboid(|p| turn.transpose() * (p * Vec3::splat(0.3)) + Vec3::new(0.35, -0.7, 0.3));
        scene
    }

    fn push(&mut self, corners: [Vec3; 3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// Halves the longest edge until none is longer than `edge`.
    fn split(&mut self, [a, b, c]: [Vec3; 3], edge: f32) {
        let (ab, bc, ca) = (a.distance(b), b.distance(c), c.distance(a));
        let longest = ab.max(bc).max(ca);
        if longest <= edge {
            return self.push([a, b, c]);
        }
        let [a, b, c] = if ab == longest {
            [a, b, c]
        } else if bc == longest {
            [b, c, a]
        } else {
            [c, a, b]
        };
        let middle = (a + b) * 0.5;
        self.split([a, middle, c], edge);
        self.split([middle, b, c], edge);
    }

    fn revolve(&mut self, rows: u32, columns: u32, surface: impl Fn(f32, f32) -> Vec3) {
        let at = |i: u32, j: u32| surface(i as f32 / rows as f32, j as f32 / columns as f32);
        for i in 0..rows {
            for j in 0..columns {
                self.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                self.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }

    fn cuboid(&mut self, place: impl Fn(Vec3) -> Vec3) {
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let corner = |u: f32, v: f32| {
                    let mut p = [0.0; 3];
                    p[axis] = side;
                    p[(axis + 1) % 3] = u;
                    p[(axis + 2) % 3] = v;
                    place(p.into())
                };
                let [a, b, c, d] = [
                    corner(-1.0, -1.0),
                    corner(1.0, -1.0),
                    corner(1.0, 1.0),
                    corner(-1.0, 1.0),
                ];
                self.push([a, b, c]);
                self.push([a, c, d]);
            }
        }
    }

    /// Rays that leave the second and the third hit of paths with cosine-distributed bounces, and from the same
    /// points the segments to the lamp. Paths are independent, so that neighbours in the list have nothing in common.
    pub fn bounce_rays(&self, bvh: &Bvh, count: usize) -> (Vec<Ray>, Vec<Ray>) {
        let (mut bounces, mut shadows) = (Vec::new(), Vec::new());
        let mut path = 0;
        while bounces.len() < count {
            let mut stream = Stream::new(3, 0, 0, path);
            path += 1;
            let eye = self.eyes[stream.below(self.eyes.len())];
            let mut ray = Ray::new(eye, warp::uniform_sphere(stream.uniform2()));
            for bounce in 0..4 {
                if bounce >= 2 {
                    bounces.push(ray);
                }
                let Some(hit) = bvh.intersect(&ray) else {
                    break;
                };
                let corners =
                    self.triangles[hit.triangle as usize].map(|i| self.positions[i as usize]);
                let [a, b, c] = corners;
                let point = a * (1.0 - hit.b1 - hit.b2) + b * hit.b1 + c * hit.b2;
                let mut normal = (b - a).cross(c - a).normalize_or_zero();
                if normal.dot(ray.direction) > 0.0 {
                    normal = -normal;
                }
                let origin = offset_origin(point, normal, &corners, normal);
                if (1..3).contains(&bounce) {
                    let [u, v] = stream.uniform2();
                    let [low, high] = self.lamp;
                    let target = Vec3::new(
                        low.x + (high.x - low.x) * u,
                        low.y,
                        low.z + (high.z - low.z) * v,
                    );
                    shadows.push(Ray::between(origin, target));
                }
                let (x, y) = normal.any_orthonormal_pair();
                let w = warp::cosine_hemisphere(stream.uniform2());
                ray = Ray::new(
                    origin,
                    (x * w.x + y * w.y + normal * w.z).normalize_or_zero(),
                );
            }
        }
        (bounces, shadows)
    }
}

fn sphere(u: f32, v: f32) -> Vec3 {
    let (theta, phi) = (std::f32::consts::PI * u, std::f32::consts::TAU * v);
    Vec3::new(
        theta.sin() * phi.cos(),
        theta.cos(),
        theta.sin() * phi.sin(),
    )
}

fn torus(u: f32, v: f32) -> Vec3 {
    let (around, about) = (std::f32::consts::TAU * u, std::f32::consts::TAU * v);
    let radius = 0.7 + 0.3 * about.cos();
    Vec3::new(
        radius * around.cos(),
        0.3 * about.sin(),
        radius * around.sin(),
    )
}
