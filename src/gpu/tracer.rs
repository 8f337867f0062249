//! A scene on the card: pictures, pairs of pictures with and without inserted objects, single rays.

use crate::error::Result;
use crate::gpu::card::Card;
use crate::gpu::layout::{
    BINDINGS, Dispatch, FILM, INSERT, Kernel, Material, NONE, RENDER, TRACE, WORKGROUP, source,
};
use crate::gpu::materials::Inserted;
use crate::gpu::pace::Pace;
use crate::gpu::scene::Packed;
use crate::math::rng::splitmix64;
use crate::scene::camera::Camera;
use crate::scene::geometry::{Hit, Ray};
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use crate::transport::surroundings::Surroundings;
use glam::{DVec3, Vec3};
use std::ops::Range;
use std::time::Instant;
use wgpu::BufferUsages as Usage;

/// Samples summed in f32 on the card before the sums are added in f64.
const CHUNK: u32 = 16;

/// Four numbers of the film buffer, as their bits.
type Word = [u32; 4];

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

/// A scene on the card.
#[derive(Debug)]
pub struct Tracer {
    card: Card,
    scene: Vec<wgpu::Buffer>,
    dispatch: wgpu::Buffer,
    description: Dispatch,
    layout: wgpu::BindGroupLayout,
    shader: wgpu::ShaderModule,
    pipelines: Vec<(Kernel, wgpu::ComputePipeline)>,
    pace: Pace,
}

