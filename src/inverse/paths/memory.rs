//! Memory limit of the transport cache.

use crate::inverse::paths::{PathCache, Vertex};
use sysinfo::{MemoryRefreshKind, System};

/// Clusters traced first to measure the memory per path.
pub const PILOT_CLUSTERS: usize = 64;
/// One over the fraction of the machine's memory that stored paths may take.
const FRACTION: u64 = 4;
/// Assumed memory of the machine if it is unknown, in bytes.
const UNKNOWN: u64 = 8 << 30;

/// Bytes that stored paths may take: the given number of GiB, or for zero a quarter of the machine's memory.
pub fn allowed(gibibytes: f64) -> u64 {
    if gibibytes > 0.0 {
        return (gibibytes * (1u64 << 30) as f64) as u64;
    }
    let known = System::new().ok().map(|mut system| {
        system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
        // A container may hold less than the machine.
        let limit = system.cgroup_limits().map(|limits| limits.total_memory);
        limit.unwrap_or(u64::MAX).min(system.total_memory())
    });
    known.filter(|&bytes| bytes > 0).unwrap_or(UNKNOWN) / FRACTION
}

/// Whether this number of paths, with at most `vertices` vertices in the mean, certainly fits.
pub fn suffices(allowed: u64, paths: u64, vertices: f32) -> bool {
    paths as f64 * f64::from(vertices) * size_of::<Vertex>() as f64 <= allowed as f64
}

/// How many paths fit, at the mean size of a pilot's paths.
pub fn paths_that_fit(allowed: u64, pilot: &PathCache) -> u64 {
    let paths: usize = pilot.clusters.iter().map(|c| c.ends.len()).sum();
    let bytes = pilot.bytes().max(1);
    (u128::from(allowed) * paths as u128 / bytes as u128) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::paths::CachedCluster;
    use crate::inverse::paths::clusters::Cluster;
    use glam::Vec3;

    #[test]
    fn as_many_paths_fit_as_are_as_long_as_those_of_the_pilot() {
        // Four paths of three vertices.
        let pilot = PathCache::from(vec![CachedCluster {
            cluster: Cluster::unit(0, 2, Vec3::ONE),
            vertices: vec![Vertex::on(0); 12],
            ends: vec![3, 6, 9, 12],
        }]);
        let a_path = 3 * size_of::<Vertex>() as u64 + 4;
        assert_eq!(paths_that_fit(1000 * a_path + 5, &pilot), 1000);
        assert_eq!(paths_that_fit(1000, &PathCache::default()), 0);
    }

    #[test]
    fn a_part_of_the_machine_is_taken_where_nothing_is_said() {
        assert_eq!(allowed(2.0), 2 << 30);
        let part = allowed(0.0);
        assert!((1 << 20..1 << 46).contains(&part), "{part}");
        assert!(suffices(part, 1000, 64.0) && !suffices(part, u64::MAX, 1.0));
        assert!(!suffices(1 << 20, 1000, 1000.0));
    }
}
