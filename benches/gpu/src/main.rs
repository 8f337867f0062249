//! Rays, paths and pictures by a graphics card beside the processor's, in one run: the same rays, the same pictures.
//!
//! `cargo run --release [-- cards|any [RAYS [SAMPLES [RUNS]]]]`; `any` takes a software adapter too. Figures are medians over paired runs
//! of wall time, on all threads of the processor; the card's hold the transfer of rays and hits.

#[path = "../../embree/src/scenes.rs"]
mod scenes;

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::{Capture, Frame};
use relit::gpu::{Adapters, Card, Tracer, View};
use relit::room::Room;
use relit::scene::camera::Camera;
use relit::scene::geometry::Ray;
use relit::transport::film::Film;
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::PathOptions;
use scenes::Scene;
use std::sync::Arc;
use std::time::Instant;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let adapters = match arguments.next().as_deref() {
        None | Some("cards") => Adapters::Cards,
        Some("any") => Adapters::Any,
        Some(_) => panic!("cards or any"),
    };
    let mut number = |default: usize| {
        let given = arguments.next();
        given.map_or(default, |n| n.parse().expect("a whole number"))
    };
    let (rays, samples, runs) = (number(1 << 20), number(16), number(5));
    let Some(card) = Card::open(adapters) else {
        eprintln!("no graphics card");
        std::process::exit(1);
    };
    println!(
        "{} beside {} threads; {runs} paired runs of {rays} rays and of {samples} samples a pixel",
        card.name(),
        rayon::current_num_threads()
    );
    println!("| scene | triangles | what | card | processor | ratio |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for scene in [
        Scene::small(),
        Scene::room("room", 10.0, 0),
        Scene::room("furnished room", 0.05, 60),
    ] {
        rays_a_second(&card, scene, rays, runs);
    }
    let room = Room::new().lit([320, 240]).expect("the room is sound");
    paths_a_second(&card, &room, samples as u32, runs);
    seconds_to_a_picture(&card, &room, samples as u32, runs);
    frames_a_second(&card, &room, runs);
}

/// Nearest hits of bounces and any hits towards a lamp.
fn rays_a_second(card: &Card, mut scene: Scene, count: usize, runs: usize) {
    let lit = lit(&scene);
    // Scenes are about their middle.
    let origin = lit.scene.origin.as_vec3();
    scene.positions = lit.scene.positions.clone();
    scene.eyes.iter_mut().for_each(|eye| *eye -= origin);
    scene.lamp.iter_mut().for_each(|corner| *corner -= origin);
    let (bounces, shadows) = scene.bounce_rays(&lit.scene.bvh, count);
    let mut tracer = Tracer::new(card, &lit, &[]).expect("the scene fits");
    for (what, rays, any) in [
        ("bounces, nearest hit", &bounces, false),
        ("to the lamp, any hit", &shadows, true),
    ] {
        let by_card = || {
            let hits = tracer.trace(rays, any).expect("the card works");
            hits.iter().filter(|hit| hit.is_some()).count()
        };
        let by_processor = || {
            let is_hit = |ray: &&Ray| match any {
                true => lit.scene.occluded(ray),
                false => lit.scene.intersect(ray).is_some(),
            };
            rays.par_iter().filter(is_hit).count()
        };
        let figures = paired(runs, rays.len() as f64 * 1e-6, by_card, by_processor);
        row(
            scene.name,
            lit.scene.triangles.len(),
            what,
            "Mrays/s",
            figures,
        );
    }
}

/// Seed of all pictures.
const SEED: u64 = 1;

/// Full paths of a view of the built-in room.
fn paths_a_second(card: &Card, lit: &LitScene, samples: u32, runs: usize) {
    let camera = &lit.scene.cameras[0];
    let mut painters = Painters::new(card, lit, camera);
    let work = camera.pixels() as f64 * f64::from(samples) * 1e-6;
    let [by_card, by_processor] = painters.each(samples);
    let figures = paired(runs, work, by_card, by_processor);
    let triangles = lit.scene.triangles.len();
    row(
        "built-in room",
        triangles,
        "full paths",
        "Mpaths/s",
        figures,
    );
}

/// Pictures a second with an error of 1 % of their mean, from the time of `samples` samples a pixel and the difference between two
/// independent pictures.
fn seconds_to_a_picture(card: &Card, lit: &LitScene, samples: u32, runs: usize) {
    let camera = &lit.scene.cameras[0];
    let options = PathOptions::default();
    let picture = |seed| {
        let mut film = Film::new(camera);
        film.add(lit, camera, &options, seed, 0, samples);
        film.mean()
    };
    let [a, b] = [SEED, SEED + 1].map(picture);
    let pairs = a.iter().zip(&b);
    let square: f64 = (pairs.clone())
        .map(|(a, b)| f64::from((*a - *b).length_squared()))
        .sum();
    let mean: f64 = pairs.map(|(a, b)| f64::from((*a + *b).element_sum())).sum();
    let count = 3.0 * a.len() as f64;
    // The difference has twice the variance of one picture.
    let error = (0.5 * square / count).sqrt() / (0.5 * mean / count);
    let times = (error / 0.01).powi(2);
    let mut painters = Painters::new(card, lit, camera);
    let [by_card, by_processor] = painters.each(samples);
    let figures = paired(runs, 1.0 / times, by_card, by_processor);
    let what = format!(
        "pictures of 1 % error ({:.0} samples)",
        times * f64::from(samples)
    );
    row(
        "built-in room",
        lit.scene.triangles.len(),
        &what,
        "1/s",
        figures,
    );
}

