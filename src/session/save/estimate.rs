//! `estimate.json`: everything that later commands need, except the maps beside it.

use crate::capture::exposure::Vignetting;
use crate::capture::response::{Response, TERMS};
use crate::error::{Error, Result};
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::inverse::settings::{PARAMETERS, Settings};
use crate::inverse::solver::{Checkpoint, Termination};
use crate::math::nullable::{Rgb, rgb};
use crate::scene::Object;
use crate::session::command::{OpenOptions, Source};
use crate::session::edits::EditsRecord;
use crate::session::open_capture::OpenCapture;
use crate::session::save::maps::{self, Maps};
use crate::session::save::named::Named;
use crate::session::save::results::Results;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};

/// Version of the format; newer ones are refused.
pub const VERSION: u32 = 1;

/// Largest power of the cosine in a lens's vignetting.
const MAX_POWER: f32 = 100.0;

/// The content of `estimate.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EstimateFile {
    /// [`VERSION`] at the time of writing.
    pub version: u32,
    pub relit: String,
    pub capture: CaptureReference,
    pub settings: Settings,
    /// Why the solve ended; `null` during a solve.
    pub stopped_because: Option<Termination>,
    pub objects: Named<ObjectEstimate>,
    /// File name of the maps (see [`maps::encode`]).
    pub maps: Option<String>,
    /// Each frame's linear exposure and white balance; their median is 1 in each channel.
    pub exposures: Option<Vec<Rgb>>,
    /// The power of the [`Vignetting`] of all frames.
    #[serde(default)]
    pub vignetting: Option<Rgb>,
    /// The terms of the camera's [`Response`].
    #[serde(default)]
    pub response: Option<[Rgb; TERMS]>,
    /// [`Estimate::common_error`].
    #[serde(default)]
    pub albedo_common_stderr: f32,
    /// Edits by hand; `objects` and the maps are without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edits: Option<EditsRecord>,
}

/// The content of `checkpoint.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct CheckpointFile {
    pub(super) estimate: EstimateFile,
    pub(super) checkpoint: Option<Checkpoint>,
}

/// Reference to a capture: where it is, and its hash.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaptureReference {
    pub name: String,
    /// Whether it is the built-in room, which has no path.
    pub built_in: bool,
    /// Path relative to the folder of `estimate.json`, with forward slashes.
    pub relative: Option<String>,
    pub absolute: Option<PathBuf>,
    pub hash: String,
    pub options: OpenOptions,
}

impl EstimateFile {
    /// The content to write into `folder`, and the bytes of the maps.
    pub fn new(folder: &Path, results: &Results) -> Result<(Self, Option<Vec<u8>>)> {
        let (capture, estimate) = (&results.capture, &results.estimate);
        let bytes = maps::encode(estimate)?;
        // Named by its content, so that estimate.json never refers to maps of another run.
        let maps = bytes.as_ref().map(|bytes| {
            let hash = blake3::hash(bytes).to_hex();
            format!("maps-{}.safetensors", &hash.as_str()[..12])
        });
        let exposures = estimate.exposures.as_ref();
        let file = Self {
            version: VERSION,
            relit: env!("CARGO_PKG_VERSION").to_owned(),
            capture: CaptureReference::new(folder, capture),
            settings: results.settings.clone(),
            stopped_because: results.stopped_because,
            objects: Named::objects(&capture.scene, estimate),
            maps,
            exposures: exposures.map(|all| all.iter().copied().map(rgb).collect()),
            vignetting: estimate.vignetting.map(|v| rgb(v.power)),
            response: estimate.response.map(|r| r.terms.map(rgb)),
            albedo_common_stderr: estimate.common_error,
            edits: results.edits.record(&capture.scene),
        };
        Ok((file, bytes))
    }

    /// Checks the version and the ranges of all values.
    ///
    /// # Errors
    /// The version is newer, or a value is out of range.
    pub fn check(&self, path: &Path) -> Result<()> {
        if self.version > VERSION {
            let place = format!("{}: version", path.display());
            let problem = format!("{} is newer than {VERSION}, the newest known", self.version);
            return Err(Error::new(place, problem, "use a newer relit"));
        }
        let mut settings = Settings::default();
        for parameter in PARAMETERS {
            let checked = parameter.set(&mut settings, &parameter.get(&self.settings));
            checked.map_err(|allowed| {
                let place = format!("{}: settings.{}", path.display(), parameter.name);
                Error::new(place, allowed, "correct it, or solve again")
            })?;
        }
        let impossible = |field: &str| {
            let place = format!("{}: {field}", path.display());
            let remedy = "correct it, or solve again";
            Err(Error::new(place, "holds an impossible value", remedy))
        };
        for (name, object) in &self.objects.0 {
            if let Some(field) = object.impossible() {
                return impossible(&format!("objects.{name}.{field}"));
            }
        }
        let exposures = self.exposures.iter().flatten().flatten().flatten();
        if !exposures.into_iter().all(|&e| e.is_finite() && e > 0.0) {
            return impossible("exposures");
        }
        if !(self.albedo_common_stderr.is_finite() && self.albedo_common_stderr >= 0.0) {
            return impossible("albedo_common_stderr");
        }
        let max = Vec3::splat(MAX_POWER);
        if (self.vignetting()).is_some_and(|v| !v.power.abs().cmple(max).all()) {
            return impossible("vignetting");
        }
        if (self.response()).is_some_and(|response| !response.is_possible()) {
            return impossible("response");
        }
        Ok(())
    }

