//! The built-in room: geometry that faces its viewers, photographs that agree with its path-traced truth.

use glam::{Vec2, Vec3};
use relit::capture::read;
use relit::capture::working::load_working;
use relit::math::color::luminance;
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::math::warp::uniform_sphere;
use relit::room::photographs::{self, Rendering, STORED};
use relit::room::{self, Room, truth};
use relit::scene::geometry::{Ray, offset_origin};

#[test]
fn it_is_a_furnished_room_with_two_lamps_seen_from_all_sides() {
    let room = Room::new();
    let capture = room::capture().expect("the kept photographs decode");
    assert!(capture.frames.len() >= 12);
    assert!(room.mesh.objects.len() >= 15);
    assert!(room.mesh.triangles.len() < 10_000);
    let names: std::collections::BTreeSet<_> = room.mesh.objects.iter().collect();
    assert_eq!(names.len(), room.mesh.objects.len(), "names are unique");
    assert!(capture.up.y > 0.999_9, "{}", capture.up);

    let world = room.lit(STORED.size).expect("the room");
    let lamps: Vec<usize> = (0..world.materials.len())
        .filter(|&i| world.materials[i].emission != Vec3::ZERO)
        .collect();
    assert_eq!(lamps.len(), 2);
    for (index, pixels) in truth::seen_pixels(&world).into_iter().enumerate() {
        assert!(
            pixels >= 50,
            "{}: {pixels}",
            world.scene.objects[index].name
        );
    }
    for lamp in lamps {
        let showing = world.scene.cameras.iter().filter(|camera| {
            let size = [camera.intrinsics.width, camera.intrinsics.height];
            (0..size[0] * size[1]).any(|i| {
                let pixel = Vec2::new((i % size[0]) as f32, (i / size[0]) as f32) + 0.5;
                world
                    .scene
                    .intersect(&camera.ray(pixel))
                    .is_some_and(|hit| {
                        world.scene.object_of[hit.triangle as usize] as usize == lamp
                    })
            })
        });
        assert!(showing.count() >= 3, "{}", world.scene.objects[lamp].name);
    }
}

#[test]
fn no_triangle_is_degenerate_and_every_one_that_is_seen_shows_its_front() {
    let world = Room::new().lit(STORED.size).expect("the room");
    let scene = &world.scene;
    let smallest = scene.areas.iter().copied().fold(f32::INFINITY, f32::min);
    assert!(
        smallest > 1e-9 * scene.diameter * scene.diameter,
        "{smallest}"
    );

    // From the cameras, and from wherever light is reflected to: every ray meets a front, and none escapes.
    let mut stream = Stream::new(5, 0, 0, 0);
    for camera in &scene.cameras {
        let size = Vec2::new(
            camera.intrinsics.width as f32,
            camera.intrinsics.height as f32,
        );
        for _ in 0..2000 {
            let mut ray = camera.ray(Vec2::from(stream.uniform2()) * size);
            for bounce in 0..3 {
                let hit = scene.intersect(&ray).expect("the room is closed");
                let surface = world.surface(&hit);
                let name = &scene.objects[surface.object as usize].name;
                let cosine = surface.normal.dot(ray.direction);
                // A ray that leaves a narrow bevel at a grazing angle may cross its neighbour within rounding.
                let contact = hit.t < 1e-5 * scene.diameter;
                assert!(
                    cosine <= 0.0 || contact,
                    "bounce {bounce} met the back of {name}"
                );
                let turned = uniform_sphere(stream.uniform2());
                let out = turned * surface.normal.dot(turned).signum();
                let start = offset_origin(surface.point, surface.normal, &surface.corners, out);
                ray = Ray::new(start, out);
            }
        }
    }
}

/// Side of the squares of pixels of a kept photograph that become one in the fresh rendering.
const REDUCED: u32 = 4;

/// Differences between the kept photographs, reduced, and a fresh rendering, over 12 blocks each: their means in units of
/// their standard errors. Of 192 normal deviates none passes 5 with probability 1e-4.
#[test]
fn kept_photographs_agree_with_a_fresh_rendering() {
    let room = Room::new();
    let size = STORED.size.map(|side| side / REDUCED);
    let capture = room::capture().expect("the kept photographs decode");
    let pixels = capture.frames.len() as u64 * u64::from(size[0] * size[1]);
    let kept = load_working(&capture, pixels).expect("reduced").photographs;
    let rendering = Rendering {
        seed: 99,
        samples: 2,
        size,
    };
    let fresh = photographs::render(&room, &rendering).expect("rendered");
    let width = size[0] as usize;
    let side = width / 4;
    let mut total = Moments::default();
    for (frame, (kept, fresh)) in kept.iter().zip(&fresh).enumerate() {
        assert_eq!([kept.width, kept.height], size);
        let mut blocks = vec![Moments::default(); 12];
        for (index, (a, b)) in kept.pixels.iter().zip(&fresh.pixels).enumerate() {
            assert!(a.is_finite() && a.min_element() >= 0.0);
            let (x, y) = (index % width, index / width);
            blocks[y / side * 4 + x / side].push(f64::from(luminance(*b - *a)));
        }
        for (index, block) in blocks.iter().enumerate() {
            let z = block.mean / block.standard_error();
            assert!(z.abs() < 5.0, "frame {frame} block {index}: {z}");
            total.push(z);
        }
    }
    let mean = total.mean / (1.0 / total.count as f64).sqrt();
    assert!(mean.abs() < 4.0, "all blocks together: {mean}");
}

