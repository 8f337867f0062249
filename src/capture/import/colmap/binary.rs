//! Reads cameras.bin and images.bin: little-endian, each beginning with the number of entries.

use crate::capture::import::colmap::model::{self, Image};
use crate::capture::import::folder::Folder;
use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};
use glam::DVec3;
use std::collections::HashMap;

const MAX_BYTES: u64 = 1 << 32;
/// Bytes of an image's feature point: x, y, and the id of its 3-D point.
const POINT_BYTES: u64 = 24;

struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(head)
    }

    /// A number by its function `from_le_bytes`.
    fn number<T, const N: usize>(&mut self, from: fn([u8; N]) -> T) -> Option<T> {
        self.take(N)?.try_into().ok().map(from)
    }

    fn text(&mut self) -> Option<String> {
        let end = self.0.iter().position(|&byte| byte == 0)?;
        let name = String::from_utf8_lossy(self.take(end)?).into_owned();
        self.take(1)?;
        Some(name)
    }
}

fn broken(folder: &Folder, name: &str, index: u64, problem: &str) -> Error {
    Error::file(
        &folder.path(name),
        format!("entry {index} (counted from 0) {problem}"),
        "export the model again",
    )
}

/// Cameras by id. An entry is: id, model, width, height, parameters.
pub fn cameras(folder: &Folder, name: &str) -> Result<HashMap<u32, Lens>> {
    let bytes = folder.bytes(name, MAX_BYTES)?;
    let mut cursor = Cursor(&bytes);
    let cut = |index| broken(folder, name, index, "is cut off");
    let count = cursor.number(u64::from_le_bytes).ok_or_else(|| cut(0))?;
    let mut cameras = HashMap::new();
    for index in 0..count {
        let mut head = || {
            let (id, kind) = (
                cursor.number(u32::from_le_bytes)?,
                cursor.number(u32::from_le_bytes)?,
            );
            Some((
                id,
                kind as i32,
                cursor.number(u64::from_le_bytes)?,
                cursor.number(u64::from_le_bytes)?,
            ))
        };
        let (id, kind, width, height) = head().ok_or_else(|| cut(index))?;
        let known = model::MODELS.iter().find(|(number, _, _)| *number == kind);
        let Some((_, model, parameters)) = known else {
            let problem = format!("has the unknown camera model {kind}");
            return Err(broken(folder, name, index, &problem));
        };
        let values: Option<Vec<f64>> = (0..*parameters)
            .map(|_| cursor.number(f64::from_le_bytes))
            .collect();
        let values = values.ok_or_else(|| cut(index))?;
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(broken(folder, name, index, "has an impossible size"));
        };
        let lens = model::lens(model, [width, height], &values)
            .map_err(|problem| broken(folder, name, index, &format!("is refused: {problem}")))?;
        cameras.insert(id, lens);
    }
    Ok(cameras)
}

/// Images. An entry is: id, quaternion, translation, camera, name, points.
pub fn images(folder: &Folder, name: &str) -> Result<Vec<Image>> {
    let bytes = folder.bytes(name, MAX_BYTES)?;
    let mut cursor = Cursor(&bytes);
    let cut = |index| broken(folder, name, index, "is cut off");
    let count = cursor.number(u64::from_le_bytes).ok_or_else(|| cut(0))?;
    let mut images = Vec::new();
    for index in 0..count {
        let image = image(&mut cursor).ok_or_else(|| cut(index))?;
        images.push(image);
    }
    Ok(images)
}

fn image(cursor: &mut Cursor) -> Option<Image> {
    cursor.number(u32::from_le_bytes)?;
    let mut number = || cursor.number(f64::from_le_bytes);
    let quaternion = [number()?, number()?, number()?, number()?];
    let translation = DVec3::new(number()?, number()?, number()?);
    let camera = cursor.number(u32::from_le_bytes)?;
    let name = cursor.text()?;
    let points = cursor
        .number(u64::from_le_bytes)?
        .checked_mul(POINT_BYTES)?;
    cursor.take(usize::try_from(points).ok()?)?;
    Some(Image {
        quaternion,
        translation,
        camera,
        name,
    })
}
