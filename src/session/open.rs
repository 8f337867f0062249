//! Opens a capture for solving and display.

use crate::calibrate::alignment::{Alignment, Decision};
use crate::calibrate::photographs::{leave_out, leave_out_mispaired, name, without_hot_pixels};
use crate::calibrate::segments::segment_mesh;
use crate::capture::Capture;
use crate::capture::photograph::{Photograph, PhotographSource};
use crate::capture::read::{ReadOptions, read};
use crate::capture::reading::Reading;
use crate::capture::regroup::regroup;
use crate::capture::working::{WORKING_PIXELS, Working, load_working};
use crate::error::{Error, Result};
use crate::inverse::estimate::Estimate;
use crate::room;
use crate::scene::Scene;
use crate::scene::prepare::{Prepared, prepare};
use crate::session::command::{OpenOptions, Source};
use crate::session::open_capture::OpenCapture;
use std::fs;
use std::sync::Arc;

/// Reads a capture and its photographs.
///
/// # Errors
/// A part of the capture is missing or broken.
pub fn open(source: &Source, options: &OpenOptions) -> Result<OpenCapture> {
    let capture = match source {
        Source::BuiltInRoom => Ok(room::capture()?.read_as(&options.reading)),
        Source::Folder(folder) => read(
            folder,
            &ReadOptions {
                up: options.up,
                segments: options.segments.map(|n| n as usize),
                reading: options.reading,
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
    /// The mesh is empty, or a photograph cannot be read.
    pub fn new(source: Source, options: OpenOptions, capture: Capture) -> Result<Self> {
        // Hash before the change of coordinates: results belong to a capture in any coordinates.
        let hash = hash(&capture)?;
        let mut capture = capture.placed(options.up, &options.coordinates)?;
        let mut working = load_working(&capture, WORKING_PIXELS)?;
        leave_out(&capture, &mut working)?;
        let check = options.check_alignment;
        let alignment = check.then(|| alignment(&capture, &working)).transpose()?;
        if let Some(alignment) = &alignment {
            leave_out_mispaired(&capture, &mut working, &alignment.mispaired);
        }
        if let Some(cut) = capture.segmentation.clone() {
            segment_mesh(&mut capture, &cut, &working, options.hold_out)?;
        }
        regroup(&mut capture.mesh, &options.objects)?;
        let prepared = prepare(&capture, &working).map_err(|error| {
            let alignment = alignment.as_ref();
            let read_wrongly = alignment.and_then(|a| a.error(&capture.name, &options.reading));
            read_wrongly.unwrap_or(error)
        })?;
        let mut warnings = prepared.warnings.clone();
        let photographs = remove_hot_pixels(&capture, &prepared, &mut warnings);
        warnings.extend(alignment.as_ref().and_then(Alignment::warning));
        Ok(Self {
            name: capture.name.clone(),
            hash,
            source,
            options,
            summary: prepared.summary(),
            warnings,
            scene: Arc::new(prepared.scene),
            photographs,
            capture: Arc::new(capture),
            alignment,
        })
    }

    /// The reading with which photographs and mesh agree, if they clearly disagree as the capture is read now.
    pub fn other_reading(&self) -> Option<Reading> {
        match self.alignment.as_ref()?.decision {
            Decision::Wrong { reading, .. } => Some(self.options.reading.then(&reading)),
            _ => None,
        }
    }

    /// Marks an estimate as undetermined if the photographs may not show the mesh from their poses. The standard
    /// error of each albedo is then at least that of a uniform distribution over [0, 1], about the estimate.
    pub fn marked_doubtful(&self, mut estimate: Estimate) -> Estimate {
        match self.alignment.as_ref().map(|alignment| &alignment.decision) {
            None | Some(Decision::Sound) => return estimate,
            Some(Decision::Doubtful | Decision::Wrong { .. }) => {}
        }
        for object in &mut estimate.objects {
            let off = object.albedo - 0.5;
            let guess = (off * off + 1.0 / 12.0).map(f32::sqrt);
            object.albedo_stderr = object.albedo_stderr.max(guess);
            object.identifiable = false;
            object.note = "the photographs may not show it from their poses".into();
        }
        estimate
    }

    /// Refuses a capture whose photographs clearly do not show the mesh from their poses.
    pub(crate) fn aligned(self) -> Result<Self> {
        let alignment = self.alignment.as_ref();
        let error = alignment.and_then(|a| a.error(&self.name, &self.options.reading));
        error.map_or(Ok(self), Err)
    }
}

/// Removes hot pixels from the photographs, with a warning for each photograph.
fn remove_hot_pixels(
    capture: &Capture,
    prepared: &Prepared,
    warnings: &mut Vec<String>,
) -> Vec<Arc<Photograph>> {
    let scene = &prepared.scene;
    let cleaned = (prepared.photographs.iter().enumerate()).map(|(frame, photograph)| {
        let seen = &scene.ids().triangles[frame];
        let object = |pixel: usize| scene.object_of.get(seen[pixel] as usize).copied();
        let Some((cleaned, count)) = without_hot_pixels(photograph, object) else {
            return photograph.clone();
        };
        warnings.push(format!(
            "{}: {count} pixels are a thousand times as bright as all around them and are left out",
            name(capture, frame)
        ));
        cleaned
    });
    cleaned.collect()
}

/// Checks how well the photographs agree with the mesh.
fn alignment(capture: &Capture, working: &Working) -> Result<Alignment> {
    let scene = Scene::new(&capture.at(working))?;
    Ok(Alignment::new(&scene, &working.photographs))
}

/// Hash of everything that an estimate depends on: mesh, cameras, exposures and photograph files.
fn hash(capture: &Capture) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let mesh = &capture.mesh;
    hasher.update(&(mesh.positions.len() as u64).to_le_bytes());
    for v in mesh.positions.iter().flat_map(|p| p.to_array()) {
        hasher.update(&v.to_le_bytes());
    }
    for i in mesh.triangles.iter().flatten() {
        hasher.update(&i.to_le_bytes());
    }
    for frame in &capture.frames {
        let k = &frame.intrinsics;
        hasher.update(format!("{k:?} {:?} {:?}", frame.pose, frame.exposure).as_bytes());
        match &frame.photograph {
            PhotographSource::File(path, _) => {
                let bytes = fs::read(path).map_err(|error| Error::io(path, &error))?;
                hasher.update(blake3::hash(&bytes).as_bytes());
            }
            PhotographSource::Memory(photograph) => {
                for v in photograph.pixels.iter().flat_map(|p| p.to_array()) {
                    hasher.update(&v.to_le_bytes());
                }
            }
        }
    }
    Ok(hasher.finalize().to_hex().to_string())
}
