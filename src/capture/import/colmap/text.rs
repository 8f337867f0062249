//! Reads cameras.txt and images.txt.

use crate::capture::import::colmap::{self, Image};
use crate::capture::import::folder::Folder;
use crate::capture::import::matrix::number;
use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};
use glam::DVec3;
use std::collections::HashMap;

fn broken(folder: &Folder, name: &str, line: usize, problem: &str) -> Error {
    Error::new(
        format!("{} line {}", folder.path(name).display(), line + 1),
        problem,
        "export the model again",
    )
}

/// Cameras by id, from lines of `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`.
pub fn cameras(folder: &Folder, name: &str) -> Result<HashMap<u32, Lens>> {
    let text = folder.text(name)?;
    let mut cameras = HashMap::new();
    for (index, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.is_empty() || words[0].starts_with('#') {
            continue;
        }
        let parsed = || -> Option<(u32, [u32; 2], Vec<f64>)> {
            let size = [words.get(2)?.parse().ok()?, words.get(3)?.parse().ok()?];
            let parameters: Option<Vec<f64>> = words[4..].iter().map(|word| number(word)).collect();
            Some((words[0].parse().ok()?, size, parameters?))
        };
        let Some((id, size, parameters)) = parsed() else {
            let problem = "is not a line of CAMERA_ID MODEL WIDTH HEIGHT PARAMS";
            return Err(broken(folder, name, index, problem));
        };
        let lens = colmap::lens(words[1], size, &parameters)
            .map_err(|problem| broken(folder, name, index, &problem))?;
        cameras.insert(id, lens);
    }
    Ok(cameras)
}

/// Images, from pairs of lines: `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME` and the image's points, which may be empty.
pub fn images(folder: &Folder, name: &str) -> Result<Vec<Image>> {
    let text = folder.text(name)?;
    let mut images = Vec::new();
    let mut lines = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.starts_with('#'));
    while let Some((index, line)) = lines.next() {
        if line.trim().is_empty() {
            continue;
        }
        let Some(image) = image(line) else {
            let problem = "is not a line of IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
            return Err(broken(folder, name, index, problem));
        };
        images.push(image);
        lines.next();
    }
    Ok(images)
}

fn image(line: &str) -> Option<Image> {
    // The name is the rest of the line; it may hold spaces.
    let mut rest = line.trim();
    let mut words = Vec::new();
    for _ in 0..9 {
        let (word, after) = rest.split_once(char::is_whitespace)?;
        words.push(word);
        rest = after.trim_start();
    }
    let numbers: Option<Vec<f64>> = words[1..8].iter().map(|word| number(word)).collect();
    let Some(&[w, x, y, z, tx, ty, tz]) = numbers.as_deref() else {
        return None;
    };
    words[0].parse::<u64>().ok()?;
    (!rest.is_empty()).then(|| {
        Some(Image {
            quaternion: [w, x, y, z],
            translation: DVec3::new(tx, ty, tz),
            camera: words[8].parse().ok()?,
            name: rest.to_owned(),
        })
    })?
}
