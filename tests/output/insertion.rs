//! Insertion against closed forms and against rendering the object as a part of the scene.

use glam::{DMat3, DVec3, Vec2, Vec3};
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::exposure::{Exposure, Vignetting};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::response::Response;
use relit::capture::{Capture, Frame};
use relit::compose::backdrop::{Backdrop, LayeredPixel};
use relit::compose::first_look::first_look;
use relit::compose::insert::Insertion;
use relit::compose::naive;
use relit::compose::object::ObjectModel;
use relit::compose::pick::{below, fall, pick};
use relit::compose::placement::{PlacedObject, Placement};
use relit::math::picture::Picture;
use relit::math::stats::Moments;
use relit::scene::Scene;
use relit::transport::environment::Environment;
use relit::transport::film::Film;
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::PathOptions;
use std::sync::Arc;

const SIDE: u32 = 24;

/// A box between two corners as triangles facing outwards, or inwards.
fn cuboid(low: DVec3, high: DVec3, inwards: bool) -> Vec<[DVec3; 3]> {
    let corner = |i: usize| {
        DVec3::new(
            if i & 1 == 0 { low.x } else { high.x },
            if i & 2 == 0 { low.y } else { high.y },
            if i & 4 == 0 { low.z } else { high.z },
        )
    };
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mut triangles = Vec::new();
    for [a, b, c, d] in faces.map(|face| face.map(corner)) {
        triangles.push([a, b, c]);
        triangles.push([a, c, d]);
    }
    if inwards {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    triangles
}

/// A capture of named triangle groups, seen by one camera at (0, 0, 2.8) looking down −z.
fn capture(groups: &[(&str, Vec<[DVec3; 3]>)]) -> Capture {
    let mut mesh = Mesh::default();
    for (index, (name, triangles)) in groups.iter().enumerate() {
        mesh.objects.push((*name).to_owned());
        for triangle in triangles {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(triangle);
            mesh.triangles.push([first, first + 1, first + 2]);
            mesh.object_of.push(index as u32);
        }
    }
    let photograph = Arc::new(Photograph {
        width: SIDE,
        height: SIDE,
        pixels: (0..SIDE * SIDE)
            .map(|i| Vec3::new(0.1, 0.2, 0.3) + 1e-3 * i as f32)
            .collect(),
        usable: Vec::new(),
        encoding: Encoding::Linear,
        saturation: Vec3::INFINITY,
        limits: Vec::new(),
    });
    Capture {
        name: "test".to_owned(),
        folder: None,
        segmentation: None,
        mesh,
        frames: vec![Frame {
            intrinsics: Intrinsics {
                width: SIDE,
                height: SIDE,
                fx: f64::from(SIDE),
                fy: f64::from(SIDE),
                cx: f64::from(SIDE) * 0.5,
                cy: f64::from(SIDE) * 0.5,
                distortion: [0.0; 4],
            },
            pose: Pose {
                rotation: DMat3::IDENTITY,
                center: DVec3::new(0.0, 0.0, 2.8),
            },
            exposure: None,
            photograph: PhotographSource::Memory(photograph),
            depth: None,
        }],
        up: DVec3::Y,
        warnings: Vec::new(),
    }
}

/// A closed room of half-size 3, its walls reflecting and emitting the same everywhere.
fn walls() -> Vec<[DVec3; 3]> {
    cuboid(DVec3::splat(-3.0), DVec3::splat(3.0), true)
}

/// A lamp under the ceiling, shining down.
fn lamp() -> Vec<[DVec3; 3]> {
    let [a, b, c, d] =
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| DVec3::new(x, 2.9, z));
    vec![[a, b, c], [a, c, d]]
}

fn lit(groups: &[(&str, Vec<[DVec3; 3]>)], materials: Vec<Material>) -> (Capture, Arc<LitScene>) {
    let capture = capture(groups);
    let scene = Arc::new(Scene::new(&capture).expect("the scene is sound"));
    (capture, Arc::new(LitScene::new(scene, materials, None)))
}

