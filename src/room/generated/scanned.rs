//! Scanned rooms: photographs like a phone's, and a mesh fused from noisy depth images.

use crate::capture::Segmentation;
use crate::capture::camera::Pose;
use crate::capture::fuse::{MAX_BYTES, fuse, voxel_size};
use crate::capture::import::{DepthImage, ImportedFrame, Lens};
use crate::capture::poses;
use crate::error::{Error, Result};
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::room::cameras;
use crate::room::generated::furnisher::Furnisher;
use crate::room::generated::photographed::{Draft, Generated};
use crate::room::generated::{patterned, phone, window};
use crate::room::photographs::{Rendering, render_lit};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::transport::denoise::{denoise, guides};
use crate::transport::lit::LitScene;
use glam::{DMat3, DVec3, Vec2};
use std::path::{Path, PathBuf};

/// Key of the depth camera's random numbers.
const DEPTH_KEY: u64 = 0x7363_616e;
/// Width of the depth images in pixels, as phones have it.
const WIDTH: u32 = 256;
/// Fraction of the rooms that light from outside enters through openings.
const OPEN: f64 = 0.4;
/// Fraction of the rooms whose cameras never look up, so that the scan lacks a part of the ceiling.
const LOOKING_DOWN: f64 = 0.5;
/// Fraction of the objects that have a pattern.
const PATTERNED: f64 = 0.4;
/// Metres per unit of the depth images.
const UNIT: f64 = 0.001;
/// Largest measured depth in metres.
const MAX_DEPTH: f64 = 5.0;
/// Smallest cosine between ray and normal at which depth is measured.
const MIN_COSINE: f32 = 0.2;
/// Standard deviation of the camera positions along each axis, in metres.
const POSITION_DEVIATION: f64 = 0.003;
/// Standard deviation of the camera rotations about each axis, in radians.
const ROTATION_DEVIATION: f64 = 0.12 / 180.0 * std::f64::consts::PI;

/// A partly patterned room with many views, lit by lamps or through openings; in half of the rooms all views look down.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    let openings = match f.between(0.0, 1.0) < OPEN {
        true => window::shell(f),
        false => {
            f.shell();
            f.lamps();
            Vec::new()
        }
    };
    f.furniture();
    patterned::paint(f, PATTERNED);
    f.look_around(12, 18);
    window::look_out(f, &openings);
    f.expose(32.0, 64.0);
    if f.between(0.0, 1.0) < LOOKING_DOWN {
        f.look_down();
    }
}

/// Standard deviation in metres of a structured-light camera's depth (Nguyen, Izadi and Lovell 2012).
pub fn deviation(depth: f64) -> f64 {
    0.0012 + 0.0019 * (depth - 0.4).powi(2)
}

/// Scans the room as `relit import` reads scans: photographs and depth images from the same poses, known with an error that is
/// refined, and a mesh fused from the depth.
pub fn scan(draft: Draft) -> Result<Generated> {
    let lit = draft.lit()?;
    let files = phone::files(&draft, &lit, &noiseless(&lit, &draft.rendering))?;
    let mut stream = Stream::new(draft.seed, DEPTH_KEY, 0, 0);
    let folder = tempfile::tempdir().map_err(|e| Error::io(&std::env::temp_dir(), &e))?;
    let known = cameras::cameras(&draft.room.views, draft.rendering.size);
    let mut frames = Vec::new();
    for (index, ((intrinsics, pose), file)) in known.into_iter().zip(&files).enumerate() {
        let photograph = folder.path().join(format!("{index:03}.jpg"));
        std::fs::write(&photograph, file).map_err(|e| Error::io(&photograph, &e))?;
        let k = &intrinsics;
        let lens = Lens::plain([k.width, k.height], [k.fx, k.fy], [k.cx, k.cy]);
        let height = (WIDTH * k.height).div_ceil(k.width.max(1));
        let path = folder.path().join(format!("{index:03}.png"));
        let depth = DepthImage::new(path, lens.resized([WIDTH, height]), UNIT);
        let camera = Camera::new(&depth.lens.pinhole, &pose, lit.scene.origin);
        let measured = measure(&lit.scene, &camera, &mut stream);
        write_depth(&depth.path, &measured, &camera)?;
        let pose = jittered(&pose, &mut stream);
        frames.push(ImportedFrame::new(photograph, lens, pose, Some(depth)));
    }
    let all: Vec<usize> = (0..frames.len()).collect();
    poses::refine(&mut frames, &all)?;
    let (voxel, _) = voxel_size(&frames, None)?;
    let mesh = fuse(&frames, voxel, MAX_BYTES, &mut |_, _| {})?;

    let photographs = files.iter().map(|file| phone::decode(file));
    let photographs = photographs.collect::<Result<_>>()?;
    let mut scanned = draft.photographed(lit, photographs);
    for (frame, imported) in scanned.capture.frames.iter_mut().zip(&frames) {
        frame.pose = imported.pose;
    }
    scanned.capture.mesh = mesh;
    scanned.capture.segmentation = Some(Segmentation {
        file: PathBuf::from("fused mesh"),
        wanted: None,
    });
    Ok(scanned)
}

