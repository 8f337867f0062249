//! Reads a house of Matterport3D (Chang et al. 2017).
//!
//! Photographs are the HDR images in `matterport_hdr_images` if converted to EXR or HDR, else the tone-mapped ones in
//! `matterport_color_images`. Lenses are in `matterport_camera_intrinsics` (one line: width height fx fy cx cy k1 k2 p1 p2 k3),
//! poses in `matterport_camera_poses` (camera to world, OpenCV's axes); files are named `UUID_KINDcamera_yaw`. Without these,
//! cameras come from `undistorted_camera_parameters/*.conf` with `undistorted_color_images`, whose cy counts from the bottom. Depth
//! is in quarter millimetres. The mesh in `house_segmentations`, which has objects, is preferred.

use crate::capture::import::Scan;
use crate::capture::import::folder::Folder;
use crate::capture::import::geometry;
use crate::capture::import::matrix::{number, numbers, pose_of_rows, rows};
use crate::capture::scan::ImportedFrame;
use crate::capture::scan::depth::{self, DepthImage};
use crate::capture::scan::lens::{Lens, Model};
use crate::error::{Error, Result};
use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};

const POSES: &str = "matterport_camera_poses";
const INTRINSICS: &str = "matterport_camera_intrinsics";
const HDR: &str = "matterport_hdr_images";
const COLOR: &str = "matterport_color_images";
const DEPTH: &str = "matterport_depth_images";
const UNDISTORTED: &str = "undistorted_camera_parameters";
/// Metres per unit of depth.
const UNIT: f64 = 0.000_25;

pub fn is_here(folder: &Folder) -> bool {
    [POSES, UNDISTORTED]
        .iter()
        .any(|name| folder.has_folder(name))
}

pub fn read(folder: &Folder) -> Result<Scan> {
    let mut scan = Scan::default();
    if folder.has_folder(POSES) && folder.has_folder(INTRINSICS) {
        original(folder, &mut scan)?;
    } else {
        undistorted(folder, &mut scan)?;
    }
    let places = [
        "house_segmentations",
        "region_segmentations",
        "poisson_meshes",
        "matterport_mesh",
        "",
    ];
    scan.mesh = geometry::find(folder, &places, &mut scan.remarks)?;
    Ok(scan)
}

/// Names of the entries of a subfolder; none where it is missing.
fn names_of(folder: &Folder, name: &str) -> Result<Vec<String>> {
    match folder.has_folder(name) {
        true => folder.names(name),
        false => Ok(Vec::new()),
    }
}

fn original(folder: &Folder, scan: &mut Scan) -> Result<()> {
    let listed = |name: &str| -> Result<BTreeSet<String>> {
        Ok(names_of(folder, name)?.into_iter().collect())
    };
    let (hdr, color, depths) = (listed(HDR)?, listed(COLOR)?, listed(DEPTH)?);
    let mut lenses: HashMap<String, Lens> = HashMap::new();
    let (mut hdr_count, mut tone_mapped) = (0, 0);
    for name in folder.names(POSES)? {
        // UUID_pose_CAMERA_YAW.txt
        let Some((uuid, view)) = name
            .strip_suffix(".txt")
            .and_then(|stem| stem.split_once("_pose_"))
        else {
            continue;
        };
        let Some((camera, _)) = view.split_once('_') else {
            continue;
        };
        let pose_name = format!("{POSES}/{name}");
        let place = folder.path(&pose_name).display().to_string();
        let Some(pose) = pose_of_rows(&place, &rows(folder, &pose_name)?)? else {
            continue;
        };
        let first = |set: &BTreeSet<String>, kind: &str, ends: &[&str]| {
            let mut names = ends.iter().map(|end| format!("{uuid}_{kind}{view}.{end}"));
            names.find(|name| set.contains(name))
        };
        let photograph = match (
            first(&hdr, "j", &["exr", "hdr"]),
            first(&color, "i", &["jpg", "png"]),
        ) {
            (Some(name), _) => {
                hdr_count += 1;
                format!("{HDR}/{name}")
            }
            (None, Some(name)) => {
                tone_mapped += 1;
                format!("{COLOR}/{name}")
            }
            (None, None) => {
                let remedy = match hdr.contains(&format!("{uuid}_j{view}.jxr")) {
                    true => {
                        "convert the JPEG XR images to EXR beside them, or add the tone-mapped ones"
                    }
                    false => "add it, or delete its pose",
                };
                let path = folder.path(&format!("{COLOR}/{uuid}_i{view}.jpg"));
                return Err(Error::file(
                    &path,
                    "is missing, though it has a pose",
                    remedy,
                ));
            }
        };
        let key = format!("{INTRINSICS}/{uuid}_intrinsics_{camera}.txt");
        let lens = match lenses.entry(key) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(entry) => {
                let lens = lens(folder, entry.key())?;
                *entry.insert(lens)
            }
        };
        let depth = first(&depths, "d", &["png"])
            .map(|name| depth_image(folder, &format!("{DEPTH}/{name}"), &lens))
            .transpose()?;
        let photograph = folder.file(&place, &photograph)?;
        scan.frames
            .push(ImportedFrame::new(photograph, lens, pose, depth));
    }
    scan.remarks.push(format!(
        "HDR photographs: {hdr_count}, tone-mapped: {tone_mapped}"
    ));
    let undecoded = hdr.iter().filter(|name| name.ends_with(".jxr")).count();
    if undecoded > 0 && hdr_count == 0 {
        scan.remarks.push(format!(
            "{undecoded} JPEG XR images in {HDR} are not read; convert them to EXR beside them to have HDR photographs"
        ));
    }
    Ok(())
}

