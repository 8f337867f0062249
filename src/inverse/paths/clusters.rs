//! Which pixels are fitted, gathered in clusters: neighbouring pixels of one object in one photograph.
//!
//! Light varies little within a cluster, so its mean holds nearly all that its pixels know of the unknowns, while the
//! noise of photographs and of paths averages out before products are taken.

use crate::calibrate::gbuffer::{GBuffer, GBufferPixel};
use crate::calibrate::problem::Problem;
use glam::{BVec3, DVec3, Vec3};
use std::collections::BTreeMap;

/// Pixels of a cluster aimed at.
const CLUSTER_PIXELS: f64 = 48.0;
/// Objects with fewer pixels than this away from their edges are fitted at their edges too.
const ENOUGH: u64 = 48;
/// Objects seen by fewer pixels than this keep all of theirs, at edges each by itself.
const SMALL: u64 = 400;
/// Below this fraction of a typical photograph's level, pixels weigh no more for being darker.
const DARK: f32 = 0.5;

/// Neighbouring pixels of one object in one photograph.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    /// Frame index.
    pub frame: u32,
    /// Object behind the pixels' centres.
    pub object: u32,
    /// The pixels, row by row from the top left.
    pub pixels: Vec<u32>,
    /// Paths a pixel in each of the two sets.
    pub paths: u32,
    /// Mean radiance of the pixels in the photograph.
    pub measured: Vec3,
    /// Channels in which a pixel is saturated, so that `measured` is a lower bound.
    pub censored: BVec3,
    /// Weight of the squared difference of the means, per channel: pixels / level².
    pub weight: Vec3,
    /// Level below which pixels weigh no more for being darker.
    pub dark: Vec3,
}

impl Cluster {
    /// Weighs it by a level per channel.
    ///
    /// The photograph's own level gives more weight to what is dark by its noise or its texture, so that one albedo for
    /// a textured object comes out below the mean. A prediction from independent paths does not.
    pub fn weigh(&mut self, level: Vec3) {
        self.weight = (level * level + self.dark * self.dark).recip() * self.pixels.len() as f32;
    }
}

/// Gathers the pixels that are in the fit. `max_pixels` bounds how many are used; small objects keep all of theirs.
pub fn cluster(problem: &Problem, gbuffer: &GBuffer, max_pixels: usize) -> Vec<Cluster> {
    // Usable pixels: away from all edges, or nearer to them on objects that have few.
    let seen = |object: u32| gbuffer.seen.get(object as usize).copied().unwrap_or(0);
    let mut usable: Vec<&GBufferPixel> = gbuffer
        .pixels
        .iter()
        .filter(|p| !p.held_out && p.object != u32::MAX)
        .collect();
    let saturated = |frame: u32, pixel: u32| {
        let photograph = &problem.photographs[frame as usize];
        photograph.saturated(pixel as usize)
    };
    let nearest = nearest_to_edges(&usable, gbuffer.seen.len(), |p| {
        saturated(p.frame, p.pixel).any()
    });
    usable.retain(|p| Edge::of(p) <= nearest[p.object as usize].0);
    let thinning = (usable.len() as f64 / max_pixels.max(1) as f64).max(1.0);
    let tile = (CLUSTER_PIXELS * thinning).sqrt().round().max(1.0) as u32;

    // Tiles of each photograph, apart for each object, and for what is saturated.
    let mut tiles: BTreeMap<(u32, u32, u32, u32, bool), Vec<u32>> = BTreeMap::new();
    for pixel in usable {
        let width = problem.photographs[pixel.frame as usize].width;
        let bound = saturated(pixel.frame, pixel.pixel).any();
        let tile = match nearest[pixel.object as usize] {
            (Edge::Near | Edge::On, pixels) if !bound => tile_at_edges(pixels).min(tile),
            _ => tile,
        };
        let place = (pixel.pixel / width / tile, pixel.pixel % width / tile);
        tiles
            .entry((pixel.frame, place.0, place.1, pixel.object, bound))
            .or_default()
            .push(pixel.pixel);
    }

    // Thin out large objects, evenly over each tile.
    let dark = typical_level(problem, gbuffer) * DARK;
    tiles
        .into_iter()
        .map(|((frame, _, _, object, _), all)| {
            let keep = if seen(object) < SMALL { 1.0 } else { thinning };
            let count = ((all.len() as f64 / keep).round() as usize).clamp(1, all.len());
            let pixels: Vec<u32> = (0..count).map(|i| all[i * all.len() / count]).collect();
            let photograph = &problem.photographs[frame as usize];
            let sum: DVec3 = pixels
                .iter()
                .map(|&p| photograph.pixels[p as usize].as_dvec3())
                .sum();
            let measured = (sum / pixels.len() as f64).as_vec3();
            let bounds = pixels.iter().map(|&p| saturated(frame, p));
            let censored = bounds.fold(BVec3::FALSE, |all, bound| all | bound);
            let mut cluster = Cluster {
                frame,
                object,
                pixels,
                paths: 1,
                measured,
                censored,
                weight: Vec3::ONE,
                dark,
            };
            cluster.weigh(measured);
            cluster
        })
        .collect()
}

/// How near to an edge of what it sees a pixel lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Edge {
    /// None of the pixels around is on one.
    Far,
    /// It sees one surface, as far as its rays tell: a sliver may have slipped between them.
    Near,
    /// It sees more than one.
    On,
}

impl Edge {
    fn of(pixel: &GBufferPixel) -> Self {
        match (pixel.inside, pixel.pure) {
            (true, _) => Self::Far,
            (false, true) => Self::Near,
            (false, false) => Self::On,
        }
    }
}

