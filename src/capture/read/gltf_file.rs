//! glTF and GLB files and their buffers, checked before the gltf crate trusts them.

use crate::capture::read::confine::Confine;
use crate::error::{Error, Result};
use gltf::buffer::{Data, Source};
use gltf::json::Root;
use gltf::json::validation::Checked;
use gltf::{Document, Glb, Gltf, Semantic};
use std::path::Path;

/// Bytes of a GLB file's header.
const GLB_HEADER: usize = 12;

/// Parses and validates the bytes of a glTF or GLB file.
///
/// # Errors
/// The file breaks the format or requires an extension that is not supported.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Gltf> {
    let broken = |problem: String| Error::file(path, problem, "export the mesh again");
    let invalid = |e: gltf::Error| broken(format!("is no valid glTF: {e}"));
    let (root, blob): (std::result::Result<Root, _>, _) = if bytes.starts_with(b"glTF") {
        if declared_length(bytes).is_none_or(|n| n < GLB_HEADER) {
            return Err(broken("is no valid GLB: its header is too short".into()));
        }
        let glb = Glb::from_slice(bytes).map_err(invalid)?;
        let root = gltf::json::deserialize::from_slice(&glb.json);
        (root, glb.bin.map(|bin| bin.into_owned()))
    } else {
        (gltf::json::deserialize::from_slice(bytes), None)
    };
    let root = root.map_err(|e| invalid(gltf::Error::Deserialize(e)))?;
    check_positions(&root).map_err(broken)?;
    let document = Document::from_json(root).map_err(invalid)?;
    Ok(Gltf { document, blob })
}

/// The crate's validation looks up the POSITION accessors before it knows that they exist.
fn check_positions(root: &Root) -> std::result::Result<(), String> {
    for (index, mesh) in root.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let positions = primitive
                .attributes
                .get(&Checked::Valid(Semantic::Positions));
            if positions.is_some_and(|accessor| accessor.value() >= root.accessors.len()) {
                return Err(format!(
                    "is no valid glTF: meshes[{index}] names a POSITION accessor that is not there"
                ));
            }
        }
    }
    Ok(())
}

/// The file length that a GLB header declares.
fn declared_length(bytes: &[u8]) -> Option<usize> {
    let field = bytes.get(8..GLB_HEADER)?;
    Some(u32::from_le_bytes(field.try_into().ok()?) as usize)
}

/// The bytes of all buffers: the GLB's own, data URIs, and files inside the confined folder.
///
/// # Errors
/// A buffer is missing, shorter than promised, or leaves the folder.
pub fn buffers(gltf: &Gltf, path: &Path, confine: &Confine) -> Result<Vec<Vec<u8>>> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut blob = gltf.blob.clone();
    gltf.buffers()
        .map(|buffer| {
            let place = format!("{}: buffers[{}]", path.display(), buffer.index());
            let bytes = match buffer.source() {
                Source::Bin => blob
                    .take()
                    .ok_or_else(|| Error::new(&place, "has no data", "export the mesh again"))?,
                Source::Uri(uri) if uri.starts_with("data:") => {
                    Data::from_source(Source::Uri(uri), None)
                        .map_err(|e| Error::new(&place, e, "export the mesh again"))?
                        .0
                }
                Source::Uri(uri) => {
                    let file = confine.file_from(folder, &place, &uri.replace("%20", " "))?;
                    std::fs::read(&file).map_err(|e| Error::io(&file, &e))?
                }
            };
            if bytes.len() < buffer.length() {
                return Err(Error::new(
                    &place,
                    format!(
                        "holds {} bytes of the {} promised",
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
