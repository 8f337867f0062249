//! Closed forms.

use crate::card;
use crate::scenes::{capture, closed_box, room_views};
use glam::{DVec3, Vec3};
use relit::gpu::{Tracer, View};
use relit::math::stats::Moments;
use relit::scene::Scene;
use relit::transport::environment::Environment;
use relit::transport::lit::LitScene;
use relit::transport::material::{Lobe, Material};
use relit::transport::path::PathOptions;
use std::sync::Arc;

/// Radiance of all pixels of a view from within a box, red alone.
fn seen(lit: &LitScene, options: &PathOptions, samples: u32) -> Option<Moments> {
    let mut tracer = Tracer::new(card()?, lit, &[]).expect("the scene fits");
    let view = View {
        camera: &lit.scene.cameras[0],
        options,
        seed: 1,
        frame: 0,
    };
    let film = tracer.film(&view, samples).expect("the adapter works");
    assert_eq!(film.rejected, 0);
    let mut moments = Moments::default();
    film.mean()
        .iter()
        .for_each(|pixel| moments.push(f64::from(pixel.x)));
    Some(moments)
}

fn boxed(half: f64, center: DVec3, materials: Vec<Material>) -> LitScene {
    let views = room_views().map(|(from, to)| (from * half + center, to * half + center));
    let capture = capture(closed_box(half, center), &views, [16, 12]);
    let scene = Scene::new(&capture).expect("the test scene is sound");
    LitScene::new(Arc::new(scene), materials, None)
}

/// Inside a closed box that emits Le everywhere and reflects ρ, radiance is Le/(1 − ρ), at any size and place: four tests at 4
/// standard errors (6e-5 each). Then each number of bounces is a term of the series.
#[test]
fn a_closed_furnace_has_its_closed_form_radiance_at_any_size_and_place() {
    for (half, center) in [
        (1.0, DVec3::ZERO),
        (1e-4, DVec3::ZERO),
        (1e5, DVec3::ZERO),
        (1.0, DVec3::splat(1e5)),
    ] {
        let albedo = 0.8f32;
        let material = Material::diffuse(Vec3::splat(albedo), Vec3::new(1.0, 2.0, 1e-6));
        let lit = boxed(half, center, vec![material; 6]);
        let Some(m) = seen(&lit, &PathOptions::default(), 16) else {
            return;
        };
        let truth = 1.0 / (1.0 - f64::from(albedo));
        let z = (m.mean - truth) / m.standard_error();
        println!(
            "size {half}, albedo {albedo}: {} against {truth}, z {z:.2}",
            m.mean
        );
        assert!(z.abs() < 4.0, "albedo {albedo}, size {half}: z {z}");
    }
    let lit = boxed(
        1.0,
        DVec3::ZERO,
        vec![Material::diffuse(Vec3::splat(0.5), Vec3::ONE); 6],
    );
    for (max_bounces, truth) in [(0, 1.0), (1, 1.5), (2, 1.75)] {
        let options = PathOptions {
            max_bounces,
            rr_depth: 100,
            ..PathOptions::default()
        };
        let Some(m) = seen(&lit, &options, 16) else {
            return;
        };
        let z = (m.mean - truth) / m.standard_error().max(1e-6);
        assert!(z.abs() < 4.0, "{max_bounces}: {}", m.mean);
    }
}

/// Under uniform light from outside, whatever a convex thing reflects is that light times its reflectance; a box seen from within
/// that lets no light in is black.
#[test]
fn light_from_outside_is_seen_where_rays_escape_and_nowhere_else() {
    let mut lit = boxed(
        1.0,
        DVec3::ZERO,
        vec![Material::diffuse(Vec3::splat(0.5), Vec3::ZERO); 6],
    );
    let map = Environment::new(8, 4, vec![Vec3::splat(2.0); 32]).expect("sizes fit");
    lit.outside = Some(Arc::new(map));
    let Some(m) = seen(&lit, &PathOptions::default(), 4) else {
        return;
    };
    assert_eq!(m.mean, 0.0);
    // A floor under an open sky: 0.5 of 2, exactly where light samples and BSDF samples are weighed right.
    let mut mesh = relit::capture::mesh::Mesh::default();
    let corner = |x: f64, z: f64| DVec3::new(x, -1.0, z) * 1.0;
    crate::scenes::quad(
        &mut mesh,
        "floor",
        [
            corner(-9.0, 9.0),
            corner(9.0, 9.0),
            corner(9.0, -9.0),
            corner(-9.0, -9.0),
        ],
    );
    let down = [(DVec3::new(0.0, 1.0, 0.1), DVec3::new(0.0, -1.0, 0.0))];
    let capture = capture(mesh, &down, [16, 12]);
    let scene = Arc::new(Scene::new(&capture).expect("the test scene is sound"));
    let map = Environment::new(8, 4, vec![Vec3::splat(2.0); 32]).expect("sizes fit");
    let material = Material::diffuse(Vec3::splat(0.5), Vec3::ZERO);
    let lit = LitScene::new(scene, vec![material], Some(Arc::new(map)));
    let Some(m) = seen(&lit, &PathOptions::default(), 64) else {
        return;
    };
    let z = (m.mean - 1.0) / m.standard_error();
    println!("floor under the sky: {} z {z:.2}", m.mean);
    assert!(z.abs() < 4.0 && m.standard_error() < 0.02, "{}", m.mean);
}

/// A lobe neither makes nor loses energy against the processor's furnace; narrow ones stay finite.
#[test]
fn lobes_in_a_furnace_stay_finite_and_below_the_energy_that_there_is() {
    for roughness in [1e-4f32, 0.05, 0.4, 1.0] {
        let material = Material {
            lobe: Some(Lobe {
                roughness,
                specular: Vec3::splat(0.2),
            }),
            ..Material::diffuse(Vec3::splat(0.6), Vec3::ONE)
        };
        let lit = boxed(1.0, DVec3::ZERO, vec![material; 6]);
        let Some(m) = seen(&lit, &PathOptions::default(), 16) else {
            return;
        };
        // At most what a surface that reflects 0.2 and 0.6 of the rest returns, and at least the base alone.
        let most = 1.0 / (1.0 - (0.2 + 0.8 * 0.6 + 0.1));
        assert!(m.mean < most && m.mean > 1.5, "α {roughness}: {}", m.mean);
    }
}