impl Tracer {
    /// Uploads a scene with inserted objects.
    ///
    /// # Errors
    /// The scene does not fit, or the card failed.
    pub fn new(card: &Card, lit: &LitScene, objects: &[Inserted<'_>]) -> Result<Self> {
        if (lit.outside.as_ref()).is_some_and(|map| map.surroundings() != Surroundings::Far) {
            return Err(card
                .failed("an environment on a box is supported on the processor only".to_owned()));
        }
        let packed = Packed::new(lit, objects);
        let contents: [&[u8]; 7] = [
            bytemuck::cast_slice(&packed.nodes),
            bytemuck::cast_slice(&packed.triangles),
            bytemuck::cast_slice(&packed.materials),
            bytemuck::cast_slice(&packed.data),
            bytemuck::cast_slice(&packed.emitters),
            bytemuck::cast_slice(&packed.environment),
            // No rays yet.
            &[],
        ];
        let device = &card.device;
        for (bytes, (name, _)) in contents.iter().zip(BINDINGS) {
            if bytes.len() as u64 > card.max_buffer() {
                let size = bytes.len() >> 20;
                let max = card.max_buffer() >> 20;
                return Err(card.failed(format!(
                    "the scene's {name} take {size} MiB, but a buffer may have {max}"
                )));
            }
        }
        let mut scene = Vec::with_capacity(contents.len());
        for bytes in contents {
            scene.push(storage(card, bytes)?);
        }
        let (layout, shader) = card.attempt(|| {
            let text = source(packed.stack_size);
            let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("paths"),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            });
            (bind_group_layout(device), shader)
        })?;
        let size = size_of::<Dispatch>() as u64;
        Ok(Self {
            card: card.clone(),
            scene,
            dispatch: buffer(card, "dispatch", size, Usage::UNIFORM | Usage::COPY_DST)?,
            description: packed.dispatch,
            layout,
            shader,
            pipelines: Vec::new(),
            pace: Pace::default(),
        })
    }

    /// Adds `samples` paths to every pixel of a film, keyed as in [`Film::add`]; after an error the film is unchanged.
    ///
    /// # Errors
    /// The card failed.
    pub fn add(&mut self, film: &mut Film, view: &View<'_>, samples: u32) -> Result<()> {
        let mut added = Film::new(view.camera);
        let pixels = 0..added.sums.len() as u32;
        let range = film.samples..film.samples + samples;
        let description = with_view(self.description, view);
        self.dispatch_all(RENDER, description, pixels, range, |pixel, found| {
            let [r, g, b, counts] = found[0];
            added.sums[pixel as usize] += color([r, g, b]);
            added.rays += u64::from(counts & 0x00ff_ffff);
            added.rejected += u64::from(counts >> 24);
        })?;
        for (sum, added) in film.sums.iter_mut().zip(added.sums) {
            *sum += added;
        }
        film.rays += added.rays;
        film.rejected += added.rejected;
        film.samples += samples;
        Ok(())
    }

    /// A picture from `samples` paths per pixel.
    ///
    /// # Errors
    /// The card failed.
    pub fn film(&mut self, view: &View<'_>, samples: u32) -> Result<Film> {
        let mut film = Film::new(view.camera);
        self.add(&mut film, view, samples)?;
        Ok(film)
    }

    /// Traces pairs of paths with and without the inserted objects, for ranges of pixels and samples.
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
        self.dispatch_all(INSERT, description, pixels, samples, |pixel, found| {
            let sum = &mut sums[(pixel - first) as usize];
            let [with, without, covered_with, covered_without, counts] = found else {
                return;
            };
            let sums = |&[r, g, b, _]: &Word| color([r, g, b]);
            sum.with += sums(with);
            sum.without += sums(without);
            sum.covered_with += sums(covered_with);
            sum.covered_without += sums(covered_without);
            sum.covered += f32::from_bits(with[3]) as u32;
            sum.rays += counts[0];
            sum.rejected += counts[1];
            sum.changed |= counts[2] > 0;
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
        let bytes: &[u8] = bytemuck::cast_slice(&words);
        if bytes.len() as u64 > self.card.max_buffer() {
            return Err(self.card.failed("too many rays at once".to_owned()));
        }
        let buffer = storage(&self.card, bytes)?;
        if let Some(place) = self.scene.last_mut() {
            *place = buffer;
        }
        let mut hits = vec![None; rays.len()];
        let mut description = self.description;
        description.slice[0] = rays.len().max(1) as u32;
        let all = 0..rays.len() as u32;
        self.dispatch_all(TRACE, description, all, 0..1, |ray, found| {
            let [t, b1, b2, triangle] = found[0];
            let [t, b1, b2] = [t, b1, b2].map(f32::from_bits);
            hits[ray as usize] = (triangle != NONE).then_some(Hit {
                t,
                triangle,
                b1,
                b2,
            });
        })?;
        Ok(hits)
    }

    /// Traces samples of pixels in bands and chunks; `add` gets the sums of up to [`CHUNK`] samples of each pixel.
    fn dispatch_all(
        &mut self,
        kernel: Kernel,
        mut description: Dispatch,
        pixels: Range<u32>,
        samples: Range<u32>,
        mut add: impl FnMut(u32, &[Word]),
    ) -> Result<()> {
        let pipeline = self.pipeline(kernel)?;
        let pixel_size = u64::from(kernel.words) * size_of::<Word>() as u64;
        let fit = (self.card.max_buffer() / pixel_size).min(u64::from(u32::MAX));
        let band = (fit as u32).min(pixels.len() as u32).max(1);
        let card = self.card.clone();
        let size = u64::from(band) * pixel_size;
        let film = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST;
        let film = buffer(&card, FILM, size, film)?;
        let read = buffer(&card, FILM, size, Usage::MAP_READ | Usage::COPY_DST)?;
        let group = card.attempt(|| self.bind_group(&film))?;
        for first in pixels.clone().step_by(band as usize) {
            let band = first..first.saturating_add(band).min(pixels.end);
            for chunk in samples.clone().step_by(CHUNK as usize) {
                let end = chunk.saturating_add(CHUNK).min(samples.end);
                clear(&card, &film);
                description.paths[3] = band.start;
                self.slices(&pipeline, &group, description, band.clone(), chunk..end)?;
                let found = self.read(&film, &read, band.len() * kernel.words as usize)?;
                for (pixel, found) in band.clone().zip(found.chunks_exact(kernel.words as usize)) {
                    add(pixel, found);
                }
            }
        }
        Ok(())
    }

    /// Submits the dispatches that add a range of samples of a band to the film buffer.
    fn slices(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        mut description: Dispatch,
        band: Range<u32>,
        samples: Range<u32>,
    ) -> Result<()> {
        let (mut pixel, mut sample) = (band.start, samples.start);
        while sample < samples.end && !band.is_empty() {
            let left = samples.end - sample;
            let [count, fit] = self.pace.slice(band.len() as u32, left);
            let taken = if pixel == band.start { fit } else { 1 };
            let end = pixel.saturating_add(count).min(band.end);
            (description.slice[1], description.slice[2]) = (pixel, end);
            (description.slice[3], description.paths[0]) = (sample, taken);
            let card = &self.card;
            card.queue
                .write_buffer(&self.dispatch, 0, bytemuck::bytes_of(&description));
            let mut encoder = card.device.create_command_encoder(&Default::default());
            {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.dispatch_workgroups((end - pixel).div_ceil(WORKGROUP), 1, 1);
            }
            let start = Instant::now();
            let submission = card.queue.submit([encoder.finish()]);
            card.wait(submission)?;
            self.pace.record((end - pixel) * taken, start.elapsed());
            pixel = end;
            if pixel == band.end {
                (pixel, sample) = (band.start, sample + taken);
            }
        }
        Ok(())
    }

    fn read(&self, film: &wgpu::Buffer, read: &wgpu::Buffer, words: usize) -> Result<Vec<Word>> {
        let bytes = (words * size_of::<Word>()) as u64;
        let card = &self.card;
        let mut encoder = card.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(film, 0, read, 0, bytes);
        let submission = card.queue.submit([encoder.finish()]);
        let (send, receive) = std::sync::mpsc::sync_channel(1);
        read.map_async(wgpu::MapMode::Read, 0..bytes, move |mapped| {
            let _ = send.send(mapped.is_ok());
        });
        card.wait(submission)?;
        let failed = || card.failed("its results cannot be read back".to_owned());
        if !receive.try_recv().unwrap_or(false) {
            return Err(failed());
        }
        let view = read.get_mapped_range(0..bytes).map_err(|_| failed())?;
        let mut found = vec![Word::default(); words];
        bytemuck::cast_slice_mut(&mut found).copy_from_slice(&view);
        drop(view);
        read.unmap();
        Ok(found)
    }

    fn bind_group(&self, film: &wgpu::Buffer) -> wgpu::BindGroup {
        let buffers = std::iter::once(&self.dispatch).chain(&self.scene);
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(buffers.chain([film]))
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let device = &self.card.device;
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene"),
            layout: &self.layout,
            entries: &entries,
        })
    }

    /// The pipeline of a kernel, compiled at first use.
    fn pipeline(&mut self, kernel: Kernel) -> Result<wgpu::ComputePipeline> {
        if let Some((_, pipeline)) = self.pipelines.iter().find(|(k, _)| *k == kernel) {
            return Ok(pipeline.clone());
        }
        let device = &self.card.device;
        let pipeline = self.card.attempt(|| {
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("paths"),
                bind_group_layouts: &[Some(&self.layout)],
                ..Default::default()
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(kernel.name),
                layout: Some(&layout),
                module: &self.shader,
                entry_point: Some(kernel.name),
                compilation_options: Default::default(),
                cache: None,
            })
        })?;
        self.pipelines.push((kernel, pipeline.clone()));
        Ok(pipeline)
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

