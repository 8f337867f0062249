//! What each pixel sees: the objects behind a few rays through it.

use crate::inverse::held_out::is_held_out;
use crate::inverse::settings::Settings;
use crate::inverse::solver::Problem;
use crate::math::rng::{Stream, splitmix64};
use crate::scene::Scene;
use crate::scene::geometry::Hit;
use crate::scene::visibility::IdBuffers;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Rays through a pixel besides the one through its centre: one in each quarter.
const QUARTERS: usize = 4;
/// All pixels are looked at of objects that fewer pixels than this see.
const RARE: u64 = 2_000;
/// First of the sample keys of survey rays, far from those of paths.
const KEY: u64 = 1 << 62;

/// One usable pixel of a photograph.
#[derive(Debug, Clone, Copy)]
pub struct SurveyedPixel {
    /// Frame index.
    pub frame: u32,
    /// Row by row from the top left.
    pub pixel: u32,
    /// Object behind the centre; `u32::MAX` where the ray leaves the mesh.
    pub object: u32,
    /// Whether all its rays meet one side of one smooth surface of one object.
    pub pure: bool,
    /// Whether it is kept out of the fit.
    pub held_out: bool,
    /// Points behind the quarters, with the normal of the side that is seen; unset where a ray leaves the mesh.
    pub points: [Option<SurveyPoint>; QUARTERS],
}

/// A surface point behind a part of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct SurveyPoint {
    /// Position.
    pub point: Vec3,
    /// Unit normal of the side that is seen.
    pub normal: Vec3,
    /// Object index.
    pub object: u32,
}

/// The usable pixels that were looked at, and how often each object was seen.
#[derive(Debug, Clone)]
pub struct Survey {
    /// In order of frame and pixel.
    pub pixels: Vec<SurveyedPixel>,
    /// For each object, usable pixels whose centre sees it.
    pub seen: Vec<u64>,
    /// Median size of a pixel's footprint on the surfaces, in metres; zero where no pixel sees the mesh.
    pub footprint: f32,
    /// Rays cast.
    pub rays: u64,
}

impl Survey {
    /// Casts the rays of all pixels, or of a keyed share of about `most_pixels` and of the objects that few pixels see.
    pub fn new(problem: &Problem, settings: &Settings, most_pixels: usize) -> Self {
        let scene = &*problem.scene;
        let centers = IdBuffers::new(scene);
        let mut seen = vec![0u64; scene.objects.len()];
        for (photograph, triangles) in problem.photographs.iter().zip(&centers.triangles) {
            for (pixel, &triangle) in triangles.iter().enumerate() {
                let usable = photograph.usable.is_empty() || photograph.usable[pixel];
                if let Some(&object) = scene.object_of.get(triangle as usize)
                    && usable
                {
                    seen[object as usize] += 1;
                }
            }
        }
        let total: usize = problem.photographs.iter().map(|p| p.pixels.len()).sum();
        let share = (most_pixels as f64 / total.max(1) as f64).min(1.0);
        let frames: Vec<(Vec<SurveyedPixel>, Vec<f32>)> = problem
            .photographs
            .par_iter()
            .enumerate()
            .map(|(frame, photograph)| {
                let mut pixels = Vec::new();
                let mut footprints = Vec::new();
                for pixel in 0..photograph.pixels.len() {
                    let usable = photograph.usable.is_empty() || photograph.usable[pixel];
                    let triangle = centers.triangles[frame][pixel] as usize;
                    let rare = scene
                        .object_of
                        .get(triangle)
                        .is_some_and(|&k| seen[k as usize] < RARE);
                    if !usable || !(rare || drawn(share, frame as u64, pixel as u64)) {
                        continue;
                    }
                    let held_out = is_held_out(settings, frame as u32, pixel as u32);
                    let (surveyed, footprint) = look(
                        scene,
                        settings.seed,
                        frame,
                        pixel,
                        photograph.width,
                        held_out,
                    );
                    footprints.extend(footprint);
                    pixels.push(surveyed);
                }
                (pixels, footprints)
            })
            .collect();

        let mut pixels = Vec::with_capacity(frames.iter().map(|f| f.0.len()).sum());
        let mut footprints = Vec::with_capacity(pixels.capacity());
        for (frame_pixels, frame_footprints) in frames {
            pixels.extend(frame_pixels);
            footprints.extend(frame_footprints);
        }
        let middle = footprints.len() / 2;
        let footprint = if footprints.is_empty() {
            0.0
        } else {
            *footprints.select_nth_unstable_by(middle, f32::total_cmp).1
        };
        let rays = total as u64 + pixels.len() as u64 * (QUARTERS as u64 + 1);
        Self {
            pixels,
            seen,
            footprint,
            rays,
        }
    }
}

/// Whether a pixel belongs to the keyed share that is looked at.
fn drawn(share: f64, frame: u64, pixel: u64) -> bool {
    share >= 1.0
        || ((splitmix64(splitmix64(frame ^ KEY) ^ pixel) >> 11) as f64)
            < share * (1u64 << 53) as f64
}

/// Looks through one pixel; returns it with the size of its footprint.
fn look(
    scene: &Scene,
    seed: u64,
    frame: usize,
    pixel: usize,
    width: u32,
    held_out: bool,
) -> (SurveyedPixel, Option<f32>) {
    let camera = &scene.cameras[frame];
    let corner = Vec2::new(
        (pixel % width as usize) as f32,
        (pixel / width as usize) as f32,
    );
    let seen_from = |hit: &Hit| {
        let normal = scene.normals[hit.triangle as usize];
        let point = scene.point(hit);
        let front = normal.dot(camera.center - point) >= 0.0;
        SurveyPoint {
            point,
            normal: if front { normal } else { -normal },
            object: scene.object_of[hit.triangle as usize],
        }
    };
    let center = scene
        .intersect(&camera.ray(corner + 0.5))
        .map(|hit| seen_from(&hit));
    let mut stream = Stream::new(seed, frame as u64, pixel as u64, KEY);
    let points: [Option<SurveyPoint>; QUARTERS] = std::array::from_fn(|quarter| {
        let [dx, dy] = stream.uniform2();
        let offset = Vec2::new((quarter % 2) as f32 + dx, (quarter / 2) as f32 + dy) * 0.5;
        scene
            .intersect(&camera.ray(corner + offset))
            .map(|hit| seen_from(&hit))
    });

    // The footprint's area is d² / (f² cosθ).
    let footprint = center.map(|c| {
        let to_camera = camera.center - c.point;
        let focal = (camera.intrinsics.fx * camera.intrinsics.fy) as f32;
        let cosine = c.normal.dot(to_camera.normalize_or_zero()).max(0.05);
        (to_camera.length_squared() / (focal * cosine)).sqrt()
    });
    let pure = center.zip(footprint).is_some_and(|(center, size)| {
        points.iter().all(|p| {
            p.is_some_and(|p| {
                p.object == center.object
                    && p.normal.dot(center.normal) > 0.9
                    && (p.point - center.point).dot(center.normal).abs() < size
            })
        })
    });
    let object = center.map_or(u32::MAX, |c| c.object);
    let surveyed = SurveyedPixel {
        frame: frame as u32,
        pixel: pixel as u32,
        object,
        pure,
        held_out,
        points,
    };
    (surveyed, footprint)
}
