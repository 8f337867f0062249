//! Hits by the card against brute force in f64.

use crate::card;
use glam::{DMat3, DVec3, Vec3};
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::PhotographSource;
use relit::capture::{Capture, Frame};
use relit::gpu::Tracer;
use relit::math::rng::Stream;
use relit::math::warp;
use relit::scene::Scene;
use relit::scene::geometry::Ray;
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use std::sync::Arc;

fn lit(positions: Vec<DVec3>) -> LitScene {
    let count = positions.len() as u32 / 3;
    let mesh = Mesh {
        positions,
        triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        object_of: vec![0; count as usize],
        objects: vec!["soup".to_owned()],
        ..Mesh::default()
    };
    let frame = Frame {
        intrinsics: Intrinsics {
            width: 1,
            height: 1,
            fx: 1.0,
            fy: 1.0,
            cx: 0.5,
            cy: 0.5,
            distortion: [0.0; 4],
        },
        pose: Pose {
            rotation: DMat3::IDENTITY,
            center: DVec3::ZERO,
        },
        exposure: None,
        photograph: PhotographSource::Memory(Arc::new(crate::scenes::photograph(
            [1, 1],
            vec![Vec3::ZERO],
        ))),
        depth: None,
    };
    let capture = Capture {
        name: "soup".into(),
        folder: None,
        segmentation: None,
        frames: vec![frame],
        mesh,
        up: DVec3::Y,
        warnings: Vec::new(),
    };
    let scene = Arc::new(Scene::new(&capture).expect("the soup is sound"));
    LitScene::new(scene, vec![Material::diffuse(Vec3::ONE, Vec3::ZERO)], None)
}

/// Distances at which a ray meets triangles in f64, each with how far inside its edges the hit lies, in barycentric terms.
fn brute(scene: &Scene, ray: &Ray) -> Vec<(f64, u32, f64)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut hits: Vec<(f64, u32, f64)> = (0..scene.triangles.len() as u32)
        .filter_map(|index| {
            let [a, b, c] = scene.corners(index).map(|p| p.as_dvec3());
            let (e1, e2) = (b - a, c - a);
            let p = d.cross(e2);
            let determinant = e1.dot(p);
            let (s, q) = (o - a, (o - a).cross(e1));
            let (u, v) = (s.dot(p) / determinant, d.dot(q) / determinant);
            let t = e2.dot(q) / determinant;
            let margin = u.min(v).min(1.0 - u - v);
            (margin >= -1e-4 && t > 0.0 && t < f64::from(ray.t_max)).then_some((t, index, margin))
        })
        .collect();
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    hits
}

/// Traces rays and compares those whose answer is clear: no triangle's edge is nearer than 1e-4 of its size up to the first hit.
fn compare(name: &str, lit: &LitScene, rays: &[Ray]) {
    let Some(card) = card() else { return };
    let mut tracer = Tracer::new(card, lit, &[]).expect("the soup fits");
    let nearest = tracer.trace(rays, false).expect("the adapter works");
    let any = tracer.trace(rays, true).expect("the adapter works");
    let (mut hits, mut misses) = (0, 0);
    for ((ray, nearest), any) in rays.iter().zip(nearest).zip(any) {
        let exact = brute(&lit.scene, ray);
        assert_eq!(nearest.is_some(), any.is_some(), "{name}: {ray:?}");
        if exact.iter().any(|(_, _, margin)| *margin < 1e-4) {
            continue;
        }
        match (exact.first(), nearest) {
            (None, None) => misses += 1,
            (Some((t, index, _)), Some(hit)) => {
                let close =
                    (f64::from(hit.t) - t).abs() <= 2e-4 * t + 1e-6 * f64::from(lit.scene.diameter);
                let alike = exact
                    .iter()
                    .filter(|(other, _, _)| (other - t).abs() <= 2e-4 * t)
                    .count()
                    > 1;
                assert!(
                    close && (hit.triangle == *index || alike),
                    "{name}: {hit:?} against {t} of {index}"
                );
                hits += 1;
            }
            (exact, found) => panic!("{name}: {found:?} against {exact:?} for {ray:?}"),
        }
    }
    println!(
        "{name}: {hits} hits and {misses} misses compared of {}",
        rays.len()
    );
    assert!(hits > rays.len() / 20, "{name}: only {hits}");
}