/// How near to its edges each object is fitted, and by how many pixels: as far as there are enough. A sliver of a lamp in
/// a pixel of the ceiling outshines it, and its fraction of the pixel is known no better than the photograph's noise and the
/// camera's place. Lower bounds do not count.
fn nearest_to_edges(
    pixels: &[&GBufferPixel],
    objects: usize,
    is_bound: impl Fn(&GBufferPixel) -> bool,
) -> Vec<(Edge, u64)> {
    let mut counts = vec![[0u64; 3]; objects];
    for pixel in pixels.iter().filter(|p| !is_bound(p)) {
        let [far, off, all] = &mut counts[pixel.object as usize];
        *far += u64::from(Edge::of(pixel) == Edge::Far);
        *off += u64::from(Edge::of(pixel) != Edge::On);
        *all += 1;
    }
    let nearest = |[far, off, all]: [u64; 3]| match (far >= ENOUGH, off >= ENOUGH) {
        (true, _) => (Edge::Far, far),
        (false, true) => (Edge::Near, off),
        (false, false) => (Edge::On, all),
    };
    counts.into_iter().map(nearest).collect()
}

/// Side of the tiles of an object that is fitted at its edges: near a lamp each pixel holds light of its own, or a fraction of
/// the lamp of its own, and is known as well as those allow. Gathered with others it would weigh like them.
fn tile_at_edges(pixels: u64) -> u32 {
    (pixels as f64 / SMALL as f64).sqrt().floor().max(1.0) as u32
}

/// Median over photographed pixels that are in the fit, per channel; one where all are black.
fn typical_level(problem: &Problem, gbuffer: &GBuffer) -> Vec3 {
    let channel = |c: usize| {
        let mut values: Vec<f32> = gbuffer
            .pixels
            .iter()
            .filter(|p| !p.held_out && p.object != u32::MAX)
            .map(|p| problem.photographs[p.frame as usize].pixels[p.pixel as usize][c])
            .filter(|&v| v > 0.0)
            .collect();
        if values.is_empty() {
            return 1.0;
        }
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    Vec3::new(channel(0), channel(1), channel(2))
}

/// Mean radiance of the clusters.
pub fn mean_radiance(clusters: &[Cluster]) -> Vec3 {
    let sum: DVec3 = clusters.iter().map(|c| c.measured.as_dvec3()).sum();
    (sum / clusters.len().max(1) as f64).as_vec3()
}

/// Mean of each surface's brightest channel over its clusters.
pub fn brightness(clusters: &[Cluster], surfaces: usize) -> Vec<f32> {
    let mut sums = vec![(0.0, 0.0); surfaces];
    for cluster in clusters {
        let (sum, pixels) = &mut sums[cluster.object as usize];
        *sum += f64::from(cluster.measured.max_element()) * cluster.pixels.len() as f64;
        *pixels += cluster.pixels.len() as f64;
    }
    let mean = |(sum, pixels): (f64, f64)| (sum / pixels.max(1.0)) as f32;
    sums.into_iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_predicted_level_weighs_dark_and_bright_spots_of_a_texture_alike() {
        let cluster = |measured: f32| Cluster {
            frame: 0,
            object: 0,
            pixels: vec![0; 10],
            paths: 1,
            measured: Vec3::splat(measured),
            censored: BVec3::FALSE,
            weight: Vec3::ONE,
            dark: Vec3::splat(0.1),
        };
        let mut spots = [cluster(0.2), cluster(1.8)];
        let mean = |spots: &[Cluster]| {
            let (sum, weight) = spots.iter().fold((0.0, 0.0), |(s, w), c| {
                (s + c.weight.x * c.measured.x, w + c.weight.x)
            });
            sum / weight
        };
        for spot in &mut spots {
            spot.weigh(spot.measured);
        }
        assert!(mean(&spots) < 0.3);
        for spot in &mut spots {
            spot.weigh(Vec3::ONE);
        }
        assert!((mean(&spots) - 1.0).abs() < 1e-6);
        assert!((spots[0].weight.x - 10.0 / 1.01).abs() < 1e-4);
    }

    #[test]
    fn objects_are_fitted_as_far_from_their_edges_as_there_are_enough_pixels() {
        let pixel = |object: u32, edge: Edge| GBufferPixel {
            frame: 0,
            pixel: 0,
            object,
            pure: edge != Edge::On,
            inside: edge == Edge::Far,
            held_out: false,
            points: [None; 4],
        };
        let of = |object: u32, counts: [u64; 3]| {
            let edges = [Edge::Far, Edge::Near, Edge::On];
            (edges.into_iter().zip(counts))
                .flat_map(move |(edge, n)| (0..n).map(move |_| pixel(object, edge)))
        };
        let pixels: Vec<GBufferPixel> = of(0, [ENOUGH, 500, 500])
            .chain(of(1, [ENOUGH - 1, 1, 500]))
            .chain(of(2, [10, 20, 5]))
            .collect();
        let pixels: Vec<&GBufferPixel> = pixels.iter().collect();
        let nearest = nearest_to_edges(&pixels, 4, |_| false);
        let edges: Vec<Edge> = nearest.iter().map(|n| n.0).collect();
        assert_eq!(edges, [Edge::Far, Edge::Near, Edge::On, Edge::On]);
        let counts: Vec<u64> = nearest.iter().map(|n| n.1).collect();
        assert_eq!(counts, [ENOUGH, ENOUGH, 35, 0]);
        // Lower bounds alone are none.
        let bounds = nearest_to_edges(&pixels[..ENOUGH as usize], 1, |_| true);
        assert_eq!(bounds, [(Edge::On, 0)]);
        assert_eq!([1, SMALL, 4 * SMALL].map(tile_at_edges), [1, 1, 2]);
    }
}
