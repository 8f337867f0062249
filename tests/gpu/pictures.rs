//! Pictures by the card against the processor's.

use crate::card;
use crate::scenes::{capture, checkerboard, closed_box, lamp_room, room_views, without};
use glam::{DVec3, Vec3};
use relit::gpu::{Checks, Tracer, View};
use relit::room::Room;
use relit::scene::Scene;
use relit::scene::camera::Camera;
use relit::scene::texels::TexelLayout;
use relit::transport::environment::Environment;
use relit::transport::film::Film;
use relit::transport::lit::LitScene;
use relit::transport::material::{Albedo, Lobe, Material, TexelColors};
use relit::transport::path::PathOptions;
use relit::transport::sun::Sun;
use relit::transport::surroundings::Surroundings;
use std::sync::Arc;

/// Samples a pixel.
const SAMPLES: u32 = 8;
/// Blocks a side over which means are compared.
const BLOCKS: usize = 3;

fn processor(lit: &LitScene, camera: &Camera, seed: u64) -> Film {
    let mut film = Film::new(camera);
    film.add(lit, camera, &PathOptions::default(), seed, 3, SAMPLES);
    film
}

/// Compares one view of a world: with other random numbers, means over 9 blocks and 3 channels within 4.5 standard errors (2e-4
/// that any of 27 is outside), and with the same ones, 98 of 100 pixels within a thousandth, because their paths are the
/// same but for rounding.
fn agree(name: &str, lit: &LitScene, camera: &Camera) {
    let Some(card) = card() else { return };
    let mut tracer = Tracer::new(card, lit, &[]).expect("the scene fits");
    let options = PathOptions::default();
    let view = View {
        camera,
        options: &options,
        seed: 1,
        frame: 3,
    };
    let film = tracer.film(&view, SAMPLES).expect("the adapter works");
    let (same, other) = (processor(lit, camera, 1), processor(lit, camera, 2));
    assert_eq!((film.rejected, film.samples), (0, SAMPLES));
    let rays = film.rays as f64 / same.rays as f64;
    assert!(
        (rays - 1.0).abs() < 0.01,
        "{name}: {rays} of the processor's rays"
    );

    let (found, truth) = (film.mean(), other.mean());
    let (width, height) = (film.width as usize, film.height as usize);
    let mut worst: f64 = 0.0;
    for block in 0..BLOCKS * BLOCKS {
        let rows = block / BLOCKS * height / BLOCKS..(block / BLOCKS + 1) * height / BLOCKS;
        let columns = block % BLOCKS * width / BLOCKS..(block % BLOCKS + 1) * width / BLOCKS;
        for channel in 0..3 {
            let mut moments = relit::math::stats::Moments::default();
            for row in rows.clone() {
                for pixel in row * width + columns.start..row * width + columns.end {
                    moments.push(f64::from(found[pixel][channel] - truth[pixel][channel]));
                }
            }
            let z = moments.mean / moments.standard_error().max(1e-9);
            worst = worst.max(z.abs());
        }
    }
    let same = same.mean();
    let alike = found
        .iter()
        .zip(&same)
        .filter(|(a, b)| (**a - **b).abs().max_element() <= 1e-3 * b.max_element().max(1e-6));
    let alike = alike.count() as f64 / same.len() as f64;
    println!(
        "{name}: worst z {worst:.2}, {:.1} % of pixels alike, rays {rays:.5}",
        100.0 * alike
    );
    assert!(worst < 4.5, "{name}: z {worst}");
    assert!(alike > 0.98, "{name}: {alike} of pixels alike");
}

fn room_of(mesh: relit::capture::mesh::Mesh, materials: Vec<Material>) -> LitScene {
    let capture = capture(mesh, &room_views(), [36, 27]);
    let scene = Scene::new(&capture).expect("the test scene is sound");
    LitScene::new(Arc::new(scene), materials, None)
}

/// The room with a lamp, without its ceiling.
fn open_room() -> LitScene {
    let (mesh, materials) = lamp_room();
    let ceiling = mesh.objects[3].clone();
    let (mesh, materials) = without((mesh, materials), &[&ceiling]);
    room_of(mesh, materials)
}

#[test]
fn the_built_in_room_is_the_processors() {
    let lit = Room::new().lit([64, 48]).expect("the room is sound");
    agree("built-in room", &lit, &lit.scene.cameras[1].shrunk(48));
}

/// The shader without checks of its indices is the one with them.
#[test]
fn unchecked_pictures_are_the_checked_ones() {
    let Some(card) = card() else { return };
    let lit = Room::new().lit([64, 48]).expect("the room is sound");
    let view = View {
        camera: &lit.scene.cameras[1],
        options: &PathOptions::default(),
        seed: 3,
        frame: 1,
    };
    let [on, off] = [Checks::On, Checks::Off].map(|checks| {
        let card = card.with_checks(checks);
        let mut tracer = Tracer::new(&card, &lit, &[]).expect("the room fits");
        tracer.film(&view, 4).expect("the card works").mean()
    });
    let pairs = on.iter().zip(&off);
    let alike = |(a, b): &(&Vec3, &Vec3)| {
        let difference = (**a - **b).abs().max_element();
        difference <= 1e-3 * a.max_element().max(1e-6)
    };
    let alike = pairs.filter(alike).count();
    println!("{alike} of {} pixels alike", on.len());
    assert!(alike as f64 > 0.98 * on.len() as f64);
}

