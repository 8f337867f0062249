//! Reads cameras.bin and images.bin: little-endian, each beginning with the number of entries.

use crate::capture::import::colmap::{self, Image};
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

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes)
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
    let count = cursor.u64().ok_or_else(|| cut(0))?;
    let mut cameras = HashMap::new();
    for index in 0..count {
        let mut head = || Some((cursor.u32()?, cursor.u32()?, cursor.u64()?, cursor.u64()?));
        let (id, kind, width, height) = head().ok_or_else(|| cut(index))?;
        let kind = kind as i32;
        let known = colmap::MODELS.iter().find(|(number, _, _)| *number == kind);
        let Some((_, model, parameters)) = known else {
            let problem = format!("has the unknown camera model {kind}");
            return Err(broken(folder, name, index, &problem));
        };
        let values: Option<Vec<f64>> = (0..*parameters).map(|_| cursor.f64()).collect();
        let values = values.ok_or_else(|| cut(index))?;
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(broken(folder, name, index, "has an impossible size"));
        };
        let lens = colmap::lens(model, [width, height], &values)
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
    let count = cursor.u64().ok_or_else(|| cut(0))?;
    let image = |index| image(&mut cursor).ok_or_else(|| cut(index));
    (0..count).map(image).collect()
}

fn image(cursor: &mut Cursor) -> Option<Image> {
    cursor.u32()?;
    let mut number = || cursor.f64();
    let quaternion = [number()?, number()?, number()?, number()?];
    let translation = DVec3::new(number()?, number()?, number()?);
    let camera = cursor.u32()?;
    let name = cursor.text()?;
    let points = cursor.u64()?.checked_mul(POINT_BYTES)?;
    cursor.take(usize::try_from(points).ok()?)?;
    Some(Image {
        quaternion,
        translation,
        camera,
        name,
    })
}