/// Triangles whose arms are of a size and whose third corner lies near the line through the others by a factor.
fn soup(seed: u64, count: usize, size: f64, flatness: f64) -> Vec<DVec3> {
    let mut stream = Stream::new(seed, 0, 0, 0);
    (0..count)
        .flat_map(|_| {
            let mut point =
                || DVec3::from_array([0; 3].map(|_| f64::from(stream.uniform()) * 2.0 - 1.0));
            let (center, long, short) = (point(), point() * size, point() * size);
            [
                center,
                center + long,
                center + long * 0.5 + short * flatness,
            ]
        })
        .collect()
}

fn rays(seed: u64, count: usize, scale: f32) -> Vec<Ray> {
    let mut stream = Stream::new(seed, 1, 0, 0);
    (0..count)
        .map(|_| {
            let origin = Vec3::from_array([0; 3].map(|_| stream.uniform() * 3.0 - 1.5));
            Ray::new(origin * scale, warp::uniform_sphere(stream.uniform2()))
        })
        .collect()
}

#[test]
fn hits_agree_with_brute_force_at_any_scale() {
    for scale in [1.0, 1e-6, 1e6] {
        let positions = soup(3, 400, 0.4, 1.0).iter().map(|p| *p * scale).collect();
        compare(
            &format!("scale {scale:e}"),
            &lit(positions),
            &rays(3, 1500, scale as f32),
        );
    }
}

#[test]
fn slivers_are_hit_where_they_are() {
    compare(
        "slivers",
        &lit(soup(4, 900, 0.8, 0.05)),
        &rays(4, 2000, 1.0),
    );
}

/// Rays along the axes, from within the planes of boxes too.
#[test]
fn axis_aligned_rays_agree_with_brute_force() {
    let mut stream = Stream::new(5, 1, 0, 0);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    let aligned: Vec<Ray> = (0..1500)
        .map(|i| {
            let origin = Vec3::from_array([0; 3].map(|_| stream.uniform() * 2.0 - 1.0));
            let mut ray = Ray::new(origin, axes[i % 6] * (1.0 + stream.uniform()));
            if i % 5 == 0 {
                ray.t_max = 0.3;
            }
            ray
        })
        .collect();
    compare("axis-aligned", &lit(soup(5, 500, 0.5, 1.0)), &aligned);
}

/// No ray from within a closed sphere of shared corners leaves it, at edges and corners either.
#[test]
fn no_ray_leaves_a_closed_mesh_through_its_edges() {
    let Some(card) = card() else { return };
    let (rings, sectors) = (12u32, 17u32);
    let at = |ring: u32, sector: u32| {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        let phi = std::f64::consts::TAU * f64::from(sector % sectors) / f64::from(sectors);
        DVec3::new(
            theta.sin() * phi.cos(),
            theta.cos(),
            theta.sin() * phi.sin(),
        )
    };
    let mut positions = Vec::new();
    for ring in 0..rings {
        for s in 0..sectors {
            positions.extend([at(ring, s), at(ring, s + 1), at(ring + 1, s)]);
            positions.extend([at(ring, s + 1), at(ring + 1, s + 1), at(ring + 1, s)]);
        }
    }
    let lit = lit(positions);
    let mut stream = Stream::new(6, 1, 0, 0);
    let scene = &lit.scene;
    let mut rays = Vec::new();
    for t in 0..scene.triangles.len() as u32 {
        let [a, b, c] = scene.corners(t);
        let mut on_edge = |p: Vec3, q: Vec3| p.lerp(q, stream.uniform());
        for target in [a, b, c, on_edge(a, b), on_edge(b, c), on_edge(c, a)] {
            for origin in [
                Vec3::ZERO,
                Vec3::new(0.2, -0.3, 0.1),
                Vec3::new(0.0, 0.5, 0.0),
            ] {
                rays.push(Ray::new(origin, target - origin));
            }
        }
    }
    let mut tracer = Tracer::new(card, &lit, &[]).expect("the sphere fits");
    let hits = tracer.trace(&rays, false).expect("the adapter works");
    let leaks = hits.iter().filter(|hit| hit.is_none()).count();
    assert_eq!(leaks, 0, "of {} rays", rays.len());
    // Each is met where it was aimed at, give or take rounding.
    for hit in hits.into_iter().flatten() {
        assert!((hit.t - 1.0).abs() < 1e-4, "{hit:?}");
    }
}
