//! The true materials and lights of a capture, read by `evaluate` only: no solver imports this.

use crate::capture::camera::Intrinsics;
use crate::capture::orientation::Orientation;
use crate::capture::photograph::Photograph;
use crate::capture::read::confine::Confine;
use crate::capture::read::fields::without_bom;
use crate::capture::read::image;
use crate::error::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

const MAX_BYTES: u64 = 1 << 28;

/// The content of truth.json.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The truth about each object, by name.
    pub objects: BTreeMap<String, ObjectTruth>,
}

/// The truth about an object.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectTruth {
    /// Diffuse reflectance; its mean if `textured`. `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo: Option<DVec3>,
    /// Emitted radiance.
    #[serde(default)]
    pub emission: DVec3,
    /// Mean radiance that leaves the object, emitted and reflected, where it differs from the emission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exitance: Option<DVec3>,
    /// GGX roughness of the specular lobe; `None` for diffuse objects.
    #[serde(default)]
    pub roughness: Option<f64>,
    /// Whether the albedo varies over the surface.
    #[serde(default)]
    pub textured: bool,
}

impl ObjectTruth {
    /// Whether the object emits.
    pub fn is_emitter(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}

impl Truth {
    /// Reads truth.json of the capture in `folder`.
    ///
    /// # Errors
    /// The file is absent or broken, or holds an impossible number.
    pub fn read(folder: &Path) -> Result<Self> {
        let place = folder.join("truth.json");
        let path = Confine::new(folder, false)?.file(&place.display().to_string(), "truth.json")?;
        let length = path.metadata().map_err(|e| Error::io(&path, &e))?.len();
        if length > MAX_BYTES {
            return Err(Error::file(
                &path,
                "is too long",
                "check that it is a truth file",
            ));
        }
        let text = std::fs::read(&path).map_err(|e| Error::io(&path, &e))?;
        let truth: Self = serde_json::from_slice(without_bom(&text)).map_err(|e| {
            Error::file(
                &path,
                format!("is not a valid truth: {e}"),
                "correct the file",
            )
        })?;
        for (name, object) in &truth.objects {
            let possible = |v: DVec3| v.is_finite() && v.min_element() >= 0.0;
            let fields = [
                ("albedo", object.albedo.unwrap_or_default()),
                ("emission", object.emission),
                ("exitance", object.exitance.unwrap_or_default()),
            ];
            if let Some((field, value)) = fields.into_iter().find(|&(_, value)| !possible(value)) {
                return Err(Error::new(
                    format!("{}: objects.{name}.{field}", path.display()),
                    format!("{value} is impossible"),
                    "give three numbers of zero or more",
                ));
            }
        }
        Ok(truth)
    }
}

/// The true albedo of each pixel of a frame, from truth/albedo_NNN.exr; `None` if there is no such file.
///
/// # Errors
/// The file is broken or has another size than the frame.
pub fn read_albedo(
    folder: &Path,
    frame: usize,
    intrinsics: &Intrinsics,
) -> Result<Option<Photograph>> {
    let name = format!("truth/albedo_{frame:03}.exr");
    let confine = Confine::new(folder, false)?;
    if !confine.holds(&name) {
        return Ok(None);
    }
    let place = folder.join(&name).display().to_string();
    let path = confine.file(&place, &name)?;
    Ok(Some(
        image::read(&path, Orientation::default(), intrinsics, None)?.0,
    ))
}
