//! The hierarchy over triangles: built by obvhs, traversed here.

use crate::scene::geometry::{Hit, Ray};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::triangle::Triangle;
use std::time::Duration;

/// Bounding volume hierarchy with its own copy of the triangles, in leaf order.
pub struct Bvh {
    nodes: Bvh2,
    corners: Vec<[Vec3; 3]>,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bvh({} triangles)", self.corners.len())
    }
}

impl Bvh {
    /// Builds the hierarchy of a mesh.
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let corners: Vec<[Vec3; 3]> = triangles
            .iter()
            .map(|t| t.map(|i| positions[i as usize]))
            .collect();
        let primitives: Vec<Triangle> = corners
            .iter()
            .map(|c| Triangle {
                v0: Vec3A::from(c[0]),
                v1: Vec3A::from(c[1]),
                v2: Vec3A::from(c[2]),
            })
            .collect();
        let nodes = build_bvh2_from_tris(
            &primitives,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        );
        Self { nodes, corners }
    }

    /// The nearest hit, or none.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        self.traverse(ray, |hit| {
            nearest = Some(hit);
            false
        });
        nearest
    }

    /// Whether there is any hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut found = false;
        self.traverse(ray, |_| {
            found = true;
            true
        });
        found
    }

    /// Visits hits, each nearer than the last, until `visit` returns true.
    fn traverse(&self, ray: &Ray, mut visit: impl FnMut(Hit) -> bool) {
        let inverse = ray.direction.recip();
        let mut t_max = ray.t_max;
        let mut stack = [0u32; 96];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes.nodes[stack[depth] as usize];
            if !slab(
                ray,
                inverse,
                Vec3::from(node.aabb().min),
                Vec3::from(node.aabb().max),
                t_max,
            ) {
                continue;
            }
            if node.is_leaf() {
                for i in node.first_index..node.first_index + node.prim_count {
                    let triangle = self.nodes.primitive_indices[i as usize];
                    if let Some(hit) =
                        intersect_triangle(ray, &self.corners[triangle as usize], triangle, t_max)
                    {
                        t_max = hit.t;
                        if visit(hit) {
                            return;
                        }
                    }
                }
            } else {
                stack[depth] = node.first_index;
                stack[depth + 1] = node.first_index + 1;
                depth += 2;
            }
        }
    }
}

/// Whether the ray meets a box before `t_max`, widened by the rounding of the slab distances.
fn slab(ray: &Ray, inverse: Vec3, low: Vec3, high: Vec3, t_max: f32) -> bool {
    let a = (low - ray.origin) * inverse;
    let b = (high - ray.origin) * inverse;
    let near = a.min(b).max_element().max(ray.t_min);
    let far = a.max(b).min_element().min(t_max);
    near <= far * (1.0 + 4.0 * f32::EPSILON)
}

/// Edge-function (Plücker) triangle test: rays through a shared edge meet one of the two triangles.
fn intersect_triangle(ray: &Ray, corners: &[Vec3; 3], triangle: u32, t_max: f32) -> Option<Hit> {
    let [v0, v1, v2] = corners.map(|c| c - ray.origin);
    let d = ray.direction;
    let (e0, e1, e2) = (v2 - v0, v0 - v1, v1 - v2);
    let u = e0.cross(v2 + v0).dot(d);
    let v = e1.cross(v0 + v1).dot(d);
    let w = e2.cross(v1 + v2).dot(d);
    let total = u + v + w;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    if !inside || total == 0.0 {
        return None;
    }
    let normal = e0.cross(e1);
    let denominator = 2.0 * normal.dot(d);
    let t = 2.0 * normal.dot(v0) / denominator;
    (t > ray.t_min && t < t_max).then(|| Hit {
        t,
        triangle,
        b1: u / total,
        b2: v / total,
    })
}
