//! Buffers on the card.

use crate::error::Result;
use crate::gpu::card::Card;
use bytemuck::Pod;
use wgpu::BufferUsages as Usage;

/// Size of the smallest buffer in bytes: a binding must hold at least one element.
const MIN_SIZE: u64 = 256;

/// A read-only storage buffer with these contents.
///
/// # Errors
/// They do not fit, or the card failed.
pub(super) fn storage<T: Pod>(card: &Card, label: &str, contents: &[T]) -> Result<wgpu::Buffer> {
    let bytes: &[u8] = bytemuck::cast_slice(contents);
    if bytes.len() as u64 > card.max_buffer() {
        let [size, max] = [bytes.len() as u64, card.max_buffer()].map(|size| size >> 20);
        let problem = format!("the scene's {label} take {size} MiB, but a buffer may have {max}");
        return Err(card.failed(problem));
    }
    let buffer = empty(
        card,
        label,
        bytes.len() as u64,
        Usage::STORAGE | Usage::COPY_DST,
    )?;
    if !bytes.is_empty() {
        card.attempt(|| card.queue.write_buffer(&buffer, 0, bytes))?;
    }
    Ok(buffer)
}

/// A buffer of zeros.
///
/// # Errors
/// It does not fit, or the card failed.
pub(super) fn empty(card: &Card, label: &str, size: u64, usage: Usage) -> Result<wgpu::Buffer> {
    card.attempt(|| {
        card.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size.max(MIN_SIZE),
            usage,
            mapped_at_creation: false,
        })
    })
}
