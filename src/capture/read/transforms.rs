//! Reads transforms.json: cameras, photographs, exposures, the mesh's path and the up vector.

use crate::capture::Frame;
use crate::capture::orientation::Orientation;
use crate::capture::photograph::{Encoding, PhotographSource};
use crate::capture::read::confine::Confine;
use crate::capture::read::fields::{Fields, without_bom};
use crate::capture::read::{CAMERAS, MESHES, image, lens, pose};
use crate::error::{Error, Result};
use crate::math::stats::quantile;
use glam::DVec3;
use rayon::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

const MAX_BYTES: u64 = 1 << 28;
/// Default metres per unit of a depth image (millimetres).
const DEPTH_UNIT: f64 = 0.001;

/// The content of transforms.json.
pub struct Transforms {
    /// Posed photographs in file order.
    pub frames: Vec<Frame>,
    pub mesh: PathBuf,
    /// Unit up vector.
    pub up: DVec3,
}

/// Reads transforms.json and the headers of the photographs it names.
pub fn read(
    confine: &Confine,
    up: Option<DVec3>,
    orientation: Orientation,
    warnings: &mut Vec<String>,
) -> Result<Transforms> {
    let path = confine.folder().join(CAMERAS);
    let place = path.display().to_string();
    let file = confine.file(&place, CAMERAS)?;
    let length = file.metadata().map_err(|e| Error::io(&file, &e))?.len();
    if length > MAX_BYTES {
        return Err(Error::file(
            &file,
            format!("has {length} bytes, more than the limit of {MAX_BYTES}"),
            "split the capture",
        ));
    }
    let text = std::fs::read(&file).map_err(|e| Error::io(&file, &e))?;
    let value: Value = serde_json::from_slice(without_bom(&text))
        .map_err(|e| Error::file(&file, format!("is not valid JSON: {e}"), "correct the file"))?;
    let shared = Fields::new(format!("{place}: "), &value)?;

    let frames = read_frames(confine, &shared, orientation, warnings)?;
    let mesh = find_mesh(confine, &shared)?;
    if shared.get("applied_transform").is_some() {
        warnings.push(format!(
            "{place}: applied_transform is not applied; mesh and poses are taken to share one coordinate system"
        ));
    }
    let up = match up {
        Some(up) => unit(up, "--up")?,
        None => match shared.vector("up")? {
            Some(up) => unit(up, &shared.place("up"))?,
            None => mean_up(&frames, &place, warnings),
        },
    };
    Ok(Transforms { frames, mesh, up })
}

/// Reads all frames in parallel; equal remarks become one warning with the number of frames.
fn read_frames(
    confine: &Confine,
    shared: &Fields,
    orientation: Orientation,
    warnings: &mut Vec<String>,
) -> Result<Vec<Frame>> {
    let place = shared.place("frames");
    let entries = shared.frames()?;
    if entries.is_empty() {
        return Err(Error::new(&place, "is empty", "add the photographs"));
    }
    let results: Vec<Result<(Frame, image::Header, Vec<String>)>> = entries
        .par_iter()
        .enumerate()
        .map(|(index, entry)| {
            let fields = Fields::new(format!("{place}[{index}]."), entry)?;
            read_frame(confine, shared, &fields, orientation)
        })
        .collect();

    let mut frames = Vec::with_capacity(results.len());
    let mut headers = Vec::with_capacity(results.len());
    let mut remarks: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for (index, result) in results.into_iter().enumerate() {
        let (frame, header, frame_remarks) = result?;
        for remark in frame_remarks {
            remarks.entry(remark).or_insert((index, 0)).1 += 1;
        }
        frames.push(frame);
        headers.push(header);
    }
    for (remark, (first, count)) in remarks {
        warnings.push(match count {
            1 => format!("{place}[{first}]: {remark}"),
            _ => format!("{place}[{first}] and {} more: {remark}", count - 1),
        });
    }
    exposures_from_exif(&mut frames, &headers, &place, warnings);
    Ok(frames)
}

