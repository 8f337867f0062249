//! A small modeller: boxes, rounded boxes and lofted rings, collected in one mesh of named objects.

use crate::capture::mesh::Mesh;
use glam::{DAffine3, DVec2, DVec3, Vec2};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Texture coordinates linear in position: u = (p − origin) · u_axis + offset.x, v likewise.
#[derive(Debug, Clone, Copy)]
pub struct Projection {
    /// The point whose coordinates are `offset`.
    pub origin: DVec3,
    /// Gradient of u, per metre.
    pub u_axis: DVec3,
    /// Gradient of v, per metre.
    pub v_axis: DVec3,
    /// (u, v) at the origin.
    pub offset: DVec2,
}

/// Collects triangles, counter-clockwise seen from outside, in named objects.
#[derive(Debug, Default)]
pub struct Modeller {
    /// Mesh built so far.
    pub mesh: Mesh,
    /// Transform from local to room coordinates.
    pub placement: DAffine3,
    /// Texture coordinates of the next shapes; zero if `None`.
    pub projection: Option<Projection>,
}

impl Modeller {
    /// Starts an object; the shapes that follow belong to it.
    pub fn object(&mut self, name: &str) {
        self.mesh.objects.push(name.to_owned());
        self.placement = DAffine3::IDENTITY;
        self.projection = None;
    }

    /// Runs `shapes` in local coordinates with a further transform.
    pub fn placed(&mut self, placement: DAffine3, shapes: impl FnOnce(&mut Self)) {
        let outer = self.placement;
        self.placement = outer * placement;
        shapes(self);
        self.placement = outer;
    }

    fn vertex(&mut self, local: DVec3) -> u32 {
        let index = self.mesh.positions.len() as u32;
        let point = self.placement.transform_point3(local);
        self.mesh.positions.push(point);
        index
    }

    /// Adds a triangle unless two of its corners coincide.
    fn triangle(&mut self, corners: [u32; 3]) {
        let points = corners.map(|i| self.mesh.positions[i as usize]);
        let [a, b, c] = points;
        if a == b || b == c || c == a {
            return;
        }
        let uv = |p: DVec3| match self.projection {
            Some(map) => {
                let d = p - map.origin;
                (map.offset + DVec2::new(d.dot(map.u_axis), d.dot(map.v_axis))).as_vec2()
            }
            None => Vec2::ZERO,
        };
        let object = self.mesh.objects.len() as u32 - 1;
        self.mesh.triangles.push(corners);
        self.mesh.object_of.push(object);
        self.mesh.corner_uvs.push(points.map(uv));
    }

    /// A grid of `columns` × `rows` cells over a parallelogram; its front is on the side of `u × v`.
    pub fn grid(&mut self, corner: DVec3, u: DVec3, v: DVec3, columns: u32, rows: u32) {
        let lines = |count: u32| (0..=count).map(move |i| f64::from(i) / f64::from(count));
        let points: Vec<Vec<DVec3>> = lines(rows)
            .map(|y| lines(columns).map(|x| corner + u * x + v * y).collect())
            .collect();
        self.surface(&points, false);
    }

    /// Joins rows of equally many points by quads; their front is on the side of (along the row) × (to the next row).
    pub fn surface(&mut self, rows: &[Vec<DVec3>], closed: bool) {
        let mut row_of = |row: &Vec<DVec3>| row.iter().map(|&p| self.vertex(p)).collect();
        let rows: Vec<Vec<u32>> = rows.iter().map(&mut row_of).collect();
        for (low, high) in rows.iter().zip(rows.iter().skip(1)) {
            let count = low.len();
            for i in 0..if closed { count } else { count - 1 } {
                let j = (i + 1) % count;
                self.triangle([low[i], low[j], high[j]]);
                self.triangle([low[i], high[j], high[i]]);
            }
        }
    }

    /// An axis-aligned box between two opposite corners.
    pub fn cuboid(&mut self, low: DVec3, high: DVec3) {
        let half = (high - low) * 0.5;
        self.rounded_box((low + high) * 0.5, half, 0.0, 0);
    }

