//! What the photographs see of a mesh, and what is said and done about it.

use glam::{DMat3, DVec3, Vec3};
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::working::load_working;
use relit::capture::{Capture, Frame};
use relit::scene::prepare::{Prepared, prepare};
use relit::scene::visibility::NOTHING;
use std::sync::Arc;

const SIZE: u32 = 32;

/// A camera at the origin looking down −z with a field of view of 90°, whose left half sees light, the right dark.
fn frame(left: f32, right: f32) -> Frame {
    let pixel = |i: u32| Vec3::splat(if i % SIZE < SIZE / 2 { left } else { right });
    let half = f64::from(SIZE) / 2.0;
    Frame {
        intrinsics: Intrinsics {
            width: SIZE,
            height: SIZE,
            fx: half,
            fy: half,
            cx: half,
            cy: half,
            distortion: [0.0; 4],
        },
        pose: Pose {
            rotation: DMat3::IDENTITY,
            center: DVec3::ZERO,
        },
        exposure: None,
        photograph: PhotographSource::Memory(Arc::new(Photograph {
            width: SIZE,
            height: SIZE,
            pixels: (0..SIZE * SIZE).map(pixel).collect(),
            usable: Vec::new(),
            encoding: Encoding::Linear,
            saturation: Vec3::INFINITY,
            limits: Vec::new(),
        })),
        depth: None,
    }
}

/// Rectangles (x from, x to, z, front towards the camera) of height 4 around the view axis, an object each.
fn capture(rectangles: &[(f64, f64, f64, bool)], frame: Frame) -> Capture {
    let mut mesh = Mesh::default();
    for (object, &(x0, x1, z, front)) in rectangles.iter().enumerate() {
        let first = mesh.positions.len() as u32;
        for (x, y) in [(x0, -2.0), (x1, -2.0), (x1, 2.0), (x0, 2.0)] {
            mesh.positions.push(DVec3::new(x, y, z));
        }
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            let [b, c] = if front { [b, c] } else { [c, b] };
            mesh.triangles.push([first + a, first + b, first + c]);
            mesh.object_of.push(object as u32);
        }
        mesh.objects.push(format!("rectangle {object}"));
    }
    Capture {
        name: "test".into(),
        folder: None,
        segmentation: None,
        mesh,
        frames: vec![frame],
        up: DVec3::Y,
        warnings: Vec::new(),
    }
}

fn prepared(capture: &Capture) -> Prepared {
    prepare(capture, &load_working(capture, u64::MAX).unwrap()).unwrap()
}

#[test]
fn ids_sides_and_the_fraction_of_the_mesh_are_those_of_the_geometry() {
    // The left half of the view sees rectangle 0, the right half rectangle 1 from behind; rectangle 2 hides behind 0.
    let capture = capture(
        &[
            (-2.0, 0.0, -2.0, true),
            (0.0, 2.0, -2.0, false),
            (-2.0, 0.0, -3.0, true),
        ],
        frame(1.0, 0.5),
    );
    let prepared = prepared(&capture);
    let half = u64::from(SIZE * SIZE / 2);
    assert_eq!(prepared.scene.ids().front_pixels, [half, 0, 0]);
    assert_eq!(prepared.scene.ids().back_pixels, [0, half, 0]);
    assert!(!prepared.scene.ids().triangles[0].contains(&NOTHING));
    assert!(
        prepared.scene.ids().triangles[0][0] < 2
            && prepared.scene.ids().triangles[0][SIZE as usize - 1] >= 2
    );
    let fraction = prepared.seen_area_fraction;
    assert!((fraction - 2.0 / 3.0).abs() < 0.02, "{fraction}");
    assert!(prepared.warnings.iter().any(|w| w.contains("rectangle 2")));
    assert_eq!(prepared.summary().len(), 4);
    assert_eq!(prepared.capture.mesh.triangles, capture.mesh.triangles);
}

