//! The same problem with finer triangles.

use crate::capture::camera::Pose;
use crate::capture::mesh::Mesh;
use crate::capture::photograph::PhotographSource;
use crate::capture::{Capture, Frame};
use crate::error::Result;
use crate::inverse::solver::Problem;
use crate::scene::Scene;
use crate::scene::visibility::NOTHING;
use std::sync::Arc;

/// Cuts each triangle into four that at least `pixels` pixel centres see, through the middles of its edges. Returns the
/// new problem and for each of its triangles the one that it was cut from.
///
/// # Errors
/// Never for a problem that could be set up.
pub fn cut(problem: &Problem, pixels: u64) -> Result<(Problem, Vec<u32>)> {
    let scene = &problem.scene;
    let mut seen = vec![0u64; scene.triangles.len()];
    for &triangle in scene.ids().triangles.iter().flatten() {
        if triangle != NOTHING {
            seen[triangle as usize] += 1;
        }
    }
    let position = |i: u32| scene.positions[i as usize].as_dvec3() + scene.origin;
    let mut mesh = Mesh {
        objects: scene.objects.iter().map(|o| o.name.clone()).collect(),
        ..Mesh::default()
    };
    let mut parents = Vec::new();
    for (triangle, &corners) in scene.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(position);
        let [ab, bc, ca] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
        let parts = if seen[triangle] >= pixels {
            vec![[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        } else {
            vec![[a, b, c]]
        };
        for part in parts {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(part);
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.object_of.push(scene.object_of[triangle]);
            parents.push(triangle as u32);
        }
    }
    let frame = |(camera, photograph): (&crate::scene::camera::Camera, &Arc<_>)| Frame {
        intrinsics: camera.intrinsics,
        pose: Pose {
            rotation: camera.rotation.as_dmat3(),
            center: camera.center.as_dvec3() + scene.origin,
        },
        exposure: None,
        photograph: PhotographSource::Memory(Arc::clone(photograph)),
        depth: None,
    };
    let capture = Capture {
        name: String::new(),
        folder: None,
        cut: None,
        mesh,
        frames: scene
            .cameras
            .iter()
            .zip(&problem.photographs)
            .map(frame)
            .collect(),
        up: scene.up.as_dvec3(),
        warnings: Vec::new(),
    };
    let finer = Problem {
        scene: Arc::new(Scene::new(&capture)?),
        photographs: problem.photographs.clone(),
    };
    Ok((finer, parents))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::experiments::box_room::photographed;

    #[test]
    fn cut_triangles_cover_what_they_were_cut_from() {
        let subject = photographed("room", 0.5, 0.25, true).expect("a room");
        let coarse = &subject.problem;
        let (fine, parents) = cut(coarse, 16).expect("cut");
        assert!(parents.len() > coarse.scene.triangles.len());
        let mut areas = vec![0.0; coarse.scene.triangles.len()];
        for (area, &parent) in fine.scene.areas.iter().zip(&parents) {
            areas[parent as usize] += area;
        }
        for (sum, whole) in areas.iter().zip(&coarse.scene.areas) {
            assert!((sum / whole - 1.0).abs() < 1e-5, "{sum} {whole}");
        }
        // Every pixel sees a part of the triangle that it saw, but where it looks along an edge.
        let [before, after] = [coarse, &fine].map(|p| &p.scene.ids().triangles);
        let pixels = before.iter().flatten().zip(after.iter().flatten());
        let moved = pixels.filter(|(b, a)| parents[**a as usize] != **b).count();
        assert!(moved < 20, "{moved}");
    }
}
