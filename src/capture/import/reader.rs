//! What every format reader takes ([`ImportOptions`]) and returns ([`Scan`]).

use crate::capture::import::format::Format;
use crate::capture::scan::ImportedFrame;
use glam::DVec3;
use std::path::PathBuf;

/// What a person may choose about an import.
#[derive(Debug, Clone, Default)]
pub struct ImportOptions {
    /// The layout of the folder; detected from its content if `None`.
    pub format: Option<Format>,
    /// The mesh file, anywhere on disk; `None` takes the scan's own mesh or fuses one from depth.
    pub mesh: Option<PathBuf>,
    /// Voxel edge of a fused mesh in metres.
    pub voxel: Option<f64>,
    /// Every how many-th frame becomes a photograph; 0 and 1 keep all.
    pub every: usize,
    /// At most so many photographs, evenly spaced.
    pub max_frames: Option<usize>,
    /// Whether the scan's poses stay as they are, instead of being refined on photographs and depth images.
    pub keep_poses: bool,
    /// Up direction, written into the capture.
    pub up: Option<DVec3>,
    /// fx, fy, cx, cy of the colour camera in pixels, pixel centres at whole numbers, for scans without intrinsics.
    pub intrinsics: Option<[f64; 4]>,
    /// How Nerfstudio's `applied_transform` is treated.
    pub applied_transform: AppliedTransform,
}

/// How Nerfstudio's `applied_transform`, a transform of the poses after reconstruction, is treated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum AppliedTransform {
    /// Undone for a mesh from elsewhere, kept for a mesh that the file names or that is fused.
    #[default]
    Guess,
    /// Undone: the mesh has the coordinates from before the transform.
    Undo,
    /// Kept: mesh and poses share the transformed coordinates.
    Keep,
}

/// What a format's reader finds.
#[derive(Debug, Default)]
pub struct Scan {
    /// All frames with a pose, in order.
    pub frames: Vec<ImportedFrame>,
    /// The scan's own mesh.
    pub mesh: Option<PathBuf>,
    /// Up direction, where the scan gives one.
    pub up: Option<DVec3>,
    /// Whether the scan's world is left-handed: the frames are already mirrored in z, the mesh is not.
    pub mirrored: bool,
    /// Whether the frames are a video, so that neighbours are nearly equal.
    pub is_video: bool,
    /// Remarks for the person, a line each.
    pub remarks: Vec<String>,
}

impl Scan {
    /// Adds a remark about the photographs whose lens a capture does not support.
    pub fn remark_on_resampled(&mut self) {
        let resampled = self.frames.iter().filter(|f| !f.lens.fits_a_capture());
        let count = resampled.count();
        if count > 0 {
            self.remarks.push(format!(
                "{count} photographs are resampled to a pinhole of the same focal length; what lies outside it is lost"
            ));
        }
    }
}
