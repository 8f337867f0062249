//! The graph of neighbouring cells, found by stepping over their edges.

use crate::inverse::texture::cells::{Cell, Cells};
use crate::inverse::texture::observations::row_range;
use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray};
use glam::Vec3;
use rayon::prelude::*;

/// Points along each edge from which to step over it, as fractions of its length.
const STEPS: [f32; 2] = [0.25, 0.75];
/// Length of a step, relative to the height of the piece over the edge.
const STRIDE: f32 = 0.2;
/// Cosine of the largest angle between neighbours' normals.
const FOLD: f32 = 0.7;

/// A symmetric graph of neighbours, in compressed sparse rows.
#[derive(Debug, Clone, Default)]
pub struct Links {
    /// End of each cell's row.
    pub ends: Vec<u32>,
    /// The neighbours.
    pub to: Vec<u32>,
    /// Length of the common border, in mean widths of the two cells.
    pub borders: Vec<f32>,
}

impl Links {
    /// Finds the neighbours of all cells of an object.
    pub fn new(scene: &Scene, cells: &Cells) -> Self {
        let directed: Vec<Vec<(u32, u32, f32)>> = (0..cells.count() as u32)
            .into_par_iter()
            .map(|cell| neighbours(scene, cells, cell))
            .collect();

        // Each border is found from both of its sides.
        let mut both: Vec<(u32, u32, f32)> =
            Vec::with_capacity(2 * directed.iter().map(Vec::len).sum::<usize>());
        for (a, b, border) in directed.into_iter().flatten() {
            both.extend([(a, b, border * 0.5), (b, a, border * 0.5)]);
        }
        both.sort_by_key(|&(a, b, _)| (a, b));
        let mut links = Self {
            ends: vec![0; cells.count()],
            ..Self::default()
        };
        for group in both.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            let (a, b, _) = group[0];
            links.to.push(b);
            links.borders.push(group.iter().map(|g| g.2).sum());
            links.ends[a as usize] = links.to.len() as u32;
        }
        let mut end = 0;
        for e in &mut links.ends {
            end = end.max(*e);
            *e = end;
        }
        links
    }

    /// A cell's links: index of the link and the neighbour.
    #[inline]
    pub fn neighbours(&self, cell: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let row = self.row(cell);
        row.map(|at| (at, self.to[at] as usize))
    }

    /// Indices of a cell's links.
    #[inline]
    pub fn row(&self, cell: usize) -> std::ops::Range<usize> {
        row_range(&self.ends, cell)
    }
}

/// The borders of a cell: its index, the neighbour, and the length of the border in mean widths of both.
fn neighbours(scene: &Scene, cells: &Cells, index: u32) -> Vec<(u32, u32, f32)> {
    let cell = &cells.cells[index as usize];
    let mut found = Vec::new();
    for piece in &cell.pieces {
        let corners = piece.corners(scene);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let double_area = normal.length();
        let normal = normal.normalize_or_zero();
        for edge in 0..3 {
            let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
            let length = from.distance(to);
            if double_area <= 0.0 || length <= 0.0 {
                continue;
            }
            let stride = STRIDE * double_area / length;
            let out = (to - from).cross(normal).normalize_or_zero() * stride;
            for fraction in STEPS {
                let beyond = from.lerp(to, fraction) + out;
                let Some(other) = cell_at(scene, cells, piece.triangle, beyond, cell, stride)
                else {
                    continue;
                };
                if other != index {
                    let width = 0.5 * (cell.size + cells.cells[other as usize].size);
                    found.push((index, other, length / (STEPS.len() as f32 * width)));
                }
            }
        }
    }
    found
}

/// The cell at a point near a triangle: in its plane, or on a surface of similar normal within `reach`.
fn cell_at(
    scene: &Scene,
    cells: &Cells,
    triangle: u32,
    point: Vec3,
    cell: &Cell,
    reach: f32,
) -> Option<u32> {
    if let Some(hit) = on_triangle(scene, triangle, point) {
        return cells.locate(&hit);
    }
    let ray = Ray {
        origin: point + cell.normal * reach,
        direction: -cell.normal * (2.0 * reach),
        t_min: 0.0,
        t_max: 1.0,
    };
    let hit = scene.intersect(&ray)?;
    let other = cells.locate(&hit)?;
    (cells.cells[other as usize].normal.dot(cell.normal) > FOLD).then_some(other)
}

/// The barycentric coordinates of a point in a triangle's plane; `None` outside the triangle.
fn on_triangle(scene: &Scene, triangle: u32, point: Vec3) -> Option<Hit> {
    let [a, b, c] = scene.corners(triangle);
    let (u, v, p) = (b - a, c - a, point - a);
    let n = u.cross(v);
    let n2 = n.length_squared();
    if n2 <= 0.0 {
        return None;
    }
    let b1 = p.cross(v).dot(n) / n2;
    let b2 = u.cross(p).dot(n) / n2;
    (b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0).then_some(Hit {
        t: 0.0,
        triangle,
        b1,
        b2,
    })
}