/// Frames a second of 1280 × 800 pixels with one sample each.
fn frames_a_second(card: &Card, lit: &LitScene, runs: usize) {
    const FRAMES: usize = 8;
    let mut camera = lit.scene.cameras[0].clone();
    let grow = 1280.0 / f64::from(camera.intrinsics.width);
    let k = &mut camera.intrinsics;
    (k.width, k.height) = (1280, 800);
    (k.fx, k.fy, k.cx, k.cy) = (k.fx * grow, k.fy * grow, 640.0, 400.0);
    let mut painters = Painters::new(card, lit, &camera);
    let [mut by_card, mut by_processor] = painters.each(1);
    let frames = |paint: &mut dyn FnMut() -> usize| (0..FRAMES).map(|_| paint()).sum();
    let by_card = || frames(&mut *by_card);
    let by_processor = || frames(&mut *by_processor);
    let figures = paired(runs, FRAMES as f64, by_card, by_processor);
    let what = "frames of 1280 × 800, 1 sample";
    row(
        "built-in room",
        lit.scene.triangles.len(),
        what,
        "1/s",
        figures,
    );
}

/// The same pictures by card and processor.
struct Painters<'a> {
    tracer: Tracer,
    lit: &'a LitScene,
    camera: &'a Camera,
    options: PathOptions,
}

impl<'a> Painters<'a> {
    fn new(card: &Card, lit: &'a LitScene, camera: &'a Camera) -> Self {
        Self {
            tracer: Tracer::new(card, lit, &[]).expect("the room fits"),
            lit,
            camera,
            options: PathOptions::default(),
        }
    }

    /// Both add samples to a picture of their own and return the number of its rays.
    fn each(&mut self, samples: u32) -> [Box<dyn FnMut() -> usize + '_>; 2] {
        let (lit, camera, options) = (self.lit, self.camera, &self.options);
        let tracer = &mut self.tracer;
        let [mut card, mut processor] = [Film::new(camera), Film::new(camera)];
        let by_card = move || {
            let view = View {
                camera,
                options,
                seed: SEED,
                frame: 0,
            };
            tracer
                .add(&mut card, &view, samples)
                .expect("the card works");
            std::hint::black_box(card.mean());
            card.rays as usize
        };
        let by_processor = move || {
            processor.add(lit, camera, options, SEED, 0, samples);
            std::hint::black_box(processor.mean());
            processor.rays as usize
        };
        [Box::new(by_card), Box::new(by_processor)]
    }
}

fn row(scene: &str, triangles: usize, what: &str, unit: &str, [card, processor, ratio]: [f64; 3]) {
    println!(
        "| {scene} | {triangles} | {what}, {unit} | {card:.3} | {processor:.3} | {ratio:.3} |"
    );
}

/// Median work a second of both ways, and of their ratio pair by pair. Says where their counts differ.
fn paired(
    runs: usize,
    work: f64,
    mut card: impl FnMut() -> usize,
    mut processor: impl FnMut() -> usize,
) -> [f64; 3] {
    let mut pairs = Vec::new();
    for run in 0..=runs {
        let start = Instant::now();
        let found = card();
        let by_card = work / start.elapsed().as_secs_f64();
        let start = Instant::now();
        let truth = processor();
        let by_processor = work / start.elapsed().as_secs_f64();
        if found != truth && run == 0 {
            eprintln!("  counts differ: {found} against {truth}");
        }
        // The first pair only warms up.
        if run > 0 {
            pairs.push([by_card, by_processor, by_card / by_processor]);
        }
    }
    [0, 1, 2].map(|column| {
        let mut values: Vec<f64> = pairs.iter().map(|pair| pair[column]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    })
}

/// The triangles as a scene of one grey object.
fn lit(scene: &Scene) -> LitScene {
    let mesh = Mesh {
        positions: scene.positions.iter().map(|p| p.as_dvec3()).collect(),
        triangles: scene.triangles.clone(),
        object_of: vec![0; scene.triangles.len()],
        objects: vec!["all".to_owned()],
        ..Mesh::default()
    };
    let frame = Frame {
        intrinsics: Intrinsics {
            width: 1,
            height: 1,
            fx: 1.0,
            fy: 1.0,
            cx: 0.5,
            cy: 0.5,
            distortion: [0.0; 4],
        },
        pose: Pose {
            rotation: DMat3::IDENTITY,
            center: DVec3::ZERO,
        },
        exposure: None,
        photograph: PhotographSource::Memory(Arc::new(Photograph {
            width: 1,
            height: 1,
            pixels: vec![Vec3::ZERO],
            usable: Vec::new(),
            encoding: Encoding::Linear,
            saturation: Vec3::INFINITY,
            limits: Vec::new(),
        })),
        depth: None,
    };
    let capture = Capture {
        name: "bench".into(),
        folder: None,
        segmentation: None,
        frames: vec![frame],
        mesh,
        up: DVec3::Y,
        warnings: Vec::new(),
    };
    let scene = relit::scene::Scene::new(&capture).expect("the scene is sound");
    let grey = Material::diffuse(Vec3::splat(0.5), Vec3::ZERO);
    LitScene::new(Arc::new(scene), vec![grey], None)
}
