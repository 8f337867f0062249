//! The transport cache: paths traced once, stored with everything that does not depend on the unknowns.
//!
//! For diffuse surfaces and cosine sampling, a path's contribution is a product of albedos, one emission (or measured
//! radiance), and a weight. It is evaluated and differentiated for any values of the unknowns without casting rays.
//! Rough specular lobes are held fixed in stored paths; [`crate::inverse::lobe`] fits them.

pub mod clusters;
pub mod derivative;
pub mod evaluate;
pub mod lamp_patches;
pub mod memory;
pub mod outside_grid;
mod scatter;
pub mod trace;

use crate::transport::arrival::RayCount;
use clusters::Cluster;
use glam::Vec3;

/// The light sample at this vertex reached no lamp.
pub const NO_LAMP: u32 = u32::MAX;

/// No patch of a lamp was reached.
pub const NO_PATCH: u32 = u32::MAX;

/// The vertex's surface has no texture.
pub const NO_TEXEL: u32 = u32::MAX;

/// In place of a surface: the path was scattered by a lobe, which has no unknown.
pub const SPECULAR: u32 = u32::MAX;

/// One vertex of a stored path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// The surface (set of triangles sharing unknowns) that the vertex lies on, or [`SPECULAR`].
    pub surface: u32,
    /// The surface that the light sample (NEE) reached, or [`NO_LAMP`].
    pub lamp: u32,
    /// Weight of that surface's emission, without albedos.
    pub lamp_weight: f32,
    /// The lamp patch that the light sample reached, or that the path ends at; or [`NO_PATCH`].
    pub patch: u32,
    /// Weight of the emission of the vertex's own surface, without albedos.
    pub emission_weight: f32,
    /// The texel of its surface's texture, or [`NO_TEXEL`].
    pub texel: u32,
    /// Weighted known radiance that arrives here, to be multiplied by the vertex's albedo.
    pub known: Vec3,
}

impl Vertex {
    /// A vertex on a surface, without light and texture.
    pub fn on(surface: u32) -> Self {
        Self {
            surface,
            lamp: NO_LAMP,
            lamp_weight: 0.0,
            patch: NO_PATCH,
            emission_weight: 0.0,
            texel: NO_TEXEL,
            known: Vec3::ZERO,
        }
    }
}

#[cfg(test)]
impl Vertex {
    /// A random path over few surfaces, so that they repeat, with lobes, light samples, hit emission and known radiance.
    pub fn random_path(surfaces: usize, stream: &mut crate::math::rng::Stream) -> Vec<Self> {
        (0..1 + stream.below(7))
            .map(|_| Self {
                surface: [SPECULAR, stream.below(surfaces) as u32][stream.below(5).min(1)],
                lamp: [NO_LAMP, stream.below(surfaces) as u32][stream.below(2)],
                lamp_weight: stream.uniform(),
                emission_weight: [0.0, stream.uniform()][stream.below(3).min(1)],
                known: Vec3::from_array(std::array::from_fn(|_| stream.uniform())),
                ..Self::on(0)
            })
            .collect()
    }
}

/// The paths of one cluster of pixels: for each pixel those of set A, then those of set B.
#[derive(Debug, Clone)]
pub struct CachedCluster {
    /// The pixels and their measurement.
    pub cluster: Cluster,
    /// Vertices of all paths, one path after the other, starting at the camera.
    pub vertices: Vec<Vertex>,
    /// End index of each path in `vertices`.
    pub ends: Vec<u32>,
}

impl CachedCluster {
    /// The vertices of each path, in order.
    pub fn paths(&self) -> impl Iterator<Item = &[Vertex]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| {
            let path = &self.vertices[start..end as usize];
            start = end as usize;
            path
        })
    }
}

/// Two independent sets of paths through the same pixels.
#[derive(Debug, Clone, Default)]
pub struct PathCache {
    /// In the order of the traced clusters.
    pub clusters: Vec<CachedCluster>,
    /// Number of rays cast, and of paths rejected because a weight was not finite.
    pub cast: RayCount,
}

impl From<Vec<CachedCluster>> for PathCache {
    /// Stored paths whose rays are counted elsewhere.
    fn from(clusters: Vec<CachedCluster>) -> Self {
        let cast = RayCount::default();
        Self { clusters, cast }
    }
}

impl PathCache {
    /// Bytes that the stored paths take.
    pub fn bytes(&self) -> usize {
        self.clusters
            .iter()
            .map(|c| c.vertices.len() * size_of::<Vertex>() + c.ends.len() * size_of::<u32>())
            .sum()
    }

    /// Fraction of the paths whose last vertex lies on a surface of index `first` or above.
    pub fn fraction_ending_on(&self, first: u32) -> f64 {
        let (mut ending, mut all) = (0u64, 0u64);
        for cached in &self.clusters {
            all += cached.ends.len() as u64;
            let last = cached.paths().filter_map(|path| path.last());
            ending += last
                .filter(|v| v.surface >= first && v.surface != SPECULAR)
                .count() as u64;
        }
        ending as f64 / all.max(1) as f64
    }
}
