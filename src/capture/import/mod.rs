//! Scans of other programs, turned into what a capture holds: posed photographs with their lenses, and a mesh.
//!
//! A format's reader gives a [`Scan`]: every frame whose pose is known, and the mesh if the scan has one. What all formats
//! share is done here: frames are chosen, the mesh is read, or fused from the depth images ([`crate::capture::fuse`]).
//! Nothing outside the scan's folder is opened, but for a mesh that the person names.

mod colmap;
pub mod depth;
mod folder;
mod format;
mod geometry;
mod lens;
mod matrix;
mod matterport;
mod nerf;
mod rgbd;

pub use depth::DepthImage;
pub use format::Format;
pub use lens::{Lens, Model};

use crate::capture::camera::Pose;
use crate::capture::fuse::MAX_BYTES;
use crate::capture::mesh::Mesh;
use crate::error::{Error, Result};
use folder::Folder;
use glam::DVec3;
use std::path::{Path, PathBuf};

/// Photographs taken of a video, where the person does not say how many.
const PHOTOGRAPHS_OF_A_VIDEO: usize = 200;

/// No depth image has units of so many metres.
const MAX_UNIT: f64 = 1000.0;

/// What a person may choose about an import.
#[derive(Debug, Clone, Default)]
pub struct ImportOptions {
    /// The layout of the folder; found by its content if `None`.
    pub format: Option<Format>,
    /// The mesh, wherever it lies; otherwise the scan's own or one fused from depth.
    pub mesh: Option<PathBuf>,
    /// Edge of the voxels of a fused mesh in metres.
    pub voxel: Option<f64>,
    /// Every how many-th frame becomes a photograph; 0 and 1 are all.
    pub every: usize,
    /// At most so many photographs, evenly spaced.
    pub max_frames: Option<usize>,
    /// Up direction, written into the capture.
    pub up: Option<DVec3>,
    /// fx, fy, cx, cy of the colour camera in pixels, pixel centres at whole numbers, for scans that do not say.
    pub intrinsics: Option<[f64; 4]>,
    /// What becomes of Nerfstudio's `applied_transform`.
    pub applied_transform: AppliedTransform,
}

/// What becomes of Nerfstudio's `applied_transform`, which moved the poses after they were found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum AppliedTransform {
    /// Undone for a mesh that comes from elsewhere, kept for one that the file names or that is fused.
    #[default]
    Guess,
    /// Undone: the mesh has the coordinates from before it.
    Undo,
    /// Kept: mesh and poses share its coordinates.
    Keep,
}

/// A photograph to be, and its depth image.
#[derive(Debug, Clone)]
pub struct ImportedFrame {
    /// The image file.
    pub photograph: PathBuf,
    /// Its camera.
    pub lens: Lens,
    /// Camera to world, right-handed, OpenGL's camera axes.
    pub pose: Pose,
    /// Linear multiplier: radiance = value / exposure, where the scan says.
    pub exposure: Option<f64>,
    /// A grey image of the photograph's size, dark where the photograph may not be used.
    pub mask: Option<PathBuf>,
    /// What a depth camera at the same place saw.
    pub depth: Option<DepthImage>,
}

/// What is needed to write a capture.
#[derive(Debug, Clone)]
pub struct Import {
    /// Photographs in the scan's order, at least one.
    pub frames: Vec<ImportedFrame>,
    /// Geometry in the poses' coordinates.
    pub mesh: Mesh,
    /// Whether `mesh` is cut into objects that mean something.
    pub has_objects: bool,
    /// Up direction, if known better than by the cameras' mean up.
    pub up: Option<DVec3>,
    /// What was found, guessed and left out, a line each.
    pub said: Vec<String>,
}

/// What a format's reader finds.
#[derive(Debug, Default)]
struct Scan {
    /// All frames with a pose, in order.
    frames: Vec<ImportedFrame>,
    /// The scan's own mesh.
    mesh: Option<PathBuf>,
    /// Up direction, where the scan says.
    up: Option<DVec3>,
    /// Whether the scan's world is left-handed: the frames are mirrored in z already, a mesh still has to be.
    mirrored: bool,
    /// Whether neighbouring frames show nearly the same.
    is_video: bool,
    /// Remarks, a line each.
    said: Vec<String>,
}

