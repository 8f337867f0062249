//! A lit scene on the card: pictures, pairs of pictures with and without inserted objects, single rays.

use crate::error::Result;
use crate::gpu::buffers::{empty, storage};
use crate::gpu::card::Card;
use crate::gpu::film::FilmBuffers;
#[cfg(doc)]
use crate::gpu::film::SAMPLES_AT_ONCE;
use crate::gpu::geometry::Geometry;
use crate::gpu::layout::{Dispatch, INSERT, NONE, RENDER, TRACE};
use crate::gpu::lights::{emitters, environment};
use crate::gpu::materials::{Inserted, Materials};
use crate::gpu::pace::Pace;
use crate::math::rng::splitmix64;
use crate::scene::camera::Camera;
use crate::scene::geometry::{Hit, Ray};
use crate::transport::arrival::RayCount;
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use wgpu::BufferUsages as Usage;

/// Four numbers of the film buffer, as their bits.
pub(super) type Word = [u32; 4];

/// A camera and how its paths are traced.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Depth of paths; the switches of emitter and BSDF sampling are ignored (both are on).
    pub options: &'a PathOptions,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The frame, also part of the key.
    pub frame: u64,
}

/// Sums over pairs of paths through one pixel, with and without the inserted objects.
#[derive(Debug, Clone, Copy, Default)]
pub struct PairSums {
    /// Sum of radiance with the objects.
    pub with: DVec3,
    /// Sum of radiance without them.
    pub without: DVec3,
    /// Sum of radiance with the objects, over samples whose first hit is an inserted object.
    pub covered_with: DVec3,
    /// Sum of radiance without the objects, over the same samples.
    pub covered_without: DVec3,
    /// Number of samples whose first hit is an inserted object.
    pub covered: u32,
    /// Whether any sample differs.
    pub changed: bool,
    /// Rays cast.
    pub rays: u32,
    /// Samples dropped because they were not finite.
    pub rejected: u32,
}

impl PairSums {
    /// From the words of [`INSERT`].
    fn from_words(words: &[Word]) -> Self {
        let [with, without, covered_with, covered_without, counts] = words else {
            return Self::default();
        };
        let sums = |&[r, g, b, _]: &Word| color([r, g, b]);
        Self {
            with: sums(with),
            without: sums(without),
            covered_with: sums(covered_with),
            covered_without: sums(covered_without),
            covered: f32::from_bits(with[3]) as u32,
            rays: counts[0],
            rejected: counts[1],
            changed: counts[2] > 0,
        }
    }

    /// Adds the sums over more samples.
    pub fn add(&mut self, other: &Self) {
        self.with += other.with;
        self.without += other.without;
        self.covered_with += other.covered_with;
        self.covered_without += other.covered_without;
        self.covered += other.covered;
        self.changed |= other.changed;
        self.rays += other.rays;
        self.rejected += other.rejected;
    }
}

/// A lit scene on the card.
#[derive(Debug)]
pub struct Tracer {
    pub(super) card: Card,
    pub(super) geometry: Arc<Geometry>,
    /// Materials, their data, emitters and environment.
    pub(super) light: [wgpu::Buffer; 4],
    pub(super) rays: wgpu::Buffer,
    pub(super) dispatch: wgpu::Buffer,
    description: Dispatch,
    pub(super) film: Option<FilmBuffers>,
    pub(super) pace: Pace,
}

