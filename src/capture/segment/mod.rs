//! Segments a mesh without objects by normals and by the colours in its photographs.
//!
//! First, the graph-based segmentation of Felzenszwalb and Huttenlocher (2004) over the edges between faces gives fine segments;
//! concave edges weigh more than convex ones (Karpathy et al. 2013). Then neighbours are merged in Ward's order (1963: the least
//! increase of the area-weighted variance of normal and colour) down to the wanted number.
//!
//! Illumination varies smoothly, and in brightness more than in hue. So the colour difference of two segments is at most the
//! difference across their border, and brightness has half weight. Saturated patches (lamps and windows) are never merged with
//! others. Last, neighbours of which most pixels are saturated are joined: they are pieces of one lamp. All quantities are relative
//! to the mesh's area and mean colour, so scale and exposure do not matter.

mod graph;
mod sets;
mod shown;
mod ward;

use crate::capture::mesh::Mesh;
use graph::FaceGraph;
use sets::Sets;
use shown::MOSTLY;
pub use shown::ShownFace;

/// Felzenszwalb and Huttenlocher's k: the contrast tolerated by a segment with the area of the mean face.
const FINE_CONTRAST: f64 = 0.2;

/// Replaces the mesh's objects by segments, named "segment 000", "segment 001", … by descending area.
///
/// `shown` is what photographs show of each face; it has priority over vertex colours. `wanted` is the number of segments without
/// the saturated ones; `None` chooses it by the merge cost. The result is deterministic. Returns the number of saturated segments.
pub fn segment(mesh: &mut Mesh, shown: &[ShownFace], wanted: Option<usize>) -> usize {
    let graph = FaceGraph::new(mesh, shown);
    let fine = fine_segments(&graph);
    let mut segment_of = ward::merge(&graph, &fine, wanted);
    join_saturated(&graph, shown, &mut segment_of);
    let (segment_of, count) = number_by_area(&graph, &segment_of);
    mesh.object_of = segment_of;
    mesh.objects = (0..count).map(|i| format!("segment {i:03}")).collect();
    let mut saturated = vec![false; count];
    for (&segment, &is_saturated) in mesh.object_of.iter().zip(&graph.saturated) {
        saturated[segment as usize] |= is_saturated;
    }
    saturated.iter().filter(|&&saturated| saturated).count()
}

/// Felzenszwalb–Huttenlocher segmentation; returns the representative face of each face's segment.
fn fine_segments(graph: &FaceGraph) -> Vec<u32> {
    let mut order: Vec<u32> = (0..graph.edges.len() as u32).collect();
    let contrasts: Vec<f64> = graph.contrasts();
    order.sort_unstable_by(|&a, &b| {
        let contrast = |edge: u32| contrasts[edge as usize];
        contrast(a).total_cmp(&contrast(b)).then(a.cmp(&b))
    });

    // Join two segments if the contrast between them is at most the tolerance of both.
    let count = graph.area.len();
    let mean_area = graph.area.iter().sum::<f64>() / count as f64;
    let mut sets = Sets::new(count);
    let mut size: Vec<f64> = graph.area.iter().map(|a| a / mean_area).collect();
    let mut tolerance: Vec<f64> = size.iter().map(|s| FINE_CONTRAST / s).collect();
    for edge in order {
        let contrast = contrasts[edge as usize];
        let [a, b] = graph.edges[edge as usize].map(|face| sets.find(face));
        let [left, right] = graph.edges[edge as usize].map(|face| graph.saturated[face as usize]);
        // Saturated neighbours always join: a lamp is one segment.
        let tolerated = match left && right {
            true => f64::INFINITY,
            false => tolerance[a as usize].min(tolerance[b as usize]),
        };
        if a == b || left != right || contrast > tolerated {
            continue;
        }
        let total = size[a as usize] + size[b as usize];
        let root = sets.join(a, b) as usize;
        size[root] = total;
        tolerance[root] = contrast + FINE_CONTRAST / total;
    }
    (0..count as u32).map(|face| sets.find(face)).collect()
}

/// Joins neighbouring segments that are saturated. `segment_of` holds a representative of each face's segment.
///
/// A lamp's normals cut it into pieces, and photographs tell only lower bounds of their radiance. The light in the room tells the
/// sum of the pieces well, but not each of them.
fn join_saturated(graph: &FaceGraph, shown: &[ShownFace], segment_of: &mut [u32]) {
    let count = segment_of.len();
    let mut pixels = vec![[0.0; 2]; count];
    for (face, &segment) in shown.iter().zip(&*segment_of) {
        let [saturated, all] = &mut pixels[segment as usize];
        *saturated += f64::from(face.pixels) * f64::from(face.saturated);
        *all += f64::from(face.pixels);
    }
    let is_saturated = |segment: u32| {
        let [saturated, all] = pixels[segment as usize];
        saturated > MOSTLY * all
    };
    let mut sets = Sets::new(count);
    for edge in &graph.edges {
        let [a, b] = edge.map(|face| segment_of[face as usize]);
        if is_saturated(a) && is_saturated(b) {
            sets.unite(a, b);
        }
    }
    for segment in segment_of {
        *segment = sets.find(*segment);
    }
}