fn gray(albedo: f32, emission: f32) -> Material {
    Material::diffuse(Vec3::splat(albedo), Vec3::splat(emission))
}

fn lamp_room() -> (Capture, Arc<LitScene>) {
    let groups = [("walls", walls()), ("lamp", lamp())];
    lit(&groups, vec![gray(0.6, 0.0), gray(0.0, 10.0)])
}

fn placed(
    lit: &LitScene,
    triangles: Vec<[DVec3; 3]>,
    material: Material,
    at: DVec3,
) -> Arc<PlacedObject> {
    let model = ObjectModel::from_corners("block", triangles, material).expect("a sound object");
    let placement = Placement::new("block.obj", Some(at));
    Arc::new(PlacedObject::new(Arc::new(model), &placement, &lit.scene).expect("a sound place"))
}

fn block() -> Vec<[DVec3; 3]> {
    cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), false)
}

fn backdrop(capture: &Capture, lit: &LitScene) -> Backdrop {
    let photograph = capture.frames[0].load().expect("in memory");
    Backdrop::new(0, &lit.scene.cameras[0], &photograph, Exposure::default()).expect("one size")
}

/// The composite of a pixel of which objects cover a fraction `alpha`, whose mean radiance is `with`; where they cover none of it, the
/// radiance changes from `without` to `with`.
fn blended(backdrop: &Backdrop, pixel: usize, alpha: f32, with: f32, without: f32) -> Vec3 {
    let mut layers = vec![LayeredPixel::default(); backdrop.photograph.pixels.len()];
    layers[pixel] = LayeredPixel {
        alpha,
        with: Vec3::splat(with),
        uncovered: Vec3::splat(if alpha > 0.0 { without } else { with }),
        without: Vec3::splat(without),
        changed: true,
    };
    backdrop.composite(&layers).pixels[pixel]
}

fn insertion(capture: &Capture, lit: &Arc<LitScene>, objects: Vec<Arc<PlacedObject>>) -> Insertion {
    let options = PathOptions {
        max_bounces: 6,
        ..PathOptions::default()
    };
    Insertion::new(backdrop(capture, lit), lit.clone(), objects, options, 7)
}

#[test]
fn without_objects_or_with_one_out_of_reach_the_composite_is_the_photograph_to_the_bit() {
    let (capture, lit) = lamp_room();
    let hidden = placed(&lit, block(), gray(0.5, 0.0), DVec3::new(0.0, -9.0, 0.0));
    for objects in [Vec::new(), vec![hidden]] {
        let mut insertion = insertion(&capture, &lit, objects);
        assert!(insertion.composite() == *insertion.backdrop().photograph);
        insertion.pass(2);
        assert!(insertion.composite() == *insertion.backdrop().photograph);
    }
}

#[test]
fn a_convex_object_under_a_uniform_sky_shows_its_albedo_and_changes_nothing_else() {
    // The scene is one speck behind the camera: nothing that could be shadowed or take up light.
    let speck = vec![[
        DVec3::new(0.0, 0.0, 90.0),
        DVec3::new(1e-3, 0.0, 90.0),
        DVec3::new(0.0, 1e-3, 90.0),
    ]];
    let capture = capture(&[("speck", speck)]);
    let scene = Arc::new(Scene::new(&capture).expect("the scene is sound"));
    let sky = Environment::new(8, 4, vec![Vec3::new(1.0, 2.0, 4.0); 32]).map(Arc::new);
    let lit = Arc::new(LitScene::new(scene, vec![gray(0.5, 0.0)], sky));
    let albedo = Vec3::new(0.25, 0.5, 1.0);
    let material = Material::diffuse(albedo, Vec3::ZERO);
    let object = placed(&lit, block(), material, DVec3::new(0.1, -0.4, 0.0));
    let mut insertion = insertion(&capture, &lit, vec![object]);
    insertion.pass(64);
    let (composite, layers) = (insertion.composite(), insertion.layers());
    let mut ratio = Moments::default();
    for (pixel, &alpha) in layers.alpha.iter().enumerate() {
        assert!((0.0..=1.0).contains(&alpha));
        let photograph = insertion.backdrop().photograph.pixels[pixel];
        if alpha == 0.0 {
            assert_eq!(composite.pixels[pixel], photograph);
        } else {
            let want = albedo * Vec3::new(1.0, 2.0, 4.0) * alpha + photograph * (1.0 - alpha);
            ratio.push(f64::from(
                (composite.pixels[pixel] / want).element_sum() / 3.0,
            ));
        }
    }
    assert!(ratio.count > 20, "{} pixels", ratio.count);
    let off = (ratio.mean - 1.0).abs() / ratio.standard_error().max(1e-6);
    assert!(off < 4.0 && (ratio.mean - 1.0).abs() < 0.01, "{ratio:?}");
}

