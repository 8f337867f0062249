//! Selects the pixels of the fit and groups them in clusters: neighbouring pixels of one object in one photograph.
//!
//! Radiance varies little within a cluster, so its mean carries nearly all the information of its pixels, and the noise of
//! photographs and paths averages out before products are taken.

use crate::calibrate::gbuffer::{GBuffer, GBufferPixel};
use crate::calibrate::problem::Problem;
use crate::math::stats::upper_median;
use glam::{BVec3, DVec3, Vec3};
use std::collections::BTreeMap;

const CLUSTER_PIXELS: f64 = 48.0;
/// Objects with fewer pixels than this away from their edges are fitted at their edges too.
const ENOUGH: u64 = 48;
/// Objects seen by fewer pixels than this are not thinned; their pixels at edges form clusters of one pixel.
const SMALL: u64 = 400;
/// Fraction of the median photographed radiance below which weights stop growing.
const DARK: f32 = 0.5;

/// Neighbouring pixels of one object in one photograph.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    /// Frame index.
    pub frame: u32,
    /// Object that the pixels' centres see.
    pub object: u32,
    /// Pixel indices, row by row from the top left.
    pub pixels: Vec<u32>,
    /// Paths per pixel in each of the two sets.
    pub paths: u32,
    /// Mean radiance of the pixels in the photograph.
    pub measured: Vec3,
    /// Channels in which a pixel is saturated, so that `measured` is a lower bound.
    pub censored: BVec3,
    /// Level that [`Self::weight`] is taken at; `None` for photographed and fitted radiance alike.
    pub level: Option<Vec3>,
    /// Level below which the weight stops growing.
    pub dark: Vec3,
}

impl Cluster {
    /// Weight of the squared residual of the mean, per channel: pixels / (level² + dark²).
    ///
    /// The photographed radiance as the level favours pixels that are dark by noise or texture, and biases the albedo of a textured
    /// object below its mean; a level predicted by paths other than the fit's does not. Where mesh or pose are a pixel off, as in a
    /// scan, a dark pixel that the fit has in the sun would outweigh a sunlit one that it has in shadow by (level / dark)². The mean
    /// of the squares of photographed and `fitted` radiance weighs both mistakes alike, and the variance follows the mean as in a
    /// quasi-likelihood (Wedderburn 1974).
    pub fn weight(&self, fitted: DVec3) -> DVec3 {
        let square = match self.level {
            Some(level) => level * level,
            None => {
                let fitted = fitted.as_vec3();
                (self.measured * self.measured + fitted * fitted) * 0.5
            }
        };
        ((square + self.dark * self.dark).recip() * self.pixels.len() as f32).as_dvec3()
    }
}

/// Groups the pixels that are in the fit, about `max_pixels` of them; small objects keep all of theirs.
pub fn cluster(problem: &Problem, gbuffer: &GBuffer, max_pixels: usize) -> Vec<Cluster> {
    // Pixels at edges are used only on objects with few other pixels.
    let seen = |object: u32| gbuffer.seen.get(object as usize).copied().unwrap_or(0);
    let mut usable: Vec<&GBufferPixel> = gbuffer.fitted().collect();
    let saturated = |frame: u32, pixel: u32| {
        let photograph = &problem.photographs[frame as usize];
        photograph.saturated(pixel as usize)
    };
    let allowed = allowed_edges(&usable, gbuffer.seen.len(), |p| {
        saturated(p.frame, p.pixel).any()
    });
    usable.retain(|p| Edge::of(p) <= allowed[p.object as usize].0);
    let thinning = (usable.len() as f64 / max_pixels.max(1) as f64).max(1.0);
    let tile = (CLUSTER_PIXELS * thinning).sqrt().round().max(1.0) as u32;

    // Image tiles, separate for each object and for saturated pixels.
    let mut tiles: BTreeMap<(u32, u32, u32, u32, bool), Vec<u32>> = BTreeMap::new();
    for pixel in usable {
        let width = problem.photographs[pixel.frame as usize].width;
        let is_saturated = saturated(pixel.frame, pixel.pixel).any();
        let tile = match allowed[pixel.object as usize] {
            (Edge::Near | Edge::On, pixels) if !is_saturated => tile_at_edges(pixels).min(tile),
            _ => tile,
        };
        let (y, x) = (pixel.pixel / width / tile, pixel.pixel % width / tile);
        tiles
            .entry((pixel.frame, y, x, pixel.object, is_saturated))
            .or_default()
            .push(pixel.pixel);
    }

    // Thin large objects, evenly over each tile.
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
            let censored = (pixels.iter())
                .map(|&p| saturated(frame, p))
                .fold(BVec3::FALSE, |any, saturated| any | saturated);
            Cluster {
                frame,
                object,
                pixels,
                paths: 1,
                measured,
                censored,
                level: (!problem.scene.scanned).then_some(measured),
                dark,
            }
        })
        .collect()
}

