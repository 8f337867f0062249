//! The surface at each pixel's centre, and maps of the estimate there.

use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::math::picture::Picture;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::geometry::Hit;
use crate::transport::material::Material;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// The nearest hit at each pixel's centre, row by row.
#[derive(Debug)]
pub struct Hits {
    width: u32,
    height: u32,
    hits: Vec<Option<Hit>>,
}

impl Hits {
    pub fn new(scene: &Scene, camera: &Camera) -> Self {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let nearest = |pixel: usize| {
            let (x, y) = (pixel % width as usize, pixel / width as usize);
            scene.intersect(&camera.ray(Vec2::new(x as f32, y as f32) + 0.5))
        };
        let pixels = (0..width as usize * height as usize).into_par_iter();
        Self {
            width,
            height,
            hits: pixels.map(nearest).collect(),
        }
    }

    /// Object index of each pixel; `u32::MAX` where the ray leaves the mesh.
    pub fn objects(&self, scene: &Scene) -> Vec<u32> {
        let object = |hit: &Hit| scene.object_of[hit.triangle as usize];
        let object = |hit: &Option<Hit>| hit.as_ref().map_or(u32::MAX, object);
        self.hits.iter().map(object).collect()
    }

    /// Diffuse reflectance; black where the ray leaves the mesh.
    pub fn albedo(&self, scene: &Scene, materials: &[Material]) -> Picture {
        self.paint(scene, |object, hit| {
            let material = materials.get(object);
            material.map_or(Vec3::ZERO, |m| m.albedo_at(hit))
        })
    }

    /// Radiance emitted towards the camera; only front sides emit.
    pub fn emission(&self, scene: &Scene, camera: &Camera, estimate: &Estimate) -> Picture {
        self.paint(scene, |object, hit| {
            let to_camera = camera.center - scene.point(hit);
            let front = scene.normals[hit.triangle as usize].dot(to_camera) > 0.0;
            match estimate.objects.get(object) {
                Some(object) if front => object.emission,
                _ => Vec3::ZERO,
            }
        })
    }

    /// Sets the pixels of a picture to −1 that no photograph determines: beyond the mesh, and on surfaces that no
    /// photograph sees.
    pub fn mark_unseen(&self, mut picture: Picture, scene: &Scene, estimate: &Estimate) -> Picture {
        let seen = self.seen(scene, estimate);
        for (pixel, seen) in picture.pixels.iter_mut().zip(&seen.pixels) {
            if seen.x == 0.0 {
                *pixel = Vec3::NEG_ONE;
            }
        }
        picture
    }

    pub fn stderr(&self, scene: &Scene, estimate: &Estimate) -> Picture {
        self.paint(scene, |object, hit| {
            let texel = textured(estimate, object, hit);
            let texel = texel.and_then(|(texels, texel)| texels.stderr.get(texel).copied());
            let whole = estimate.objects.get(object).map(|o| o.albedo_stderr);
            texel.or(whole).unwrap_or(Vec3::ZERO)
        })
    }

    /// Number of pixels of all photographs that see a pixel's texel, or its object without texture.
    pub fn seen(&self, scene: &Scene, estimate: &Estimate) -> Picture {
        self.paint(scene, |object, hit| {
            let texel = textured(estimate, object, hit);
            let texel = texel.and_then(|(texels, texel)| Some(*texels.seen.get(texel)? as f32));
            let whole = estimate.objects.get(object).map(|o| o.seen_pixels as f32);
            Vec3::splat(texel.or(whole).unwrap_or(0.0))
        })
    }

    fn paint(&self, scene: &Scene, color: impl Fn(usize, &Hit) -> Vec3 + Sync) -> Picture {
        let color = |hit: &Hit| color(scene.object_of[hit.triangle as usize] as usize, hit);
        let hits = self.hits.par_iter();
        Picture {
            width: self.width,
            height: self.height,
            pixels: (hits.map(|hit| hit.as_ref().map_or(Vec3::ZERO, color))).collect(),
        }
    }
}

/// The textures and the index of the texel that is hit, if the object has one.
fn textured<'a>(
    estimate: &'a Estimate,
    object: usize,
    hit: &Hit,
) -> Option<(&'a TexelEstimate, usize)> {
    let texels = estimate.texels.as_deref()?;
    (texels.textured.get(object)).filter(|&&textured| textured)?;
    Some((texels, texels.colors.layout.texel(hit) as usize))
}
