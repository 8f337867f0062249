//! Merges neighbouring segments in Ward's order: cheapest merge first.

use crate::capture::segment::graph::FaceGraph;
use crate::capture::segment::sets::Sets;
use glam::DVec3;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// Default merging stops at a merge cost of this fraction of the mesh's area (times a unit squared difference of normal or colour).
const MERGE_LIMIT: f64 = 5e-4;
const MAX_SEGMENTS: usize = 400;

/// Outdated candidates are purged when the heap has twice as many entries as after the last purge, and more than twice this.
const MIN_CANDIDATES: usize = 4096;

/// A segment: area, and area-weighted sums of normal, colour and position.
#[derive(Debug, Clone, Copy, Default)]
struct Region {
    area: f64,
    normal: DVec3,
    color: DVec3,
    position: DVec3,
    /// A saturated region is never merged.
    saturated: bool,
    /// Counts merges; candidates of older versions are outdated.
    version: u32,
}

impl Region {
    fn centroid(&self) -> DVec3 {
        self.position / self.area.max(f64::MIN_POSITIVE)
    }

    /// Ward's cost of a merge: the increase of the area-weighted variance of normal and colour. The colour difference is at most
    /// that across the border, since differences between the interiors are due to illumination.
    fn cost(&self, other: &Self, border: &Border) -> f64 {
        if self.area <= 0.0 || other.area <= 0.0 {
            return 0.0;
        }
        let difference = |a: DVec3, b: DVec3| (a / self.area).distance_squared(b / other.area);
        let color = difference(self.color, other.color).min(border.contrast_squared());
        let change = difference(self.normal, other.normal) + 2.0 * color;
        change * self.area * other.area / (self.area + other.area)
    }

    fn absorb(&mut self, other: &Self) {
        self.area += other.area;
        self.normal += other.normal;
        self.color += other.color;
        self.position += other.position;
        self.version += 1;
    }
}

/// Sums over the edges between a region and a neighbour.
#[derive(Debug, Clone, Copy, Default)]
struct Border {
    /// Sum of the region's colour minus the neighbour's.
    change: DVec3,
    edges: f64,
}

impl Border {
    fn reversed(self) -> Self {
        Self {
            change: -self.change,
            ..self
        }
    }

    fn extend(&mut self, other: Self) {
        self.change += other.change;
        self.edges += other.edges;
    }

    /// Squared mean colour difference across the border; infinite for regions without common edges.
    fn contrast_squared(&self) -> f64 {
        if self.edges == 0.0 {
            return f64::INFINITY;
        }
        (self.change / self.edges).length_squared()
    }
}

/// The neighbours of each region with their borders; saturated regions have none.
fn borders(graph: &FaceGraph, region_of: &[u32], regions: &[Region]) -> Vec<BTreeMap<u32, Border>> {
    let mut neighbors = vec![BTreeMap::<u32, Border>::new(); regions.len()];
    for &[a, b] in &graph.edges {
        let change = graph.color[a as usize] - graph.color[b as usize];
        let (a, b) = (region_of[a as usize], region_of[b as usize]);
        let saturated = [a, b].map(|region| regions[region as usize].saturated);
        if a != b && saturated == [false; 2] {
            let border = Border { change, edges: 1.0 };
            neighbors[a as usize].entry(b).or_default().extend(border);
            let back = neighbors[b as usize].entry(a).or_default();
            back.extend(border.reversed());
        }
    }
    neighbors
}