/// Where a pixel lies relative to edges of its object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Edge {
    /// It and its neighbours see one object.
    Far,
    /// All its rays hit one surface, but a sliver of another may lie between them.
    Near,
    /// Its rays hit several surfaces.
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

/// For each object, the kind of pixels closest to edges that the fit needs to use, and the number of usable pixels then.
/// Saturated pixels are not counted.
///
/// Pixels at edges are avoided because a sliver of a lamp outshines the rest of a pixel, and its coverage is only as well known
/// as the camera's pose.
fn allowed_edges(
    pixels: &[&GBufferPixel],
    objects: usize,
    is_saturated: impl Fn(&GBufferPixel) -> bool,
) -> Vec<(Edge, u64)> {
    let mut counts = vec![[0u64; 3]; objects];
    for pixel in pixels.iter().filter(|p| !is_saturated(p)) {
        let [far, pure, all] = &mut counts[pixel.object as usize];
        *far += u64::from(Edge::of(pixel) == Edge::Far);
        *pure += u64::from(Edge::of(pixel) != Edge::On);
        *all += 1;
    }
    let allowed = |[far, pure, all]: [u64; 3]| match (far >= ENOUGH, pure >= ENOUGH) {
        (true, _) => (Edge::Far, far),
        (false, true) => (Edge::Near, pure),
        (false, false) => (Edge::On, all),
    };
    counts.into_iter().map(allowed).collect()
}

/// Side of the tiles, in pixels, of an object fitted at its edges: pixels there differ, so that few share a cluster and its weight.
fn tile_at_edges(pixels: u64) -> u32 {
    (pixels as f64 / SMALL as f64).sqrt().floor().max(1.0) as u32
}

/// Median of the positive values of pixels in the fit, per channel; one if there are none.
fn typical_level(problem: &Problem, gbuffer: &GBuffer) -> Vec3 {
    let channel = |c: usize| {
        let mut values: Vec<f32> = (gbuffer.fitted())
            .map(|p| problem.photographs[p.frame as usize].pixels[p.pixel as usize][c])
            .filter(|&v| v > 0.0)
            .collect();
        upper_median(&mut values).unwrap_or(1.0)
    };
    Vec3::new(channel(0), channel(1), channel(2))
}

/// Mean of the clusters' measured radiance.
pub fn mean_radiance(clusters: &[Cluster]) -> Vec3 {
    let sum: DVec3 = clusters.iter().map(|c| c.measured.as_dvec3()).sum();
    (sum / clusters.len().max(1) as f64).as_vec3()
}

/// For each surface, the mean over its pixels of the brightest channel of their cluster.
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
impl Cluster {
    /// A cluster for tests: a weight of one a pixel, one path per pixel and set.
    pub fn unit(object: u32, pixels: u32, measured: Vec3) -> Self {
        Self {
            frame: 0,
            object,
            pixels: (0..pixels).collect(),
            paths: 1,
            measured,
            censored: BVec3::FALSE,
            level: Some(Vec3::ZERO),
            dark: Vec3::ONE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weight of a cluster of ten pixels.
    fn weight(measured: f32, level: Option<f32>, fitted: f32) -> f64 {
        let cluster = Cluster {
            level: level.map(Vec3::splat),
            dark: Vec3::splat(0.1),
            ..Cluster::unit(0, 10, Vec3::splat(measured))
        };
        cluster.weight(DVec3::splat(f64::from(fitted))).x
    }

    #[test]
    fn a_predicted_level_weighs_dark_and_bright_spots_of_a_texture_alike() {
        let mean = |level: &dyn Fn(f32) -> Option<f32>| {
            let [dark, bright] = [0.2, 1.8].map(|measured| weight(measured, level(measured), 1.0));
            (0.2 * dark + 1.8 * bright) / (dark + bright)
        };
        assert!(mean(&Some) < 0.3);
        let both = mean(&|_| None);
        assert!((0.5..0.55).contains(&both), "{both}");
        assert!((mean(&|_| Some(1.0)) - 1.0).abs() < 1e-6);
        assert!((weight(0.2, Some(1.0), 1.0) - 10.0 / 1.01).abs() < 1e-4);
    }

    #[test]
    fn a_dark_pixel_taken_for_lit_weighs_as_a_lit_one_taken_for_dark() {
        let ratio = weight(0.1, None, 5.0) / weight(5.0, None, 0.1);
        assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
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
        let allowed = allowed_edges(&pixels, 4, |_| false);
        let edges: Vec<Edge> = allowed.iter().map(|n| n.0).collect();
        assert_eq!(edges, [Edge::Far, Edge::Near, Edge::On, Edge::On]);
        let counts: Vec<u64> = allowed.iter().map(|n| n.1).collect();
        assert_eq!(counts, [ENOUGH, ENOUGH, 35, 0]);
        // Saturated pixels do not count.
        let saturated = allowed_edges(&pixels[..ENOUGH as usize], 1, |_| true);
        assert_eq!(saturated, [(Edge::On, 0)]);
        assert_eq!([1, SMALL, 4 * SMALL].map(tile_at_edges), [1, 1, 2]);
    }
}
