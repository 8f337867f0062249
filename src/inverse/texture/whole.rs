//! The textures of all objects as texels of the whole mesh; what no pixel sees takes its neighbours' value.

use super::errors::spread;
use super::surface::Surface;
use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::scene::Scene;
use crate::scene::geometry::Hit;
use crate::scene::texels::TexelLayout;
use crate::transport::material::TexelColors;
use glam::Vec3;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::sync::Arc;

/// Seen cells whose mean an unseen triangle takes.
const NEIGHBOURS: usize = 4;

/// The texels of an estimate with these surfaces textured.
pub fn texels(scene: &Scene, estimate: &Estimate, surfaces: &[Surface]) -> TexelEstimate {
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

    // Objects of one colour have it on each triangle.
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
        let places: Vec<GeomWithData<[f32; 3], usize>> = (0..surface.cells.count())
            .filter(|&cell| surface.seen[cell] > 0)
            .map(|cell| GeomWithData::new(surface.cells.cells[cell].center.to_array(), cell))
            .collect();
        let tree = RTree::bulk_load(places);
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
                    seen[at] = surface.seen[cell as usize];
                    stderr[at] = surface.stderr.get(cell as usize).copied().unwrap_or(unseen);
                } else {
                    let point = scene.point(&hit).to_array();
                    let near = tree.nearest_neighbor_iter(point).take(NEIGHBOURS);
                    let (sum, count) = near.fold((Vec3::ZERO, 0.0f32), |(sum, n), g| {
                        (sum + surface.texture.colors[g.data], n + 1.0)
                    });
                    colors[at] = sum / count.max(1.0);
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
