//! The compiled shaders of a card.

use crate::error::Result;
use crate::gpu::card::Card;
use crate::gpu::layout::{BINDINGS, FILM, Kernel, source};
use std::sync::{Mutex, PoisonError};

/// Which checks the shader makes at run time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checks {
    /// None: the tables hold only indices in range, and all loops end.
    Off,
    /// Of every index and the number of steps of every loop. An H100 traces 1.2 to 1.7 times as many paths without them; tests compare
    /// both.
    On,
}

/// Pipelines, compiled at first use.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub layout: wgpu::BindGroupLayout,
    compiled: Mutex<Vec<(Key, wgpu::ComputePipeline)>>,
}

/// Kernel, stack size and checks.
type Key = (Kernel, u32, Checks);

impl Pipelines {
    pub fn new(device: &wgpu::Device) -> Self {
        Self {
            layout: bind_group_layout(device),
            compiled: Mutex::default(),
        }
    }

    /// The pipeline of a kernel.
    ///
    /// # Errors
    /// The card failed.
    pub fn get(
        &self,
        card: &Card,
        kernel: Kernel,
        stack_size: u32,
    ) -> Result<wgpu::ComputePipeline> {
        let key = (kernel, stack_size, card.checks);
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, pipeline)) = compiled.iter().find(|(other, _)| *other == key) {
            return Ok(pipeline.clone());
        }
        let pipeline = card.attempt(|| self.compile(card, kernel, stack_size))?;
        compiled.push((key, pipeline.clone()));
        Ok(pipeline)
    }

    fn compile(&self, card: &Card, kernel: Kernel, stack_size: u32) -> wgpu::ComputePipeline {
        let device = &card.device;
        let text = source(stack_size);
        let module = module(device, &text, card.checks);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("paths"),
            bind_group_layouts: &[Some(&self.layout)],
            ..Default::default()
        });
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.name),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(kernel.name),
            compilation_options: wgpu::PipelineCompilationOptions {
                // A stack's entries are written before they are read.
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        })
    }
}

#[expect(
    unsafe_code,
    reason = "without checks a wrong index would be undefined behaviour"
)]
fn module(device: &wgpu::Device, text: &str, checks: Checks) -> wgpu::ShaderModule {
    let description = wgpu::ShaderModuleDescriptor {
        label: Some("paths"),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    };
    match checks {
        Checks::On => device.create_shader_module(description),
        // SAFETY: every index that the shader reads is made by `gpu::geometry` and `gpu::lights`, checked by `gpu::materials` and
        // `Tracer::on`, or clamped; the stack holds the depth of the hierarchy, and each thread's pixel is within the film buffer.
        // Loops go down a finite tree, halve a range, or end with a path.
        Checks::Off => unsafe {
            let checks = wgpu::ShaderRuntimeChecks::unchecked();
            device.create_shader_module_trusted(description, checks)
        },
    }
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