#[test]
fn a_white_object_in_a_furnace_conserves_its_light() {
    // Walls that emit 0.5 and reflect 0.5 show radiance 1 everywhere, and so does a white object among them.
    let (capture, lit) = lit(&[("walls", walls())], vec![gray(0.5, 0.5)]);
    let object = placed(&lit, block(), gray(1.0, 0.0), DVec3::new(0.0, -1.0, 0.0));
    let options = PathOptions {
        max_bounces: 60,
        ..PathOptions::default()
    };
    let mut insertion = Insertion::new(
        backdrop(&capture, &lit),
        lit.clone(),
        vec![object],
        options,
        3,
    );
    insertion.pass(48);
    let layers = insertion.layers();
    for picture in [&layers.with, &layers.without] {
        let mut radiance = Moments::default();
        picture
            .pixels
            .iter()
            .for_each(|c| radiance.push(f64::from(c.y)));
        let off = (radiance.mean - 1.0).abs() / radiance.standard_error();
        assert!(
            off < 4.0 && radiance.standard_error() < 5e-3,
            "{radiance:?}"
        );
    }
}

#[test]
fn with_and_without_agree_with_rendering_scenes_that_have_and_lack_the_object() {
    let (capture_without, lit_without) = lamp_room();
    let at = DVec3::new(0.4, -3.0, -0.5);
    let object = placed(&lit_without, block(), gray(0.3, 0.0), at);
    let mut insertion = insertion(&capture_without, &lit_without, vec![object]);
    insertion.pass(96);
    let layers = insertion.layers();
    let options = PathOptions {
        max_bounces: 6,
        ..PathOptions::default()
    };
    let camera = &lit_without.scene.cameras[0];

    // Without: the same keys, hence the same bits.
    let mut film = Film::new(camera);
    film.add(&*lit_without, camera, &options, 7, 0, 96);
    assert!(film.mean() == layers.without.pixels);

    // With: another seed, and the object as a part of the mesh.
    let low = at + DVec3::new(-0.5, 0.0, -0.5);
    let solid = cuboid(low, low + DVec3::ONE, false);
    let groups = [("walls", walls()), ("lamp", lamp()), ("block", solid)];
    let materials = vec![gray(0.6, 0.0), gray(0.0, 10.0), gray(0.3, 0.0)];
    let (_, lit_with) = lit(&groups, materials);
    let mut film = Film::new(camera);
    film.add(&*lit_with, camera, &options, 1234, 0, 96);
    let mut difference = Moments::default();
    for (a, b) in film.mean().iter().zip(&layers.with.pixels) {
        difference.push(f64::from(a.y - b.y));
    }
    let off = difference.mean.abs() / difference.standard_error();
    assert!(off < 4.0, "{difference:?}");
}

