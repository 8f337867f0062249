//! Imports scans of other programs: posed photographs with their lenses, and a mesh.
//!
//! Each format's reader has `is_here`, whether a folder has its layout, and `read`, which returns a `Scan`: every frame with a
//! known pose, and the mesh if the scan has one. It fails if a file is missing, broken or outside the folder. This module does what
//! all formats share: it selects frames and reads the mesh or fuses one from the depth images ([`crate::capture::fuse`]). Nothing
//! outside the scan's folder is opened except a mesh that the person names.

mod colmap;
mod folder;
mod geometry;
mod matrix;
mod matterport;
mod nerf;
mod rgbd;

pub use crate::capture::scan::{DepthImage, ImportedFrame, Lens, Model};

use crate::capture::mesh::Mesh;
use crate::capture::poses;
use crate::error::{Error, Result};
use folder::Folder;
use glam::DVec3;
use std::path::{Path, PathBuf};

/// Photographs selected from a video by default.
const PHOTOGRAPHS_OF_A_VIDEO: usize = 200;

/// Metres per depth unit at and above which a depth image is refused.
const MAX_UNIT: f64 = 1000.0;

/// A layout of a scan's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// 7-Scenes and 3DMatch: `frame-N.color.png`, `.depth.png`, `.pose.txt`, possibly in `seq-NN`.
    SevenScenes,
    /// ScanNet as its exporter writes it: `color`, `depth`, `pose`, `intrinsic`.
    ScanNet,
    /// TUM RGB-D: `rgb.txt`, `depth.txt`, `groundtruth.txt`.
    Tum,
    /// ICL-NUIM: as TUM, with a left-handed camera.
    IclNuim,
    /// Open3D's reconstruction system and Redwood: colour and depth folders, a trajectory, camera_intrinsic.json.
    Open3d,
    /// A COLMAP model, text or binary, with its photographs and a mesh.
    Colmap,
    /// transforms.json of Nerfstudio, instant-ngp, Polycam, Record3D.
    Nerfstudio,
    /// A house of Matterport3D.
    Matterport,
}

impl Format {
    /// All layouts, with their names for `--format`.
    pub const ALL: &[(&str, Self)] = &[
        ("7scenes", Self::SevenScenes),
        ("scannet", Self::ScanNet),
        ("tum", Self::Tum),
        ("icl-nuim", Self::IclNuim),
        ("open3d", Self::Open3d),
        ("colmap", Self::Colmap),
        ("nerfstudio", Self::Nerfstudio),
        ("matterport", Self::Matterport),
    ];

    /// A description for messages.
    pub fn description(self) -> &'static str {
        match self {
            Self::SevenScenes => "7-Scenes (frame-N.color, .depth, .pose)",
            Self::ScanNet => "a ScanNet export (color, depth, pose, intrinsic)",
            Self::Tum => "TUM RGB-D (rgb.txt, depth.txt, groundtruth.txt)",
            Self::IclNuim => "ICL-NUIM (TUM's layout, left-handed camera)",
            Self::Open3d => "Open3D's reconstruction system (colour, depth, trajectory)",
            Self::Colmap => "a COLMAP model (cameras, images)",
            Self::Nerfstudio => "Nerfstudio (transforms.json)",
            Self::Matterport => "a house of Matterport3D",
        }
    }
}

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
    /// fx, fy, cx, cy of the colour camera in pixels, pixel centres at whole numbers, for scans without intrinsics. A principal
    /// point of exactly half the size is the middle.
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
struct Scan {
    /// All frames with a pose, in order.
    frames: Vec<ImportedFrame>,
    mesh: Option<PathBuf>,
    /// Up direction, where the scan gives one.
    up: Option<DVec3>,
    /// Whether the scan's world is left-handed: the frames are already mirrored in z, the mesh is not.
    mirrored: bool,
    /// Whether the frames are a video, so that neighbours are nearly equal.
    is_video: bool,
    remarks: Vec<String>,
}

impl Scan {
    /// Adds a remark about the photographs whose lens a capture does not support.
    fn remark_on_resampled(&mut self) {
        let resampled = self.frames.iter().filter(|f| !f.lens.fits_a_capture());
        let count = resampled.count();
        if count > 0 {
            self.remarks.push(format!(
                "{count} photographs are resampled to a pinhole of the same focal length; what lies outside it is lost"
            ));
        }
    }
}

/// What is needed to write a capture.
#[derive(Debug, Clone)]
pub struct Import {
    /// Photographs in the scan's order, at least one.
    pub frames: Vec<ImportedFrame>,
    /// Geometry in the poses' coordinates.
    pub mesh: Mesh,
    /// Whether the mesh file defines objects.
    pub has_objects: bool,
    /// Up direction; `None` leaves the cameras' mean up.
    pub up: Option<DVec3>,
    /// What was found, guessed and left out, a line each.
    pub remarks: Vec<String>,
}

