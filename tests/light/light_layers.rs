//! Layers of light by lamp: they add up to the full render, and each is what its lamp alone would light.

use crate::scenes;
use glam::{DVec3, Vec3};
use relit::export::light_layers;
use relit::math::picture::Picture;
use relit::scene::Scene;
use relit::transport::environment::Environment;
use relit::transport::film::Film;
use relit::transport::layers::{LightSource, MAX_LAMPS, Split, mix};
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::PathOptions;
use std::sync::Arc;

const SIZE: [u32; 2] = [24, 18];

/// The room with its lamp, a glowing block, and no front wall, so that light comes in from outside.
fn lit() -> LitScene {
    let (mut mesh, mut materials) = scenes::lamp_room();
    let front = mesh.objects.iter().position(|o| o == "front");
    let front = front.expect("a front") as u32;
    let kept: Vec<usize> = (0..mesh.triangles.len())
        .filter(|&t| mesh.object_of[t] != front || t % 2 == 0)
        .collect();
    mesh.triangles = kept.iter().map(|&t| mesh.triangles[t]).collect();
    mesh.object_of = kept.iter().map(|&t| mesh.object_of[t]).collect();
    let block = mesh.objects.iter().position(|o| o == "block");
    materials[block.expect("a block")].emission = Vec3::new(0.2, 0.6, 1.5);
    let views = &scenes::room_views()[..1];
    let capture = scenes::capture(mesh, views, SIZE);
    let scene = Arc::new(Scene::new(&capture).expect("a scene"));
    let sky = (0..8).map(|i| Vec3::new(0.5, 1.0, 2.0) * (1.0 + i as f32));
    let outside = Environment::new(4, 2, sky.collect()).expect("a sky");
    LitScene::new(scene, materials, Some(Arc::new(outside)))
}

fn film(lit: &LitScene, seed: u64, samples: u32) -> Picture {
    let camera = &lit.scene.cameras[0];
    let mut film = Film::new(camera);
    film.add(lit, camera, &PathOptions::default(), seed, 0, samples);
    Picture {
        width: film.width,
        height: film.height,
        pixels: film.mean(),
    }
}

fn layers(lit: &LitScene, seed: u64, samples: u32) -> (Split, Vec<Picture>) {
    let split = Split::new(lit);
    let options = PathOptions::default();
    let pictures = split.render(lit, &lit.scene.cameras[0], &options, seed, 0, samples);
    (split, pictures)
}

/// Largest difference of two pictures, relative to the brightest value.
fn apart(a: &Picture, b: &Picture) -> f32 {
    let brightest = a.pixels.iter().map(|p| p.max_element());
    let brightest = brightest.fold(f32::MIN_POSITIVE, f32::max);
    let pairs = a.pixels.iter().zip(&b.pixels);
    pairs
        .map(|(a, b)| (*a - *b).abs().max_element())
        .fold(0.0, f32::max)
        / brightest
}

#[test]
fn layers_add_up_to_the_render_of_the_same_paths() {
    let lit = lit();
    let (split, pictures) = layers(&lit, 7, 32);
    assert_eq!(split.sources().len(), 3, "{:?}", split.sources());
    assert_eq!(split.sources()[2], LightSource::Outside);
    let sum = mix(pictures.iter().map(|p| (p, Vec3::ONE))).expect("layers");
    let difference = apart(&film(&lit, 7, 32), &sum);
    assert!(difference < 1e-5, "{difference}");
    for picture in &pictures {
        assert!(picture.pixels.iter().any(|p| p.max_element() > 0.0));
    }
}