#[test]
fn an_object_that_shines_on_its_back_is_turned_over_and_a_dim_one_is_not() {
    let rectangles = [(-2.0, 0.0, -2.0, true), (0.0, 2.0, -2.0, false)];
    let bright = capture(&rectangles, frame(1.0, 10.0));
    let turned = prepared(&bright);
    assert_eq!(turned.scene.ids().back_pixels, [0, 0]);
    assert_eq!(
        turned.capture.mesh.triangles[..2],
        bright.mesh.triangles[..2]
    );
    assert!(turned.warnings.iter().any(|w| w.contains("turned over")));
    assert!(turned.scene.normals[2].z > 0.99);

    let dim = capture(&rectangles, frame(1.0, 0.9));
    assert_eq!(prepared(&dim).capture.mesh.triangles, dim.mesh.triangles);
}

#[test]
fn a_mesh_wound_the_other_way_round_is_turned_over_except_what_no_photograph_sees() {
    let backwards = capture(
        &[
            (-2.0, 0.0, -2.0, false),
            (0.0, 2.0, -2.0, false),
            (-1.0, 1.0, 5.0, false),
        ],
        frame(1.0, 0.1),
    );
    let turned = prepared(&backwards);
    assert_eq!(turned.scene.ids().back_pixels, [0, 0, 0]);
    assert_eq!(
        turned.capture.mesh.triangles[4..],
        backwards.mesh.triangles[4..]
    );
}

#[test]
fn a_mesh_that_no_photograph_sees_is_an_error() {
    let behind = capture(&[(-2.0, 2.0, 2.0, true)], frame(1.0, 1.0));
    let working = load_working(&behind, u64::MAX).unwrap();
    let error = prepare(&behind, &working).unwrap_err();
    assert!(error.problem.contains("no photograph sees the mesh"));
}

/// A wall at two metres fills the left half of the view; the right half sees past the mesh.
#[test]
fn pixels_whose_depth_contradicts_the_mesh_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("depth.png");
    // Twice the photograph's size. Left: the wall, with a chair before it in the upper quarter and nothing measured in
    // the lowest. Right: a wall that the mesh lacks above, nothing measured below.
    let image = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(2 * SIZE, 2 * SIZE, |x, y| {
        image::Luma([match (x < SIZE, y / (SIZE / 2)) {
            (true, 0) => 1200,
            (true, 3) => 0,
            (true, _) => 1995 + (x % 3) as u16 * 5,
            (false, 0 | 1) => 3000,
            (false, _) => 0,
        }])
    });
    image.save(&path).unwrap();
    let mut with_depth = frame(1.0, 0.5);
    with_depth.depth = Some((path.clone(), 1e-3));
    let compared = prepared(&capture(&[(-2.0, 0.0, -2.0, true)], with_depth.clone()));
    for y in 0..SIZE {
        for x in 0..SIZE {
            let usable = compared.photographs[0].usable[(y * SIZE + x) as usize];
            let (left, quarter) = (x < SIZE / 2, y / (SIZE / 4));
            let contradicts = if left { quarter == 0 } else { quarter < 2 };
            assert_eq!(usable, !contradicts, "{x} {y}");
        }
    }
    let said = |p: &Prepared, words: &str| p.warnings.iter().any(|w| w.contains(words));
    // An eighth of all, and a quarter.
    assert!(
        said(&compared, "38 % of the pixels"),
        "{:?}",
        compared.warnings
    );

    // A depth image that cannot be read, or that shows another view, is said and costs no pixel.
    std::fs::write(&path, b"no image").unwrap();
    let unread = prepared(&capture(&[(-2.0, 0.0, -2.0, true)], with_depth.clone()));
    assert!(unread.photographs[0].usable.iter().all(|&u| u));
    assert!(said(&unread, "depth.png"), "{:?}", unread.warnings);
    let wide = image::ImageBuffer::from_pixel(2 * SIZE, SIZE, image::Luma([1u16]));
    wide.save(&path).unwrap();
    let other = prepared(&capture(&[(-2.0, 0.0, -2.0, true)], with_depth));
    assert!(other.photographs[0].usable.iter().all(|&u| u));
    assert!(said(&other, "another aspect ratio"), "{:?}", other.warnings);
}
