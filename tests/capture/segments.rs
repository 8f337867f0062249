//! Segments of meshes without objects: by what photographs show, against the objects of the same meshes.

use glam::{DVec3, Vec3};
use relit::calibrate::held_out::HoldOut;
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph};
use relit::capture::{Capture, Segmentation};
use relit::math::color::{linear_to_srgb, srgb_to_linear};
use relit::room::Room;
use relit::room::cameras::View;
use relit::room::generated::generate;
use relit::room::photographs::{Rendering, render};
use relit::room::shape::Modeller;
use relit::session::command::{OpenOptions, Source};
use relit::session::snapshot::OpenCapture;
use relit::transport::material::{Albedo, Material};
use std::collections::BTreeSet;

/// Every pixel of every photograph is held out.
const BLIND: HoldOut = HoldOut {
    held_out: 0.0,
    hold_out: 1,
};

fn open_cut(mut capture: Capture, wanted: Option<usize>, hold_out: HoldOut) -> OpenCapture {
    capture.segmentation = Some(Segmentation {
        file: "mesh.ply".into(),
        wanted,
    });
    let options = OpenOptions {
        hold_out,
        ..OpenOptions::default()
    };
    OpenCapture::new(Source::BuiltInRoom, options, capture).expect("a room")
}

/// The mesh as one object.
fn whole(mesh: &Mesh) -> Mesh {
    Mesh {
        object_of: vec![0; mesh.triangles.len()],
        objects: vec!["mesh".into()],
        ..mesh.clone()
    }
}

/// What an 8-bit camera keeps.
fn eight_bit(mut photograph: Photograph, exposure: f32) -> Photograph {
    let kept = |value: f32| {
        srgb_to_linear((linear_to_srgb(value.clamp(0.0, 1.0)) * 255.0).round() / 255.0)
    };
    for pixel in &mut photograph.pixels {
        *pixel = (*pixel * exposure).map(kept);
    }
    photograph.encoding = Encoding::Srgb8;
    photograph.saturation = Vec3::ONE;
    photograph
}

const SIZE: [u32; 2] = [192, 144];

/// A wall of 4 m × 3 m that three cameras see in full, showing the given radiance at each point.
fn wall(photographed: impl Fn(usize, DVec3) -> Vec3) -> (Capture, Vec<DVec3>) {
    let mut modeller = Modeller::default();
    modeller.object("wall");
    modeller.grid(
        DVec3::new(-2.0, -1.5, 0.0),
        DVec3::X * 4.0,
        DVec3::Y * 3.0,
        64,
        48,
    );
    let towards = DVec3::ZERO;
    let room = Room {
        name: "wall".into(),
        mesh: whole(&modeller.mesh),
        materials: vec![Material::diffuse(Vec3::ONE, Vec3::ZERO)],
        views: [-0.2, 0.0, 0.2]
            .map(|x| View::towards(DVec3::new(x, 0.0, 2.6), towards))
            .to_vec(),
    };
    let mesh = &room.mesh;
    let middles: Vec<DVec3> = (mesh.triangles.iter())
        .map(|t| t.iter().map(|&i| mesh.positions[i as usize]).sum::<DVec3>() / 3.0)
        .collect();
    let scene = room.lit(SIZE).expect("a wall").scene;
    let photographs = (scene.ids().triangles.iter().enumerate()).map(|(frame, triangles)| {
        let shown = |t: &u32| {
            middles
                .get(*t as usize)
                .map_or(Vec3::ZERO, |&p| photographed(frame, p))
        };
        let pixels = triangles.iter().map(shown).collect();
        let photograph = Photograph {
            width: SIZE[0],
            height: SIZE[1],
            pixels,
            usable: Vec::new(),
            encoding: Encoding::Linear,
            saturation: Vec3::INFINITY,
            limits: Vec::new(),
        };
        eight_bit(photograph, 1.0)
    });
    (room.capture_of(photographs.collect(), SIZE), middles)
}

/// Red on the left and grey on the right under light that falls off fivefold, and a lamp flush in the grey.
fn painted(point: DVec3) -> Vec3 {
    let light = 0.2 + 0.8 * ((point.y + 1.5) / 3.0) as f32;
    match point.x {
        _ if lamp(point) => Vec3::splat(3.0),
        x if x < -0.5 => Vec3::new(0.5, 0.2, 0.1) * light,
        _ => Vec3::splat(0.5) * light,
    }
}

