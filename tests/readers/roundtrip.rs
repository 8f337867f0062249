//! What is written is read back: geometry, cameras and poses to the bit, photographs to the precision chosen.

use crate::open;
use glam::{DMat3, DQuat, DVec3, Vec2, Vec3};
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::truth::{ObjectTruth, Truth, read_albedo};
use relit::capture::{Capture, Frame};
use relit::export::capture::{write, write_truth};
use relit::math::picture::Picture;
use std::sync::Arc;

fn capture() -> Capture {
    let third = 1.0 / 3.0;
    let frame = |angle: f64, fx: f64| Frame {
        intrinsics: Intrinsics {
            width: 3,
            height: 2,
            fx,
            fy: 2.0 + third,
            cx: 1.5,
            cy: third,
            distortion: [0.01, -third * 0.01, 1e-4, 2e-5],
        },
        pose: Pose {
            rotation: DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, angle, 0.3, -0.2)),
            center: DVec3::new(third, -1e5 * third, 1e-7 * third),
        },
        exposure: None,
        photograph: PhotographSource::Memory(Arc::new(Photograph {
            width: 3,
            height: 2,
            pixels: (0..6)
                .map(|i| Vec3::new(i as f32 / 3.0, 1e-4, 7e4))
                .collect(),
            usable: Vec::new(),
            encoding: Encoding::Linear,
            saturation: Vec3::INFINITY,
            limits: Vec::new(),
        })),
        depth: None,
    };
    Capture {
        name: "test".into(),
        folder: None,
        segmentation: None,
        mesh: Mesh {
            positions: (0..6)
                .map(|i| DVec3::new(third + f64::from(i), f64::from(i * i) * third, 1e6 * third))
                .collect(),
            triangles: vec![[0, 1, 2], [3, 5, 4]],
            object_of: vec![0, 1],
            objects: vec!["red wall".into(), "lamp".into()],
            vertex_colors: (0..6).map(|i| Vec3::splat(i as f32 / 7.0)).collect(),
            corner_uvs: vec![[Vec2::ZERO, Vec2::X, Vec2::splat(0.1)]; 2],
        },
        frames: vec![frame(0.1, 2.0), frame(0.7, 3.0 * third)],
        up: DVec3::new(0.6, 0.0, 0.8),
        warnings: Vec::new(),
    }
}

#[test]
fn a_written_capture_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let original = capture();
    write(folder.path(), &original).unwrap();
    let back = open(folder.path()).unwrap();
    assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    assert!((back.up - original.up).length() < 1e-15);
    assert_eq!(back.mesh.objects, original.mesh.objects);
    assert_eq!(back.mesh.object_of, original.mesh.object_of);
    assert_eq!(back.mesh.corner_uvs, original.mesh.corner_uvs);
    assert_eq!(back.mesh.triangles.len(), original.mesh.triangles.len());
    for (t, u) in back.mesh.triangles.iter().zip(&original.mesh.triangles) {
        for (&i, &j) in t.iter().zip(u) {
            assert_eq!(
                back.mesh.positions[i as usize],
                original.mesh.positions[j as usize]
            );
            assert_eq!(
                back.mesh.vertex_colors[i as usize],
                original.mesh.vertex_colors[j as usize]
            );
        }
    }
    assert_eq!(back.frames.len(), original.frames.len());
    for (a, b) in back.frames.iter().zip(&original.frames) {
        assert_eq!(a.intrinsics, b.intrinsics);
        assert_eq!(a.pose.center, b.pose.center);
        let difference = a.pose.rotation - b.pose.rotation;
        assert!(difference.to_cols_array().iter().all(|d| d.abs() < 1e-14));
        assert_eq!(a.load().unwrap().pixels, b.load().unwrap().pixels);
    }
}

#[test]
fn truth_reads_back_and_flaws_in_it_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = ObjectTruth {
        albedo: Some(DVec3::splat(0.1)),
        emission: DVec3::new(18.387, 13.9873, 6.75357),
        exitance: Some(DVec3::splat(20.0)),
        roughness: Some(0.2),
        textured: true,
    };
    let truth = Truth {
        objects: [
            ("lamp".to_owned(), lamp),
            ("wall".to_owned(), ObjectTruth::default()),
        ]
        .into(),
    };
    let picture = Picture::from_fn(3, 2, |x, y| Vec3::new(x as f32, y as f32, 0.5));
    write_truth(folder.path(), &truth, std::slice::from_ref(&picture)).unwrap();
    let back = Truth::read(folder.path()).unwrap();
    assert_eq!(back, truth);
    assert!(back.objects["lamp"].is_emitter() && !back.objects["wall"].is_emitter());

    let lens = capture().frames[0].intrinsics;
    let albedo = read_albedo(folder.path(), 0, &lens).unwrap().unwrap();
    assert_eq!(albedo.pixels, picture.pixels);
    assert!(read_albedo(folder.path(), 1, &lens).unwrap().is_none());

    let path = folder.path().join("truth.json");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen("18.387", "-18.387", 1)).unwrap();
    let error = Truth::read(folder.path()).unwrap_err();
    assert!(error.place.contains("objects.lamp.emission"), "{error}");
}
