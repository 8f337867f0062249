//! Texels of the whole mesh from the textures of all objects; unseen texels are interpolated from seen cells.

use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::inverse::texture::errors::spread;
use crate::inverse::texture::surface::TexturedSurface;
use crate::scene::Scene;
use crate::scene::geometry::Hit;
use crate::scene::texels::TexelLayout;
use crate::transport::material::TexelColors;
use glam::Vec3;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::sync::Arc;

/// Number of seen cells that an unseen texel is interpolated from.
const NEIGHBOURS: usize = 32;
/// Number of pixels above which the weight of a cell stops growing.
const WELL_SEEN: u32 = 8;

/// The centre of a seen cell.
type Center = GeomWithData<[f32; 3], usize>;

/// Colour at an unseen point: the mean over the nearest seen cells, weighted by inverse squared distance and number of pixels;
/// `None` if no cell is seen.
fn interpolated(surface: &TexturedSurface, tree: &RTree<Center>, point: Vec3) -> Option<Vec3> {
    let near = tree
        .nearest_neighbor_iter(point.to_array())
        .take(NEIGHBOURS);
    let neighbours = near.map(|center| Neighbour {
        distance: Vec3::from(*center.geom()).distance(point),
        size: surface.cells.cells[center.data].size,
        seen: surface.coverage.observations.seen(center.data),
        color: surface.texture.colors[center.data],
    });
    mean_color(neighbours)
}

/// A seen cell near an unseen point.
struct Neighbour {
    distance: f32,
    size: f32,
    /// Number of pixels that see it.
    seen: u32,
    color: Vec3,
}

fn mean_color(neighbours: impl Iterator<Item = Neighbour>) -> Option<Vec3> {
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for neighbour in neighbours {
        // The weight is bounded at distances below the size of the cell.
        let relative = neighbour.distance / neighbour.size.max(f32::MIN_POSITIVE);
        let weight = neighbour.seen.min(WELL_SEEN) as f32 / (relative * relative + 1.0);
        sum += neighbour.color * weight;
        total += weight;
    }
    (total > 0.0).then(|| sum / total)
}

/// The texels of an estimate in which the given surfaces are textured.
pub fn texels(scene: &Scene, estimate: &Estimate, surfaces: &[TexturedSurface]) -> TexelEstimate {
    let mut levels = vec![0; scene.triangles.len()];
    let mut textured = vec![false; scene.objects.len()];
    for surface in surfaces {
        textured[surface.object] = true;
        for &triangle in &scene.objects[surface.object].triangles {
            levels[triangle as usize] = surface.cells.depth(triangle).unwrap_or(0);
        }
    }
    let layout = TexelLayout::new(levels);
    let mut colors = vec![Vec3::ZERO; layout.len()];
    let mut stderr = vec![Vec3::ZERO; layout.len()];
    let mut seen = vec![0; layout.len()];

    // Objects without a texture.
    for (index, object) in scene.objects.iter().enumerate() {
        if let Some(known) = estimate.objects.get(index).filter(|_| !textured[index]) {
            for &triangle in &object.triangles {
                let texel = layout.first[triangle as usize] as usize;
                colors[texel] = known.albedo;
                stderr[texel] = known.albedo_stderr;
            }
        }
    }

    for surface in surfaces {
        let centers: Vec<Center> = (0..surface.cells.count())
            .filter(|&cell| surface.coverage.observations.seen(cell) > 0)
            .map(|cell| GeomWithData::new(surface.cells.cells[cell].center.to_array(), cell))
            .collect();
        let tree = RTree::bulk_load(centers);
        let mean = surface.mean();
        let unseen = spread(&surface.texture.colors, mean);
        for &triangle in &scene.objects[surface.object].triangles {
            let first = layout.first[triangle as usize];
            for texel in 0..layout.first[triangle as usize + 1] - first {
                let [b1, b2] = layout.center(triangle as usize, texel);
                let hit = Hit {
                    t: 0.0,
                    triangle,
                    b1,
                    b2,
                };
                let at = (first + texel) as usize;
                if let Some(cell) = surface.cells.locate(&hit) {
                    colors[at] = surface.texture.colors[cell as usize];
                    seen[at] = surface.coverage.observations.seen(cell as usize);
                    stderr[at] = surface.stderr.get(cell as usize).copied().unwrap_or(unseen);
                } else {
                    colors[at] = interpolated(surface, &tree, scene.point(&hit)).unwrap_or(mean);
                    stderr[at] = unseen;
                }
            }
        }
    }
    TexelEstimate {
        colors: Arc::new(TexelColors { layout, colors }),
        stderr,
        seen,
        textured,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unseen_place_goes_by_what_is_near_and_well_seen() {
        let neighbour = |distance: f32, seen: u32, color: f32| Neighbour {
            distance,
            size: 0.01,
            seen,
            color: Vec3::splat(color),
        };
        // One badly seen cell nearby against many well seen ones farther away.
        let stray = mean_color(
            std::iter::once(neighbour(0.02, 1, 0.0))
                .chain((0..31).map(|_| neighbour(0.03, 40, 0.6))),
        );
        assert!(stray.is_some_and(|c| (c.x - 0.6).abs() < 0.01), "{stray:?}");
        // Of two equally seen cells the nearer one dominates.
        let near = mean_color([neighbour(0.01, 9, 0.2), neighbour(0.1, 9, 0.8)].into_iter());
        assert!(near.is_some_and(|c| (c.x - 0.2).abs() < 0.02), "{near:?}");
        assert_eq!(mean_color(std::iter::empty()), None);
    }
}
