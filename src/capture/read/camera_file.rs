//! A camera in its own file: the fields of a frame of transforms.json, with the picture's size.

use crate::capture::camera::{Intrinsics, Pose};
use crate::capture::inputs;
use crate::capture::read::fields::{Fields, without_bom};
use crate::capture::read::{lens, pose};
use crate::error::{Error, Result};
use serde_json::Value;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Longest file that is read, in bytes; a camera takes a few hundred.
const MAX_BYTES: u64 = 1 << 20;
const MAX_PIXELS: u64 = 1 << 28;

/// Reads a camera; also returns remarks about guessed fields.
///
/// # Errors
/// The file is not JSON, has an unsupported lens model or no size, or its pose is not a rigid motion.
pub fn read(path: &Path) -> Result<(Intrinsics, Pose, Vec<String>)> {
    let failed = |error: std::io::Error| Error::io(path, &error);
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(failed)?;
    inputs::note(path);
    (file.take(MAX_BYTES + 1).read_to_end(&mut bytes)).map_err(failed)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::file(
            path,
            "is too long for a camera",
            "give the fields of one frame",
        ));
    }
    let value: Value = serde_json::from_slice(without_bom(&bytes)).map_err(|error| {
        Error::file(
            path,
            error,
            "write w, h, fl_x, fl_y, cx, cy and transform_matrix as in transforms.json",
        )
    })?;
    let fields = Fields::new(format!("{}: ", path.display()), &value)?;
    let side = |name: &str| {
        fields.count(name)?.ok_or_else(|| {
            Error::new(
                fields.place(name),
                "is absent",
                "give the picture's size in pixels",
            )
        })
    };
    let size = [side("w")?, side("h")?];
    if size.iter().map(|&side| u64::from(side)).product::<u64>() > MAX_PIXELS {
        return Err(Error::new(
            fields.place("w, h"),
            "the size is not supported",
            "give sizes from 1 to 16384",
        ));
    }
    let (intrinsics, guesses) = lens::read(&fields, &fields, size)?;
    let (pose, remark) = pose::of_frame(&fields)?;
    let remarks = guesses.into_iter().map(str::to_owned).chain(remark);
    let remarks = remarks.map(|remark| format!("{}: {remark}", path.display()));
    Ok((intrinsics, pose, remarks.collect()))
}