#[test]
fn each_layer_is_what_its_source_alone_lights() {
    let lit = lit();
    let (split, pictures) = layers(&lit, 3, 256);
    for (source, layer) in split.sources().iter().zip(&pictures) {
        // Independent paths in a world in which all else is dark.
        let mut materials = lit.materials.clone();
        for (object, material) in materials.iter_mut().enumerate() {
            if *source != LightSource::Lamp(object as u32) {
                material.emission = Vec3::ZERO;
            }
        }
        let outside = lit.outside.clone();
        let outside = outside.filter(|_| *source == LightSource::Outside);
        let alone = film(
            &LitScene::new(lit.scene.clone(), materials, outside),
            91,
            256,
        );
        // Differences a pixel are independent: their mean against its own standard error, at 4.5 sigma.
        for channel in 0..3 {
            let differences: Vec<f64> = (layer.pixels.iter().zip(&alone.pixels))
                .map(|(a, b)| f64::from(a[channel] - b[channel]))
                .collect();
            let n = differences.len() as f64;
            let mean = differences.iter().sum::<f64>() / n;
            let squares: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
            let error = (squares / (n - 1.0) / n).sqrt();
            assert!(
                mean.abs() < 4.5 * error,
                "{source:?} {channel}: {mean} ± {error}"
            );
        }
    }
}

#[test]
fn a_strength_of_zero_takes_away_that_layer_and_nothing_else() {
    let lit = lit();
    let (_, pictures) = layers(&lit, 5, 8);
    for off in 0..pictures.len() {
        let factor = |layer: usize| Vec3::splat(f32::from(layer != off));
        let without = mix((0..).zip(&pictures).map(|(i, p)| (p, factor(i)))).expect("layers");
        let others = (0..).zip(&pictures).filter(|(i, _)| *i != off);
        let others = mix(others.map(|(_, p)| (p, Vec3::ONE))).expect("layers");
        assert_eq!(without, others);
    }
    let doubled = mix(pictures.iter().map(|p| (p, Vec3::splat(2.0)))).expect("layers");
    let once = mix(pictures.iter().map(|p| (p, Vec3::ONE))).expect("layers");
    assert!(
        doubled
            .pixels
            .iter()
            .zip(&once.pixels)
            .all(|(d, o)| *d == *o * 2.0)
    );
}

#[test]
fn lamps_beyond_the_most_share_a_layer_and_a_dark_room_has_none() {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    let count = MAX_LAMPS + 4;
    for lamp in 0..count {
        let x = -0.9 + 1.8 * lamp as f64 / count as f64;
        let at = |dx: f64, z: f64| DVec3::new(x + dx, 0.9, z);
        let corners = [at(0.0, 0.0), at(0.02, 0.0), at(0.02, 0.1), at(0.0, 0.1)];
        scenes::quad(&mut mesh, &format!("lamp {lamp}"), corners);
    }
    let views = &scenes::room_views()[..1];
    let capture = scenes::capture(mesh, views, SIZE);
    let scene = Arc::new(Scene::new(&capture).expect("a scene"));
    let mut materials = vec![Material::diffuse(Vec3::splat(0.5), Vec3::ZERO); 6];
    let dark = LitScene::new(scene.clone(), vec![materials[0].clone(); 6 + count], None);
    assert!(layers(&dark, 1, 1).1.is_empty());
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("dark.exr");
    assert!(light_layers::write(&file, &scene, []).is_err() && !file.exists());

    let glow = |lamp: usize| Material::diffuse(Vec3::ZERO, Vec3::splat(1.0 + lamp as f32));
    materials.extend((0..count).map(glow));
    let lit = LitScene::new(scene, materials, None);
    let (split, pictures) = layers(&lit, 2, 4);
    assert_eq!(split.sources().len(), MAX_LAMPS + 1);
    assert_eq!(split.source_of(6), Some(LightSource::OtherLamps));
    assert_eq!(split.source_of(10), Some(LightSource::Lamp(10)));
    assert_eq!(split.source_of(0), None);
    let sum = mix(pictures.iter().map(|p| (p, Vec3::ONE))).expect("layers");
    assert!(apart(&film(&lit, 2, 4), &sum) < 1e-5);
}
