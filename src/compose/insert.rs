//! Differential rendering (Debevec 1998): the photograph times the ratio of renders with and without the objects, covered by these.
//!
//! Both use the same random numbers. Paths that meet no object cancel to the bit: the photograph stays where they have no effect.

use crate::compose::backdrop::{Backdrop, LayeredPixel};
use crate::compose::placement::PlacedObject;
use crate::compose::world::FurnishedScene;
use crate::error::Result;
use crate::gpu::{PairSums, Tracer, View};
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::scene::geometry::Ray;
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, PathSample, radiance};
use crate::transport::world::World;
use glam::{BVec3, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// An insertion of objects into a photograph, refined progressively.
#[derive(Debug)]
pub struct Insertion {
    backdrop: Backdrop,
    /// The scene and its light.
    pub lit: Arc<LitScene>,
    /// The objects inserted.
    pub objects: Vec<Arc<PlacedObject>>,
    options: PathOptions,
    /// Keys the random numbers.
    pub seed: u64,
    pixels: Vec<PairSums>,
    /// Samples per pixel of each row so far.
    row_samples: Vec<u32>,
    next_row: usize,
    rays: u64,
    rejected: u64,
}

/// The layers that a composite is made of, one entry a pixel.
#[derive(Debug, Clone)]
pub struct Layers {
    /// Radiance with the objects.
    pub with: Picture,
    /// Radiance without.
    pub without: Picture,
    /// What the objects add to the photograph's light and take from it where they do not cover it, as radiance.
    pub delta: Picture,
    /// Ratio of radiance with to without the objects where they darken it, 0 to 1; 1 where they cover the pixel or brighten it.
    pub shadow: Picture,
    /// Fraction of the pixel that the objects cover, 0 to 1.
    pub alpha: Vec<f32>,
    /// Depth along the viewing direction at the pixel's centre, in metres; infinite where nothing is met.
    pub depth: Vec<f32>,
    /// Object index at the pixel's centre, inserted objects after the scene's; `u32::MAX` where nothing is met.
    pub object: Vec<u32>,
}

/// Ratio of radiance with to without the objects where they darken a pixel beside them, else 1.
fn shadow(pixel: &LayeredPixel) -> Vec3 {
    let dimmed = pixel.with.cmplt(pixel.without) & BVec3::splat(pixel.alpha == 0.0);
    let ratio = (pixel.with / pixel.without).max(Vec3::ZERO);
    Vec3::select(dimmed, ratio, Vec3::ONE)
}

impl Insertion {
    /// Starts an insertion; without samples, its composite is the photograph.
    pub fn new(
        backdrop: Backdrop,
        lit: Arc<LitScene>,
        objects: Vec<Arc<PlacedObject>>,
        options: PathOptions,
        seed: u64,
    ) -> Self {
        let (width, height) = (backdrop.photograph.width, backdrop.photograph.height);
        Self {
            backdrop,
            lit,
            objects,
            options,
            seed,
            pixels: vec![PairSums::default(); width as usize * height as usize],
            row_samples: vec![0; height as usize],
            next_row: 0,
            rays: 0,
            rejected: 0,
        }
    }

    /// The same insertion with other random numbers and no samples yet.
    pub fn with_seed(&self, seed: u64) -> Self {
        let (lit, objects) = (self.lit.clone(), self.objects.clone());
        Self::new(self.backdrop.clone(), lit, objects, self.options, seed)
    }

    /// The light of the same insertion at a smaller size: the photograph is black. No samples yet.
    pub fn smaller(&self, long_side: u32, seed: u64) -> Self {
        let (lit, objects) = (self.lit.clone(), self.objects.clone());
        let camera = self.backdrop.camera.shrunk(long_side);
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let photograph = Arc::new(Picture::from_fn(width, height, |_, _| Vec3::ZERO));
        let backdrop = Backdrop {
            camera,
            photograph,
            ..self.backdrop.clone()
        };
        Self::new(backdrop, lit, objects, self.options, seed)
    }

    /// Adds `samples` paths to every pixel, in parallel. The same to the bit for any split into calls and any number of threads.
    pub fn pass(&mut self, samples: u32) {
        self.refine_to(self.samples() + samples, || true);
    }

    /// Samples every pixel up to `samples` paths. Stops between two bands of rows once `go_on` returns false; the
    /// next call continues there. Returns whether all samples are done.
    pub fn refine_to(&mut self, samples: u32, go_on: impl Fn() -> bool) -> bool {
        if self.objects.is_empty() {
            return true;
        }
        let height = self.row_samples.len();
        let band = 16.max(2 * rayon::current_num_threads());
        while self.samples() < samples {
            if !go_on() {
                return false;
            }
            let rows = band.min(height - self.next_row);
            // Rows that the graphics card has sampled already are skipped.
            let samples_so_far = &self.row_samples[self.next_row..self.next_row + rows];
            if samples_so_far.iter().any(|&n| n < samples) {
                self.add_rows(self.next_row, rows);
            }
            self.next_row = (self.next_row + rows) % height;
        }
        true
    }

    /// [`Insertion::refine_to`] on a graphics card that holds the scene and the objects. After an error some rows have more samples
    /// than others; [`Insertion::refine_to`] completes the rest.
    ///
    /// # Errors
    /// The card failed.
    pub fn refine_on(
        &mut self,
        tracer: &mut Tracer,
        samples: u32,
        go_on: impl Fn() -> bool,
    ) -> Result<bool> {
        /// Most pixels between two calls of `go_on`, but at least a row.
        const BAND: usize = 1 << 18;
        let (width, height) = (self.width(), self.row_samples.len());
        if self.objects.is_empty() || width == 0 {
            return Ok(true);
        }
        let band = (BAND / width).max(1);
        let (camera, options) = (self.backdrop.camera.clone(), self.options);
        let view = View {
            camera: &camera,
            options: &options,
            seed: self.seed,
            frame: self.backdrop.frame,
        };
        let mut first = 0;
        while first < height {
            if !go_on() {
                return Ok(false);
            }
            // Rows with equally many samples: the processor may have stopped in mid-pass.
            let taken = self.row_samples[first];
            let alike = self.row_samples[first..].iter().take(band);
            let rows = first..first + alike.take_while(|&&n| n == taken).count();
            first = rows.end;
            let pixels = (rows.start * width) as u32..(rows.end * width) as u32;
            if taken < samples {
                let added = tracer.pairs(&view, pixels, taken..samples)?;
                self.accumulate(rows, samples - taken, &added);
            }
        }
        Ok(true)
    }

    /// Adds `samples` new samples, summed in `added`, to a range of rows.
    fn accumulate(&mut self, rows: Range<usize>, samples: u32, added: &[PairSums]) {
        let width = self.width();
        let sums = &mut self.pixels[rows.start * width..rows.end * width];
        (sums.par_iter_mut().zip(added)).for_each(|(sum, added)| sum.add(added));
        self.rays += added.iter().map(|sum| u64::from(sum.rays)).sum::<u64>();
        self.rejected += (added.iter().map(|sum| u64::from(sum.rejected))).sum::<u64>();
        for row in &mut self.row_samples[rows] {
            *row += samples;
        }
    }

    /// The composite in the photograph's values.
    ///
    /// Pixels that no object changes, not even within the reach of the blur, keep the photograph's value to the bit.
    pub fn composite(&self) -> Picture {
        let pixels = (0..self.pixels.len()).into_par_iter();
        let layers: Vec<LayeredPixel> = pixels.map(|pixel| self.layered(pixel)).collect();
        self.backdrop.composite(&layers)
    }

    fn layered(&self, pixel: usize) -> LayeredPixel {
        let (with, without, alpha) = self.means(pixel);
        LayeredPixel {
            alpha,
            with,
            uncovered: without + self.uncovered_change_at(pixel),
            without,
            changed: self.pixels[pixel].changed,
        }
    }

    /// Mean radiance of the objects where they cover a pixel; black where none does.
    pub fn object_radiance(&self) -> Picture {
        self.picture(|pixel| {
            let sums = &self.pixels[pixel];
            (sums.covered_with / f64::from(sums.covered.max(1))).as_vec3()
        })
    }

    /// Change in radiance in the part of each pixel that no object covers; black where they cover all of it.
    pub fn uncovered_change(&self) -> Picture {
        self.picture(|pixel| self.uncovered_change_at(pixel))
    }

    fn uncovered_change_at(&self, pixel: usize) -> Vec3 {
        let sums = &self.pixels[pixel];
        let free = self.row_samples[pixel / self.width()].max(1) - sums.covered;
        let with = sums.with - sums.covered_with;
        let without = sums.without - sums.covered_without;
        ((with - without) / f64::from(free.max(1))).as_vec3()
    }

    /// Mean radiance without the objects.
    pub fn without(&self) -> Picture {
        self.picture(|pixel| self.means(pixel).1)
    }

    /// Fraction of each pixel that the objects cover.
    pub fn alpha(&self) -> Vec<f32> {
        (0..self.pixels.len()).map(|p| self.means(p).2).collect()
    }

    /// Depth along the viewing direction and object index of each pixel, as [`Layers`] has them.
    fn at_centers(&self) -> (Vec<f32>, Vec<u32>) {
        let world = FurnishedScene::new(&self.lit, &self.objects);
        let camera = &self.backdrop.camera;
        let forward = camera.forward();
        let seen = |pixel: usize| match world.intersect(&self.ray(pixel, [0.5; 2])) {
            Some(s) => ((s.point - camera.center).dot(forward), s.object),
            None => (f32::INFINITY, u32::MAX),
        };
        (0..self.pixels.len()).into_par_iter().map(seen).unzip()
    }

    /// The layers of the composite.
    pub fn layers(&self) -> Layers {
        let pixels = 0..self.pixels.len();
        self.layers_of(&pixels.map(|pixel| self.layered(pixel)).collect::<Vec<_>>())
    }

    /// The layers of a composite of given pixels.
    pub(super) fn layers_of(&self, layered: &[LayeredPixel]) -> Layers {
        let (depth, object) = self.at_centers();
        Layers {
            with: self.picture(|pixel| layered[pixel].with),
            without: self.picture(|pixel| layered[pixel].without),
            delta: self.picture(|pixel| self.backdrop.delta(pixel, &layered[pixel])),
            shadow: self.picture(|pixel| shadow(&layered[pixel])),
            alpha: layered.iter().map(|pixel| pixel.alpha).collect(),
            depth,
            object,
        }
    }

    /// The photograph that is inserted into.
    pub fn backdrop(&self) -> &Backdrop {
        &self.backdrop
    }

    /// Replaces the photograph by another one of the same view.
    pub fn set_photograph(&mut self, photograph: Arc<Picture>) {
        self.backdrop.photograph = photograph;
    }

    /// Fewest samples of any pixel.
    pub fn samples(&self) -> u32 {
        self.row_samples.iter().copied().min().unwrap_or(0)
    }

    /// Rays cast.
    pub fn rays(&self) -> u64 {
        self.rays
    }

    /// Samples dropped because they came out non-finite.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    fn width(&self) -> usize {
        self.backdrop.photograph.width as usize
    }

    fn picture(&self, color: impl Fn(usize) -> Vec3) -> Picture {
        Picture {
            pixels: (0..self.pixels.len()).map(color).collect(),
            ..*self.backdrop.photograph
        }
    }

    /// Mean radiance with and without the objects, and coverage.
    fn means(&self, pixel: usize) -> (Vec3, Vec3, f32) {
        let sums = &self.pixels[pixel];
        let n = f64::from(self.row_samples[pixel / self.width()].max(1));
        let [with, without] = [sums.with, sums.without].map(|sum| (sum / n).as_vec3());
        (with, without, (f64::from(sums.covered) / n) as f32)
    }

    /// The ray through a pixel, at an offset in [0, 1)² from its corner.
    fn ray(&self, pixel: usize, offset: [f32; 2]) -> Ray {
        let corner = Vec2::new((pixel % self.width()) as f32, (pixel / self.width()) as f32);
        self.backdrop.camera.ray(corner + Vec2::from(offset))
    }

    /// A pair of paths through a pixel, with and without the objects, from the same random numbers.
    fn pair(&self, world: &FurnishedScene<'_>, pixel: usize, sample: u32) -> PairSums {
        let frame = self.backdrop.frame;
        let mut stream = Stream::new(self.seed, frame, pixel as u64, u64::from(sample));
        let ray = self.ray(pixel, stream.uniform2());
        let mut again = stream.clone();
        let covered = world.sees_object(&ray);
        world.take_touched();
        let with = radiance(world, &ray, &mut stream, &self.options);
        // A path that met no object is the same without them.
        let without = if world.take_touched() {
            radiance(&*self.lit, &ray, &mut again, &self.options)
        } else {
            PathSample { rays: 0, ..with }
        };
        let rejected = with.rejected || without.rejected;
        // If one of the pair is rejected both are, or the difference would be biased.
        let [kept, kept_without] = [with, without].map(|sample| match rejected {
            true => DVec3::ZERO,
            false => sample.radiance.as_dvec3(),
        });
        let of_covered = |value: DVec3| if covered { value } else { DVec3::ZERO };
        PairSums {
            with: kept,
            without: kept_without,
            covered_with: of_covered(kept),
            covered_without: of_covered(kept_without),
            covered: u32::from(covered),
            changed: covered || kept != kept_without,
            rays: with.rays + without.rays,
            rejected: u32::from(rejected),
        }
    }

    /// Adds one sample to every pixel of some rows.
    fn add_rows(&mut self, first: usize, rows: usize) {
        let width = self.width();
        let sampled = |row: usize| -> Vec<PairSums> {
            let world = FurnishedScene::new(&self.lit, &self.objects);
            let (pixels, sample) = (row * width..(row + 1) * width, self.row_samples[row]);
            pixels
                .map(|pixel| self.pair(&world, pixel, sample))
                .collect()
        };
        let rows_of_all = (first..first + rows).into_par_iter();
        let added: Vec<Vec<PairSums>> = rows_of_all.map(sampled).collect();
        self.accumulate(first..first + rows, 1, &added.concat());
    }
}
