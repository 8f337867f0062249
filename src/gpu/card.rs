//! The graphics card: selection of an adapter, its device, and its errors.

use crate::error::{Error, Result};
use crate::gpu::pipelines::{Checks, Pipelines};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Accepted adapters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Adapters {
    /// Graphics cards, discrete or integrated.
    Cards,
    /// Software adapters, too.
    Any,
}

/// An adapter with its device. A clone is the same device.
#[derive(Debug, Clone)]
pub struct Card {
    name: String,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) pipelines: Arc<Pipelines>,
    pub(super) checks: Checks,
    failure: Arc<Mutex<Option<String>>>,
}

/// Time after which a dispatch counts as hung.
pub(super) const TIMEOUT: Duration = Duration::from_secs(60);

impl Card {
    /// Opens the best accepted adapter; `None` if none can trace paths.
    pub fn open(adapters: Adapters) -> Option<Self> {
        if adapters == Adapters::Cards && !may_have_card() {
            return None;
        }
        let backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        if (wgpu::Instance::enabled_backend_features() & backends).is_empty() {
            return None;
        }
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let mut found = pollster::block_on(instance.enumerate_adapters(backends));
        found.retain(|adapter| rank(&adapter.get_info(), adapters).is_some());
        found.sort_by_key(|adapter| rank(&adapter.get_info(), adapters));
        found.iter().find_map(Self::of)
    }

    fn of(adapter: &wgpu::Adapter) -> Option<Self> {
        let granted = adapter.limits();
        // Limits that WebGPU guarantees, plus the adapter's full buffer sizes. "Downlevel" defaults lack the eight storage buffers.
        let limits = wgpu::Limits {
            max_storage_buffers_per_shader_stage: 8,
            max_storage_buffer_binding_size: granted.max_storage_buffer_binding_size,
            max_buffer_size: granted.max_buffer_size,
            ..wgpu::Limits::downlevel_defaults()
        };
        let description = wgpu::DeviceDescriptor {
            label: Some("relit paths"),
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&description)).ok()?;
        let failure: Arc<Mutex<Option<String>>> = Arc::default();
        let record = |failure: &Mutex<Option<String>>, text: String| {
            if let Ok(mut failure) = failure.lock() {
                failure.get_or_insert(text);
            }
        };
        let lost = failure.clone();
        device.set_device_lost_callback(move |_, text| {
            record(&lost, format!("the device was lost ({})", one_line(&text)));
        });
        let uncaptured = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            record(&uncaptured, one_line(&error.to_string()));
        }));
        Some(Self {
            name: adapter.get_info().name,
            pipelines: Arc::new(Pipelines::new(&device)),
            checks: Checks::Off,
            device,
            queue,
            failure,
        })
    }

    /// The same device with other checks in its shaders.
    #[must_use]
    pub fn with_checks(&self, checks: Checks) -> Self {
        Self {
            checks,
            ..self.clone()
        }
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Maximum size of a buffer in bytes.
    pub(super) fn max_buffer(&self) -> u64 {
        let limits = self.device.limits();
        limits
            .max_storage_buffer_binding_size
            .min(limits.max_buffer_size)
    }

    /// Destroys the device, as a driver reset would; all further work fails.
    pub fn lose(&self) {
        self.device.destroy();
        // The callback runs during a poll.
        let _ = self.device.poll(wgpu::PollType::Poll);
    }

    /// Whether it has failed for good.
    pub fn is_lost(&self) -> bool {
        self.check().is_err()
    }

    /// Waits until a submission is done.
    pub(super) fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        let polled = self.device.poll(wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: Some(TIMEOUT),
        });
        self.check()?;
        let failed = |error: wgpu::PollError| self.failed(one_line(&error.to_string()));
        polled.map(drop).map_err(failed)
    }

    /// Fails if an error was recorded.
    pub(super) fn check(&self) -> Result<()> {
        match self.failure.lock().map(|failure| failure.clone()) {
            Ok(None) => Ok(()),
            Ok(Some(problem)) => Err(self.failed(problem)),
            Err(_) => Err(self.failed("its error handler failed".to_owned())),
        }
    }

    /// Runs `make` and returns its out-of-memory and validation errors.
    pub(super) fn attempt<T>(&self, make: impl FnOnce() -> T) -> Result<T> {
        self.check()?;
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        for scope in [validation, memory] {
            if let Some(error) = pollster::block_on(scope.pop()) {
                return Err(self.failed(one_line(&error.to_string())));
            }
        }
        self.check()?;
        Ok(made)
    }

    pub(super) fn failed(&self, problem: String) -> Error {
        Error::new(&self.name, problem, "")
    }
}

/// Whether the system may have a graphics card, without loading drivers: software drivers start slowly.
fn may_have_card() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    // Device nodes of NVIDIA, WSL, Mali and Adreno; other drivers have nodes in /dev/dri.
    let nodes = ["/dev/nvidia0", "/dev/dxg", "/dev/mali0", "/dev/kgsl-3d0"];
    let is_node = |name: std::ffi::OsString| name.to_string_lossy().starts_with("renderD");
    nodes.iter().any(|node| std::path::Path::new(node).exists())
        || std::fs::read_dir("/dev/dri")
            .is_ok_and(|mut folder| folder.any(|e| e.is_ok_and(|e| is_node(e.file_name()))))
}

/// Order of preference; `None` for adapters that are not accepted.
fn rank(info: &wgpu::AdapterInfo, adapters: Adapters) -> Option<u8> {
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => Some(0),
        wgpu::DeviceType::IntegratedGpu => Some(1),
        wgpu::DeviceType::VirtualGpu => Some(2),
        _ if adapters == Adapters::Any => Some(3),
        _ => None,
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
