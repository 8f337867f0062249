//! Parses glTF and GLB files, their buffers and accessors, with the checks that the gltf crate lacks.

use crate::error::{Error, Result};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::{Data, Source};
use gltf::json::Root;
use gltf::{Accessor, Document, Glb, Gltf};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

const GLB_HEADER: usize = 12;

/// Parses and validates the bytes of a glTF or GLB file.
///
/// # Errors
/// The file breaks the format or requires an extension that is not supported.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Gltf> {
    let broken = |problem: String| Error::file(path, problem, "export the mesh again");
    let invalid = |e: gltf::Error| broken(format!("is not a valid glTF: {e}"));
    let (root, blob): (std::result::Result<Root, _>, _) = if bytes.starts_with(b"glTF") {
        if declared_length(bytes).is_none_or(|n| n < GLB_HEADER) {
            return Err(broken("is not a valid GLB: its header is too short".into()));
        }
        let glb = Glb::from_slice(bytes).map_err(invalid)?;
        let root = gltf::json::deserialize::from_slice(&glb.json);
        (root, glb.bin.map(|bin| bin.into_owned()))
    } else {
        (gltf::json::deserialize::from_slice(bytes), None)
    };
    let root = root.map_err(|e| invalid(gltf::Error::Deserialize(e)))?;
    let required = |extension: &str| root.extensions_required.iter().any(|r| r == extension);
    if let Some((_, name)) = COMPRESSIONS.iter().find(|(e, _)| required(e)) {
        return Err(Error::file(
            path,
            format!("is compressed with {name}, which is not supported"),
            "export the mesh without compression, or decode it: npx @gltf-transform/cli copy IN.glb OUT.glb",
        ));
    }
    check_accessors(&root).map_err(broken)?;
    let document = Document::from_json(root).map_err(invalid)?;
    Ok(Gltf { document, blob })
}

const COMPRESSIONS: [(&str, &str); 2] = [
    ("KHR_draco_mesh_compression", "Draco"),
    ("EXT_meshopt_compression", "meshopt"),
];

/// Checks that attributes refer to existing accessors: the crate's validation would panic otherwise.
fn check_accessors(root: &Root) -> std::result::Result<(), String> {
    for (index, mesh) in root.meshes.iter().enumerate() {
        let mut accessors = (mesh.primitives.iter()).flat_map(|p| p.attributes.values());
        if accessors.any(|accessor| accessor.value() >= root.accessors.len()) {
            return Err(format!(
                "is not a valid glTF: meshes[{index}] names an accessor that is not there"
            ));
        }
    }
    Ok(())
}

fn declared_length(bytes: &[u8]) -> Option<usize> {
    let field = bytes.get(8..GLB_HEADER)?;
    Some(u32::from_le_bytes(field.try_into().ok()?) as usize)
}

/// Reads a file that a glTF file names. Arguments: the field (for messages) and the name.
pub type ReadFile<'a> = &'a dyn Fn(&str, &str) -> Result<Vec<u8>>;

/// The bytes of a buffer; buffers with the same URI share them.
pub type Buffer = Arc<Vec<u8>>;

/// The bytes of all buffers: the GLB's own chunk, data URIs, and files read by `file`.
///
/// # Errors
/// A buffer is missing or shorter than declared, or `file` fails.
pub fn buffers(gltf: &Gltf, path: &Path, file: ReadFile<'_>) -> Result<Vec<Buffer>> {
    let mut blob = gltf.blob.clone();
    let mut named: BTreeMap<&str, Buffer> = BTreeMap::new();
    gltf.buffers()
        .map(|buffer| {
            let place = format!("{}: buffers[{}]", path.display(), buffer.index());
            let bytes = match buffer.source() {
                Source::Bin => {
                    let blob = blob.take().map(Arc::new);
                    blob.ok_or_else(|| Error::new(&place, "has no data", "export the mesh again"))?
                }
                Source::Uri(uri) => match named.get(uri) {
                    Some(bytes) => bytes.clone(),
                    None => {
                        let bytes = Arc::new(resource(&place, uri, file)?);
                        named.insert(uri, bytes.clone());
                        bytes
                    }
                },
            };
            if bytes.len() < buffer.length() {
                return Err(Error::new(
                    &place,
                    format!(
                        "holds {} bytes of the {} declared",
                        bytes.len(),
                        buffer.length()
                    ),
                    "export the mesh again",
                ));
            }
            Ok(bytes)
        })
        .collect()
}

/// The bytes of a URI: inline data, or a file read by `file`. `place` names the field for messages.
///
/// # Errors
/// The inline data is broken, or `file` fails.
pub fn resource(place: &str, uri: &str, file: ReadFile<'_>) -> Result<Vec<u8>> {
    if uri.starts_with("data:") {
        let data = Data::from_source(Source::Uri(uri), None);
        return data
            .map(|data| data.0)
            .map_err(|e| Error::new(place, e, "export it again"));
    }
    file(place, &percent_decoded(uri))
}

fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while let Some(&byte) = bytes.get(i) {
        let hex = bytes
            .get(i + 1..i + 3)
            .filter(|_| byte == b'%')
            .and_then(|h| std::str::from_utf8(h).ok())
            .and_then(|h| u8::from_str_radix(h, 16).ok());
        decoded.push(hex.unwrap_or(byte));
        i += if hex.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&decoded).into_owned()
}

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
) -> std::result::Result<(Vec<f64>, usize), String> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn buffers_of_one_name_are_read_once_and_share_their_bytes() {
        let json = r#"{"asset": {"version": "2.0"}, "buffers": [
            {"uri": "a.bin", "byteLength": 4}, {"uri": "a.bin", "byteLength": 3}, {"uri": "b.bin", "byteLength": 4}]}"#;
        let path = Path::new("scan.gltf");
        let gltf = parse(path, json.as_bytes()).expect("valid");
        let reads = Cell::new(0);
        let file = |_: &str, name: &str| {
            reads.set(reads.get() + 1);
            Ok(vec![name.as_bytes()[0]; 4])
        };
        let buffers = buffers(&gltf, path, &file).expect("reads");
        assert_eq!(reads.get(), 2);
        assert!(Arc::ptr_eq(&buffers[0], &buffers[1]));
        assert_eq!([buffers[0][0], buffers[2][0]], [b'a', b'b']);
    }
}
