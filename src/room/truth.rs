//! The ground truth of the room, in the format that `relit evaluate` reads.

use crate::math::cumulative::Cumulative;
use crate::math::frame::Frame;
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::math::warp::{cosine_hemisphere, uniform_triangle};
use crate::scene::Object;
use crate::scene::camera::Camera;
use crate::scene::geometry::{Hit, Ray, offset_origin};
use crate::transport::lit::LitScene;
use crate::transport::material::Albedo;
use crate::transport::path::{PathOptions, radiance};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Sample points per object for its mean albedo, and paths per emitter for its irradiance.
const SAMPLES: u64 = 1 << 16;

/// The content of truth.json.
#[derive(Debug, Clone, Serialize)]
pub struct Truth {
    /// The capture's name.
    pub name: String,
    /// The program that rendered the photographs.
    pub renderer: String,
    /// Most bounces in the photographs; `None` if unbounded.
    pub max_bounces: Option<u32>,
    /// Samples per pixel of the photographs.
    pub spp: u32,
    /// Random seed of the photographs.
    pub seed: u64,
    /// Radiance from outside; `None` in the built-in room.
    pub outside_light: Option<[f32; 3]>,
    /// Truth of each object by name.
    pub objects: BTreeMap<String, ObjectTruth>,
}

/// The truth of one object.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectTruth {
    /// Diffuse reflectance; the mean over the area if textured.
    pub albedo: [f32; 3],
    /// Emitted radiance.
    pub emission: [f32; 3],
    /// Mean radiance leaving an emitter: emission + albedo · irradiance / π.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exitance: Option<[f32; 3]>,
    /// GGX roughness α of its specular lobe; `None` if diffuse.
    pub roughness: Option<f32>,
    /// Whether the albedo varies over the object.
    pub textured: bool,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of pixels of all photographs whose centre sees the object.
    pub pixels: u64,
    /// Area in square metres.
    pub area: f64,
}

impl From<BTreeMap<String, ObjectTruth>> for crate::capture::truth::Truth {
    fn from(objects: BTreeMap<String, ObjectTruth>) -> Self {
        let wide = |color: [f32; 3]| Vec3::from(color).as_dvec3();
        let known = |truth: ObjectTruth| crate::capture::truth::ObjectTruth {
            albedo: Some(wide(truth.albedo)),
            emission: wide(truth.emission),
            exitance: truth.exitance.map(wide),
            roughness: truth.roughness.map(f64::from),
            textured: truth.textured,
        };
        Self {
            objects: objects.into_iter().map(|(n, o)| (n, known(o))).collect(),
        }
    }
}

/// The truth of each object of a lit scene.
pub fn objects(world: &LitScene) -> BTreeMap<String, ObjectTruth> {
    let scene = &world.scene;
    let seen = seen_pixels(world);
    let truth = |(index, object): (usize, &Object)| {
        let material = &world.materials[index];
        let textured = !matches!(material.albedo, Albedo::Constant(_));
        let albedo = match material.albedo {
            Albedo::Constant(color) => color,
            _ => mean_over_area(world, index, |hit, _| material.albedo_at(hit)),
        };
        let emits = material.emission != Vec3::ZERO;
        let arriving = |hit: &Hit, stream: &mut Stream| arriving_radiance(world, hit, stream);
        let reflected = || albedo * mean_over_area(world, index, arriving);
        let truth = ObjectTruth {
            albedo: albedo.to_array(),
            emission: material.emission.to_array(),
            exitance: emits.then(|| (material.emission + reflected()).to_array()),
            roughness: material.lobe.map(|lobe| lobe.roughness),
            textured,
            triangles: object.triangles.len(),
            pixels: seen[index],
            area: object.area,
        };
        (object.name.clone(), truth)
    };
    scene.objects.iter().enumerate().map(truth).collect()
}

/// Number of pixels of all cameras whose centre sees each object.
pub fn seen_pixels(world: &LitScene) -> Vec<u64> {
    let objects = 0..world.scene.objects.len();
    let ids = world.scene.ids();
    objects.map(|object| ids.seen_pixels(object)).collect()
}

/// The true albedo seen by a camera, averaged over 4 × 4 points of each pixel.
pub fn albedo_picture(world: &LitScene, camera: &Camera) -> Picture {
    const SIDE: u32 = 4;
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    Picture::from_fn(width, height, |x, y| {
        let points = (0..SIDE * SIDE).map(|i| {
            let offset = Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5);
            let ray = camera.ray(Vec2::new(x as f32, y as f32) + offset / SIDE as f32);
            let hit = world.scene.intersect(&ray);
            hit.map_or(Vec3::ZERO, |hit| world.surface(&hit).albedo)
        });
        points.sum::<Vec3>() / (SIDE * SIDE) as f32
    })
}

/// Mean of a quantity over an object's area, from stratified random points with fixed keys.
fn mean_over_area(
    world: &LitScene,
    object: usize,
    quantity: impl Fn(&Hit, &mut Stream) -> Vec3 + Sync,
) -> Vec3 {
    let scene = &world.scene;
    let triangles = &scene.objects[object].triangles;
    let area = |&triangle: &u32| f64::from(scene.areas[triangle as usize]);
    let areas = Cumulative::new(triangles.iter().map(area));
    let values: Vec<Vec3> = (0..SAMPLES)
        .into_par_iter()
        .map(|index| {
            let mut stream = Stream::new(0, object as u64, 0, index);
            // Strata of equal area.
            let area = (index as f64 + stream.uniform_f64()) / SAMPLES as f64 * areas.total();
            let Some(chosen) = areas.index_at(area) else {
                return Vec3::ZERO;
            };
            let [b1, b2] = uniform_triangle(stream.uniform2());
            let hit = Hit {
                triangle: triangles[chosen],
                b1,
                b2,
                ..Hit::default()
            };
            quantity(&hit, &mut stream)
        })
        .collect();
    let sum: DVec3 = values.iter().map(|v| v.as_dvec3()).sum();
    (sum / SAMPLES as f64).as_vec3()
}

/// Radiance arriving at the front of a hit from a cosine-distributed direction; its mean is irradiance / π.
fn arriving_radiance(world: &LitScene, hit: &Hit, stream: &mut Stream) -> Vec3 {
    let normal = world.scene.normals[hit.triangle as usize];
    let direction = Frame::around(normal).to_world(cosine_hemisphere(stream.uniform2()));
    let corners = world.scene.corners(hit.triangle);
    let origin = offset_origin(world.scene.point(hit), normal, &corners, direction);
    let ray = Ray::new(origin, direction);
    radiance(world, &ray, stream, &PathOptions::default()).radiance
}