    /// A box of half sizes `half` whose edges are rounded by `radius`, in `steps` facets per quarter turn.
    pub fn rounded_box(&mut self, center: DVec3, half: DVec3, radius: f64, steps: u32) {
        let inner = half - DVec3::splat(radius);
        let ticks = |extent: f64| -> Vec<f64> {
            if steps == 0 {
                return vec![-extent - radius, extent + radius];
            }
            // tan spaces the facets evenly over the quarter turn.
            let spread = |i: u32| radius * (FRAC_PI_4 * f64::from(i) / f64::from(steps)).tan();
            let end = (0..=steps).map(|i| extent + spread(i));
            end.clone().rev().map(|x| -x).chain(end).collect()
        };
        for axis in 0..3 {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            for sign in [1.0, -1.0] {
                let point = |x: f64, y: f64| {
                    let mut p = DVec3::ZERO;
                    p[axis] = sign * half[axis];
                    p[a] = sign * x;
                    p[b] = y;
                    let core = p.clamp(-inner, inner);
                    let round = core + (p - core).normalize_or_zero() * radius;
                    center + if radius > 0.0 { round } else { p }
                };
                let (columns, rows) = (ticks(inner[a]), ticks(inner[b]));
                let row = |&y: &f64| columns.iter().map(|&x| point(x, y)).collect();
                self.surface(&rows.iter().map(row).collect::<Vec<_>>(), false);
            }
        }
    }

    /// Joins rings of equally many points, counter-clockwise seen from the last ring's side, and closes both ends.
    pub fn loft(&mut self, rings: &[Vec<DVec3>]) {
        let middle = |ring: &Vec<DVec3>| {
            let mean = ring.iter().sum::<DVec3>() / ring.len() as f64;
            vec![mean; ring.len()]
        };
        let (Some(first), Some(last)) = (rings.first(), rings.last()) else {
            return;
        };
        let mut closed = vec![middle(first)];
        closed.extend(rings.iter().cloned());
        closed.push(middle(last));
        self.surface(&closed, true);
    }

    /// A solid of revolution about the local y axis; `profile` has (radius, height) points from bottom to top.
    pub fn lathe(&mut self, profile: &[[f64; 2]], sides: u32) {
        let at =
            |&[r, y]: &[f64; 2]| ring(DVec3::ZERO.with_y(y), DVec3::X * r, -DVec3::Z * r, sides);
        self.loft(&profile.iter().map(at).collect::<Vec<_>>());
    }

    /// A straight round bar with a radius at each end.
    pub fn bar(&mut self, from: DVec3, to: DVec3, radii: [f64; 2], sides: u32) {
        let axis = (to - from).normalize_or_zero();
        let (u, v) = axis.any_orthonormal_pair();
        let v = if u.cross(v).dot(axis) < 0.0 { -v } else { v };
        self.loft(&[
            ring(from, u * radii[0], v * radii[0], sides),
            ring(to, u * radii[1], v * radii[1], sides),
        ]);
    }
}

/// Points on an ellipse, turning from `u` to `v`.
pub fn ring(center: DVec3, u: DVec3, v: DVec3, sides: u32) -> Vec<DVec3> {
    (0..sides)
        .map(|i| TAU * f64::from(i) / f64::from(sides))
        .map(|angle| center + u * angle.cos() + v * angle.sin())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem; positive only if the faces of a closed surface point outwards.
    fn volume(modeller: &Modeller) -> f64 {
        let mesh = &modeller.mesh;
        let corner = |i: u32| mesh.positions[i as usize];
        let part = |&[a, b, c]: &[u32; 3]| corner(a).dot(corner(b).cross(corner(c))) / 6.0;
        mesh.triangles.iter().map(part).sum()
    }

    #[test]
    fn shapes_enclose_their_volumes_wherever_they_stand() {
        type Shape<'a> = &'a dyn Fn(&mut Modeller);
        let cuboid: Shape = &|m| m.cuboid(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0));
        let rounded: Shape = &|m| m.rounded_box(DVec3::ONE, DVec3::splat(0.5), 0.1, 4);
        let cylinder: Shape = &|m| m.lathe(&[[0.0, -1.0], [1.0, -1.0], [1.0, 1.0]], 64);
        let bar: Shape = &|m| m.bar(DVec3::ONE, DVec3::new(2.0, 0.0, 3.0), [0.1, 0.1], 48);
        // A box of radius r: core + slabs + quarter cylinders + a sphere, less than 3 % lost to the facets.
        let of_rounded = 0.512 + 6.0 * 0.064 + 12.0 * 0.8 * 0.007_854 + 0.004_189;
        let shapes = [
            (cuboid, 6.0, 1e-12),
            (rounded, of_rounded, 0.003),
            (cylinder, TAU, 0.02),
            (bar, 6f64.sqrt() * 0.01 * TAU * 0.5, 0.001),
        ];
        for (shape, expected, tolerance) in shapes {
            let mut modeller = Modeller::default();
            modeller.object("shape");
            let turn = DAffine3::from_rotation_y(0.7) * DAffine3::from_translation(DVec3::ONE);
            modeller.placed(turn, shape);
            let got = volume(&modeller);
            assert!((got - expected).abs() <= tolerance, "{got} {expected}");
        }
    }
}
