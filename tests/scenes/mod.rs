//! Rooms made by code, and photographs of them rendered in memory, for tests of light transport and of solvers.
#![allow(dead_code, reason = "each test uses its own part")]

use glam::{DMat3, DVec3, Vec2, Vec3};
use relit::calibrate::problem::Problem;
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::{Capture, Frame};
use relit::inverse::estimate::{Estimate, TexelEstimate};
use relit::inverse::settings::Settings;
use relit::inverse::solve;
use relit::inverse::solver::{Control, Observer, Progress, Solution};
use relit::scene::Scene;
use relit::scene::geometry::Hit;
use relit::transport::environment::Environment;
use relit::transport::film::Film;
use relit::transport::lit::LitScene;
use relit::transport::material::{Albedo, Material, Texture};
use relit::transport::path::PathOptions;
use std::sync::Arc;

/// Adds a quad, counter-clockwise seen from its front, to the object of that name.
pub fn quad(mesh: &mut Mesh, name: &str, corners: [DVec3; 4]) {
    let object = mesh.objects.iter().position(|o| o == name);
    let object = object.unwrap_or_else(|| {
        mesh.objects.push(name.to_owned());
        mesh.objects.len() - 1
    }) as u32;
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    mesh.triangles
        .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh.object_of.extend([object, object]);
}

/// The six faces of a box, each with its name; their fronts look inwards, or outwards.
fn faces(mesh: &mut Mesh, names: [&str; 6], half: DVec3, center: DVec3, inwards: bool) {
    for (index, name) in names.into_iter().enumerate() {
        let (axis, sign) = (index / 2, [-1.0, 1.0][index % 2]);
        let mut n = DVec3::ZERO;
        n[axis] = sign;
        let mut u = DVec3::ZERO;
        u[(axis + 1) % 3] = 1.0;
        let v = n.cross(u);
        // u × (n × u) = n for unit u ⟂ n, so the order that looks along −n is v before u.
        let at = |a: f64, b: f64| center + (n + v * a + u * b) * half;
        let mut corners = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
        if !inwards {
            corners.reverse();
        }
        quad(mesh, name, corners);
    }
}

/// A closed box of half size `half` about `center`, its six faces looking inwards.
pub fn closed_box(half: f64, center: DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    let names = ["left", "right", "floor", "ceiling", "back", "front"];
    faces(&mut mesh, names, DVec3::splat(half), center, true);
    mesh
}

/// Adds a block, its faces looking outwards.
pub fn block(mesh: &mut Mesh, name: &str, half: DVec3, center: DVec3) {
    faces(mesh, [name; 6], half, center, false);
}