/// Reads the scan in a folder; fusing tells `progress` how many of how many frames are done.
///
/// # Errors
/// The format is not recognised, a file is missing or broken, no frame has a pose, there is neither mesh nor depth, or the
/// voxels asked for need more than [`MAX_BYTES`].
pub fn read(
    source: &Path,
    options: &ImportOptions,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Import> {
    if options.up.is_some_and(|up| up.try_normalize().is_none()) {
        return Err(Error::usage(
            "--up",
            "the up vector has no length",
            "give a direction, e.g. 0,0,1",
        ));
    }
    let folder = Folder::new(source)?;
    let mut said = Vec::new();
    let format = match options.format {
        Some(format) => format,
        None => {
            let format = format::detect(&folder)?;
            said.push(format!(
                "taken for {} by its files; --format overrules",
                format.description()
            ));
            format
        }
    };
    let mut scan = match format {
        Format::SevenScenes => rgbd::seven_scenes::read(&folder, options)?,
        Format::ScanNet => rgbd::scannet::read(&folder)?,
        Format::Tum => rgbd::tum::read(&folder, options, false)?,
        Format::IclNuim => rgbd::tum::read(&folder, options, true)?,
        Format::Colmap => colmap::read(&folder)?,
        Format::Nerfstudio => nerf::read(&folder, options)?,
        Format::Matterport => matterport::read(&folder)?,
        Format::Open3d => rgbd::open3d::read(&folder, options)?,
    };
    said.append(&mut scan.said);
    check(source, &scan.frames)?;

    // The mesh: named, the scan's own, or fused from every frame's depth.
    let named = options.mesh.as_ref();
    let (mesh, has_objects) = match named.or(scan.mesh.as_ref()) {
        Some(path) => geometry::read(path, &folder, scan.mirrored, &mut said)?,
        None => (
            geometry::fuse(source, &scan.frames, options.voxel, &mut said, progress)?,
            false,
        ),
    };
    let frames = choose(scan.frames, options, scan.is_video, &mut said);
    Ok(Import {
        frames,
        mesh,
        has_objects,
        up: options.up.or(scan.up),
        said,
    })
}

/// Refuses a scan without frames and lenses that cannot be.
fn check(source: &Path, frames: &[ImportedFrame]) -> Result<()> {
    if frames.is_empty() {
        return Err(Error::file(
            source,
            "no photograph has a pose",
            "check that poses and photographs belong together",
        ));
    }
    for frame in frames {
        let lenses = [Some(frame.lens), frame.depth.as_ref().map(|d| d.lens)];
        if !lenses.iter().flatten().all(Lens::is_possible) {
            return Err(Error::file(
                &frame.photograph,
                "its camera has a focal length or coefficient that is impossible",
                "correct the intrinsics",
            ));
        }
        if let Some(depth) = &frame.depth
            && !(depth.metres_per_unit > 0.0 && depth.metres_per_unit < MAX_UNIT)
        {
            return Err(Error::file(
                &depth.path,
                format!("a depth unit of {} m is impossible", depth.metres_per_unit),
                "give the metres per unit",
            ));
        }
        if let Some(exposure) = frame.exposure
            && !(exposure > 0.0 && exposure.is_finite())
        {
            return Err(Error::file(
                &frame.photograph,
                format!("an exposure of {exposure} is impossible"),
                "give a positive multiplier",
            ));
        }
    }
    Ok(())
}

/// The frames that become photographs.
fn choose(
    frames: Vec<ImportedFrame>,
    options: &ImportOptions,
    is_video: bool,
    said: &mut Vec<String>,
) -> Vec<ImportedFrame> {
    let total = frames.len();
    let step = options.every.max(1);
    let mut frames: Vec<ImportedFrame> = frames.into_iter().step_by(step).collect();
    let asked = options.every > 0 || options.max_frames.is_some();
    let most = match options.max_frames {
        Some(most) => most.max(1),
        None if is_video && !asked => PHOTOGRAPHS_OF_A_VIDEO,
        None => usize::MAX,
    };
    if frames.len() > most {
        let count = frames.len();
        let mut index = 0..;
        frames.retain(|_| {
            // Keeps the first index of each of `most` equal parts.
            let i = index.next().unwrap_or(0);
            i == 0 || i * most / count != (i - 1) * most / count
        });
    }
    let how = match (frames.len() < total, asked) {
        (false, _) => String::new(),
        (true, true) => format!(" of {total}"),
        (true, false) => {
            format!(" of {total}, evenly spaced; --every and --most-frames choose others")
        }
    };
    said.push(format!("photographs: {}{how}", frames.len()));
    frames
}

/// The bound on memory of a fused mesh's voxels, in words.
fn memory_bound() -> String {
    format!("{} GiB", MAX_BYTES >> 30)
}