/// The lens in an intrinsics file, a single line.
fn lens(folder: &Folder, name: &str) -> Result<Lens> {
    let broken = |problem: &str| Error::file(&folder.path(name), problem, "copy it again");
    let numbers = numbers(&folder.text(name)?);
    let Some([w, h, fx, fy, cx, cy, k1, k2, p1, p2, k3]) = numbers
        .as_deref()
        .and_then(|n| <[f64; 11]>::try_from(n).ok())
    else {
        let problem = "is not a line of: width height fx fy cx cy k1 k2 p1 p2 k3";
        return Err(broken(problem));
    };
    let count = |x: f64| (1.0..=65536.0).contains(&x) && x.fract() == 0.0;
    if !(count(w) && count(h)) {
        let problem = format!("an image of {w}×{h} pixels is impossible");
        return Err(broken(&problem));
    }
    let lens = Lens::plain([w as u32, h as u32], [fx, fy], [cx, cy]).with(Model::Rational {
        k: [k1, k2, k3, 0.0, 0.0, 0.0],
        p: [p1, p2],
    });
    if !lens.is_possible() {
        return Err(broken("holds an impossible focal length or coefficient"));
    }
    Ok(lens)
}

fn depth_image(folder: &Folder, name: &str, lens: &Lens) -> Result<DepthImage> {
    let path = folder.existing(name)?;
    let lens = lens.resized(depth::size(&path)?);
    Ok(DepthImage::new(path, lens, UNIT))
}

/// Reads the undistorted images by their .conf file.
fn undistorted(folder: &Folder, scan: &mut Scan) -> Result<()> {
    let names = names_of(folder, UNDISTORTED)?;
    let Some(name) = names.iter().find(|name| name.ends_with(".conf")) else {
        return Err(Error::file(
            &folder.path(UNDISTORTED),
            "holds no .conf file, and there are no original cameras",
            "add the camera parameters",
        ));
    };
    let name = format!("{UNDISTORTED}/{name}");
    let text = folder.text(&name)?;
    let path = folder.path(&name);
    let (mut depths, mut colors) = (
        "undistorted_depth_images".to_owned(),
        "undistorted_color_images".to_owned(),
    );
    let mut matrix = None;
    for (index, line) in text.lines().enumerate() {
        let place = format!("{} line {}", path.display(), index + 1);
        let broken = |what: &str| Error::new(&place, what, "copy the file again");
        let words: Vec<&str> = line.split_whitespace().collect();
        let values = |words: &[&str]| -> Option<Vec<f64>> {
            words.iter().map(|word| number(word)).collect()
        };
        match words.as_slice() {
            ["depth_directory", name] => depths = (*name).to_owned(),
            ["color_directory", name] => colors = (*name).to_owned(),
            ["intrinsics_matrix", rest @ ..] => {
                let k = values(rest).filter(|k| k.len() == 9);
                let k = k.ok_or_else(|| broken("is not a matrix of 9 numbers"))?;
                matrix = Some([k[0], k[4], k[2], k[5]]);
            }
            ["scan", depth, color, rest @ ..] => {
                let [fx, fy, cx, cy] =
                    matrix.ok_or_else(|| broken("comes before any intrinsics_matrix"))?;
                let m = values(rest).filter(|m| m.len() == 16);
                let m = m.ok_or_else(|| broken("holds no matrix of 16 numbers"))?;
                // The file has OpenGL's camera axes; `pose_of_rows` expects OpenCV's.
                let rows: Vec<Vec<f64>> = m
                    .chunks(4)
                    .map(|row| vec![row[0], -row[1], -row[2], row[3]])
                    .collect();
                let Some(pose) = pose_of_rows(&place, &rows)? else {
                    continue;
                };
                let photograph = folder.file(&place, &format!("{colors}/{color}"))?;
                let header = crate::capture::read::image::header(&photograph)?;
                let lens = Lens::plain(
                    [header.width, header.height],
                    [fx, fy],
                    [cx, f64::from(header.height) - cy],
                );
                let depth_name = format!("{depths}/{depth}");
                let depth = (folder.has(&depth_name))
                    .then(|| depth_image(folder, &depth_name, &lens))
                    .transpose()?;
                scan.frames
                    .push(ImportedFrame::new(photograph, lens, pose, depth));
            }
            _ => {}
        }
    }
    Ok(())
}
