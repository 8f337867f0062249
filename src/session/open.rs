//! From a source to a capture that can be solved and shown.

use crate::capture::Capture;
use crate::capture::photograph::PhotographSource;
use crate::capture::read::{ReadOptions, read};
use crate::capture::regroup::regroup;
use crate::capture::working::load_working;
use crate::error::{Error, Result};
use crate::inverse::faces::cut_up;
use crate::room;
use crate::scene::prepare::prepare;
use crate::session::command::{OpenOptions, Source};
use crate::session::snapshot::OpenCapture;
use std::fs;
use std::sync::Arc;

/// Most pixels that are solved for; larger photographs are reduced together.
const WORKING_PIXELS: u64 = 4_000_000;

/// Reads a capture and its photographs.
///
/// # Errors
/// Something in it is missing or broken.
pub fn open(source: &Source, options: &OpenOptions) -> Result<OpenCapture> {
    let capture = match source {
        Source::BuiltInRoom => room::capture(),
        Source::Folder(folder) => read(
            folder,
            &ReadOptions {
                up: options.up,
                segments: options.segments.map(|n| n as usize),
                allow_outside: options.allow_outside,
            },
        ),
    }?;
    OpenCapture::new(source.clone(), options.clone(), capture)
}

impl OpenCapture {
    /// Prepares a capture for solving: scene, photographs, summary, hash.
    ///
    /// # Errors
    /// The mesh holds nothing to solve, or a photograph cannot be read.
    pub fn new(source: Source, options: OpenOptions, capture: Capture) -> Result<Self> {
        // Results belong to a capture in whatever coordinates.
        let hash = hash(&capture)?;
        let mut capture = capture.placed(options.up, &options.coordinates)?;
        let working = load_working(&capture, WORKING_PIXELS)?;
        if let Some(cut) = capture.cut.clone() {
            cut_up(&mut capture, &cut, &working, options.hold_out)?;
        }
        regroup(&mut capture.mesh, &options.objects)?;
        let prepared = prepare(&capture, &working)?;
        Ok(Self {
            name: capture.name.clone(),
            hash,
            source,
            options,
            summary: prepared.summary(),
            warnings: prepared.warnings,
            scene: Arc::new(prepared.scene),
            photographs: prepared.photographs,
            capture: Arc::new(capture),
        })
    }
}

/// Hash of what an estimate depends on: mesh, cameras, exposures and the bytes of the photographs.
fn hash(capture: &Capture) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let mesh = &capture.mesh;
    hasher.update(&(mesh.positions.len() as u64).to_le_bytes());
    for position in &mesh.positions {
        for v in position.to_array() {
            hasher.update(&v.to_le_bytes());
        }
    }
    for triangle in &mesh.triangles {
        for i in triangle {
            hasher.update(&i.to_le_bytes());
        }
    }
    for frame in &capture.frames {
        let k = &frame.intrinsics;
        hasher.update(format!("{k:?} {:?} {:?}", frame.pose, frame.exposure).as_bytes());
        match &frame.photograph {
            PhotographSource::File(path) => {
                let bytes = fs::read(path).map_err(|error| Error::io(path, &error))?;
                hasher.update(blake3::hash(&bytes).as_bytes());
            }
            PhotographSource::Memory(photograph) => {
                for pixel in &photograph.pixels {
                    for v in pixel.to_array() {
                        hasher.update(&v.to_le_bytes());
                    }
                }
            }
        }
    }
    Ok(hasher.finalize().to_hex().to_string())
}