/// Denoised renderings of all views. The rare bright samples of a path tracer are no noise of a camera: poses would follow them,
/// and they would saturate and take their light out of the photograph.
fn noiseless(lit: &LitScene, rendering: &Rendering) -> Vec<Picture> {
    let [a, b] = [0, 1].map(|half| {
        let seed = rendering.seed ^ half << u32::BITS;
        let samples = rendering.samples.div_ceil(2);
        render_lit(lit, &Rendering::new(seed, samples, rendering.size))
    });
    let pairs = a.iter().zip(&b).zip(&lit.scene.cameras);
    pairs
        .map(|((a, b), camera)| denoise(&a.picture(), &b.picture(), &guides(lit, camera)))
        .collect()
}

/// Adds a tracking error to a pose.
fn jittered(pose: &Pose, stream: &mut Stream) -> Pose {
    let mut normal = || DVec3::from([(); 3].map(|()| f64::from(stream.normal())));
    let turn = normal() * ROTATION_DEVIATION;
    Pose {
        rotation: DMat3::from_axis_angle(turn.try_normalize().unwrap_or(DVec3::X), turn.length())
            * pose.rotation,
        center: pose.center + normal() * POSITION_DEVIATION,
    }
}

/// Depth in metres along the viewing direction; 0 where it is missing: far away, at grazing angles, and in a few discs.
fn measure(scene: &Scene, camera: &Camera, stream: &mut Stream) -> Vec<f64> {
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let discs: Vec<[f32; 3]> = (0..2 + stream.below(5))
        .map(|_| {
            let [x, y] = stream.uniform2();
            let radius = (0.02 + 0.06 * stream.uniform()) * width as f32;
            [x * width as f32, y * height as f32, radius]
        })
        .collect();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    let depth = pixels.map(|[x, y]| {
        let center = Vec2::new(x as f32, y as f32) + 0.5;
        let noise = f64::from(stream.normal());
        let in_disc = |&[x, y, radius]: &[f32; 3]| center.distance(Vec2::new(x, y)) < radius;
        let ray = camera.ray(center);
        let Some(hit) = scene.intersect(&ray).filter(|_| !discs.iter().any(in_disc)) else {
            return 0.0;
        };
        let depth = f64::from(hit.t * ray.direction.dot(camera.forward()));
        let normal = scene.normals[hit.triangle as usize];
        let cosine = normal.dot(ray.direction).abs();
        if depth > MAX_DEPTH || cosine < MIN_COSINE {
            return 0.0;
        }
        (depth + noise * deviation(depth)).max(0.0)
    });
    depth.collect()
}

fn write_depth(path: &Path, depth: &[f64], camera: &Camera) -> Result<()> {
    let units = depth.iter().map(|d| (d / UNIT).round() as u16).collect();
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let image = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_raw(width, height, units);
    let saved = image.map(|image| image.save(path));
    match saved {
        Some(Ok(())) => Ok(()),
        Some(Err(error)) => Err(Error::file(path, error, "make room for temporary files")),
        None => Err(Error::file(path, "has no pixels", "choose another size")),
    }
}
