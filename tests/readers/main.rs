//! Every reader of a capture: what it understands, what it refuses and how, and that nothing makes it panic or hang.

mod corpus;
mod hostile;
mod images;
mod meshes;
mod roundtrip;
mod transforms;

use relit::capture::Capture;
use relit::capture::read::{ReadOptions, read};
use relit::error::Error;
use std::path::Path;
use tempfile::TempDir;

/// A triangle in front of the cameras of [`folder`].
pub const OBJ: &str = "o triangle\nv -1 -1 -2\nv 1 -1 -2\nv 0 1 -2\nf 1 2 3\n";

/// transforms.json of one pinhole camera at the origin for a 4 × 2 photograph; `extra` goes into the file's top level.
pub fn transforms(extra: &str) -> String {
    format!(
        r#"{{"camera_model": "PINHOLE", "w": 4, "h": 2, "fl_x": 3, "fl_y": 3, "cx": 2, "cy": 1, {extra}
            "frames": [{{"file_path": "images/000.png", "transform_matrix":
            [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}}]}}"#
    )
}

/// A folder with a mesh, one grey 4 × 2 photograph and the given transforms.json.
pub fn folder(transforms: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("images")).unwrap();
    image::RgbImage::from_pixel(4, 2, image::Rgb([128; 3]))
        .save(folder.path().join("images/000.png"))
        .unwrap();
    write(folder.path(), "mesh.obj", OBJ.as_bytes());
    write(folder.path(), "transforms.json", transforms.as_bytes());
    folder
}

/// Writes a file into a folder.
pub fn write(folder: &Path, name: &str, bytes: &[u8]) {
    std::fs::write(folder.join(name), bytes).unwrap();
}

/// Reads with the default options.
pub(crate) fn open(folder: &Path) -> Result<Capture, Error> {
    read(folder, &ReadOptions::default())
}

/// The capture whose mesh is a file of this name and content.
pub(crate) fn with_mesh(name: &str, bytes: &[u8]) -> Result<Capture, Error> {
    let folder = folder(&transforms(&format!(r#""mesh_path": "{name}","#)));
    write(folder.path(), name, bytes);
    open(folder.path())
}