impl Tracer {
    /// Uploads a scene with inserted objects.
    ///
    /// # Errors
    /// The scene does not fit, or the card failed.
    pub fn new(card: &Card, lit: &LitScene, objects: &[Inserted<'_>]) -> Result<Self> {
        let geometry = Geometry::new(card, &lit.scene, objects)?;
        Self::on(card, Arc::new(geometry), lit, objects)
    }

    /// Uploads the light and materials of a scene whose triangles are on the card, with the same inserted objects.
    ///
    /// # Errors
    /// They do not fit, or the card failed.
    pub fn on(
        card: &Card,
        geometry: Arc<Geometry>,
        lit: &LitScene,
        objects: &[Inserted<'_>],
    ) -> Result<Self> {
        let mismatch = || card.failed("tables of the scene differ in length".to_owned());
        let mut materials = Materials::new(lit).ok_or_else(mismatch)?;
        let mut first = lit.scene.triangles.len() as u32;
        for object in objects {
            materials.insert(object, first).ok_or_else(mismatch)?;
            first += object.corners.len() as u32;
        }
        if geometry.slot_of.len() != first as usize {
            return Err(mismatch());
        }
        let (emitters, count) = emitters(lit, &geometry.slot_of);
        let outside = lit.outside.as_deref().map(environment);
        let (environment, mut description) = outside.unwrap_or_default();
        description.lights[0] = count;
        description.emitter_fraction[0] = lit.emitter_fraction();
        let size = size_of::<Dispatch>() as u64;
        Ok(Self {
            light: [
                storage(card, "materials", &materials.materials)?,
                storage(card, "textures", &materials.data)?,
                storage(card, "emitters", &emitters)?,
                storage(card, "environment", &environment)?,
            ],
            rays: storage::<Word>(card, "rays", &[])?,
            dispatch: empty(card, "dispatch", size, Usage::UNIFORM | Usage::COPY_DST)?,
            description,
            geometry,
            film: None,
            pace: Pace::default(),
            card: card.clone(),
        })
    }

    /// The triangles, for a tracer of the same scene and objects in other light.
    pub fn geometry(&self) -> &Arc<Geometry> {
        &self.geometry
    }

    /// A picture from `samples` paths per pixel, keyed as in [`Film::add`].
    ///
    /// # Errors
    /// The card failed.
    pub fn film(&mut self, view: &View<'_>, samples: u32) -> Result<Film> {
        let mut film = Film::new(view.camera);
        self.add(&mut film, view, samples)?;
        Ok(film)
    }

    /// Adds `samples` paths to every pixel of a film, keyed as in [`Film::add`]. After an error the film is invalid.
    ///
    /// # Errors
    /// The card failed.
    pub fn add(&mut self, film: &mut Film, view: &View<'_>, samples: u32) -> Result<()> {
        let range = film.samples..film.samples + samples;
        let cast = self.accumulate(view, range, &mut film.sums)?;
        film.rays += cast.rays;
        film.rejected += cast.rejected;
        film.samples += samples;
        Ok(())
    }

    /// Adds a range of samples to the sum of each pixel. On an error, `sums` are unchanged if `samples` are at most
    /// [`SAMPLES_AT_ONCE`] and the pixels fit one buffer, otherwise invalid.
    ///
    /// # Errors
    /// The card failed.
    pub fn accumulate(
        &mut self,
        view: &View<'_>,
        samples: Range<u32>,
        sums: &mut [DVec3],
    ) -> Result<RayCount> {
        let mut cast = RayCount::default();
        let description = with_view(self.description, view);
        let pixels = 0..sums.len() as u32;
        self.dispatch_all(RENDER, description, pixels, samples, |pixels, words| {
            let sums = &mut sums[pixels.start as usize..pixels.end as usize];
            let add = |(sum, &[r, g, b, counts]): (&mut DVec3, &Word)| {
                *sum += color([r, g, b]);
                RayCount {
                    rays: u64::from(counts & 0x00ff_ffff),
                    rejected: u64::from(counts >> 24),
                }
            };
            let added: RayCount = sums.par_iter_mut().zip(words).map(add).sum();
            cast += added;
        })?;
        Ok(cast)
    }

    /// Sums over pairs of paths with and without the inserted objects, for each of a range of pixels.
    ///
    /// # Errors
    /// The card failed.
    pub fn pairs(
        &mut self,
        view: &View<'_>,
        pixels: Range<u32>,
        samples: Range<u32>,
    ) -> Result<Vec<PairSums>> {
        let first = pixels.start;
        let mut sums = vec![PairSums::default(); pixels.len()];
        let description = with_view(self.description, view);
        self.dispatch_all(INSERT, description, pixels, samples, |pixels, words| {
            let sums = &mut sums[(pixels.start - first) as usize..];
            let words = words.par_chunks_exact(INSERT.words as usize);
            (sums.par_iter_mut().zip(words)).for_each(|(sum, w)| sum.add(&PairSums::from_words(w)));
        })?;
        Ok(sums)
    }

    /// The nearest hit of each ray, or any hit if `any`. Triangles of inserted objects count after the scene's; `t_min` is ignored.
    ///
    /// # Errors
    /// The rays do not fit, or the card failed.
    pub fn trace(&mut self, rays: &[Ray], any: bool) -> Result<Vec<Option<Hit>>> {
        let flag = f32::from(u8::from(any));
        let words = rays.iter().flat_map(|ray| {
            let end = ray.t_max.min(f32::MAX);
            [ray.origin.extend(end), ray.direction.extend(flag)]
        });
        let words: Vec<[f32; 4]> = words.map(|v| v.to_array()).collect();
        self.rays = storage(&self.card, "rays", &words)?;
        // The film buffer's bindings hold the earlier rays.
        self.film = None;
        let mut hits = Vec::with_capacity(rays.len());
        let mut description = self.description;
        description.slice[0] = rays.len().max(1) as u32;
        let all = 0..rays.len() as u32;
        self.dispatch_all(TRACE, description, all, 0..1, |_, words| {
            hits.par_extend(words.par_iter().map(|&[t, b1, b2, triangle]| {
                let [t, b1, b2] = [t, b1, b2].map(f32::from_bits);
                (triangle != NONE).then_some(Hit {
                    t,
                    triangle,
                    b1,
                    b2,
                })
            }));
        })?;
        Ok(hits)
    }
}

fn color(bits: [u32; 3]) -> DVec3 {
    Vec3::from_array(bits.map(f32::from_bits)).as_dvec3()
}

/// Adds a view to the scene's dispatch parameters.
fn with_view(scene: Dispatch, view: &View<'_>) -> Dispatch {
    let k = &view.camera.intrinsics;
    let axes = view.camera.rotation;
    let key = splitmix64(splitmix64(view.seed) ^ view.frame);
    Dispatch {
        center: view.camera.center.extend(0.0).to_array(),
        axis_x: axes.x_axis.extend(0.0).to_array(),
        axis_y: axes.y_axis.extend(0.0).to_array(),
        axis_z: axes.z_axis.extend(0.0).to_array(),
        lens: [k.fx, k.fy, k.cx, k.cy].map(|v| v as f32),
        distortion: k.distortion.map(|v| v as f32),
        key: [key as u32, (key >> 32) as u32, 0, 0],
        slice: [k.width, 0, 0, 0],
        paths: [0, view.options.max_bounces, view.options.rr_depth, 0],
        ..scene
    }
}
