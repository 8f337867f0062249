//! COLMAP models, text and binary: `cameras`, `images`; `points3D` is not needed. Poses are world to camera with OpenCV's
//! axes, pixel centres lie at halves. The mesh comes from elsewhere; COLMAP's own meshers write it beside the model.

mod binary;
mod model;
mod text;

use crate::capture::import::folder::Folder;
use crate::capture::import::lens::Lens;
use crate::capture::import::matrix::{from_opencv, no_quaternion, rotation};
use crate::capture::import::{ImportedFrame, Scan, geometry};
use crate::error::{Error, Result};
use glam::DVec3;
use std::collections::HashMap;

/// Where models lie in a project, the best first.
const PLACES: [&str; 9] = [
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
/// What folders of photographs are called.
const IMAGES: [&str; 5] = ["images", "image", "rgb", "input", "color"];

/// A photograph of the model.
#[derive(Debug, Clone, PartialEq)]
struct Image {
    /// w, x, y, z of the rotation from world to camera.
    quaternion: [f64; 4],
    /// The world's origin in camera axes.
    translation: DVec3,
    /// The number of its camera.
    camera: u32,
    /// Its file, relative to the folder of photographs.
    name: String,
}

/// The model's place and whether it is binary.
fn find(folder: &Folder) -> Option<(&'static str, bool)> {
    let both = |place: &str, end: &str| {
        ["cameras", "images"]
            .iter()
            .all(|name| folder.has(&inside(place, &format!("{name}.{end}"))))
    };
    PLACES.into_iter().find_map(|place| {
        let binary = both(place, "bin");
        (binary || both(place, "txt")).then_some((place, binary))
    })
}

/// Whether a folder holds a model.
pub fn is_here(folder: &Folder) -> bool {
    find(folder).is_some()
}

/// Reads the model.
///
/// # Errors
/// The model is missing or broken, or a photograph is missing.
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
    scan.said
        .push(format!("model: {images_name}, {} images", images.len()));
    let photographs = photographs(folder, place, images.first());
    let place_name = folder.path(&images_name).display().to_string();
    for image in images {
        scan.frames
            .push(frame(folder, &place_name, &photographs, &cameras, image)?);
    }
    scan.frames.sort_by(|a, b| a.photograph.cmp(&b.photograph));
    let others = scan.frames.iter().filter(|f| !f.lens.fits_a_capture());
    let others = others.count();
    if others > 0 {
        scan.said.push(format!(
            "{others} photographs are resampled to a pinhole of the same focal length; what lies outside it is lost"
        ));
    }
    scan.mesh = geometry::find(folder, &["", "dense", "dense/0", place], &mut scan.said)?;
    Ok(scan)
}

/// The frame of an image.
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
        return no_quaternion(&format!("{place} image {name}"));
    };
    if !image.translation.is_finite() {
        return Err(Error::new(
            format!("{place} image {name}"),
            "the translation is not finite",
            "export the model again",
        ));
    }
    let to_world = to_camera.transpose();
    Ok(ImportedFrame {
        photograph: folder.file(&format!("{place} image {name}"), &inside(photographs, name))?,
        lens: *lens,
        pose: from_opencv(to_world, -(to_world * image.translation)),
        exposure: None,
        mask: None,
        depth: None,
    })
}

/// The folder of photographs: one of the usual names at the model or above that holds the first image.
fn photographs(folder: &Folder, place: &str, first: Option<&Image>) -> String {
    let mut above = vec![place];
    while let Some(last) = above.last().filter(|last| !last.is_empty()) {
        above.push(last.rsplit_once('/').map_or("", |(up, _)| up));
    }
    let candidates = above
        .iter()
        .flat_map(|up| IMAGES.iter().map(|name| inside(up, name)))
        .chain(above.iter().map(|up| (*up).to_owned()));
    let mut candidates = candidates
        .filter(|candidate| first.is_some_and(|image| folder.has(&inside(candidate, &image.name))));
    candidates.next().unwrap_or_else(|| "images".into())
}

fn inside(place: &str, name: &str) -> String {
    match place {
        "" => name.to_owned(),
        _ => format!("{place}/{name}"),
    }
}
