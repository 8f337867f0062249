//! Reads COLMAP models, text and binary: `cameras` and `images` (not `points3D`). Poses are world-to-camera with OpenCV's axes;
//! pixel centres are at half-integers. The mesh is a file beside the model, such as COLMAP's own meshers write.

mod binary;
mod text;

use crate::capture::import::Scan;
use crate::capture::import::folder::{Folder, inside};
use crate::capture::import::geometry;
use crate::capture::import::matrix::{from_opencv, no_quaternion, rotation};
use crate::capture::scan::ImportedFrame;
use crate::capture::scan::lens::{Lens, Model};
use crate::error::{Error, Result};
use glam::DVec3;
use std::collections::HashMap;

/// Folders of models in a project, in order of preference.
const MODEL_FOLDERS: [&str; 9] = [
    "",
    "sparse/0",
    "sparse",
    "dense/sparse",
    "dense/0/sparse",
    "colmap/sparse/0",
    "colmap",
    "undistorted/sparse",
    "distorted/sparse/0",
];
const IMAGE_FOLDERS: [&str; 5] = ["images", "image", "rgb", "input", "color"];

struct Image {
    /// Quaternion w, x, y, z of the rotation from world to camera.
    quaternion: [f64; 4],
    /// The world's origin in camera coordinates.
    translation: DVec3,
    camera: u32,
    /// Its file, relative to the folder of photographs.
    name: String,
}

/// Camera models: number, name and count of parameters.
const MODELS: [(i32, &str, usize); 11] = [
    (0, "SIMPLE_PINHOLE", 3),
    (1, "PINHOLE", 4),
    (2, "SIMPLE_RADIAL", 4),
    (3, "RADIAL", 5),
    (4, "OPENCV", 8),
    (5, "OPENCV_FISHEYE", 8),
    (6, "FULL_OPENCV", 12),
    (7, "FOV", 5),
    (8, "SIMPLE_RADIAL_FISHEYE", 4),
    (9, "RADIAL_FISHEYE", 5),
    (10, "THIN_PRISM_FISHEYE", 12),
];

/// The lens of a model with the parameters `p`.
///
/// # Errors
/// What is wrong, as a phrase.
fn lens(model: &str, size: [u32; 2], p: &[f64]) -> std::result::Result<Lens, String> {
    let known = MODELS.iter().find(|(_, name, _)| *name == model);
    let Some((_, _, count)) = known else {
        return Err(format!("the camera model {model:?} is not known"));
    };
    if p.len() != *count {
        return Err(format!(
            "the camera model {model} has {count} parameters, not {}",
            p.len()
        ));
    }
    if size[0] == 0 || size[1] == 0 {
        return Err("the camera has no pixels".into());
    }
    let one_focal = |k| Lens::plain(size, [p[0]; 2], [p[1], p[2]]).with(k);
    let two_focals = |k| Lens::plain(size, [p[0], p[1]], [p[2], p[3]]).with(k);
    let lens = match model {
        "SIMPLE_PINHOLE" => one_focal(Model::Brown([0.0; 4])),
        "PINHOLE" => two_focals(Model::Brown([0.0; 4])),
        "SIMPLE_RADIAL" => one_focal(Model::Brown([p[3], 0.0, 0.0, 0.0])),
        "RADIAL" => one_focal(Model::Brown([p[3], p[4], 0.0, 0.0])),
        "OPENCV" => two_focals(Model::Brown([p[4], p[5], p[6], p[7]])),
        "OPENCV_FISHEYE" => two_focals(Model::Fisheye([p[4], p[5], p[6], p[7]])),
        "FULL_OPENCV" => two_focals(Model::Rational {
            k: [p[4], p[5], p[8], p[9], p[10], p[11]],
            p: [p[6], p[7]],
        }),
        "SIMPLE_RADIAL_FISHEYE" => one_focal(Model::Fisheye([p[3], 0.0, 0.0, 0.0])),
        "RADIAL_FISHEYE" => one_focal(Model::Fisheye([p[3], p[4], 0.0, 0.0])),
        _ => {
            return Err(format!(
                "the camera model {model} is not supported; undistort with COLMAP's image_undistorter"
            ));
        }
    };
    if !lens.is_possible() {
        return Err("a focal length or coefficient is impossible".into());
    }
    Ok(lens)
}