/// Numbers segments by descending area, ties by representative. Returns each face's number, and how many there are.
fn number_by_area(graph: &FaceGraph, segment_of: &[u32]) -> (Vec<u32>, usize) {
    let count = segment_of.len();
    let mut areas = vec![0.0; count];
    let mut used = vec![false; count];
    for (&segment, area) in segment_of.iter().zip(&graph.area) {
        areas[segment as usize] += area;
        used[segment as usize] = true;
    }
    let mut order: Vec<u32> = (0..count as u32).filter(|&s| used[s as usize]).collect();
    let area = |segment: u32| areas[segment as usize];
    order.sort_by(|&a, &b| area(b).total_cmp(&area(a)));
    let mut number = vec![0; count];
    for (index, &segment) in (0..).zip(&order) {
        number[segment as usize] = index;
    }
    let numbers = segment_of.iter().map(|&segment| number[segment as usize]);
    (numbers.collect(), order.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    fn unseen(faces: usize) -> Vec<ShownFace> {
        vec![ShownFace::default(); faces]
    }

    /// Floor (half of it red), back wall and a floating square, each a grid of `n` × `n` quads with a little noise.
    fn room(n: usize, scale: f64, exposure: f32) -> Mesh {
        let mut mesh = Mesh::default();
        let mut square = |origin: DVec3, u: DVec3, v: DVec3, color: &dyn Fn(f64) -> Vec3| {
            let first = mesh.positions.len() as u32;
            let side = n as u32 + 1;
            for j in 0..side {
                for i in 0..side {
                    let (s, t) = (f64::from(i) / n as f64, f64::from(j) / n as f64);
                    let inside = i > 0 && j > 0 && i + 1 < side && j + 1 < side;
                    let noise = f64::from(inside) * f64::from((i * 7 + j * 13) % 5) * 0.002;
                    let normal = u.cross(v).normalize();
                    mesh.positions
                        .push((origin + u * s + v * t + normal * noise) * scale);
                    mesh.vertex_colors.push(color(s) * exposure);
                }
            }
            for j in 0..n as u32 {
                for i in 0..n as u32 {
                    let a = first + j * side + i;
                    mesh.triangles.push([a, a + 1, a + side + 1]);
                    mesh.triangles.push([a, a + side + 1, a + side]);
                }
            }
        };
        let gray = |_: f64| Vec3::splat(0.5);
        let half_red = |s: f64| match s < 0.5 {
            true => Vec3::new(0.6, 0.1, 0.1),
            false => Vec3::splat(0.5),
        };
        square(DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0, &half_red);
        square(DVec3::Y * 4.0, DVec3::X * 4.0, DVec3::Z * 3.0, &gray);
        square(DVec3::new(1.0, 1.0, 2.5), DVec3::X, DVec3::Y, &gray);
        mesh.object_of = vec![0; mesh.triangles.len()];
        mesh.objects = vec!["mesh".into()];
        mesh
    }

    #[test]
    fn surfaces_and_colours_come_apart_at_any_size_and_exposure() {
        for (scale, exposure) in [(1.0, 1.0), (1e-3, 1e4), (1e5, 1e-5)] {
            let mut mesh = room(20, scale, exposure);
            segment(&mut mesh, &unseen(2400), Some(4));
            assert_eq!(mesh.objects.len(), 4);
            let squares: Vec<&[u32]> = mesh.object_of.chunks(800).collect();
            for whole in &squares[1..] {
                assert!(whole.iter().all(|s| s == &whole[0]), "{scale}");
            }
            let mut seen = [squares[0][0], squares[0][39], squares[1][0], squares[2][0]];
            seen.sort_unstable();
            assert_eq!(seen, [0, 1, 2, 3]);
        }
    }

    #[test]
    fn the_number_wanted_is_met_and_areas_descend() {
        for wanted in [1, 2, 3, 4, 10, 100] {
            let mut mesh = room(20, 1.0, 1.0);
            segment(&mut mesh, &unseen(2400), Some(wanted));
            assert!(mesh.objects.len() <= wanted && mesh.objects.len() >= wanted.min(4));
            let graph = FaceGraph::new(&mesh, &unseen(2400));
            let mut areas = vec![0.0; mesh.objects.len()];
            for (&object, area) in mesh.object_of.iter().zip(&graph.area) {
                areas[object as usize] += area;
            }
            assert!(areas.is_sorted_by(|a, b| a >= b), "{areas:?}");
        }
    }

    /// Two squares that meet at a right angle, as bright as what lies beside them, so that no edge tells a lamp.
    #[test]
    fn neighbours_of_which_most_pixels_are_saturated_are_one_lamp() {
        for (saturated, count) in [(0.6, 1), (0.4, 2)] {
            let mut mesh = room(20, 1.0, 1.0);
            mesh.triangles.truncate(1600);
            mesh.vertex_colors.clear();
            mesh.object_of.truncate(1600);
            let face = ShownFace {
                radiance: Vec3::ONE,
                saturated,
                pixels: 10,
            };
            segment(&mut mesh, &[face; 1600], Some(2));
            assert_eq!(mesh.objects.len(), count, "{saturated}");
        }
    }

    #[test]
    fn degenerate_meshes_are_segmented_without_panic() {
        let mut flat = Mesh {
            positions: vec![DVec3::ZERO; 3],
            triangles: vec![[0, 1, 2], [0, 0, 0]],
            object_of: vec![0; 2],
            objects: vec!["mesh".into()],
            ..Mesh::default()
        };
        segment(&mut flat, &unseen(2), None);
        assert!(flat.objects.len() == 1 && flat.object_of == [0, 0]);
    }
}