#[test]
fn an_object_darkens_the_floor_beside_it() {
    let (capture, lit) = lamp_room();
    let object = placed(&lit, block(), gray(0.3, 0.0), DVec3::new(0.0, -3.0, -1.0));
    let mut insertion = insertion(&capture, &lit, vec![object]);
    insertion.pass(64);
    let layers = insertion.layers();
    // Floor pixels that the object does not cover, in the columns in front of it.
    let (mut delta, mut dimmed) = (Moments::default(), 0);
    for y in SIDE * 3 / 4..SIDE {
        for x in SIDE / 3..SIDE * 2 / 3 {
            let pixel = (y * SIDE + x) as usize;
            if layers.alpha[pixel] == 0.0 {
                delta.push(f64::from(layers.delta.pixels[pixel].y));
                let shadow = layers.shadow.pixels[pixel].y;
                assert!((0.0..=1.0).contains(&shadow));
                dimmed += u32::from(shadow < 1.0);
                if shadow < 1.0 {
                    let with = layers.without.pixels[pixel].y * shadow;
                    assert!((with - layers.with.pixels[pixel].y).abs() < 1e-5);
                }
            } else {
                assert_eq!(layers.shadow.pixels[pixel], Vec3::ONE);
            }
        }
    }
    assert!(dimmed > 10, "{dimmed} pixels are shadowed");
    assert!(delta.count > 10, "{delta:?}");
    assert!(delta.mean < -4.0 * delta.standard_error(), "{delta:?}");
    let composite = insertion.composite();
    let photograph = &insertion.backdrop().photograph.pixels;
    let changed = composite
        .pixels
        .iter()
        .zip(photograph)
        .filter(|(a, b)| a != b);
    assert!(changed.count() > 50);
}

/// A first look of a photograph twice as large as its render, against the converged composite.
#[test]
fn the_first_look_has_exact_outlines_and_light_better_than_a_sample_of_each_pixel() {
    const LARGE: u32 = 400;
    let mut capture = lamp_room().0;
    let frame = &mut capture.frames[0];
    let factor = f64::from(LARGE) / f64::from(SIDE);
    let k = &mut frame.intrinsics;
    (k.width, k.height) = (LARGE, LARGE);
    (k.fx, k.fy, k.cx, k.cy) = (k.fx * factor, k.fy * factor, k.cx * factor, k.cy * factor);
    frame.photograph = PhotographSource::Memory(Arc::new(Photograph {
        width: LARGE,
        height: LARGE,
        pixels: vec![Vec3::splat(0.3); (LARGE * LARGE) as usize],
        ..(*frame.load().expect("in memory")).clone()
    }));
    let scene = Arc::new(Scene::new(&capture).expect("the scene is sound"));
    let materials = vec![gray(0.6, 0.0), gray(0.0, 10.0)];
    let lit = Arc::new(LitScene::new(scene, materials, None));
    let object = placed(&lit, block(), gray(0.3, 0.0), DVec3::new(0.0, -3.0, -1.0));
    let mut insertion = insertion(&capture, &lit, vec![object]);
    let first = first_look(&insertion);
    insertion.pass(1);
    let sample = insertion.composite();
    insertion.pass(63);
    let (truth, alpha) = (insertion.composite(), insertion.layers().alpha);
    let inside = |pixel: usize| alpha[pixel] == 0.0 || alpha[pixel] == 1.0;
    let pixels: Vec<usize> = (0..alpha.len()).filter(|&p| inside(p)).collect();
    assert!(
        pixels
            .iter()
            .all(|&pixel| first[pixel].alpha == alpha[pixel])
    );
    let picture = insertion.backdrop().composite(&first);
    let error = |picture: &Picture| -> f64 {
        let off = |p: &usize| f64::from((picture.pixels[*p] - truth.pixels[*p]).length_squared());
        (pixels.iter().map(off).sum::<f64>() / pixels.len() as f64).sqrt()
    };
    let (first, sample) = (error(&picture), error(&sample));
    assert!(first < 0.2 * sample, "{first} {sample}");
}

