//! Light layers: one picture per lamp. Light is linear, so weighted sums of layers are relit pictures without new rays.

use crate::math::color::luminance;
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::geometry::Ray;
use crate::transport::lit::LitScene;
use crate::transport::path::{Origin, PathOptions, radiance_by_origin};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Maximum number of lamps with their own layer; weaker ones share one.
pub const MAX_LAMPS: usize = 16;

/// The light source of a layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LightSource {
    /// An emitting object of the scene.
    Lamp(u32),
    /// All lamps without their own layer.
    OtherLamps,
    /// The environment.
    Outside,
}

/// The assignment of light sources to layers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    sources: Vec<LightSource>,
    /// Layer of each object; `u32::MAX` for objects that do not emit.
    of_object: Vec<u32>,
    outside: u32,
}

/// The light of one path by origin; reused between paths to save allocations.
pub type Parts = Vec<(Origin, Vec3)>;

impl Split {
    /// One layer for each of the at most [`MAX_LAMPS`] lamps with the largest area × luminance, in the scene's order, one for all
    /// other lamps, and one for the environment; empty layers are left out.
    pub fn new(lit: &LitScene) -> Self {
        let emission = |object: usize| lit.materials.get(object).map_or(Vec3::ZERO, |m| m.emission);
        Self::of(&lit.scene, emission, lit.outside.is_some())
    }

    /// [`Split::new`] for the given emission of each object, with or without an environment.
    pub fn of(scene: &Scene, emission: impl Fn(usize) -> Vec3, outside_light: bool) -> Self {
        let power =
            |object: usize| scene.objects[object].area * f64::from(luminance(emission(object)));
        let objects = scene.objects.len();
        let mut lamps: Vec<usize> = (0..objects).filter(|&o| power(o) > 0.0).collect();
        lamps.sort_by(|&a, &b| power(b).total_cmp(&power(a)).then(a.cmp(&b)));
        let others = lamps.split_off(lamps.len().min(MAX_LAMPS));
        lamps.sort_unstable();

        let mut sources: Vec<LightSource> =
            lamps.iter().map(|&o| LightSource::Lamp(o as u32)).collect();
        let mut of_object = vec![u32::MAX; objects];
        for (layer, &lamp) in lamps.iter().enumerate() {
            of_object[lamp] = layer as u32;
        }
        for &lamp in &others {
            of_object[lamp] = sources.len() as u32;
        }
        if !others.is_empty() {
            sources.push(LightSource::OtherLamps);
        }
        let outside = sources.len() as u32;
        if outside_light {
            sources.push(LightSource::Outside);
        }
        Self {
            sources,
            of_object,
            outside,
        }
    }

    /// The light source of each layer.
    pub fn sources(&self) -> &[LightSource] {
        &self.sources
    }

    /// The layer of an object's light; `None` if it does not emit.
    pub fn source_of(&self, object: u32) -> Option<LightSource> {
        let layer = *self.of_object.get(object as usize)?;
        self.sources.get(layer as usize).copied()
    }

    /// Adds the light of one path to the layers' sums of its pixel. Consumes the stream as [`crate::transport::path::radiance`]
    /// does, so the layers sum to that path's radiance.
    pub fn add(
        &self,
        world: &LitScene,
        ray: &Ray,
        stream: &mut Stream,
        options: &PathOptions,
        parts: &mut Parts,
        sums: &mut [DVec3],
    ) {
        radiance_by_origin(world, ray, stream, options, parts);
        for &(origin, light) in parts.iter() {
            let layer = match origin {
                Origin::Object(object) => self.of_object.get(object as usize).copied(),
                Origin::Outside => Some(self.outside),
            };
            if let Some(sum) = layer.and_then(|layer| sums.get_mut(layer as usize)) {
                *sum += light.as_dvec3();
            }
        }
    }

    /// One picture per layer from `samples` paths per pixel, keyed as in [`crate::transport::film::Film::add`]: the layers sum to
    /// that film's picture.
    pub fn render(
        &self,
        world: &LitScene,
        camera: &Camera,
        options: &PathOptions,
        seed: u64,
        frame: u64,
        samples: u32,
    ) -> Vec<Picture> {
        let count = self.sources.len();
        let mut sums = vec![DVec3::ZERO; camera.pixels() * count];
        sums.par_chunks_mut(count.max(1)).enumerate().for_each_init(
            Parts::new,
            |parts, (pixel, sums)| {
                for index in 0..samples {
                    let mut stream = Stream::new(seed, frame, pixel as u64, u64::from(index));
                    let ray = camera.ray(camera.corner(pixel) + Vec2::from(stream.uniform2()));
                    self.add(world, &ray, &mut stream, options, parts, sums);
                }
            },
        );
        let scale = 1.0 / f64::from(samples.max(1));
        (0..count)
            .map(|layer| Picture {
                width: camera.intrinsics.width,
                height: camera.intrinsics.height,
                pixels: layer_of(&sums, layer, count, scale),
            })
            .collect()
    }
}

/// One layer of sums with `count` interleaved layers per pixel, times a factor.
pub fn layer_of(sums: &[DVec3], layer: usize, count: usize, scale: f64) -> Vec<Vec3> {
    let layer = sums.iter().skip(layer).step_by(count.max(1));
    layer.map(|sum| (*sum * scale).as_vec3()).collect()
}

/// The sum of pictures of one size, each times an RGB factor; `None` without pictures.
pub fn mix<'a>(layers: impl IntoIterator<Item = (&'a Picture, Vec3)>) -> Option<Picture> {
    let mut layers = layers.into_iter();
    let (first, factor) = layers.next()?;
    let mut mixed = first.clone();
    mixed.pixels.par_iter_mut().for_each(|p| *p *= factor);
    for (layer, factor) in layers.filter(|(_, factor)| *factor != Vec3::ZERO) {
        let pairs = mixed.pixels.par_iter_mut().zip(&layer.pixels);
        pairs.for_each(|(sum, light)| *sum += *light * factor);
    }
    Some(mixed)
}
