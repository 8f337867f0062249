//! obvhs's builders against relit's, both under relit's eight-wide traversal: one thread, the same triangles and rays.
//!
//! `cargo run --release [-- RUNS [SCENE [BUILDER]]]`; the figures are medians over paired, alternating runs.

#[path = "../../embree/src/clock.rs"]
mod clock;
#[path = "../../embree/src/scenes.rs"]
mod scenes;

use clock::paired;
use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::triangle::Triangle;
use relit::scene::bvh::{Bvh, InstructionSet, Tree, TreeNode};
use scenes::Scene;
use std::time::{Duration, Instant};

/// Rays a run.
const RAYS: usize = 200_000;

/// Builds of which the fastest counts.
const BUILDS: usize = 3;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let runs: usize = arguments
        .next()
        .map_or(9, |n| n.parse().expect("a number of runs"));
    let wanted = arguments.next().unwrap_or_default();
    let builder = arguments.next().unwrap_or_default();
    println!(
        "{:?}; {runs} paired runs of {RAYS} rays, one thread; builds on all threads, the fastest of {BUILDS}",
        InstructionSet::widest()
    );
    println!(
        "Mrays/s of thread time are medians; ratio = this builder / relit, median of the pairs (min, max)\n"
    );
    println!(
        "| scene | triangles | builder | build this / relit | rays | this | relit | ratio |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    let scenes = [
        Scene::small(),
        Scene::room("room", 10.0, 0),
        Scene::room("furnished room", 0.05, 60),
        Scene::room("fine room", 0.02, 200),
    ];
    for scene in scenes.iter().filter(|scene| scene.name.contains(&wanted)) {
        compare(scene, runs, &builder);
    }
}

/// Builds the hierarchy of a scene.
type Builder<'a> = Box<dyn Fn() -> Bvh + 'a>;

fn compare(scene: &Scene, runs: usize, builder: &str) {
    let (ours, ours_built) = fastest(|| Bvh::new(&scene.positions, &scene.triangles));
    let (bounces, shadows) = scene.bounce_rays(&ours, RAYS);
    let obvhs = |preset| move || obvhs_under_ours(scene, preset);
    let slow = BvhBuildParams::slow_build();
    let unsplit = BvhBuildParams {
        pre_split: false,
        ..slow
    };
    let builders: [(&str, Builder<'_>); 7] = [
        ("medium", Box::new(obvhs(BvhBuildParams::medium_build()))),
        ("slow, unsplit", Box::new(obvhs(unsplit))),
        ("slow", Box::new(obvhs(slow))),
        (
            "very slow",
            Box::new(obvhs(BvhBuildParams::very_slow_build())),
        ),
        (
            "relit, 5 % reinserted",
            Box::new(|| reinserted(scene, 0.05)),
        ),
        (
            "relit, 20 % reinserted",
            Box::new(|| reinserted(scene, 0.2)),
        ),
        ("relit, all reinserted", Box::new(|| reinserted(scene, 1.0))),
    ];
    for (name, build) in builders.iter().filter(|(name, _)| name.contains(builder)) {
        let (theirs, theirs_built) = fastest(build);
        let differ = bounces
            .iter()
            .filter(|ray| ours.intersect(ray) != theirs.intersect(ray))
            .count();
        assert_eq!(differ, 0, "hits depend on the builder");
        let row = |rays: &str, [theirs, ours, ratio]: [[f64; 3]; 3]| {
            println!(
                "| {} | {} | {name} | {:.0} / {:.0} ms | {rays} | {:.2} | {:.2} | {:.2} ({:.2}–{:.2}) |",
                scene.name,
                scene.triangles.len(),
                theirs_built * 1e3,
                ours_built * 1e3,
                theirs[1],
                ours[1],
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
                |r| theirs.intersect(r).map_or(0.0, |h| h.t),
                |r| ours.intersect(r).map_or(0.0, |h| h.t),
            ),
        );
        for (kind, rays) in [
            ("bounces, any hit", &bounces),
            ("to the lamp, any hit", &shadows),
        ] {
            row(
                kind,
                paired(
                    runs,
                    rays,
                    |r| f32::from(u8::from(theirs.occluded(r))),
                    |r| f32::from(u8::from(ours.occluded(r))),
                ),
            );
        }
    }
}

/// The last of several builds, and the seconds of the fastest.
fn fastest(build: impl Fn() -> Bvh) -> (Bvh, f64) {
    let timed = || {
        let start = Instant::now();
        (build(), start.elapsed().as_secs_f64())
    };
    let (mut bvh, mut least) = timed();
    for _ in 1..BUILDS {
        let (next, seconds) = timed();
        (bvh, least) = (next, least.min(seconds));
    }
    (bvh, least)
}

/// obvhs's binary tree with one triangle a leaf, opened eight wide as relit opens its own.
fn obvhs_under_ours(scene: &Scene, preset: BvhBuildParams) -> Bvh {
    let triangles: Vec<Triangle> = scene
        .triangles
        .iter()
        .map(|t| {
            let [v0, v1, v2] = t.map(|i| scene.positions[i as usize].into());
            Triangle { v0, v1, v2 }
        })
        .collect();
    let preset = BvhBuildParams {
        max_prims_per_leaf: 1,
        ..preset
    };
    let bvh = build_bvh2_from_tris(&triangles, preset, &mut Duration::default());
    under_ours(scene, &bvh)
}

/// relit's binary tree, improved by obvhs's reinsertion of a fraction of its nodes.
fn reinserted(scene: &Scene, fraction: f32) -> Bvh {
    let corners: Vec<[Vec3; 3]> = scene
        .triangles
        .iter()
        .map(|t| t.map(|i| scene.positions[i as usize]))
        .collect();
    let tree = Tree::new(&corners);
    let mut bvh = Bvh2 {
        nodes: tree
            .nodes
            .iter()
            .map(|node| {
                Bvh2Node::new(
                    Aabb::new(node.low.into(), node.high.into()),
                    node.count,
                    node.first,
                )
            })
            .collect(),
        primitive_indices: tree.order,
        children_are_ordered_after_parents: true,
        ..Bvh2::default()
    };
    ReinsertionOptimizer::default().run(&mut bvh, fraction, None);
    under_ours(scene, &bvh)
}

fn under_ours(scene: &Scene, bvh: &Bvh2) -> Bvh {
    let tree = Tree {
        nodes: bvh
            .nodes
            .iter()
            .map(|node| TreeNode {
                low: Vec3::from(node.aabb().min),
                high: Vec3::from(node.aabb().max),
                first: node.first_index,
                count: node.prim_count,
            })
            .collect(),
        order: bvh.primitive_indices.clone(),
    };
    Bvh::from_tree(&scene.positions, &scene.triangles, &tree)
}
