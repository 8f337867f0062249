//! Inserted objects by the card against the processor's.

use crate::card;
use crate::scenes::{capture, lamp_room, room_views};
use glam::{DVec3, Vec3};
use relit::capture::exposure::Exposure;
use relit::compose::backdrop::Backdrop;
use relit::compose::insert::{Insertion, Layers};
use relit::compose::object::ObjectModel;
use relit::compose::placement::{PlacedObject, Placement};
use relit::gpu::{Adapters, Card, Inserted, Tracer};
use relit::scene::Scene;
use relit::transport::lit::LitScene;
use relit::transport::material::{Lobe, Material};
use relit::transport::path::PathOptions;
use std::sync::Arc;

/// Samples a pixel.
const SAMPLES: u32 = 24;

/// An octahedron with smooth normals and colours at its corners, of a diffuse and a glossy half.
fn gem() -> ObjectModel {
    let tips = [DVec3::X, DVec3::Z, -DVec3::X, -DVec3::Z];
    let faces: Vec<[DVec3; 3]> = (0..8)
        .map(|i| {
            let (a, b) = (tips[i % 4], tips[(i + 1) % 4]);
            if i < 4 {
                [DVec3::Y, b, a]
            } else {
                [-DVec3::Y, a, b]
            }
        })
        .collect();
    let diffuse = Material::diffuse(Vec3::new(0.8, 0.7, 0.2), Vec3::ZERO);
    let mut model = ObjectModel::from_corners("gem", faces, diffuse.clone()).expect("it has area");
    let outwards = |face: &[DVec3; 3]| face.map(|p| p.as_vec3().normalize_or_zero());
    model.corner_normals = model.corners.iter().map(outwards).collect();
    let tint = |face: &[DVec3; 3]| face.map(|p| (p.as_vec3() + 1.2).clamp(Vec3::ZERO, Vec3::ONE));
    model.corner_colors = model.corners.iter().map(tint).collect();
    let lobe = Lobe {
        roughness: 0.2,
        specular: Vec3::splat(0.3),
    };
    model.materials.push(Material {
        lobe: Some(lobe),
        ..diffuse
    });
    for (index, material) in model.material_of.iter_mut().enumerate() {
        *material = u32::from(index % 2 == 0);
    }
    model
}

/// A room, its photograph, and a gem on its floor.
fn insertion() -> (Insertion, Vec<Arc<PlacedObject>>) {
    let (mesh, materials) = lamp_room();
    let capture = capture(mesh, &room_views(), [36, 27]);
    let scene = Arc::new(Scene::new(&capture).expect("the test scene is sound"));
    let photograph = crate::scenes::photograph([36, 27], vec![Vec3::splat(0.2); 36 * 27]);
    let camera = scene.cameras[1].clone();
    let backdrop = Backdrop::new(1, &camera, &photograph, Exposure::default()).expect("sound");
    let placement = Placement {
        scale: 0.3,
        rotate: 20.0,
        ..Placement::new("gem", Some(DVec3::new(0.35, -0.99, 0.1)))
    };
    let placed = PlacedObject::new(Arc::new(gem()), &placement, &scene).expect("it fits");
    let objects = vec![Arc::new(placed)];
    let lit = Arc::new(LitScene::new(scene, materials, None));
    let options = PathOptions::default();
    (
        Insertion::new(backdrop, lit, objects.clone(), options, 5),
        objects,
    )
}

fn tracer(card: &Card, insertion: &Insertion, objects: &[Arc<PlacedObject>]) -> Tracer {
    let inserted: Vec<Inserted<'_>> = objects.iter().map(|o| o.for_card()).collect();
    Tracer::new(card, &insertion.lit, &inserted).expect("the scene fits")
}

fn alike(a: &[Vec3], b: &[Vec3]) -> f64 {
    let same = |(a, b): (&Vec3, &Vec3)| {
        (*a - *b).abs().max_element() <= 1e-3 * b.abs().max_element().max(1e-4)
    };
    a.iter().zip(b).map(same).filter(|&same| same).count() as f64 / a.len() as f64
}

/// Random numbers are the same: 97 of 100 pixels of both renders and of their difference are within a thousandth, and coverage is the
/// same but at outlines. What no object touches cancels to the bit.
#[test]
fn an_inserted_object_its_shadow_and_its_colour_are_the_processors() {
    let Some(card) = card() else { return };
    let (mut by_card, objects) = insertion();
    let mut tracer = tracer(card, &by_card, &objects);
    let (mut by_processor, _) = insertion();
    by_processor.refine_to(SAMPLES, || true);
    // In two parts, as progress is told between them.
    for samples in [10, SAMPLES] {
        let done = by_card.refine_on(&mut tracer, samples, || true);
        assert_eq!(done, Ok(true));
    }
    assert_eq!((by_card.samples(), by_card.rejected()), (SAMPLES, 0));
    let rays = by_card.rays() as f64 / by_processor.rays() as f64;
    let [found, truth]: [Layers; 2] = [by_card.layers(), by_processor.layers()];
    let covered = |l: &Layers| l.alpha.iter().map(|&a| f64::from(a)).sum::<f64>();
    let fractions = [
        alike(&found.with.pixels, &truth.with.pixels),
        alike(&found.without.pixels, &truth.without.pixels),
        alike(&found.delta.pixels, &truth.delta.pixels),
    ];
    println!(
        "alike {fractions:.3?}, rays {rays:.4}, covered {:.3} of {:.3}",
        covered(&found),
        covered(&truth)
    );
    assert!(
        fractions.iter().all(|&fraction| fraction > 0.97),
        "{fractions:?}"
    );
    assert!(covered(&truth) > 10.0 && (covered(&found) / covered(&truth) - 1.0).abs() < 0.01);
    let untouched = |l: &Layers| l.delta.pixels.iter().filter(|p| **p == Vec3::ZERO).count();
    assert_eq!(untouched(&found), untouched(&truth));
    assert!(found.with.pixels != found.without.pixels);
}

/// After the card was lost the processor fills up what is missing, and the result is the processor's own.
#[test]
fn the_processor_goes_on_where_the_card_was_lost() {
    if card().is_none() {
        return;
    }
    let Some(card) = Card::open(Adapters::Any) else {
        return;
    };
    let (mut by_both, objects) = insertion();
    let mut tracer = tracer(&card, &by_both, &objects);
    assert_eq!(by_both.refine_on(&mut tracer, 4, || true), Ok(true));
    card.lose();
    assert!(by_both.refine_on(&mut tracer, 12, || true).is_err());
    assert!(by_both.refine_to(12, || true));
    assert_eq!(by_both.samples(), 12);
    let (mut alone, _) = insertion();
    alone.refine_to(12, || true);
    let [found, truth] = [by_both.layers(), alone.layers()];
    assert!(alike(&found.with.pixels, &truth.with.pixels) > 0.97);
}