#[test]
fn a_seed_gives_the_same_bits_and_another_seed_other_noise() {
    let room = Room::new();
    let render = |seed| {
        let rendering = Rendering {
            seed,
            samples: 1,
            size: [16, 12],
        };
        photographs::render(&room, &rendering).expect("rendered")
    };
    let single = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool");
    let (a, b, c) = (render(1), single.install(|| render(1)), render(2));
    for ((a, b), c) in a.iter().zip(&b).zip(&c) {
        assert_eq!(a.pixels, b.pixels);
        assert_ne!(a.pixels, c.pixels);
    }
}

#[test]
fn written_as_a_capture_it_is_read_back_the_same() {
    let folder = tempfile::tempdir().expect("temporary folder");
    room::write(folder.path(), None).expect("written");
    let built_in = room::capture().expect("the kept photographs decode");
    let read = read::read(folder.path(), &read::ReadOptions::default()).expect("a capture");
    assert!(read.warnings.is_empty(), "{:?}", read.warnings);
    assert_eq!(read.mesh.objects, built_in.mesh.objects);
    assert_eq!(read.mesh.object_of, built_in.mesh.object_of);
    assert!((read.up - built_in.up).length() < 1e-6);
    for (a, b) in read.mesh.triangles.iter().zip(&built_in.mesh.triangles) {
        for (&a, &b) in a.iter().zip(b) {
            let [a, b] = [
                read.mesh.positions[a as usize],
                built_in.mesh.positions[b as usize],
            ];
            assert_eq!(a, b);
        }
    }
    assert_eq!(read.frames.len(), built_in.frames.len());
    for (a, b) in read.frames.iter().zip(&built_in.frames) {
        assert_eq!(a.intrinsics, b.intrinsics);
        assert!((a.pose.center - b.pose.center).length() < 1e-12);
        let [a, b] = [a, b].map(|frame| frame.load().expect("a photograph"));
        assert_eq!(a.pixels, b.pixels);
    }

    let text = std::fs::read_to_string(folder.path().join("truth.json")).expect("written");
    let truth: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let lamp = &truth["objects"]["floor-lamp"];
    let exitance = lamp["exitance"][0].as_f64().expect("a number");
    let emission = lamp["emission"][0].as_f64().expect("a number");
    assert!(exitance > emission && exitance < 1.1 * emission);
    assert_eq!(truth["objects"]["rug"]["textured"], true);
    assert!(truth["objects"]["sofa"]["exitance"].is_null());
    assert!(folder.path().join("truth/albedo_015.exr").is_file());
}

/// The rows that show a lamp directly hold its exitance: emission and what it reflects.
#[test]
fn lamps_in_the_photographs_show_their_exitance() {
    let world = Room::new().lit(STORED.size).expect("the room");
    let objects = truth::objects(&world);
    let kept = photographs::stored().expect("the kept photographs decode");
    for name in ["ceiling-lamp", "floor-lamp"] {
        let index = world.scene.objects.iter().position(|o| o.name == name);
        let mut seen = Moments::default();
        for (camera, photograph) in world.scene.cameras.iter().zip(&kept) {
            for (i, value) in photograph.pixels.iter().enumerate() {
                let (x, y) = (i as u32 % photograph.width, i as u32 / photograph.width);
                // Only pixels that lie wholly on the lamp.
                let inside = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]]
                    .iter()
                    .all(|offset| {
                        let point = Vec2::new(x as f32, y as f32) + Vec2::from(*offset);
                        world
                            .scene
                            .intersect(&camera.ray(point))
                            .is_some_and(|hit| {
                                Some(world.scene.object_of[hit.triangle as usize] as usize) == index
                            })
                    });
                if inside {
                    seen.push(f64::from(value.y));
                }
            }
        }
        let exitance = f64::from(objects[name].exitance.expect("a lamp")[1]);
        assert!(seen.count > 50);
        assert!(
            (seen.mean / exitance - 1.0).abs() < 0.01,
            "{name} {} {exitance}",
            seen.mean
        );
    }
}