/// Adds a square lamp that looks down.
pub fn lamp(mesh: &mut Mesh, half: f64, center: DVec3) {
    let at = |x: f64, z: f64| center + DVec3::new(x, 0.0, z) * half;
    quad(
        mesh,
        "lamp",
        [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
    );
}

/// A room of 2 units with walls of six colours, a lamp below the ceiling, and a block on the floor.
pub fn lamp_room() -> (Mesh, Vec<Material>) {
    let mut mesh = closed_box(1.0, DVec3::ZERO);
    lamp(&mut mesh, 0.35, DVec3::new(0.1, 0.9, -0.1));
    let (half, center) = (DVec3::new(0.25, 0.3, 0.2), DVec3::new(-0.35, -0.69, -0.3));
    faces(&mut mesh, ["block"; 6], half, center, false);
    let materials = [
        ([0.62, 0.10, 0.08], [0.0; 3]),
        ([0.12, 0.45, 0.15], [0.0; 3]),
        ([0.40, 0.32, 0.25], [0.0; 3]),
        ([0.80, 0.80, 0.78], [0.0; 3]),
        ([0.70, 0.68, 0.60], [0.0; 3]),
        ([0.55, 0.58, 0.65], [0.0; 3]),
        // What a lamp reflects cannot be told from what it emits, so this one reflects nothing.
        ([0.0; 3], [14.0, 12.0, 9.0]),
        ([0.25, 0.30, 0.60], [0.0; 3]),
    ]
    .map(|(albedo, emission)| Material::diffuse(albedo.into(), emission.into()));
    (mesh, materials.to_vec())
}

/// A checkerboard of so many squares a side and two colours over the quad whose first triangle is given, in a mesh of so many.
pub fn checkerboard(
    triangles: usize,
    first: usize,
    checks: u32,
    colors: [Vec3; 2],
) -> Arc<Texture> {
    let size = checks * 16;
    let color = |i: u32| colors[((i % size / 16 + i / size / 16) % 2) as usize];
    let mut corner_uvs = vec![[Vec2::ZERO; 3]; triangles];
    corner_uvs[first] = [Vec2::ZERO, Vec2::X, Vec2::ONE];
    corner_uvs[first + 1] = [Vec2::ZERO, Vec2::ONE, Vec2::Y];
    Arc::new(Texture {
        width: size,
        height: size,
        pixels: (0..size * size).map(color).collect(),
        corner_uvs: Arc::new(corner_uvs),
    })
}

/// How a texel of a quad compares with the texture that is there.
pub struct TexelError {
    /// Pixels that saw it.
    pub seen: u32,
    /// What was found less the truth at its middle.
    pub error: Vec3,
    /// The reported standard error.
    pub stderr: Vec3,
    /// Whether the truth is one colour over it.
    pub is_even: bool,
}

/// All texels of the quad whose first triangle is given.
pub fn texel_errors(texels: &TexelEstimate, texture: &Texture, first: usize) -> Vec<TexelError> {
    let layout = &texels.colors.layout;
    let mut errors = Vec::new();
    for triangle in [first, first + 1] {
        let truth = |[b1, b2]: [f32; 2]| {
            texture.at(&Hit {
                t: 0.0,
                triangle: triangle as u32,
                b1,
                b2,
            })
        };
        let start = layout.first[triangle];
        for texel in 0..layout.first[triangle + 1] - start {
            let at = (start + texel) as usize;
            let center = truth(layout.center(triangle, texel));
            errors.push(TexelError {
                seen: texels.seen[at],
                error: texels.colors.colors[at] - center,
                stderr: texels.stderr[at],
                is_even: (layout.corners(triangle, texel).iter())
                    .all(|&corner| truth(corner).distance(center) < 1e-3),
            });
        }
    }
    errors
}

/// A room without the objects of the given names.
pub fn without((whole, materials): (Mesh, Vec<Material>), names: &[&str]) -> (Mesh, Vec<Material>) {
    let mut mesh = Mesh::default();
    let mut kept = Vec::new();
    for (triangle, &object) in whole.triangles.iter().zip(&whole.object_of) {
        let name = &whole.objects[object as usize];
        if names.contains(&name.as_str()) {
            continue;
        }
        if !mesh.objects.contains(name) {
            mesh.objects.push(name.clone());
            kept.push(materials[object as usize].clone());
        }
        let first = mesh.positions.len() as u32;
        mesh.positions
            .extend(triangle.map(|corner| whole.positions[corner as usize]));
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.object_of
            .push(mesh.objects.iter().position(|o| o == name).unwrap_or(0) as u32);
    }
    (mesh, kept)
}

/// A camera's place and the point in the middle of its picture.
pub type View = (DVec3, DVec3);

/// Three views of the back wall of [`closed_box`], from in front and from both sides, and one of the front.
pub fn back_wall_views() -> [View; 4] {
    [
        ([0.1, 0.0, 0.9], [0.0, 0.0, -1.0]),
        ([-0.6, 0.2, 0.5], [0.3, -0.1, -1.0]),
        ([0.6, -0.3, 0.5], [-0.3, 0.1, -1.0]),
        ([0.5, 0.3, -0.5], [-0.5, -0.6, 0.9]),
    ]
    .map(|(center, target)| (DVec3::from_array(center), DVec3::from_array(target)))
}

/// Six views of [`lamp_room`] that see all of its objects.
pub fn room_views() -> [View; 6] {
    [
        ([0.7, 0.1, 0.8], [-0.4, -0.3, -0.8]),
        ([-0.7, 0.2, 0.8], [0.5, 0.0, -0.8]),
        ([0.8, 0.0, -0.8], [-0.3, 0.2, 0.9]),
        ([-0.8, -0.1, 0.5], [0.9, -0.5, 0.3]),
        ([0.6, -0.6, 0.6], [-0.1, 0.9, -0.2]),
        ([0.85, 0.5, 0.0], [-0.9, -0.6, 0.0]),
    ]
    .map(|(center, target)| (DVec3::from_array(center), DVec3::from_array(target)))
}

/// A capture with a black photograph a view, of a wide lens.
pub fn capture(mesh: Mesh, views: &[View], [width, height]: [u32; 2]) -> Capture {
    let focal = 0.6 * f64::from(width);
    let intrinsics = Intrinsics {
        width,
        height,
        fx: focal,
        fy: focal,
        cx: 0.5 * f64::from(width),
        cy: 0.5 * f64::from(height),
        distortion: [0.0; 4],
    };
    let black = Arc::new(photograph(
        [width, height],
        vec![Vec3::ZERO; (width * height) as usize],
    ));
    let frames = views.iter().map(|&(center, target)| {
        let z = (center - target).normalize_or_zero();
        let x = DVec3::Y.cross(z).normalize_or_zero();
        Frame {
            intrinsics,
            pose: Pose {
                rotation: DMat3::from_cols(x, z.cross(x), z),
                center,
            },
            exposure: None,
            photograph: PhotographSource::Memory(black.clone()),
            depth: None,
        }
    });
    Capture {
        name: "test".into(),
        folder: None,
        segmentation: None,
        frames: frames.collect(),
        mesh,
        up: DVec3::Y,
        warnings: Vec::new(),
    }
}

/// Listens without a word.
struct Silent;

impl Observer for Silent {
    fn observe(&mut self, _: &Progress, _: &Estimate) -> Control {
        Control::Continue
    }
}

/// The default settings with a third of the paths.
pub fn with_fewer_paths() -> Settings {
    Settings {
        paths: 500_000,
        ..Settings::default()
    }
}

/// Solves without steering.
pub fn solved(problem: &Problem, settings: &Settings) -> Solution {
    solve(problem, settings, None, &mut Silent).expect("nothing to resume")
}

/// The one albedo of a material.
pub fn albedo(material: &Material) -> Vec3 {
    match material.albedo {
        Albedo::Constant(color) => color,
        _ => panic!("the room has constant materials"),
    }
}

/// Lets a photograph saturate at a value.
pub fn clip(photograph: &mut Photograph, at: f32) {
    photograph.saturation = Vec3::splat(at);
    for pixel in &mut photograph.pixels {
        *pixel = pixel.min(photograph.saturation);
    }
}

/// A linear photograph that may be used everywhere.
pub fn photograph([width, height]: [u32; 2], pixels: Vec<Vec3>) -> Photograph {
    Photograph {
        width,
        height,
        pixels,
        usable: Vec::new(),
        encoding: Encoding::Linear,
        saturation: Vec3::INFINITY,
        limits: Vec::new(),
    }
}

/// A mesh as a scene, with one small camera at the origin.
pub fn scene_of(mesh: Mesh) -> Arc<Scene> {
    let capture = capture(mesh, &[(DVec3::ZERO, DVec3::NEG_Z)], [4, 4]);
    Arc::new(Scene::new(&capture).expect("the test scene is sound"))
}

/// The photographs of a capture's cameras under given materials, `samples` paths a pixel, all bounces.
pub fn photographed(capture: &Capture, materials: &[Material], samples: u32, seed: u64) -> Problem {
    photographed_under(None, capture, materials, samples, seed)
}

/// The same with light from outside.
pub fn photographed_under(
    outside: Option<Arc<Environment>>,
    capture: &Capture,
    materials: &[Material],
    samples: u32,
    seed: u64,
) -> Problem {
    let scene = Arc::new(Scene::new(capture).expect("the test scene is sound"));
    let lit = LitScene::new(scene.clone(), materials.to_vec(), outside);
    let photographs = (0u64..)
        .zip(&scene.cameras)
        .map(|(frame, camera)| {
            let mut film = Film::new(camera);
            film.add(&lit, camera, &PathOptions::default(), seed, frame, samples);
            Arc::new(photograph([film.width, film.height], film.mean()))
        })
        .collect();
    Problem { scene, photographs }
}
