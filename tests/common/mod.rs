//! A room small enough for any test: a closed box with a lamp below its ceiling, two photographs.

use glam::{DMat3, DVec3, Vec3};
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::{Capture, Frame};
use relit::inverse::estimate::{Estimate, ObjectEstimate};
use relit::scene::Scene;
use relit::transport::film::Film;
use relit::transport::path::PathOptions;
use std::sync::Arc;

/// Side of the photographs in pixels.
pub const SIDE: u32 = 24;

/// Names, albedo and emission of the room's objects.
pub const OBJECTS: [(&str, [f32; 3], [f32; 3]); 4] = [
    ("walls", [0.6, 0.55, 0.5], [0.0; 3]),
    ("floor", [0.3, 0.2, 0.1], [0.0; 3]),
    ("ceiling", [0.75, 0.75, 0.75], [0.0; 3]),
    ("lamp", [0.0; 3], [9.0, 8.0, 6.0]),
];

/// The room with photographs path-traced from [`OBJECTS`].
pub fn room() -> Capture {
    let mut mesh = Mesh {
        objects: OBJECTS.iter().map(|o| o.0.to_owned()).collect(),
        ..Mesh::default()
    };
    let mut quad = |object: u32, corners: [[f64; 3]; 4]| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners.map(DVec3::from_array));
        for t in [[0, 1, 2], [0, 2, 3]] {
            mesh.triangles.push(t.map(|i| first + i));
            mesh.object_of.push(object);
        }
    };
    // A box of 2 metres, its front sides inwards.
    quad(
        1,
        [[-1., 0., 1.], [1., 0., 1.], [1., 0., -1.], [-1., 0., -1.]],
    );
    quad(
        2,
        [[-1., 2., -1.], [1., 2., -1.], [1., 2., 1.], [-1., 2., 1.]],
    );
    quad(
        0,
        [[-1., 0., -1.], [1., 0., -1.], [1., 2., -1.], [-1., 2., -1.]],
    );
    quad(
        0,
        [[1., 0., 1.], [-1., 0., 1.], [-1., 2., 1.], [1., 2., 1.]],
    );
    quad(
        0,
        [[-1., 0., 1.], [-1., 0., -1.], [-1., 2., -1.], [-1., 2., 1.]],
    );
    quad(
        0,
        [[1., 0., -1.], [1., 0., 1.], [1., 2., 1.], [1., 2., -1.]],
    );
    quad(
        3,
        [
            [-0.4, 1.9, -0.4],
            [0.4, 1.9, -0.4],
            [0.4, 1.9, 0.4],
            [-0.4, 1.9, 0.4],
        ],
    );

    let side = f64::from(SIDE);
    let intrinsics = Intrinsics {
        width: SIDE,
        height: SIDE,
        fx: 0.5 * side,
        fy: 0.5 * side,
        cx: 0.5 * side,
        cy: 0.5 * side,
        distortion: [0.0; 4],
    };
    let black = Arc::new(Photograph {
        width: SIDE,
        height: SIDE,
        pixels: vec![Vec3::ZERO; (SIDE * SIDE) as usize],
        usable: Vec::new(),
        encoding: Encoding::Linear,
        saturation: Vec3::INFINITY,
        limits: Vec::new(),
    });
    let frames = [0.5, -0.5].map(|turn| Frame {
        intrinsics,
        pose: Pose {
            rotation: DMat3::from_rotation_y(turn),
            center: DVec3::new(0.0, 1.0, 0.9),
        },
        exposure: None,
        photograph: PhotographSource::Memory(black.clone()),
        depth: None,
    });
    let mut capture = Capture {
        name: "tiny".to_owned(),
        folder: None,
        segmentation: None,
        mesh,
        frames: frames.to_vec(),
        up: DVec3::Y,
        warnings: Vec::new(),
    };
    let scene = Arc::new(Scene::new(&capture).expect("the room has triangles"));
    let lit = truth().lit(&scene);
    for (index, frame) in capture.frames.iter_mut().enumerate() {
        let camera = &scene.cameras[index];
        let mut film = Film::new(camera);
        film.add(&lit, camera, &PathOptions::default(), 7, index as u64, 64);
        frame.photograph = PhotographSource::Memory(Arc::new(Photograph {
            pixels: film.mean(),
            ..(*black).clone()
        }));
    }
    capture
}

/// The room's true materials and lights.
pub fn truth() -> Estimate {
    Estimate {
        objects: OBJECTS
            .iter()
            .map(|(_, albedo, emission)| ObjectEstimate {
                albedo: Vec3::from_array(*albedo),
                emission: Vec3::from_array(*emission),
                ..ObjectEstimate::default()
            })
            .collect(),
        ..Estimate::default()
    }
}
