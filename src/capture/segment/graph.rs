//! The dual graph of a mesh: faces and the edges between them.

use crate::capture::mesh::Mesh;
use crate::capture::segment::shown::{ShownFace, filled};
use glam::DVec3;
use rayon::prelude::*;

/// Weight of a change of normal in the contrast of an edge.
const NORMAL_WEIGHT: f64 = 1.0;
/// Weight of a change of colour in the contrast of an edge.
const COLOR_WEIGHT: f64 = 0.5;
/// Weight of a change of brightness relative to one of hue: light and shadow change hue less.
const BRIGHTNESS_WEIGHT: f64 = 0.5;

/// The dual graph of a mesh, with the features of segmentation per face.
pub struct FaceGraph {
    pub area: Vec<f64>,
    /// Unit normals, smoothed over vertices; zero for degenerate faces.
    pub normal: Vec<DVec3>,
    /// Square roots of colours (as lightness is perceived), relative to the mesh's mean and with half of the brightness: from the
    /// photographs, or else from vertex colours; zero without either.
    pub color: Vec<DVec3>,
    pub saturated: Vec<bool>,
    pub centroid: Vec<DVec3>,
    /// Pairs of faces that share an edge.
    pub edges: Vec<[u32; 2]>,
}

impl FaceGraph {
    /// The graph of a mesh and what photographs show of its faces; vertices at equal positions are welded.
    pub fn new(mesh: &Mesh, shown: &[ShownFace]) -> Self {
        let welded = mesh.weld();
        let corners: Vec<[u32; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|i| welded[i as usize]))
            .collect();
        let position = |i: u32| mesh.positions[i as usize];
        let crosses: Vec<DVec3> = corners
            .par_iter()
            .map(|t| {
                let [a, b, c] = t.map(position);
                (b - a).cross(c - a)
            })
            .collect();

        // Average normals over each vertex, then over each face: fused depth is noisy at the scale of a face.
        let mut at_vertex = vec![DVec3::ZERO; mesh.positions.len()];
        for (t, &cross) in corners.iter().zip(&crosses) {
            t.iter().for_each(|&i| at_vertex[i as usize] += cross);
        }
        let normal = corners
            .iter()
            .zip(&crosses)
            .map(|(t, cross)| {
                let sum: DVec3 = t
                    .iter()
                    .map(|&i| at_vertex[i as usize].normalize_or_zero())
                    .sum();
                (sum + cross.normalize_or_zero()).normalize_or_zero()
            })
            .collect();
        let edges = shared_edges(&corners);
        let (color, saturated) = filled(mesh, shown, &vertex_colors(mesh), &edges);
        Self {
            area: crosses.iter().map(|cross| cross.length() * 0.5).collect(),
            normal,
            color: relative(color),
            saturated,
            centroid: corners
                .iter()
                .map(|t| t.map(position).iter().sum::<DVec3>() / 3.0)
                .collect(),
            edges,
        }
    }

    /// The contrast of every edge: weighted change of normal (squared at convex edges) plus change of colour.
    pub fn contrasts(&self) -> Vec<f64> {
        self.edges
            .par_iter()
            .map(|&[a, b]| {
                let (a, b) = (a as usize, b as usize);
                let bend = (1.0 - self.normal[a].dot(self.normal[b])).max(0.0);
                let ahead = self.centroid[b] - self.centroid[a];
                let convex = ahead.dot(self.normal[b] - self.normal[a]) > 0.0;
                let bend = if convex { bend * bend } else { bend };
                NORMAL_WEIGHT * bend + COLOR_WEIGHT * self.color[a].distance(self.color[b])
            })
            .collect()
    }
}

/// Square root of vertex colour, averaged over each face's corners; zero without vertex colours.
fn vertex_colors(mesh: &Mesh) -> Vec<DVec3> {
    if mesh.vertex_colors.is_empty() {
        return vec![DVec3::ZERO; mesh.triangles.len()];
    }
    let compressed: Vec<DVec3> = (mesh.vertex_colors.iter())
        .map(|c| c.as_dvec3().max(DVec3::ZERO).map(f64::sqrt))
        .collect();
    let mean_of = |t: &[u32; 3]| t.iter().map(|&i| compressed[i as usize]).sum::<DVec3>() / 3.0;
    mesh.triangles.iter().map(mean_of).collect()
}

/// Divides colours by the mean over all faces, and reduces their brightness.
fn relative(mut colors: Vec<DVec3>) -> Vec<DVec3> {
    let sum: DVec3 = colors.iter().sum();
    let mean = sum.element_sum() / (3.0 * colors.len() as f64);
    let scale = if mean > 0.0 { mean.recip() } else { 0.0 };
    for color in &mut colors {
        let gray = DVec3::splat(color.element_sum() / 3.0);
        *color = (*color - gray * (1.0 - BRIGHTNESS_WEIGHT)) * scale;
    }
    colors
}

/// Pairs of faces that share an edge; at an edge of more than two faces each is paired with the next.
fn shared_edges(corners: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut sides: Vec<(u32, u32, u32)> = corners
        .par_iter()
        .enumerate()
        .flat_map_iter(|(face, &[a, b, c])| {
            [(a, b), (b, c), (c, a)].map(|(i, j)| (i.min(j), i.max(j), face as u32))
        })
        .filter(|(i, j, _)| i != j)
        .collect();
    sides.par_sort_unstable();
    sides
        .windows(2)
        .filter(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1) && pair[0].2 != pair[1].2)
        .map(|pair| [pair[0].2, pair[1].2])
        .collect()
}
