//! The layouts that are understood, and how a folder's content tells which it has.

use crate::capture::import::folder::Folder;
use crate::capture::import::{colmap, matterport, nerf, rgbd};
use crate::error::{Error, Result};

/// A layout of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// 7-Scenes and 3DMatch: `frame-N.color.png`, `.depth.png`, `.pose.txt`, perhaps in `seq-NN`.
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
    /// All layouts, with the words that `--format` takes.
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

    /// The layout in words.
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

/// The format of a folder's content.
///
/// # Errors
/// No layout is recognised.
pub fn detect(folder: &Folder) -> Result<Format> {
    if matterport::is_here(folder) {
        return Ok(Format::Matterport);
    }
    if nerf::is_here(folder) {
        return Ok(Format::Nerfstudio);
    }
    if colmap::is_here(folder) {
        return Ok(Format::Colmap);
    }
    if rgbd::seven_scenes::is_here(folder)? {
        return Ok(Format::SevenScenes);
    }
    if rgbd::scannet::is_here(folder) {
        return Ok(Format::ScanNet);
    }
    if rgbd::tum::is_icl_nuim(folder)? {
        return Ok(Format::IclNuim);
    }
    if rgbd::tum::is_here(folder) {
        return Ok(Format::Tum);
    }
    if rgbd::open3d::is_here(folder)? {
        return Ok(Format::Open3d);
    }
    let words: Vec<&str> = Format::ALL.iter().map(|(word, _)| *word).collect();
    Err(Error::file(
        folder.confine().folder(),
        "no known layout is recognised in this folder",
        format!(
            "name the folder that directly holds the scan's files, or pass --format {}",
            words.join("|")
        ),
    ))
}
