//! The input of a solve: a mesh of named objects and posed photographs (a folder in the format of [`read`]).
//!
//! Geometry is f64 in the capture's own coordinates; [`crate::scene::Scene`] recentres it and rounds to f32.

pub mod camera;
pub mod exposure;
pub mod fuse;
pub mod import;
pub mod inputs;
pub mod mesh;
pub mod orientation;
pub mod photograph;
pub mod place;
pub mod poses;
pub mod read;
pub mod reading;
pub mod regroup;
pub mod response;
pub mod scan;
pub mod segment;
pub mod truth;
pub mod working;

use crate::error::Result;
use camera::{Intrinsics, Pose};
use glam::DVec3;
use mesh::Mesh;
use photograph::{Photograph, PhotographSource};
use std::path::PathBuf;
use std::sync::Arc;

/// Geometry and posed photographs.
#[derive(Debug, Clone)]
pub struct Capture {
    /// The name shown to people: the folder's name, or "built-in room".
    pub name: String,
    /// The folder, if the capture came from one.
    pub folder: Option<PathBuf>,
    /// Triangles grouped in objects.
    pub mesh: Mesh,
    /// How to segment a mesh without objects. The reader does not segment it.
    pub segmentation: Option<Segmentation>,
    /// Posed photographs, in the order of transforms.json.
    pub frames: Vec<Frame>,
    /// Unit up vector: the cameras' mean up unless overruled.
    pub up: DVec3,
    /// Problems that were worked around, each a full sentence naming file and field.
    pub warnings: Vec<String>,
}

/// How to segment a mesh without objects (see [`segment`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    /// The mesh's file.
    pub file: PathBuf,
    /// The number of segments that the person gave.
    pub wanted: Option<usize>,
}

/// One posed photograph.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Lens and sensor.
    pub intrinsics: Intrinsics,
    /// Camera to world.
    pub pose: Pose,
    /// Linear multiplier: radiance = value / exposure. `None` where neither transforms.json nor EXIF gives one.
    pub exposure: Option<f64>,
    /// Where the pixels come from.
    pub photograph: PhotographSource,
    /// 16-bit depth image and metres per unit, where the capture has one.
    pub depth: Option<(PathBuf, f64)>,
}

impl Frame {
    /// Reads the photograph (values divided by the exposure, if one is given).
    ///
    /// # Errors
    /// The file cannot be read, is not an image, or has another size than the camera.
    pub fn load(&self) -> Result<Arc<Photograph>> {
        Ok((self.photograph.load(&self.intrinsics, self.exposure)?).0)
    }
}