/// Reads one entry of `frames`; `orientation` applies to all photographs after EXIF.
fn read_frame(
    confine: &Confine,
    shared: &Fields,
    fields: &Fields,
    orientation: Orientation,
) -> Result<(Frame, image::Header, Vec<String>)> {
    let place = fields.place("file_path");
    let name = fields
        .text("file_path")?
        .ok_or_else(|| Error::new(&place, "is absent", "name the photograph"))?;
    let photograph = confine.file(&place, name)?;
    let header = image::header(&photograph)?;
    let flag = fields.or(shared, "is_fisheye");
    if flag.get("is_fisheye").and_then(Value::as_bool) == Some(true) {
        return Err(Error::new(
            flag.place("is_fisheye"),
            "captures have no fisheye lenses",
            "run `relit import` on the folder, which resamples its photographs to a pinhole",
        ));
    }
    // A camera with the stored picture's size was calibrated on the stored picture; otherwise apply the EXIF orientation.
    let stored = [header.width, header.height];
    let by_exif = header.orientation;
    let applied = match lens::stated_size(shared, fields)? {
        Some(size) if size == orientation.size(stored) => Orientation::default(),
        Some(size) if size == by_exif.then(orientation).size(stored) => by_exif,
        _ => Orientation::default(),
    };
    let displayed = applied.then(orientation).size(stored);
    let (intrinsics, guesses) = lens::read(shared, fields, displayed)?;
    let mut remarks: Vec<String> = guesses.into_iter().map(str::to_owned).collect();
    if applied != Orientation::default() {
        remarks.push("the photograph is turned as its EXIF record says".into());
    }

    let (pose, remark) = pose::of_frame(fields)?;
    remarks.extend(remark);

    let source = fields.or(shared, "exposure");
    let exposure = source.number("exposure")?;
    if let Some(value) = exposure
        && value <= 0.0
    {
        return Err(Error::new(
            source.place("exposure"),
            format!("an exposure of {value} is impossible"),
            "give a positive multiplier",
        ));
    }
    if fields.get("mask_path").is_some() {
        remarks.push("mask_path is not read; put the mask into the photograph's alpha".into());
    }
    let depth = read_depth(confine, shared, fields, &mut remarks)?;
    let frame = Frame {
        intrinsics,
        pose,
        exposure,
        photograph: PhotographSource::File(photograph, applied),
        depth,
    };
    Ok((frame, header, remarks))
}

/// Sets the exposure of 8- and 16-bit frames without an exposure field from EXIF, relative to the median frame.
///
/// Does so only if all such frames have an EXIF exposure: a mixture of known and unknown exposures is worse than none.
fn exposures_from_exif(
    frames: &mut [Frame],
    headers: &[image::Header],
    place: &str,
    warnings: &mut Vec<String>,
) {
    let missing: Vec<(&mut Frame, Option<f64>)> = (frames.iter_mut().zip(headers))
        .filter(|(frame, header)| frame.exposure.is_none() && header.encoding != Encoding::Linear)
        .map(|(frame, header)| (frame, header.exif_exposure))
        .collect();
    let mut known: Vec<f64> = missing.iter().filter_map(|(_, exif)| *exif).collect();
    let Some(median) = quantile(&mut known, 0.5) else {
        return;
    };
    if known.len() < missing.len() {
        warnings.push(format!(
            "{place}: only {} of {} photographs have an EXIF exposure; none of them is used",
            known.len(),
            missing.len()
        ));
        return;
    }
    for (frame, exif) in missing {
        frame.exposure = exif.map(|exposure| exposure / median);
    }
}

/// The frame's depth image and its unit in metres, if there is one.
fn read_depth(
    confine: &Confine,
    shared: &Fields,
    fields: &Fields,
    remarks: &mut Vec<String>,
) -> Result<Option<(PathBuf, f64)>> {
    let Some(name) = fields.text("depth_file_path")? else {
        return Ok(None);
    };
    let name_of_scale = "depth_unit_scale_factor";
    let scale = fields.or(shared, name_of_scale).number(name_of_scale)?;
    let scale = scale.unwrap_or_else(|| {
        remarks.push("depth_unit_scale_factor is absent and taken as 0.001 (millimetres)".into());
        DEPTH_UNIT
    });
    let place = fields.place("depth_file_path");
    if scale <= 0.0 {
        return Err(Error::new(
            shared.place(name_of_scale),
            format!("a depth unit of {scale} is impossible"),
            "give the metres per unit",
        ));
    }
    if !confine.holds(name) && !confine.leads_out(name) {
        remarks.push("the depth image is missing".into());
        return Ok(None);
    }
    Ok(Some((confine.file(&place, name)?, scale)))
}

/// The mesh named by `mesh_path`, or the first of [`MESHES`] that exists.
fn find_mesh(confine: &Confine, shared: &Fields) -> Result<PathBuf> {
    let place = shared.place("mesh_path");
    if let Some(name) = shared.text("mesh_path")? {
        return confine.file(&place, name);
    }
    match MESHES.iter().find(|name| confine.holds(name)) {
        Some(name) => confine.file(&place, name),
        None => Err(Error::new(
            place,
            "is absent, and there is no mesh.glb, mesh.ply or mesh.obj",
            "put the mesh beside transforms.json or name it in mesh_path",
        )),
    }
}

fn unit(up: DVec3, place: &str) -> Result<DVec3> {
    up.try_normalize()
        .ok_or_else(|| Error::new(place, "the up vector is zero", "give a direction"))
}

/// The cameras' mean up; +y with a warning if it vanishes.
fn mean_up(frames: &[Frame], place: &str, warnings: &mut Vec<String>) -> DVec3 {
    let sum: DVec3 = frames.iter().map(|frame| frame.pose.rotation.y_axis).sum();
    // The sum of n random unit vectors has length about √n: a shorter one carries no information.
    let noise = (frames.len() as f64).sqrt();
    if frames.len() > 2 && sum.length() < noise {
        warnings.push(format!(
            "{place}: the cameras point every way, so their mean up is a guess; pass --up"
        ));
    }
    sum.try_normalize().unwrap_or_else(|| {
        warnings.push(format!(
            "{place}: the cameras' up vectors cancel; +y is taken as up; pass --up"
        ));
        DVec3::Y
    })
}