fn lamp(point: DVec3) -> bool {
    (0.5..1.0).contains(&point.x) && point.y.abs() < 0.25
}

/// The segment that most of some triangles belong to, and their share.
fn segment(open: &OpenCapture, middles: &[DVec3], of: impl Fn(DVec3) -> bool) -> (u32, f64) {
    let mut counts = vec![0; open.capture.mesh.objects.len()];
    for (&segment, _) in
        (open.capture.mesh.object_of.iter().zip(middles)).filter(|(_, at)| of(**at))
    {
        counts[segment as usize] += 1;
    }
    let all: u32 = counts.iter().sum();
    let most = (0..).zip(&counts).max_by_key(|(_, count)| **count);
    most.map_or((0, 0.0), |(segment, &count)| {
        (segment, f64::from(count) / f64::from(all))
    })
}

#[test]
fn a_flat_wall_comes_apart_by_paint_and_its_lamp_by_saturation_but_not_by_shading() {
    let (capture, middles) = wall(|_, point| painted(point));
    let blind = open_cut(capture.clone(), None, BLIND);
    assert_eq!(blind.capture.mesh.objects.len(), 1);

    let open = open_cut(capture, None, HoldOut::default());
    let parts = [
        segment(&open, &middles, |at| at.x < -0.5),
        segment(&open, &middles, |at| at.x > -0.5 && !lamp(at)),
        segment(&open, &middles, lamp),
    ];
    assert!(
        parts.iter().all(|(_, fraction)| *fraction > 0.99),
        "{parts:?}"
    );
    let different: BTreeSet<u32> = parts.iter().map(|(segment, _)| *segment).collect();
    assert_eq!(different.len(), 3, "{parts:?}");
    let said = open.warnings.iter().any(|w| {
        w.contains("cut into 3 segments") && w.contains("one is what photographs show saturated")
    });
    assert!(said, "{:?}", open.warnings);
}

#[test]
fn held_out_photographs_say_nothing_about_segments() {
    let stripes = |point: DVec3| match (point.x * 4.0).rem_euclid(2.0) < 1.0 {
        true => Vec3::new(0.1, 0.3, 0.8),
        false => Vec3::splat(2.0),
    };
    let held = HoldOut {
        hold_out: 2,
        ..HoldOut::default()
    };
    let cut = |striped: usize, hold_out: HoldOut| {
        let (capture, _) = wall(|frame, point| match frame == striped {
            true => stripes(point),
            false => painted(point),
        });
        open_cut(capture, None, hold_out)
            .capture
            .mesh
            .object_of
            .clone()
    };
    let expected = cut(usize::MAX, held);
    for striped in [0, 2] {
        assert_eq!(cut(striped, held), expected);
        assert_ne!(cut(striped, HoldOut::default()), expected);
    }
    assert_ne!(cut(1, held), expected);
}

/// No edge of a scan is longer, in metres.
const EDGE: f64 = 0.15;

/// Every triangle cut in two through its longest edge, until that is short.
fn finer(mesh: &Mesh) -> Mesh {
    let mut fine = Mesh {
        objects: mesh.objects.clone(),
        ..Mesh::default()
    };
    for (corners, &object) in mesh.triangles.iter().zip(&mesh.object_of) {
        let mut waiting = vec![corners.map(|i| mesh.positions[i as usize])];
        while let Some(corners) = waiting.pop() {
            let turned = [0, 1, 2].map(|k| [0, 1, 2].map(|i| corners[(i + k) % 3]));
            let length = |t: &[DVec3; 3]| t[0].distance(t[1]);
            let Some([a, b, c]) = turned
                .into_iter()
                .max_by(|s, t| length(s).total_cmp(&length(t)))
            else {
                continue;
            };
            if a.distance(b) > EDGE {
                let middle = (a + b) * 0.5;
                waiting.extend([[a, middle, c], [middle, b, c]]);
            } else {
                let first = fine.positions.len() as u32;
                fine.positions.extend([a, b, c]);
                fine.triangles.push([first, first + 1, first + 2]);
                fine.object_of.push(object);
            }
        }
    }
    fine
}

/// How segments agree with objects, over the area that photographs see.
#[derive(Debug, Default)]
struct Agreement {
    /// Area in the segment's most frequent object, fraction of all.
    purity: f64,
    /// Variance of albedo inside segments, fraction of all.
    albedo: f64,
    /// Area in both an object that saturates and the segment most like it, fraction of that in either.
    lamps: Vec<f64>,
}

