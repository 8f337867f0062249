//! The paper's descent from one albedo an object to the parts of triangles that a texture asks for.

use crate::scenes;
use glam::{DVec3, Vec3};
use relit::calibrate::problem::Problem;
use relit::inverse::estimate::Estimate;
use relit::inverse::paper::descent::Descent;
use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solve;
use relit::inverse::solver::{Control, Observer, Progress, Stage, Termination};
use relit::transport::material::{Albedo, Material, Texture};
use std::sync::Arc;

const BACK: usize = 4;
const LAMP: usize = 6;
const CHECKS: u32 = 4;

/// A room with a checkerboard on its back wall, photographed, its materials and the board.
fn room(size: [u32; 2]) -> (Problem, Vec<Material>, Arc<Texture>) {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    scenes::lamp(&mut mesh, 0.4, DVec3::new(0.1, 0.9, 0.2));
    let colors = [Vec3::new(0.25, 0.30, 0.40), Vec3::new(0.75, 0.60, 0.30)];
    let board = scenes::checkerboard(mesh.triangles.len(), 2 * BACK, CHECKS, colors);
    let mut materials: Vec<Material> = [0.6, 0.5, 0.4, 0.7, 0.5, 0.6, 0.0]
        .map(|a| Material::diffuse(Vec3::splat(a), Vec3::ZERO))
        .to_vec();
    materials[LAMP].emission = Vec3::new(6.0, 5.5, 5.0);
    materials[BACK].albedo = Albedo::Image(board.clone(), Vec3::ONE);
    let capture = scenes::capture(mesh, &scenes::back_wall_views(), size);
    let problem = scenes::photographed(&capture, &materials, 192, 5);
    (problem, materials, board)
}

fn settings() -> Settings {
    Settings {
        preset: Preset::Paper,
        bounces: 6,
        learning_rate: 2e-2,
        ..Settings::default()
    }
}

/// Root mean square error over the board's texels that lie within one check and that pixels saw, after the factor of each
/// channel that fits best: what is wrong with the lamp, all albedos take up.
fn board_error(estimate: &Estimate, board: &Texture) -> f32 {
    let texels = estimate.texels.as_ref().expect("triangles have albedos");
    let layout = &texels.colors.layout;
    let errors = scenes::texel_errors(texels, board, 2 * BACK);
    let first = layout.first[2 * BACK] as usize;
    let found = &texels.colors.colors[first..first + errors.len()];
    let even: Vec<(Vec3, Vec3)> = (found.iter().zip(&errors))
        .filter(|(_, e)| e.is_even && e.seen > 0)
        .map(|(found, e)| (*found, *found - e.error))
        .collect();
    assert!(!even.is_empty(), "nothing was cut as finely as the board");
    let sum = |of: fn(&(Vec3, Vec3)) -> Vec3| even.iter().map(of).sum::<Vec3>();
    let factor = sum(|(found, truth)| *found * *truth) / sum(|(found, _)| *found * *found);
    println!("factor {factor} over {} texels", even.len());
    let squares = even
        .iter()
        .map(|(found, truth)| (*found * factor - *truth).length_squared());
    (squares.sum::<f32>() / (3 * even.len()) as f32).sqrt()
}

/// Sees how fine the albedo is that is shown.
#[derive(Default)]
struct Watch {
    texels: Vec<usize>,
    phases: Vec<String>,
}

impl Observer for Watch {
    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control {
        if let Some(texels) = &estimate.texels {
            // What was seen is not hatched.
            assert!(texels.seen.iter().any(|&pixels| pixels > 0));
            self.texels.push(texels.colors.layout.len());
        }
        if self.phases.last() != Some(&progress.phase) {
            self.phases.push(progress.phase.clone());
        }
        Control::Continue
    }
}

/// From zero to the board, every stage at least as good on held-out pixels as what it began with.
#[test]
fn triangles_are_cut_until_a_texture_shows_and_no_stage_is_worse_than_the_one_before() {
    let (problem, _, board) = room([48, 36]);
    let mut watch = Watch::default();
    let solution = solve(&problem, &settings(), None, &mut watch).expect("nothing to resume");
    assert_eq!(solution.termination, Termination::Converged);
    // Whoever watches sees them split.
    let mut sizes = watch.texels.clone();
    sizes.dedup();
    println!("{sizes:?} {:?}", watch.phases);
    assert!(sizes.len() >= 3 && sizes.is_sorted(), "{sizes:?}");
    let stages = &solution.progress.stages;
    for stage in stages {
        println!("{stage:?}");
    }
    assert_eq!(stages[0].name, "objects");
    assert_eq!(stages[1].name, "triangles");
    let losses: Vec<f64> = stages
        .iter()
        .filter_map(|s: &Stage| s.held_out_loss)
        .collect();
    assert_eq!(losses.len(), stages.len());
    assert!(
        losses.windows(2).all(|pair| pair[1] <= pair[0]),
        "{losses:?}"
    );
    let kept = |s: &&Stage| s.kept && s.name.starts_with("cut");
    assert!(stages.iter().filter(kept).count() >= 1);

    // One colour for the board is 0.19 off.
    let off = board_error(&solution.estimate, &board);
    println!("board {off}, losses {losses:?}");
    assert!(off < 0.1, "{off}");
    assert!(losses[losses.len() - 1] < 0.8 * losses[0], "{losses:?}");
}

/// What is cut begins as it was, and a patch that no pixel sees keeps its colour.
#[test]
fn parts_begin_at_the_albedo_of_the_whole() {
    let (problem, materials, _) = room([24, 18]);
    let mut descent = Descent::new(&problem);
    for (k, material) in materials.iter().enumerate() {
        descent.albedo[k] = Vec3::splat(0.1 * k as f32);
        descent.emission[k] = material.emission;
    }
    let (triangles, _) = descent.refined(&problem.scene, &[]);
    let objects = materials.len();
    let of = |triangle: usize| problem.scene.object_of[triangle] as usize;
    for triangle in 0..problem.scene.triangles.len() {
        assert_eq!(
            triangles.albedo[objects + triangle],
            descent.albedo[of(triangle)]
        );
    }
    let (mut parts, _) =
        triangles.refined(&problem.scene, &vec![true; problem.scene.triangles.len()]);
    assert_eq!(
        parts.albedo.len(),
        objects + 4 * problem.scene.triangles.len()
    );
    assert!(parts.fits(&problem.scene));

    let count = parts.albedo.len() - objects;
    let covered: Vec<u64> = (0..count as u64).map(|patch| patch % 2).collect();
    parts.fix_uncovered(&covered);
    let before = parts.clone();
    for _ in 0..20 {
        parts.step(&problem, &settings(), 2);
    }
    let moved = |patch: usize| parts.albedo[objects + patch] != before.albedo[objects + patch];
    assert!((0..count).step_by(2).all(|patch| !moved(patch)));
    assert!((1..count).step_by(2).any(moved));
    // Lamps stay where they are: what gave no light still gives none.
    for (k, material) in materials.iter().enumerate() {
        assert_eq!(
            parts.emission[k] == Vec3::ZERO,
            material.emission == Vec3::ZERO
        );
    }
}
