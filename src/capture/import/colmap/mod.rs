//! Reads COLMAP models, text and binary: `cameras` and `images` (not `points3D`). Poses are world-to-camera with OpenCV's axes;
//! pixel centres are at half-integers. The mesh is a file beside the model, such as COLMAP's own meshers write.

mod binary;
mod model;
mod text;

use crate::capture::import::folder::{Folder, inside};
use crate::capture::import::geometry;
use crate::capture::import::matrix::{from_opencv, no_quaternion, rotation};
use crate::capture::import::reader::Scan;
use crate::capture::scan::ImportedFrame;
use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};
use model::Image;
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
/// Usual names of folders of photographs.
const IMAGE_FOLDERS: [&str; 5] = ["images", "image", "rgb", "input", "color"];

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