fn agreement(open: &OpenCapture, truth: &Mesh, albedo: &[DVec3], saturates: &[bool]) -> Agreement {
    let scene = &open.scene;
    let mut areas = vec![0.0; scene.triangles.len()];
    for &seen in scene.ids().triangles.iter().flatten() {
        if let Some(area) = areas.get_mut(seen as usize) {
            *area = f64::from(scene.areas[seen as usize]);
        }
    }
    let mut shared = vec![vec![0.0; truth.objects.len()]; open.capture.mesh.objects.len()];
    for ((&segment, &object), area) in (open.capture.mesh.object_of.iter())
        .zip(&truth.object_of)
        .zip(&areas)
    {
        shared[segment as usize][object as usize] += area;
    }
    let whole = |object: usize| shared.iter().map(|row| row[object]).sum::<f64>();
    let left = |row: &[f64]| {
        let area = row.iter().sum::<f64>().max(1e-12);
        let mean = row
            .iter()
            .zip(albedo)
            .map(|(area, albedo)| *albedo * *area)
            .sum::<DVec3>()
            / area;
        row.iter()
            .zip(albedo)
            .map(|(area, albedo)| area * albedo.distance_squared(mean))
            .sum::<f64>()
    };
    let all: Vec<f64> = (0..truth.objects.len()).map(whole).collect();
    let alike = |object: usize| {
        let each = shared
            .iter()
            .map(|row| row[object] / (row.iter().sum::<f64>() + all[object] - row[object]));
        each.fold(0.0, f64::max)
    };
    let most = |row: &Vec<f64>| row.iter().copied().fold(0.0, f64::max);
    Agreement {
        purity: shared.iter().map(most).sum::<f64>() / areas.iter().sum::<f64>(),
        albedo: shared.iter().map(|row| left(row)).sum::<f64>() / left(&all),
        lamps: (0..all.len())
            .filter(|&k| saturates[k] && all[k] > 0.0)
            .map(alike)
            .collect(),
    }
}

/// Rooms from seeds as scans: finer triangles, no objects, 8-bit photographs in which lamps saturate.
#[test]
fn rooms_come_apart_better_with_photographs_than_by_normals_at_the_same_number() {
    const SIZE: [u32; 2] = [160, 120];
    let mut sums = [Agreement::default(), Agreement::default()];
    for seed in 0..4 {
        let (mut room, rendering) = generate(seed, SIZE);
        let photographs = render(
            &room,
            &Rendering {
                samples: 16,
                ..rendering
            },
        )
        .expect("a room");
        let mut levels: Vec<f32> = (photographs.iter().flat_map(|p| &p.pixels))
            .map(|p| p.element_sum() / 3.0)
            .collect();
        levels.sort_by(f32::total_cmp);
        let exposure = 0.25 / levels[levels.len() / 2];
        let photographs = photographs
            .into_iter()
            .map(|p| eight_bit(p, exposure))
            .collect();
        let truth = finer(&room.mesh);
        room.mesh = whole(&truth);
        let capture = room.capture_of(photographs, SIZE);
        let albedo = |material: &Material| match &material.albedo {
            Albedo::Constant(color) => color.as_dvec3(),
            _ => panic!("rooms from seeds are plain"),
        };
        let albedo: Vec<DVec3> = room.materials.iter().map(albedo).collect();
        let saturates: Vec<bool> = (room.materials.iter())
            .map(|m| m.emission.min_element() * exposure > 1.0)
            .collect();

        let shown = open_cut(capture.clone(), Some(20), HoldOut::default());
        let same = Some(shown.capture.mesh.objects.len());
        let blind = open_cut(capture, same, BLIND);
        for (sum, open) in sums.iter_mut().zip([shown, blind]) {
            let agreement = agreement(&open, &truth, &albedo, &saturates);
            sum.purity += agreement.purity;
            sum.albedo += agreement.albedo;
            sum.lamps.extend(agreement.lamps);
        }
    }
    let [shown, blind] = &sums;
    println!("{shown:?}\n{blind:?}");
    assert!(shown.albedo < 0.75 * blind.albedo, "{shown:?} {blind:?}");
    assert!(
        shown.lamps.len() > 4 && shown.lamps.iter().all(|alike| *alike > 0.9),
        "{shown:?}"
    );
}
