//! relit's hierarchy against Embree's `rtcIntersect1` and `rtcOccluded1`: one thread, the same triangles and rays.
//!
//! `cargo run --release [-- RUNS [EMBREE_CONFIG [SCENE]]]`; the figures are medians over paired, alternating runs.

mod clock;
mod embree;
mod scenes;

use clock::paired;
use embree::{Embree, Quality};
use relit::scene::bvh::{Bvh, InstructionSet};
use relit::scene::geometry::Ray;
use scenes::Scene;
use std::time::Instant;

/// Rays a run.
const RAYS: usize = 200_000;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let runs: usize = arguments
        .next()
        .map_or(9, |n| n.parse().expect("a number of runs"));
    let config = arguments.next().unwrap_or_default();
    let wanted = arguments.next().unwrap_or_default();
    println!(
        "relit: {:?}; {runs} paired runs of {RAYS} rays, one thread",
        InstructionSet::widest()
    );
    println!(
        "Mrays/s of thread time are medians; ratio = relit / Embree, median of the pairs (least, most)\n"
    );
    println!(
        "| scene | triangles | rays | Embree build | relit | Embree | ratio |\n| --- | --- | --- | --- | --- | --- | --- |"
    );
    let scenes = [
        Scene::small(),
        Scene::room("room", 10.0, 0),
        Scene::room("furnished room", 0.05, 60),
        Scene::room("fine room", 0.02, 200),
    ];
    for scene in scenes.iter().filter(|scene| scene.name.contains(&wanted)) {
        compare(scene, runs, &config);
    }
}

fn compare(scene: &Scene, runs: usize, config: &str) {
    let start = Instant::now();
    let bvh = Bvh::new(&scene.positions, &scene.triangles);
    let built = start.elapsed().as_secs_f64();
    let (bounces, shadows) = scene.bounce_rays(&bvh, RAYS);
    eprintln!("{}: {bvh:?} built in {built:.2} s", scene.name);
    for (name, quality) in [
        (
            "medium",
            Quality {
                high: false,
                robust: false,
            },
        ),
        (
            "high",
            Quality {
                high: true,
                robust: false,
            },
        ),
        (
            "high, robust",
            Quality {
                high: true,
                robust: true,
            },
        ),
    ] {
        let embree = Embree::new(&scene.positions, &scene.triangles, quality, config);
        agree(&bvh, &embree, &bounces);
        let row = |rays: &str, [ours, theirs, ratio]: [[f64; 3]; 3]| {
            println!(
                "| {} | {} | {rays} | {name} | {:.2} | {:.2} | {:.2} ({:.2}–{:.2}) |",
                scene.name,
                scene.triangles.len(),
                ours[1],
                theirs[1],
                ratio[1],
                ratio[0],
                ratio[2]
            );
        };
        row(
            "bounces, nearest hit",
            paired(
                runs,
                &bounces,
                |r| bvh.intersect(r).map_or(0.0, |h| h.t),
                |r| embree.intersect(r).map_or(0.0, |h| h.0),
            ),
        );
        row(
            "bounces, any hit",
            paired(
                runs,
                &bounces,
                |r| f32::from(u8::from(bvh.occluded(r))),
                |r| f32::from(u8::from(embree.occluded(r))),
            ),
        );
        row(
            "to the lamp, any hit",
            paired(
                runs,
                &shadows,
                |r| f32::from(u8::from(bvh.occluded(r))),
                |r| f32::from(u8::from(embree.occluded(r))),
            ),
        );
    }
}

/// Says how many rays the two disagree on by more than rounding.
fn agree(bvh: &Bvh, embree: &Embree, rays: &[Ray]) {
    let differ = rays
        .iter()
        .filter(|ray| match (bvh.intersect(ray), embree.intersect(ray)) {
            (None, None) => false,
            (Some(a), Some(b)) => (a.t - b.0).abs() > 1e-4 * a.t.max(1e-3),
            _ => true,
        })
        .count();
    eprintln!(
        "  nearest distances differ for {differ} of {} rays",
        rays.len()
    );
}