#[test]
fn a_room_with_a_lamp_and_a_block_is_the_processors() {
    let (mesh, materials) = lamp_room();
    let lit = room_of(mesh, materials);
    agree("lamp room", &lit, &lit.scene.cameras[0]);
    // Through a lens that bends.
    let mut camera = lit.scene.cameras[2].clone();
    camera.intrinsics.distortion = [-0.1, 0.02, 0.004, -0.003];
    agree("lamp room through a lens", &lit, &camera);
}

#[test]
fn a_rough_room_is_the_processors() {
    let (mesh, mut materials) = lamp_room();
    for (material, roughness) in materials.iter_mut().zip([0.05, 0.3, 0.8, 0.15, 0.5, 1.0]) {
        material.lobe = Some(Lobe {
            roughness,
            specular: Vec3::new(0.04, 0.2, 0.5),
        });
    }
    let lit = room_of(mesh, materials);
    agree("rough room", &lit, &lit.scene.cameras[1]);
}

#[test]
fn a_textured_room_is_the_processors() {
    let (mesh, mut materials) = lamp_room();
    let count = mesh.triangles.len();
    let image = checkerboard(count, 4, 5, [Vec3::new(0.9, 0.2, 0.1), Vec3::splat(0.1)]);
    let object = mesh.object_of[4] as usize;
    materials[object].albedo = Albedo::Image(image, Vec3::new(0.8, 1.0, 0.9));
    // Texels of many levels on every other object but the lamp.
    let layout = TexelLayout::new((0..count).map(|t| (t % 5) as u8).collect());
    let colors = (0..layout.len())
        .map(|t| Vec3::new((t % 7) as f32, (t % 11) as f32, (t % 5) as f32) / 12.0)
        .collect();
    let texels = Arc::new(TexelColors { layout, colors });
    for (index, material) in materials.iter_mut().enumerate() {
        if index != object && index % 2 == 1 {
            material.albedo = Albedo::Texels(texels.clone());
        }
    }
    let lit = room_of(mesh, materials);
    agree("textured room", &lit, &lit.scene.cameras[0]);
    agree("textured room from elsewhere", &lit, &lit.scene.cameras[3]);
}

#[test]
fn an_open_room_with_light_from_outside_is_the_processors() {
    // Lit by a bright patch of the sky as well as by the lamp.
    let mut lit = open_room();
    let pixels = (0..16 * 8).map(|i| match i {
        21 | 22 => Vec3::new(40.0, 30.0, 20.0),
        _ => Vec3::new(0.2, 0.3, 0.6) * (i % 3) as f32,
    });
    let map = Environment::new(16, 8, pixels.collect()).expect("sizes fit");
    lit.outside = Some(Arc::new(map));
    agree("open room", &lit, &lit.scene.cameras[0]);
    // By the light from outside alone.
    let dark = lit.materials.iter().cloned().map(|m| Material {
        emission: Vec3::ZERO,
        ..m
    });
    let lit = LitScene::new(lit.scene.clone(), dark.collect(), lit.outside.clone());
    agree("open room without a lamp", &lit, &lit.scene.cameras[4]);
}

/// The light of real scans: on a box around the mesh, other from above the horizon, with a sun that shines through some pixels.
#[test]
fn light_from_a_box_and_a_sun_is_the_processors() {
    let mut lit = open_room();
    let corners = lit.scene.positions.iter().copied();
    let around = Surroundings::around(corners).expect("points");
    let map = |bright: f32| {
        let pixel = |i: usize| Vec3::new(0.2, 0.3, 0.6) * (i % 3) as f32 * bright;
        Environment::new(16, 8, (0..16 * 8).map(pixel).collect()).expect("sizes fit")
    };
    let above: Vec<Vec3> = map(3.0).pixels().to_vec();
    let sun = Sun {
        direction: Vec3::new(0.3, 0.9, 0.2).normalize(),
        irradiance: Vec3::new(4.0, 3.0, 2.0),
    };
    let openings = (0..16 * 8).map(|i| i % 4 != 1).collect();
    let boxed = map(1.0).around(around);
    let divided = (boxed.clone().with_above(above, Vec3::Y)).expect("sizes fit");
    let sunny = divided.clone().with_sun(Some(sun), Some(openings));
    let sky = map(1.0).with_sun(Some(sun), None);
    for (name, map) in [
        ("box", boxed),
        ("box with a horizon", divided),
        ("box with a sun", sunny.expect("sizes fit")),
        ("sky with a sun", sky.expect("sizes fit")),
    ] {
        lit.outside = Some(Arc::new(map));
        agree(name, &lit, &lit.scene.cameras[0]);
    }
}

/// Two lamps of very unequal strength, one of them of slivers.
#[test]
fn lamps_are_drawn_by_their_weight_and_area() {
    let mut mesh = closed_box(1.0, DVec3::ZERO);
    crate::scenes::lamp(&mut mesh, 0.3, DVec3::new(0.3, 0.9, 0.0));
    let at = |x: f64, z: f64| DVec3::new(x, 0.5, z);
    for (i, width) in [0.4, 0.01, 0.0001].into_iter().enumerate() {
        let left = -0.9 + 0.3 * i as f64;
        let corners = [
            at(left, -0.2),
            at(left + width, -0.2),
            at(left + width, 0.2),
            at(left, 0.2),
        ];
        crate::scenes::quad(&mut mesh, "strips", corners);
    }
    let mut materials = vec![Material::diffuse(Vec3::splat(0.6), Vec3::ZERO); 6];
    materials.push(Material::diffuse(Vec3::ZERO, Vec3::new(9.0, 8.0, 7.0)));
    materials.push(Material::diffuse(
        Vec3::splat(0.2),
        Vec3::new(0.1, 0.2, 0.4),
    ));
    let lit = room_of(mesh, materials);
    agree("two lamps", &lit, &lit.scene.cameras[4]);
}
