//! The mesh as the 3D view draws it: large triangles cut up, so that one colour a face shows what a photograph saw.

use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray, offset_origin};
use crate::session::snapshot::OpenCapture;
use glam::{Vec2, Vec3};

/// Faces at most, beyond which large triangles stay whole.
const FACES: usize = 400_000;
/// Faces no longer than this fraction of the scene's diameter.
const LONGEST: f32 = 1.0 / 56.0;

/// Faces to draw.
#[derive(Debug, Default)]
pub struct Surface {
    /// Three corners a face, in scene coordinates.
    pub corners: Vec<[Vec3; 3]>,
    /// The middle of each face, as a hit of the triangle that it is a part of.
    pub middles: Vec<Hit>,
}

impl Surface {
    /// Cuts a scene's triangles until their edges are short, or there are enough of them.
    pub fn new(scene: &Scene) -> Self {
        let mut surface = Self::default();
        let longest = scene.diameter * LONGEST;
        let budget = FACES.saturating_sub(scene.triangles.len());
        let mut cuts = 0;
        for triangle in 0..scene.triangles.len() as u32 {
            let whole = scene.corners(triangle);
            let mut stack = vec![[Vec2::ZERO, Vec2::X, Vec2::Y]];
            while let Some(face) = stack.pop() {
                let corners = face
                    .map(|b| whole[0] + (whole[1] - whole[0]) * b.x + (whole[2] - whole[0]) * b.y);
                let length = |i: usize| corners[i].distance(corners[(i + 1) % 3]);
                let edge = (0..3)
                    .max_by(|&a, &b| length(a).total_cmp(&length(b)))
                    .unwrap_or(0);
                if length(edge) > longest && cuts < budget {
                    // Halve the longest edge.
                    let (a, b, c) = (face[edge], face[(edge + 1) % 3], face[(edge + 2) % 3]);
                    let middle = (a + b) * 0.5;
                    stack.push([a, middle, c]);
                    stack.push([middle, b, c]);
                    cuts += 1;
                    continue;
                }
                let middle = (face[0] + face[1] + face[2]) / 3.0;
                surface.corners.push(corners);
                surface.middles.push(Hit {
                    t: 0.0,
                    triangle,
                    b1: middle.x,
                    b2: middle.y,
                });
            }
        }
        surface
    }

    /// The radiance that photographs saw at each face: of the camera that sees it largest; `None` where none does.
    pub fn photographed(&self, capture: &OpenCapture) -> Vec<Option<Vec3>> {
        use rayon::prelude::*;
        let scene = &capture.scene;
        let middles = self.middles.par_iter();
        middles.map(|middle| seen(scene, capture, middle)).collect()
    }
}

/// Radiance of a surface point in the photograph that sees it largest.
fn seen(scene: &Scene, capture: &OpenCapture, middle: &Hit) -> Option<Vec3> {
    let point = scene.point(middle);
    let normal = *scene.normals.get(middle.triangle as usize)?;
    let mut cameras: Vec<(f32, usize, Vec2)> = (scene.cameras.iter().enumerate())
        .filter_map(|(index, camera)| {
            let pixel = camera.project(point)?;
            let to = camera.center - point;
            let area = normal.dot(to).abs() / to.length().powi(3);
            Some((area, index, pixel))
        })
        .collect();
    cameras.sort_by(|a, b| b.0.total_cmp(&a.0));
    cameras.into_iter().take(6).find_map(|(_, index, pixel)| {
        let to = scene.cameras[index].center - point;
        let from = offset_origin(point, normal, &scene.corners(middle.triangle), to);
        if scene.occluded(&Ray::between(from, scene.cameras[index].center)) {
            return None;
        }
        let photograph = capture.photographs.get(index)?;
        let k = &scene.cameras[index].intrinsics;
        let x = (pixel.x / k.width as f32 * photograph.width as f32) as usize;
        let y = (pixel.y / k.height as f32 * photograph.height as f32) as usize;
        let pixels = &photograph.pixels;
        pixels.get(y * photograph.width as usize + x).copied()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::model::tests::scene;

    #[test]
    fn cutting_keeps_the_area_and_shortens_every_edge() {
        let scene = scene();
        let surface = Surface::new(&scene);
        let area: f32 = surface
            .corners
            .iter()
            .map(|[a, b, c]| (*b - *a).cross(*c - *a).length() * 0.5)
            .sum();
        assert!((area - 8.0).abs() < 1e-3, "{area}");
        for (corners, middle) in surface.corners.iter().zip(&surface.middles) {
            for i in 0..3 {
                assert!(corners[i].distance(corners[(i + 1) % 3]) <= scene.diameter * LONGEST);
            }
            let mean = (corners[0] + corners[1] + corners[2]) / 3.0;
            assert!(scene.point(middle).distance(mean) < 1e-5);
        }
    }
}
