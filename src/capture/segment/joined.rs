//! Joins the pieces of a lamp, and numbers segments.

use crate::capture::segment::graph::FaceGraph;
use crate::capture::segment::sets::Sets;
use crate::capture::segment::shown::{MOSTLY, ShownFace};

/// Joins neighbouring segments that are saturated. `segment_of` holds a representative of each face's segment.
///
/// A lamp's normals cut it into pieces, and photographs tell only lower bounds of their radiance. The light in the room tells the
/// sum of the pieces well, but not each of them.
pub fn join_saturated(graph: &FaceGraph, shown: &[ShownFace], segment_of: &mut [u32]) {
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
pub fn number_by_area(graph: &FaceGraph, segment_of: &[u32]) -> (Vec<u32>, usize) {
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