/// Creates a read-only storage buffer.
fn storage(card: &Card, bytes: &[u8]) -> Result<wgpu::Buffer> {
    /// Content of empty buffers: a binding must hold at least one element.
    const NOTHING: [u8; size_of::<Material>()] = [0; size_of::<Material>()];
    let bytes = if bytes.is_empty() { &NOTHING } else { bytes };
    let usage = Usage::STORAGE | Usage::COPY_DST;
    let buffer = buffer(card, "scene", bytes.len() as u64, usage)?;
    card.attempt(|| card.queue.write_buffer(&buffer, 0, bytes))?;
    Ok(buffer)
}

fn buffer(card: &Card, label: &str, size: u64, usage: Usage) -> Result<wgpu::Buffer> {
    card.attempt(|| {
        card.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        })
    })
}

fn clear(card: &Card, film: &wgpu::Buffer) {
    let mut encoder = card.device.create_command_encoder(&Default::default());
    encoder.clear_buffer(film, 0, None);
    card.queue.submit([encoder.finish()]);
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform)];
    for (binding, (name, _)) in (1..).zip(BINDINGS) {
        let read_only = name != FILM;
        let storage = wgpu::BufferBindingType::Storage { read_only };
        entries.push(entry(binding, storage));
    }
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("scene"),
        entries: &entries,
    })
}