#[test]
fn passes_give_the_same_bits_however_they_are_split_and_on_any_number_of_threads() {
    let (capture, lit) = lamp_room();
    let object = placed(&lit, block(), gray(0.3, 0.0), DVec3::new(0.0, -3.0, -1.0));
    let results = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| {
            let mut insertion = insertion(&capture, &lit, vec![object.clone()]);
            let first = insertion.backdrop().composite(&first_look(&insertion));
            if threads == 1 {
                insertion.pass(3);
            } else {
                // Stopped after one band, then taken up again.
                let bands = std::cell::Cell::new(0);
                assert!(!insertion.refine_to(2, || bands.replace(bands.get() + 1) < 1));
                assert_eq!(insertion.samples(), 0);
                assert!(insertion.refine_to(2, || true));
                insertion.pass(1);
            }
            assert_eq!(insertion.samples(), 3);
            (first, insertion.composite())
        })
    });
    assert!(results[0].0 == results[1].0, "the first looks differ");
    assert!(results[0].1 == results[1].1, "the composites differ");
}

#[test]
fn a_saturating_photograph_gives_a_composite_that_saturates_like_it() {
    let (capture, lit) = lamp_room();
    let mut backdrop = backdrop(&capture, &lit);
    backdrop.saturation = Vec3::ONE;
    backdrop.exposure.factor = Vec3::splat(2.0);
    backdrop.photograph = Arc::new(Picture::from_fn(SIDE, SIDE, |x, _| {
        Vec3::splat(if x == 0 { 1.0 } else { 0.5 })
    }));
    // Pixel 0 is saturated and estimated at 2, pixel 1 is seen at a quarter of its estimate.
    for (pixel, alpha, over, want) in [
        (0, 0.0, 0.5, 1.0),
        (0, 0.0, 0.1, 0.2),
        (1, 0.0, 0.9, 0.45),
        (1, 0.0, 0.0, 0.0),
        (1, 1.0, 0.4, 0.8),
        (1, 1.0, 9.0, 1.0),
    ] {
        let got = blended(&backdrop, pixel, alpha, over, 1.0);
        assert!(
            (got - want).abs().max_element() < 1e-6,
            "{got} for {over} in {pixel}"
        );
    }
}

#[test]
fn an_object_in_the_corner_is_dimmed_as_the_photograph_is() {
    let (capture, lit) = lamp_room();
    let mut backdrop = backdrop(&capture, &lit);
    backdrop.exposure.vignetting = Some(Vignetting {
        power: Vec3::splat(2.0),
    });
    // Nothing behind, fully covered: the squared cosine of the corner's angle.
    let lens = &backdrop.camera.intrinsics;
    let [x, y] = [(0.5 - lens.cx) / lens.fx, (0.5 - lens.cy) / lens.fy];
    let want = 1.0 / (1.0 + x * x + y * y);
    let corner = blended(&backdrop, 0, 1.0, 1.0, 0.0);
    assert!((corner - want as f32).abs().max_element() < 1e-5);
    assert!(want < 0.9);
    let middle = (SIDE * SIDE / 2 + SIDE / 2) as usize;
    let middle = blended(&backdrop, middle, 1.0, 1.0, 0.0);
    assert!((middle - 1.0).abs().max_element() < 1e-2, "{middle}");
}

/// Through a camera's curve light is added, not values.
#[test]
fn light_is_composed_on_the_sensor_and_shown_through_the_cameras_curve() {
    let (capture, lit) = lamp_room();
    let mut backdrop = backdrop(&capture, &lit);
    let curve = Response {
        terms: [0.2, 0.6, -0.4].map(Vec3::splat),
    };
    backdrop.saturation = Vec3::ONE;
    backdrop.exposure.response = Some(curve);
    let shown = |light: f32| curve.value(Vec3::splat(light), Vec3::ONE);
    backdrop.photograph = Arc::new(Picture::from_fn(SIDE, SIDE, |_, _| shown(0.4)));
    // The surface hides a fraction of the pixel, and takes a tenth of the light that shines past it.
    for (alpha, over, under, want) in [
        (1.0, 0.3, 0.4, 0.3),
        (0.0, 0.3, 0.4, 0.3),
        (0.5, 0.3, 0.4, 0.3),
        (0.25, 0.8, 0.9, 0.425),
        (1.0, 9.0, 0.4, 9.0),
    ] {
        let got = blended(&backdrop, 1, alpha, over, under);
        let want = shown(want).min(Vec3::ONE);
        assert!((got - want).abs().max_element() < 1e-5, "{got} {want}");
    }
}

