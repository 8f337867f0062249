//! The supported layouts of scans.

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