/// Merges the segments of `fine` (the representative of each face's segment) until `wanted` are left.
///
/// Returns a representative of each face's segment, below the number of faces.
pub fn merge(graph: &FaceGraph, fine: &[u32], wanted: Option<usize>) -> Vec<u32> {
    let (region_of, mut regions) = regions_of(graph, fine);
    let mut neighbors = borders(graph, &region_of, &regions);
    link_islands(&regions, &mut neighbors);

    // Costs are not negative, so their bits sort as they do.
    let mut heap = BinaryHeap::new();
    let candidate = |regions: &[Region], a: u32, b: u32, border: &Border| {
        let (ra, rb) = (&regions[a as usize], &regions[b as usize]);
        Reverse((ra.cost(rb, border).to_bits(), a, b, ra.version, rb.version))
    };
    for (a, around) in (0..).zip(&neighbors) {
        let after = around.range(a + 1..);
        heap.extend(after.map(|(&b, border)| candidate(&regions, a, b, border)));
    }
    let mut purged_size = heap.len().max(MIN_CANDIDATES);
    let total: f64 = regions.iter().map(|region| region.area).sum();
    let mut sets = Sets::new(regions.len());
    let mut count = regions.iter().filter(|region| !region.saturated).count();
    while let Some(Reverse((cost, a, b, version_a, version_b))) = heap.pop() {
        let enough = match wanted {
            Some(wanted) => count <= wanted.max(1),
            None => count <= MAX_SEGMENTS && f64::from_bits(cost) > MERGE_LIMIT * total,
        };
        if enough {
            break;
        }
        let current = |x: u32, version: u32| regions[x as usize].version == version;
        if !current(a, version_a) || !current(b, version_b) {
            continue;
        }
        let root = sets.join(a, b);
        let child = if root == a { b } else { a };
        let absorbed = regions[child as usize];
        regions[root as usize].absorb(&absorbed);
        regions[child as usize].version = u32::MAX;
        count -= 1;
        let moved = std::mem::take(&mut neighbors[child as usize]);
        for (other, border) in moved {
            neighbors[other as usize].remove(&child);
            if other != root {
                let joined = neighbors[root as usize].entry(other).or_default();
                joined.extend(border);
                let seen_back = joined.reversed();
                neighbors[other as usize].insert(root, seen_back);
            }
        }
        let around = &neighbors[root as usize];
        heap.extend(
            around
                .iter()
                .map(|(&b, border)| candidate(&regions, root, b, border)),
        );
        // Purge outdated candidates: a large region that absorbs many small ones leaves many.
        if heap.len() > 2 * purged_size {
            heap.retain(|Reverse((_, a, b, version_a, version_b))| {
                let current = |x: u32, version: u32| regions[x as usize].version == version;
                current(*a, *version_a) && current(*b, *version_b)
            });
            purged_size = heap.len().max(MIN_CANDIDATES);
        }
    }
    region_of.iter().map(|&region| sets.find(region)).collect()
}

/// Each face's region, and the regions in the order of their first faces.
fn regions_of(graph: &FaceGraph, fine: &[u32]) -> (Vec<u32>, Vec<Region>) {
    let mut index = vec![u32::MAX; fine.len()];
    let mut regions: Vec<Region> = Vec::new();
    let region_of = fine
        .iter()
        .enumerate()
        .map(|(face, &segment)| {
            let slot = &mut index[segment as usize];
            if *slot == u32::MAX {
                *slot = regions.len() as u32;
                regions.push(Region::default());
            }
            let area = graph.area[face];
            let region = &mut regions[*slot as usize];
            region.area += area;
            region.normal += graph.normal[face] * area;
            region.color += graph.color[face] * area;
            region.position += graph.centroid[face] * area;
            region.saturated = graph.saturated[face];
            *slot
        })
        .collect();
    (region_of, regions)
}

/// Connects separate components of the mesh: each component's largest region becomes a neighbour of the nearest region in a
/// larger component. Saturated components stay separate.
fn link_islands(regions: &[Region], neighbors: &mut [BTreeMap<u32, Border>]) {
    let mut sets = Sets::new(regions.len());
    for (a, around) in (0..).zip(neighbors.iter()) {
        for &b in around.keys() {
            sets.unite(a, b);
        }
    }
    // Components by descending area, ties by the first region.
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); regions.len()];
    for a in 0..regions.len() as u32 {
        members[sets.find(a) as usize].push(a);
    }
    members.retain(|piece| {
        piece
            .first()
            .is_some_and(|&a| !regions[a as usize].saturated)
    });
    let area = |piece: &[u32]| -> f64 { piece.iter().map(|&a| regions[a as usize].area).sum() };
    members.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a[0].cmp(&b[0])));

    let mut larger: RTree<GeomWithData<[f64; 3], u32>> = RTree::new();
    let place = |x: u32| regions[x as usize].centroid().to_array();
    for piece in members {
        let by_area = |a: &u32, b: &u32| {
            let area = |x: u32| regions[x as usize].area;
            area(*a).total_cmp(&area(*b)).then(b.cmp(a))
        };
        if let Some(&largest) = piece.iter().max_by(|a, b| by_area(a, b)) {
            // Ties by index.
            let nearest = larger.nearest_neighbors(&place(largest));
            if let Some(nearest) = nearest.iter().map(|region| region.data).min() {
                neighbors[largest as usize].insert(nearest, Border::default());
                neighbors[nearest as usize].insert(largest, Border::default());
            }
        }
        for x in piece {
            larger.insert(GeomWithData::new(place(x), x));
        }
    }
}
