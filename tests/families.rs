//! Families of generated rooms: each holds what it promises.

use glam::{Vec2, Vec3};
use relit::math::rng::splitmix64;
use relit::room::generated::{Family, Generated, generate};
use relit::room::photographs;
use relit::transport::material::Albedo;

/// Size of photographs that are rendered in a moment.
const TINY: [u32; 2] = [24, 18];
const SEEDS: std::ops::Range<u64> = 1..4;

fn rooms(family: Family) -> impl Iterator<Item = Generated> {
    SEEDS.map(move |seed| family.generate(seed, TINY).expect("a room"))
}

/// A hash of the capture: mesh, poses and photographs.
fn hash(room: &Generated) -> u64 {
    let mut hash = 0;
    let mut add = |bits: u64| hash = splitmix64(hash ^ bits);
    let mesh = &room.capture.mesh;
    for v in mesh.positions.iter().flat_map(|p| p.to_array()) {
        add(v.to_bits());
    }
    for &i in mesh.triangles.iter().flatten().chain(&mesh.object_of) {
        add(u64::from(i));
    }
    for frame in &room.capture.frames {
        let photograph = frame.load().expect("in memory");
        for v in photograph.pixels.iter().flat_map(|p| p.to_array()) {
            add(u64::from(v.to_bits()));
        }
    }
    hash
}

/// The objects that the pixels' centres see, `None` where a ray leaves the room.
fn seen(room: &Generated) -> Vec<Option<usize>> {
    let scene = &room.lit.scene;
    let mut seen = Vec::new();
    for camera in &scene.cameras {
        for i in 0..TINY[0] * TINY[1] {
            let center = Vec2::new((i % TINY[0]) as f32, (i / TINY[0]) as f32) + 0.5;
            let hit = scene.intersect(&camera.ray(center));
            seen.push(hit.map(|hit| scene.object_of[hit.triangle as usize] as usize));
        }
    }
    seen
}

fn mean_light(room: &Generated) -> f32 {
    let loaded = room
        .capture
        .frames
        .iter()
        .map(|f| f.load().expect("in memory"));
    let means = loaded.map(|p| p.pixels.iter().map(|p| p.max_element()).sum::<f32>());
    means.sum::<f32>() / (room.capture.frames.len() as u32 * TINY[0] * TINY[1]) as f32
}

#[test]
fn the_same_seed_gives_the_same_bits_and_rooms_of_a_family_differ() {
    for family in Family::ALL {
        let [a, again, b] = [1, 1, 2].map(|seed| family.generate(seed, TINY).expect("a room"));
        assert_eq!(hash(&a), hash(&again), "{}", family.name());
        assert_ne!(hash(&a), hash(&b), "{}", family.name());
        assert_ne!(a.capture.mesh.bounds(), b.capture.mesh.bounds());
        assert!(mean_light(&a) > 0.0, "{}", family.name());
    }
}

/// The hash is that of the program before there were families.
#[test]
fn plain_rooms_are_what_they_were() {
    let room = Family::Plain.generate(1, TINY).expect("a room");
    assert_eq!(hash(&room), 0x3b19_8524_7a41_a68f);
    let (plain, rendering) = generate(1, TINY);
    let taken = photographs::render(&plain, &rendering).expect("rendered");
    let own = room.capture.frames[0].load().expect("in memory");
    assert_eq!(own.pixels, taken[0].pixels);
}

#[test]
fn names_in_truth_are_the_objects_of_the_mesh_wherever_it_has_any() {
    for family in Family::ALL {
        let room = family.generate(2, TINY).expect("a room");
        let mut names = room.capture.mesh.objects.clone();
        names.sort();
        match family {
            Family::Scanned => assert!(room.truth.objects.is_empty()),
            _ => assert!(names.iter().eq(room.truth.objects.keys())),
        }
    }
}

#[test]
fn unseen_lamps_light_rooms_in_which_no_pixel_sees_one() {
    for seed in 1..6 {
        let room = Family::Unseen.generate(seed, TINY).expect("a room");
        let lamps = room.truth.objects.values().filter(|o| o.is_emitter());
        assert!(lamps.count() > 0);
        for object in seen(&room) {
            let object = object.expect("the room is closed");
            assert_eq!(
                room.lit.materials[object].emission,
                Vec3::ZERO,
                "room {seed}"
            );
        }
        for frame in &room.capture.frames {
            let photograph = frame.load().expect("in memory");
            let lit = photograph.pixels.iter().filter(|p| p.max_element() > 0.0);
            assert!(lit.count() * 2 > photograph.pixels.len(), "room {seed}");
        }
    }
}