/// The model's folder, and whether the model is binary.
fn find(folder: &Folder) -> Option<(&'static str, bool)> {
    let both = |place: &str, end: &str| {
        ["cameras", "images"]
            .iter()
            .all(|name| folder.has(&inside(place, &format!("{name}.{end}"))))
    };
    MODEL_FOLDERS.into_iter().find_map(|place| {
        let binary = both(place, "bin");
        (binary || both(place, "txt")).then_some((place, binary))
    })
}

pub fn is_here(folder: &Folder) -> bool {
    find(folder).is_some()
}

pub fn read(folder: &Folder) -> Result<Scan> {
    let Some((place, is_binary)) = find(folder) else {
        return Err(Error::file(
            &folder.path("cameras.bin"),
            "there is no model of cameras and images, binary or text",
            "name the folder that holds them, or the one above sparse/0",
        ));
    };
    let end = if is_binary { "bin" } else { "txt" };
    let cameras_name = inside(place, &format!("cameras.{end}"));
    let images_name = inside(place, &format!("images.{end}"));
    let (cameras, images) = if is_binary {
        (
            binary::cameras(folder, &cameras_name)?,
            binary::images(folder, &images_name)?,
        )
    } else {
        (
            text::cameras(folder, &cameras_name)?,
            text::images(folder, &images_name)?,
        )
    };
    let mut scan = Scan::default();
    scan.remarks
        .push(format!("model: {images_name}, {} images", images.len()));
    let photographs = photographs(folder, place, images.first());
    let place_name = folder.path(&images_name).display().to_string();
    for image in images {
        scan.frames
            .push(frame(folder, &place_name, &photographs, &cameras, image)?);
    }
    scan.frames.sort_by(|a, b| a.photograph.cmp(&b.photograph));
    scan.remark_on_resampled();
    scan.mesh = geometry::find(folder, &["", "dense", "dense/0", place], &mut scan.remarks)?;
    Ok(scan)
}

fn frame(
    folder: &Folder,
    place: &str,
    photographs: &str,
    cameras: &HashMap<u32, Lens>,
    image: Image,
) -> Result<ImportedFrame> {
    let name = &image.name;
    let Some(lens) = cameras.get(&image.camera) else {
        return Err(Error::new(
            format!("{place} image {name}"),
            format!("its camera {} is not in the list of cameras", image.camera),
            "export the model again",
        ));
    };
    let [w, x, y, z] = image.quaternion;
    let Some(to_camera) = rotation(x, y, z, w) else {
        return Err(no_quaternion(&format!("{place} image {name}")));
    };
    if !image.translation.is_finite() {
        return Err(Error::new(
            format!("{place} image {name}"),
            "the translation is not finite",
            "export the model again",
        ));
    }
    let to_world = to_camera.transpose();
    let photograph = folder.file(&format!("{place} image {name}"), &inside(photographs, name))?;
    let pose = from_opencv(to_world, -(to_world * image.translation));
    Ok(ImportedFrame::new(photograph, *lens, pose, None))
}

/// The folder of photographs: one of the usual names at the model or above that holds the first image.
fn photographs(folder: &Folder, place: &str, first: Option<&Image>) -> String {
    let mut above = vec![place];
    while let Some(last) = above.last().filter(|last| !last.is_empty()) {
        above.push(last.rsplit_once('/').map_or("", |(up, _)| up));
    }
    let candidates = above
        .iter()
        .flat_map(|up| IMAGE_FOLDERS.iter().map(|name| inside(up, name)))
        .chain(above.iter().map(|up| (*up).to_owned()));
    let mut candidates = candidates
        .filter(|candidate| first.is_some_and(|image| folder.has(&inside(candidate, &image.name))));
    candidates.next().unwrap_or_else(|| "images".into())
}