    /// Reads the maps of this file, which lies in `folder`.
    pub fn read_maps(&self, folder: &Path) -> Result<Maps> {
        let Some(name) = &self.maps else {
            return Ok(Maps::default());
        };
        let path = folder.join(name);
        if Path::new(name).file_name() != Some(name.as_ref()) {
            let problem = "maps have to lie beside estimate.json";
            let remedy = "put the file there and name it without a folder";
            return Err(Error::file(&path, problem, remedy));
        }
        maps::decode(&path, &read_whole(&path)?)
    }

    /// The estimate for a capture's objects.
    ///
    /// # Errors
    /// An object of the capture has no entry, or the maps belong to another mesh.
    pub fn estimate(&self, path: &Path, maps: &Maps, capture: &OpenCapture) -> Result<Estimate> {
        let scene = &capture.scene;
        let wrong = |field: &str, problem: &str| {
            let remedy = "name the capture it was made from, or solve again";
            Error::new(format!("{}: {field}", path.display()), problem, remedy)
        };
        let entry = |object: &Object| {
            self.objects.get(&object.name).cloned().ok_or_else(|| {
                let problem = format!("no entry for object \"{}\" of the capture", object.name);
                wrong("objects", &problem)
            })
        };
        let objects: Vec<_> = scene.objects.iter().map(entry).collect::<Result<_>>()?;
        let misfit = "does not fit the capture's mesh";
        if let Some(texels) = &maps.texels
            && (texels.colors.layout.levels.len() != scene.triangles.len()
                || texels.textured.len() != objects.len())
        {
            return Err(wrong("maps", misfit));
        }
        let exposures = self.exposures.as_ref();
        if exposures.is_some_and(|all| all.len() != scene.cameras.len()) {
            return Err(wrong("exposures", misfit));
        }
        let exposure = |rgb: &Rgb| Vec3::from_array(rgb.map(|v| v.unwrap_or(1.0)));
        Ok(Estimate {
            objects,
            texels: maps.texels.clone(),
            outside: maps.outside.clone(),
            exposures: exposures.map(|all| all.iter().map(exposure).collect()),
            vignetting: self.vignetting(),
            response: self.response(),
            common_error: self.albedo_common_stderr,
        })
    }

    fn vignetting(&self) -> Option<Vignetting> {
        let power = self.vignetting.map(color)?;
        Some(Vignetting { power })
    }

    fn response(&self) -> Option<Response> {
        let terms = self.response?.map(color);
        Some(Response { terms })
    }
}

fn color(rgb: Rgb) -> Vec3 {
    Vec3::from_array(rgb.map(|v| v.unwrap_or(f32::NAN)))
}

impl CaptureReference {
    fn new(folder: &Path, capture: &OpenCapture) -> Self {
        let absolute = match &capture.source {
            Source::BuiltInRoom => None,
            Source::Folder(path) => std::path::absolute(path).ok(),
        };
        let relative = absolute
            .as_ref()
            .zip(std::path::absolute(folder).ok())
            .and_then(|(capture, folder)| relative(&folder, capture));
        Self {
            name: capture.name.clone(),
            built_in: capture.source == Source::BuiltInRoom,
            relative,
            absolute,
            hash: capture.hash.clone(),
            options: capture.options.clone(),
        }
    }

    /// Where the capture is: at the relative path from `folder` if it exists, else at the absolute path.
    pub fn source(&self, folder: &Path) -> Source {
        if self.built_in {
            return Source::BuiltInRoom;
        }
        let relative = self.relative.as_ref().map(|path| folder.join(path));
        match (relative, &self.absolute) {
            (Some(relative), _) if relative.is_dir() => Source::Folder(relative),
            (_, Some(absolute)) => Source::Folder(absolute.clone()),
            (Some(relative), None) => Source::Folder(relative),
            (None, None) => Source::Folder(folder.to_owned()),
        }
    }
}

/// Reads a regular file; a pipe or device might never end.
pub(super) fn read_whole(path: &Path) -> Result<Vec<u8>> {
    let io = |error: std::io::Error| Error::io(path, &error);
    let metadata = fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        return Err(Error::file(path, "is no regular file", "restore the file"));
    }
    fs::read(path).map_err(io)
}

/// The relative path between two absolute folders, with forward slashes; `None` if they have no common root.
fn relative(from: &Path, to: &Path) -> Option<String> {
    let (from, to): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return None;
    }
    let up = from[shared..].iter().map(|_| Some(".."));
    let down = to[shared..].iter().map(|part| part.as_os_str().to_str());
    let parts: Vec<&str> = up.chain(down).collect::<Option<_>>()?;
    Some(match parts.is_empty() {
        true => ".".to_owned(),
        false => parts.join("/"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn relative_paths_lead_back() {
        let path = |from: &str, to: &str| relative(Path::new(from), Path::new(to));
        assert_eq!(path("/a/b/out", "/a/room").as_deref(), Some("../../room"));
        assert_eq!(path("/a", "/a/b/c").as_deref(), Some("b/c"));
        assert_eq!(path("/a", "/a").as_deref(), Some("."));
    }
}