#[test]
fn naive_pasting_is_lit_by_harmonics_and_hidden_behind_the_scene() {
    let (capture, lit) = lit(&[("walls", walls())], vec![gray(0.5, 0.5)]);
    let backdrop = backdrop(&capture, &lit);
    let white = Picture::from_fn(SIDE, SIDE, |_, _| Vec3::ONE);
    let seen = naive::harmonics_of_photographs([(&backdrop.camera, &white)]);
    let options = PathOptions {
        max_bounces: 60,
        ..PathOptions::default()
    };
    let estimated = naive::harmonics_of_estimate(&lit, Vec3::ZERO, &options, 1);
    for (harmonics, tolerance) in [(seen, 1e-3), (estimated, 0.05)] {
        // Radiance 1 from everywhere: irradiance π, and the object shows its albedo.
        let error = harmonics.irradiance(Vec3::Y) / std::f32::consts::PI - 1.0;
        assert!(error.abs().max_element() < tolerance, "{error}");
        let object = placed(&lit, block(), gray(0.25, 0.0), DVec3::new(0.0, -0.5, 0.0));
        let pasted = naive::Pasted::new(
            &backdrop,
            &lit,
            &[object],
            &[harmonics],
            Exposure::default(),
        );
        let picture = pasted.over(&backdrop.photograph);
        let middle = picture.pixels[(SIDE / 2 * SIDE + SIDE / 2) as usize];
        assert!((middle - 0.25).abs().max_element() < 0.25 * tolerance);
        assert_eq!(picture.pixels[0], backdrop.photograph.pixels[0]);
    }
    let object = placed(&lit, block(), gray(0.25, 0.0), DVec3::new(0.0, -0.5, -3.6));
    let pasted = naive::Pasted::new(&backdrop, &lit, &[object], &[seen], Exposure::default());
    let picture = pasted.over(&backdrop.photograph);
    assert!(picture == *backdrop.photograph);
}

#[test]
fn a_pixel_leads_to_its_surface_and_objects_fall_onto_what_is_below() {
    let shelf = cuboid(
        DVec3::new(-1.0, -2.0, -1.0),
        DVec3::new(1.0, -1.8, 1.0),
        false,
    );
    let groups = [("walls", walls()), ("shelf", shelf)];
    let (_, lit) = lit(&groups, vec![gray(0.5, 0.5), gray(0.5, 0.0)]);
    let scene = &lit.scene;
    let camera = &scene.cameras[0];
    let middle = Vec2::splat(SIDE as f32 * 0.5);
    let seen = pick(scene, camera, middle).expect("the room is closed");
    assert!((seen.point - Vec3::new(0.0, 0.0, -3.0)).length() < 1e-5);
    assert_eq!((seen.normal, seen.object), (Vec3::Z, 0));
    let floor = below(scene, &seen).expect("there is a floor");
    assert!(
        (floor - Vec3::new(0.0, -3.0, -3.0)).length() < 1e-4,
        "{floor}"
    );

    // Half over the shelf's edge it comes to rest on the shelf, beside it on the floor.
    for (x, height) in [(1.2, 1.8), (2.0, 3.0)] {
        let object = placed(&lit, block(), gray(0.5, 0.0), DVec3::new(x, 0.0, 0.0));
        let distance = fall(scene, &object, 0.0).expect("there is a floor");
        assert!((distance - height).abs() < 1e-4, "{distance} for {height}");
    }
}