/// Reads the scan in a folder. While depth is fused, `progress` gets the number of fused frames and of all frames.
///
/// # Errors
/// The format is not recognised, a file is missing or broken, no frame has a pose, there is neither mesh nor depth, or the
/// voxels need more than [`crate::capture::fuse::MAX_BYTES`].
pub fn read(
    source: &Path,
    options: &ImportOptions,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Import> {
    if options.up.is_some_and(|up| up.try_normalize().is_none()) {
        return Err(Error::usage(
            "--up",
            "the up vector is zero",
            "give a direction, e.g. 0,0,1",
        ));
    }
    let folder = Folder::new(source)?;
    let mut remarks = Vec::new();
    let format = match options.format {
        Some(format) => format,
        None => {
            let format = detect(&folder)?;
            remarks.push(format!(
                "detected {} from its files; --format overrides",
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
    remarks.append(&mut scan.remarks);
    check(source, &scan.frames)?;

    let chosen = choose(scan.frames.len(), options, scan.is_video, &mut remarks);
    if !options.keep_poses
        && let Some(remark) = poses::refine(&mut scan.frames, &chosen)?
    {
        remarks.push(remark);
    }

    // The mesh: the one that the person names, the scan's own, or one fused from the depth of all frames.
    let named = options.mesh.as_ref();
    let (mesh, has_objects) = match named.or(scan.mesh.as_ref()) {
        Some(path) => geometry::read(path, &folder, scan.mirrored, &mut remarks)?,
        None => (
            geometry::fuse(source, &scan.frames, options.voxel, &mut remarks, progress)?,
            false,
        ),
    };
    Ok(Import {
        frames: chosen.into_iter().map(|i| scan.frames[i].clone()).collect(),
        mesh,
        has_objects,
        up: options.up.or(scan.up),
        remarks,
    })
}

/// Detects the layout of a folder from its content.
fn detect(folder: &Folder) -> Result<Format> {
    type IsHere = fn(&Folder) -> Result<bool>;
    let layouts: [(Format, IsHere); 8] = [
        (Format::Matterport, |f| Ok(matterport::is_here(f))),
        (Format::Nerfstudio, |f| Ok(nerf::is_here(f))),
        (Format::Colmap, |f| Ok(colmap::is_here(f))),
        (Format::SevenScenes, rgbd::seven_scenes::is_here),
        (Format::ScanNet, |f| Ok(rgbd::scannet::is_here(f))),
        (Format::IclNuim, rgbd::tum::is_icl_nuim),
        (Format::Tum, |f| Ok(rgbd::tum::is_here(f))),
        (Format::Open3d, rgbd::open3d::is_here),
    ];
    for (format, is_here) in layouts {
        if is_here(folder)? {
            return Ok(format);
        }
    }
    let words: Vec<&str> = Format::ALL.iter().map(|(word, _)| *word).collect();
    Err(Error::file(
        folder.confine().folder(),
        "no known layout is recognised in this folder",
        format!(
            "name the folder that directly holds the scan's files, or a capture's transforms.json; relit import --format {} names the layout",
            words.join("|")
        ),
    ))
}

/// Refuses a scan without frames, and impossible lenses, depth units and exposures.
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

/// Selects the frames that become photographs, by index.
fn choose(
    total: usize,
    options: &ImportOptions,
    is_video: bool,
    remarks: &mut Vec<String>,
) -> Vec<usize> {
    let mut chosen: Vec<usize> = (0..total).step_by(options.every.max(1)).collect();
    let asked = options.every > 0 || options.max_frames.is_some();
    let max = match options.max_frames {
        Some(max) => max.max(1),
        None if is_video && !asked => PHOTOGRAPHS_OF_A_VIDEO,
        None => usize::MAX,
    };
    let count = chosen.len();
    if count > max {
        // Keep the first of each of `max` equal parts.
        let first = |i: usize| i == 0 || i * max / count != (i - 1) * max / count;
        chosen = (0..count)
            .filter(|&i| first(i))
            .map(|i| chosen[i])
            .collect();
    }
    let how = match (chosen.len() < total, asked) {
        (false, _) => String::new(),
        (true, true) => format!(" of {total}"),
        (true, false) => {
            format!(" of {total}, evenly spaced; --every and --max-frames choose others")
        }
    };
    remarks.push(format!("photographs: {}{how}", chosen.len()));
    chosen
}
