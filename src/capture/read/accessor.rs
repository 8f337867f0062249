//! Reads glTF accessors with all bounds checked.

use crate::capture::read::gltf_file::Buffer;
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions};

/// The numbers of an accessor, and the number of components per element.
///
/// Normalised integers are scaled to [0, 1] or [−1, 1].
///
/// # Errors
/// As a phrase: the accessor is sparse, its type is not `allowed`, or it reaches past its buffer's end.
pub fn numbers(
    accessor: &Accessor,
    buffers: &[Buffer],
    allowed: &[Dimensions],
) -> Result<(Vec<f64>, usize), String> {
    let index = accessor.index();
    if !allowed.contains(&accessor.dimensions()) {
        return Err(format!(
            "accessors[{index}] has type {:?} where {allowed:?} is expected",
            accessor.dimensions()
        ));
    }
    if accessor.sparse().is_some() {
        return Err(format!(
            "accessors[{index}] is sparse, which is not supported"
        ));
    }
    let view = accessor
        .view()
        .ok_or_else(|| format!("accessors[{index}] has no bufferView"))?;
    let components = accessor.dimensions().multiplicity();
    let width = accessor.data_type().size();
    let stride = view.stride().unwrap_or(components * width);
    let past_end = || format!("accessors[{index}] reaches past the end of its buffer");

    let bytes = buffers
        .get(view.buffer().index())
        .and_then(|buffer| {
            let end = view.offset().checked_add(view.length())?;
            buffer.get(view.offset()..end)
        })
        .and_then(|bytes| bytes.get(accessor.offset()..))
        .ok_or_else(past_end)?;
    let count = accessor.count();
    let needed = count
        .checked_sub(1)
        .and_then(|last| last.checked_mul(stride)?.checked_add(components * width));
    if stride < components * width || needed.is_none_or(|needed| needed > bytes.len()) {
        return Err(past_end());
    }
    let scale = match (accessor.normalized(), accessor.data_type()) {
        (true, DataType::U8) => 1.0 / 255.0,
        (true, DataType::I8) => 1.0 / 127.0,
        (true, DataType::U16) => 1.0 / 65535.0,
        (true, DataType::I16) => 1.0 / 32767.0,
        _ => 1.0,
    };
    let mut values = Vec::with_capacity(count * components);
    for element in bytes.chunks(stride).take(count) {
        for component in element.chunks_exact(width).take(components) {
            values.push(number(accessor.data_type(), component) * scale);
        }
    }
    Ok((values, components))
}

/// One little-endian number; [`numbers`] guarantees the right number of bytes.
fn number(data_type: DataType, bytes: &[u8]) -> f64 {
    match (data_type, bytes) {
        (DataType::I8, &[a]) => f64::from(i8::from_le_bytes([a])),
        (DataType::U8, &[a]) => f64::from(a),
        (DataType::I16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
        (DataType::U16, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
        (DataType::U32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        (DataType::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => 0.0,
    }
}