#[test]
fn rays_leave_rooms_with_windows_for_light_that_the_truth_holds() {
    let mut suns = 0;
    for seed in 1..6 {
        let room = Family::Window.generate(seed, TINY).expect("a room");
        let outside = room.lit.outside.as_ref().expect("light from outside");
        assert!(outside.power() > 0.0);
        let seen = seen(&room);
        let left = seen.iter().filter(|object| object.is_none()).count();
        assert!(left > 0 && left * 2 < seen.len(), "room {seed}: {left}");
        let lamps = room.truth.objects.values().filter(|o| o.is_emitter());
        assert!(lamps.count() <= 1);
        // Whoever looks out sees the sky.
        let sky = room
            .capture
            .frames
            .iter()
            .zip(seen.chunks((TINY[0] * TINY[1]) as usize));
        for (frame, seen) in sky {
            let photograph = frame.load().expect("in memory");
            let bright = |(object, pixel): (&Option<usize>, &Vec3)| {
                object.is_some() || pixel.min_element() > 0.0
            };
            assert!(
                seen.iter().zip(&photograph.pixels).all(bright),
                "room {seed}"
            );
        }
        let brightest =
            (0..64 * 128).map(|i| relit::transport::environment::direction_of(128, 64, i));
        let mean = outside.power() / (4.0 * std::f64::consts::PI);
        let peak = brightest
            .map(|d| outside.radiance(d).max_element())
            .fold(0.0, f32::max);
        suns += u32::from(f64::from(peak) > 20.0 * mean);
    }
    assert!(suns > 1, "{suns}");
}

#[test]
fn cluttered_rooms_hold_hundreds_of_things() {
    for room in rooms(Family::Clutter) {
        let things = room.capture.mesh.objects.iter();
        let things = things.filter(|name| name.starts_with("thing-")).count();
        assert!((300..=1000).contains(&things), "{things}");
        let (low, high) = room.capture.mesh.bounds();
        assert!(low.y > -0.01 && high.y < 3.7, "{low} {high}");
    }
}

#[test]
fn most_surfaces_of_patterned_rooms_are_textured() {
    for room in rooms(Family::Patterned) {
        let surfaces = || room.truth.objects.values().filter(|o| !o.is_emitter());
        let textured = surfaces().filter(|o| o.textured).count();
        assert!(2 * textured > surfaces().count(), "{textured}");
        let mut varied = 0;
        for frame in 0..room.capture.frames.len() {
            let picture = room.albedo(frame);
            let values = || picture.pixels.iter().map(|p| p.y);
            let [low, high] = [values().fold(1.0, f32::min), values().fold(0.0, f32::max)];
            varied += usize::from(high - low > 0.1);
        }
        assert!(varied * 2 > room.capture.frames.len());
    }
}

#[test]
fn several_objects_of_glossy_rooms_have_lobes_over_a_diffuse_base() {
    for room in rooms(Family::Glossy) {
        let lobes = room.lit.materials.iter().filter_map(|m| m.lobe);
        let lobes: Vec<_> = lobes.collect();
        assert!(lobes.len() >= 2, "{}", lobes.len());
        for lobe in &lobes {
            assert!((0.1..=1.0).contains(&lobe.roughness) && lobe.specular.x >= 0.04);
        }
        let said = room
            .truth
            .objects
            .values()
            .filter(|o| o.roughness.is_some());
        assert_eq!(said.count(), lobes.len());
        assert!(matches!(room.lit.materials[0].albedo, Albedo::Constant(c) if c.x > 0.0));
    }
}

#[test]
fn shell_and_most_furniture_of_white_rooms_reflect_nine_tenths() {
    for room in rooms(Family::White) {
        let white = |name: &str| {
            let albedo = room.truth.objects[name].albedo.expect("known");
            albedo.min_element() >= 0.8999 && albedo.max_element() <= 0.97
        };
        let names = room.capture.mesh.objects.iter();
        let shell = ["floor", "ceiling", "wall-"];
        let (shell, rest): (Vec<_>, Vec<_>) = names
            .filter(|name| !room.truth.objects[*name].is_emitter())
            .partition(|name| shell.iter().any(|s| name.starts_with(s)));
        assert!(shell.len() >= 3 && shell.iter().all(|name| white(name)));
        let painted = rest.iter().filter(|name| white(name)).count();
        assert!(2 * painted >= rest.len(), "{painted} of {}", rest.len());
    }
}

#[test]
fn sparse_rooms_are_in_six_photographs_of_five_to_fifteen_percent_of_noise() {
    for a in rooms(Family::Sparse) {
        assert_eq!(a.capture.frames.len(), 6);
        // Against a rendering with hardly any noise.
        let clean = photographs::Rendering {
            seed: 99,
            samples: 400,
            size: TINY,
        };
        let clean = photographs::render_lit(&a.lit, &clean);
        let mut off = Vec::new();
        for (frame, clean) in a.capture.frames.iter().zip(&clean) {
            let noisy = frame.load().expect("in memory");
            for (noisy, clean) in noisy.pixels.iter().zip(&clean.pixels) {
                off.push(f64::from((noisy.y / clean.y - 1.0).abs()));
            }
        }
        let median = relit::math::stats::quantile(&mut off, 0.5).expect("pixels");
        let deviation = median / 0.674_49;
        assert!(
            (0.045..0.17).contains(&deviation),
            "room {}: {deviation}",
            a.seed
        );
    }
}
