//! The g-buffer: which surface points each pixel sees, from a few rays through it.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::math::rng::{Stream, splitmix64};
use crate::math::stats::upper_median;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::visibility::NOTHING;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Rays through a pixel besides the one through its centre: one in each quarter.
const QUARTERS: usize = 4;
/// Objects that fewer pixels than this see are not subsampled.
const RARE: u64 = 2_000;
/// Largest distance of a corner from a plane that it lies on, as a fraction of the scene's diameter.
const COPLANAR: f32 = 1e-6;
/// Sample key of g-buffer rays, disjoint from those of paths.
const KEY: u64 = 1 << 62;

/// One usable pixel of a photograph.
#[derive(Debug, Clone, Copy)]
pub struct GBufferPixel {
    /// Frame index.
    pub frame: u32,
    /// Pixel index, row by row from the top left.
    pub pixel: u32,
    /// Object that the pixel's centre sees; `u32::MAX` where the ray misses the mesh.
    pub object: u32,
    /// Whether all its rays hit the same side of one smooth surface of one object.
    pub pure: bool,
    /// Whether it is pure and its eight neighbours see the same object, so that no edge crosses it.
    pub inside: bool,
    /// Whether it is held out of the fit.
    pub held_out: bool,
    /// Hit points of the rays through the quarters; `None` where a ray misses the mesh.
    pub points: [Option<SurfacePoint>; QUARTERS],
}

/// A surface point that a camera ray hits.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// Position.
    pub point: Vec3,
    /// Unit normal of the side that is seen.
    pub normal: Vec3,
    /// Object index.
    pub object: u32,
}

/// The sampled usable pixels of all photographs.
#[derive(Debug, Clone)]
pub struct GBuffer {
    /// In order of frame and pixel.
    pub pixels: Vec<GBufferPixel>,
    /// For each object, the number of usable pixels of all photographs whose centre sees it.
    pub seen: Vec<u64>,
    /// Median width of a pixel's footprint on the surfaces, in metres; zero if no pixel sees the mesh.
    pub footprint: f32,
    /// Rays cast.
    pub rays: u64,
}

impl GBuffer {
    /// The pixels in the fit whose centre sees the mesh.
    pub fn fitted(&self) -> impl Iterator<Item = &GBufferPixel> {
        let fitted = |p: &&GBufferPixel| !p.held_out && p.object != u32::MAX;
        self.pixels.iter().filter(fitted)
    }

    /// For each photograph, whether none of its pixels is in the fit: it is held out whole or has no usable pixel.
    pub fn unfitted(&self, photographs: usize) -> Vec<bool> {
        let mut unfitted = vec![true; photographs];
        for pixel in self.pixels.iter().filter(|p| !p.held_out) {
            unfitted[pixel.frame as usize] = false;
        }
        unfitted
    }

    /// Casts the rays of about `max_pixels` pixels, chosen by hash, and of all pixels of objects that few pixels see.
    pub fn new(problem: &Problem, hold_out: HoldOut, seed: u64, max_pixels: usize) -> Self {
        let scene = &*problem.scene;
        let centers = scene.ids();
        let mut seen = vec![0u64; scene.objects.len()];
        for (photograph, triangles) in problem.photographs.iter().zip(&centers.triangles) {
            for (pixel, &triangle) in triangles.iter().enumerate() {
                let usable = photograph.is_usable(pixel);
                if let Some(&object) = scene.object_of.get(triangle as usize)
                    && usable
                {
                    seen[object as usize] += 1;
                }
            }
        }
        let total = problem.pixels();
        let fraction = (max_pixels as f64 / total.max(1) as f64).min(1.0);
        // Each pixel with its footprint and the number of its rays.
        let sampled: Vec<(GBufferPixel, Option<f32>, u64)> =
            (problem.photographs.par_iter().enumerate())
                .flat_map_iter(|(frame, photograph)| {
                    let view = FrameView {
                        scene,
                        camera: &scene.cameras[frame],
                        triangles: &centers.triangles[frame],
                        frame: frame as u32,
                        hold_out,
                    };
                    let seen = &seen;
                    let chosen = move |&pixel: &usize| {
                        let object = scene.object_of.get(view.triangles[pixel] as usize);
                        let rare = object.is_some_and(|&k| seen[k as usize] < RARE);
                        photograph.is_usable(pixel)
                            && (rare || drawn(fraction, frame as u64, pixel as u64))
                    };
                    let pixels = (0..photograph.pixels.len()).filter(chosen);
                    pixels.map(move |pixel| {
                        view.sample(pixel, Stream::new(seed, frame as u64, pixel as u64, KEY))
                    })
                })
                .collect();
        let mut footprints: Vec<f32> = sampled.iter().filter_map(|s| s.1).collect();
        Self {
            rays: total as u64 + sampled.iter().map(|s| s.2).sum::<u64>(),
            pixels: sampled.into_iter().map(|s| s.0).collect(),
            seen,
            footprint: upper_median(&mut footprints).unwrap_or(0.0),
        }
    }
}

