//! The film buffer of a tracer, and the dispatches that fill it.

use crate::error::Result;
use crate::gpu::buffers::empty;
use crate::gpu::card::TIMEOUT;
use crate::gpu::layout::{Dispatch, FILM, Kernel, WORKGROUP};
use crate::gpu::tracer::{Tracer, Word};
use std::ops::Range;
use std::time::Instant;
use wgpu::BufferUsages as Usage;

/// Samples summed in f32 on the card before the sums are added in f64.
pub(super) const SAMPLES_AT_ONCE: u32 = 16;

/// The buffer that the shader writes, a copy for the processor, and the bindings.
#[derive(Debug)]
pub(super) struct FilmBuffers {
    film: wgpu::Buffer,
    read: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Tracer {
    /// Traces samples of pixels in bands and chunks. `add` gets ranges of pixels and their words, the sums of up to [`SAMPLES_AT_ONCE`]
    /// samples.
    pub(super) fn dispatch_all(
        &mut self,
        kernel: Kernel,
        mut description: Dispatch,
        pixels: Range<u32>,
        samples: Range<u32>,
        mut add: impl FnMut(Range<u32>, &[Word]),
    ) -> Result<()> {
        if pixels.is_empty() {
            return Ok(());
        }
        let pipeline = (self.card.pipelines).get(&self.card, kernel, self.geometry.stack_size)?;
        let pixel_size = u64::from(kernel.words) * size_of::<Word>() as u64;
        let fit = (self.card.max_buffer() / pixel_size).min(u64::from(u32::MAX));
        let band = (fit as u32).min(pixels.len() as u32).max(1);
        self.prepare(u64::from(band) * pixel_size)?;
        for first in pixels.clone().step_by(band as usize) {
            let band = first..first.saturating_add(band).min(pixels.end);
            description.paths[3] = band.start;
            for chunk in samples.clone().step_by(SAMPLES_AT_ONCE as usize) {
                let chunk = chunk..chunk.saturating_add(SAMPLES_AT_ONCE).min(samples.end);
                let bytes = band.len() as u64 * pixel_size;
                self.fill(&pipeline, description, band.clone(), chunk, bytes)?;
                self.read(bytes, |words| add(band.clone(), words))?;
            }
        }
        Ok(())
    }

    /// Makes film buffers of at least a size, and their bindings.
    fn prepare(&mut self, size: u64) -> Result<()> {
        if (self.film.as_ref()).is_some_and(|buffers| buffers.film.size() >= size) {
            return Ok(());
        }
        let card = &self.card;
        let usage = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST;
        let film = empty(card, FILM, size, usage)?;
        let read = empty(card, FILM, size, Usage::MAP_READ | Usage::COPY_DST)?;
        let geometry = [&self.geometry.nodes, &self.geometry.triangles];
        let buffers = std::iter::once(&self.dispatch)
            .chain(geometry)
            .chain(&self.light)
            .chain([&self.rays, &film]);
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let group = card.attempt(|| {
            card.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("scene"),
                layout: &card.pipelines.layout,
                entries: &entries,
            })
        })?;
        self.film = Some(FilmBuffers { film, read, group });
        Ok(())
    }

    /// Fills the film buffer with the sums over samples of a band of pixels, slice by slice, and copies them.
    fn fill(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        mut description: Dispatch,
        band: Range<u32>,
        samples: Range<u32>,
        bytes: u64,
    ) -> Result<()> {
        let card = &self.card;
        let Some(buffers) = &self.film else {
            return Err(card.failed("there is no film buffer".to_owned()));
        };
        let (mut pixel, mut sample) = (band.start, samples.start);
        while sample < samples.end {
            let left = samples.end - sample;
            let [count, fit] = self.pace.slice(band.len() as u32, left);
            let taken = if pixel == band.start { fit } else { 1 };
            let end = pixel.saturating_add(count).min(band.end);
            (description.slice[1], description.slice[2]) = (pixel, end);
            (description.slice[3], description.paths[0]) = (sample, taken);
            card.queue
                .write_buffer(&self.dispatch, 0, bytemuck::bytes_of(&description));
            let mut encoder = card.device.create_command_encoder(&Default::default());
            if (pixel, sample) == (band.start, samples.start) {
                encoder.clear_buffer(&buffers.film, 0, Some(bytes));
            }
            {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &buffers.group, &[]);
                pass.dispatch_workgroups((end - pixel).div_ceil(WORKGROUP), 1, 1);
            }
            let paths = (end - pixel) * taken;
            pixel = end;
            if pixel == band.end {
                (pixel, sample) = (band.start, sample + taken);
            }
            if sample >= samples.end {
                encoder.copy_buffer_to_buffer(&buffers.film, 0, &buffers.read, 0, bytes);
            }
            let start = Instant::now();
            let submission = card.queue.submit([encoder.finish()]);
            card.wait(submission)?;
            self.pace.record(paths, start.elapsed());
        }
        Ok(())
    }

    /// Calls `take` with the copied words.
    fn read(&self, bytes: u64, take: impl FnOnce(&[Word])) -> Result<()> {
        let card = &self.card;
        let failed = || card.failed("its results cannot be read back".to_owned());
        let read = self.film.as_ref().map(|buffers| &buffers.read);
        let read = read.ok_or_else(failed)?;
        let (send, receive) = std::sync::mpsc::sync_channel(1);
        read.map_async(wgpu::MapMode::Read, 0..bytes, move |mapped| {
            let _ = send.send(mapped.is_ok());
        });
        // The copy is done. Another thread's poll may run the callback.
        let polled = card.device.poll(wgpu::PollType::Poll);
        let mapped = polled.is_ok() && receive.recv_timeout(TIMEOUT).unwrap_or(false);
        card.check()?;
        if !mapped {
            return Err(failed());
        }
        let view = read.get_mapped_range(0..bytes).map_err(|_| failed())?;
        take(bytemuck::cast_slice(&view));
        drop(view);
        read.unmap();
        Ok(())
    }
}
