//! The graphics card: which there is, its device, and what goes wrong with it.

use crate::error::{Error, Result};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Which adapters will do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Adapters {
    /// Graphics cards, in a chip of their own or the processor's.
    Cards,
    /// Programs that do a card's work on the processor, too.
    Any,
}

/// An adapter with its device. A clone is the same device.
#[derive(Debug, Clone)]
pub struct Card {
    name: String,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    failure: Arc<Mutex<Option<String>>>,
}

/// A dispatch that has not come back after this has hung.
const TIMEOUT: Duration = Duration::from_secs(60);

impl Card {
    /// Opens the best adapter of those that will do; `None` where there is none that can trace paths.
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
        // What WebGPU grants everywhere, with as much memory as there is: of a device below its standard ("downlevel") only the
        // eight storage buffers are asked in addition.
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
        let note = |failure: &Mutex<Option<String>>, text: String| {
            if let Ok(mut failure) = failure.lock() {
                failure.get_or_insert(text);
            }
        };
        let lost = failure.clone();
        device.set_device_lost_callback(move |_, text| {
            note(&lost, format!("the device was lost ({})", one_line(&text)));
        });
        let wrong = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            note(&wrong, one_line(&error.to_string()));
        }));
        Some(Self {
            name: adapter.get_info().name,
            device,
            queue,
            failure,
        })
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Most bytes that one buffer may hold.
    pub(super) fn max_buffer(&self) -> u64 {
        let limits = self.device.limits();
        limits
            .max_storage_buffer_binding_size
            .min(limits.max_buffer_size)
    }

    /// Gives the device back as if the driver had taken it; all further work fails.
    pub fn lose(&self) {
        self.device.destroy();
        // The loss is heard at the next poll.
        let _ = self.device.poll(wgpu::PollType::Poll);
    }

    /// Waits until the work submitted last is done.
    pub(super) fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        let polled = self.device.poll(wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: Some(TIMEOUT),
        });
        self.check()?;
        match polled {
            Ok(_) => Ok(()),
            Err(error) => Err(self.failed(one_line(&error.to_string()))),
        }
    }

    /// Fails if anything has gone wrong so far.
    pub(super) fn check(&self) -> Result<()> {
        match self.failure.lock().map(|failure| failure.clone()) {
            Ok(None) => Ok(()),
            Ok(Some(problem)) => Err(self.failed(problem)),
            Err(_) => Err(self.failed("its error handler failed".to_owned())),
        }
    }

    /// Runs `make`, which asks for memory or pipelines; what goes wrong there is its error.
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

    /// An error of this card.
    pub(super) fn failed(&self, problem: String) -> Error {
        Error::new(&self.name, problem, "")
    }
}

/// Whether the system shows a graphics card at all, without asking drivers: those of software adapters take a while to start.
fn may_have_card() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    // Render nodes of the kernel's own drivers, of NVIDIA's, of Windows below, of phones' chips.
    let nodes = ["/dev/nvidia0", "/dev/dxg", "/dev/mali0", "/dev/kgsl-3d0"];
    let is_node = |name: std::ffi::OsString| name.to_string_lossy().starts_with("renderD");
    nodes.iter().any(|node| std::path::Path::new(node).exists())
        || std::fs::read_dir("/dev/dri")
            .is_ok_and(|mut folder| folder.any(|e| e.is_ok_and(|e| is_node(e.file_name()))))
}

/// Order of preference; `None` where an adapter will not do.
fn rank(info: &wgpu::AdapterInfo, adapters: Adapters) -> Option<u8> {
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => Some(0),
        wgpu::DeviceType::IntegratedGpu => Some(1),
        wgpu::DeviceType::VirtualGpu => Some(2),
        _ if adapters == Adapters::Any => Some(3),
        _ => None,
    }
}

/// Drivers' messages run over many lines.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