/// Whether a pixel belongs to the hashed fraction of sampled pixels.
fn drawn(fraction: f64, frame: u64, pixel: u64) -> bool {
    fraction >= 1.0
        || ((splitmix64(splitmix64(frame ^ KEY) ^ pixel) >> 11) as f64)
            < fraction * (1u64 << 53) as f64
}

/// A photograph's camera, and the triangle that the centre of each of its pixels sees.
#[derive(Clone, Copy)]
struct FrameView<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    triangles: &'a [u32],
    frame: u32,
    hold_out: HoldOut,
}

impl FrameView<'_> {
    /// Samples a pixel with stratified offsets from `stream`; returns it with its width on the surface and the number of rays.
    /// Where the pixel and its neighbours see one plane, the points are computed on that plane without casting rays.
    fn sample(&self, pixel: usize, mut stream: Stream) -> (GBufferPixel, Option<f32>, u64) {
        let width = self.camera.intrinsics.width as usize;
        let corner = self.camera.corner(pixel);
        let triangle = self.triangles[pixel];
        let center = (triangle != NOTHING)
            .then(|| self.on_plane(triangle, corner + 0.5))
            .flatten();
        let one_object = (self.neighbours(pixel, width))
            .filter(|triangles| self.is_one_object(triangle, *triangles));
        let flat = center.is_some() && one_object.is_some_and(|t| self.is_flat(triangle, t));
        let points: [Option<SurfacePoint>; QUARTERS] = std::array::from_fn(|quarter| {
            let [dx, dy] = stream.uniform2();
            let offset = Vec2::new((quarter % 2) as f32 + dx, (quarter / 2) as f32 + dy) * 0.5;
            if flat {
                return self.on_plane(triangle, corner + offset);
            }
            let hit = self.scene.intersect(&self.camera.ray(corner + offset))?;
            Some(self.seen_from(hit.triangle, self.scene.point(&hit)))
        });

        // The footprint's area is d² / (f² cosθ).
        let footprint = center.map(|c| {
            let to_camera = self.camera.center - c.point;
            let lens = &self.camera.intrinsics;
            let focal = (lens.fx * lens.fy) as f32;
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
        let sampled = GBufferPixel {
            frame: self.frame,
            pixel: pixel as u32,
            object: center.map_or(u32::MAX, |c| c.object),
            pure,
            inside: pure && one_object.is_some(),
            held_out: self.hold_out.contains(self.frame, pixel as u32),
            points,
        };
        (sampled, footprint, if flat { 0 } else { QUARTERS as u64 })
    }

    /// A point on a triangle, with the normal of the side that faces the camera.
    fn seen_from(&self, triangle: u32, point: Vec3) -> SurfacePoint {
        let normal = self.scene.normals[triangle as usize];
        let front = normal.dot(self.camera.center - point) >= 0.0;
        SurfacePoint {
            point,
            normal: if front { normal } else { -normal },
            object: self.scene.object_of[triangle as usize],
        }
    }

    /// Where the ray through an image position meets a triangle's plane; `None` if the plane is parallel or behind the camera.
    fn on_plane(&self, triangle: u32, at: Vec2) -> Option<SurfacePoint> {
        let ray = self.camera.ray(at);
        let t = self.scene.plane_distance(triangle, &ray);
        let point = ray.origin + ray.direction * t;
        (t > 0.0 && point.is_finite()).then(|| self.seen_from(triangle, point))
    }

    /// The triangles that a pixel and its eight neighbours see, in three rows; `None` on the image border.
    fn neighbours(&self, pixel: usize, width: usize) -> Option<[&[u32]; 3]> {
        let height = self.triangles.len() / width;
        let (x, y) = (pixel % width, pixel / width);
        let surrounded = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
        surrounded.then(|| {
            [y - 1, y, y + 1].map(|y| &self.triangles[y * width + x - 1..=y * width + x + 1])
        })
    }

    /// Whether all `triangles` belong to the object of `own`.
    fn is_one_object(&self, own: u32, triangles: [&[u32]; 3]) -> bool {
        let object = |triangle: u32| self.scene.object_of.get(triangle as usize);
        (triangles.into_iter().flatten()).all(|&other| other == own || object(other) == object(own))
    }

    /// Whether all `triangles` lie in the plane of `own`.
    fn is_flat(&self, own: u32, triangles: [&[u32]; 3]) -> bool {
        let scene = self.scene;
        let [on_plane, _, _] = scene.corners(own);
        let normal = scene.normals[own as usize];
        let tolerance = COPLANAR * scene.diameter;
        let coplanar = |other: u32| {
            let corners = scene.corners(other);
            (corners.iter()).all(|c| (*c - on_plane).dot(normal).abs() <= tolerance)
        };
        (triangles.into_iter().flatten()).all(|&other| other == own || coplanar(other))
    }
}
