//! Objects to insert: what their files mean, where they come to stand, and what hostile files are told.

use crate::beside::beside;
use glam::{DQuat, DVec2, DVec3, Vec3};
use relit::compose::object::ObjectModel;
use relit::compose::placement::Placement;
use relit::math::color::srgb_to_linear;
use relit::math::rng::Stream;
use relit::scene::geometry::Hit;
use relit::transport::material::Albedo;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const SQUARE: &str =
    "v 0 0 0\nv 2 0 0\nv 2 4 0\nv 0 4 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";
const FACE: &str = "usemtl paint\nf 1/1/1 2/2/1 3/3/1 4/4/1\n";

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("has a parent")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
    folder
}

fn png(width: u32, height: u32, color: impl Fn(u32, u32) -> [u8; 3]) -> Vec<u8> {
    let image = image::RgbImage::from_fn(width, height, |x, y| image::Rgb(color(x, y)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("encodes");
    bytes.into_inner()
}

fn problem(path: &Path) -> String {
    let error = ObjectModel::read(path).expect_err("the file is hostile");
    let line = error.to_string();
    assert!(!line.contains('\n') && error.exit_code() == 1, "{line}");
    line
}

#[test]
fn an_obj_has_its_colors_texture_gloss_and_normals() {
    // The left half of the image is dark, the bottom row is green.
    let image = png(2, 2, |x, y| {
        if y == 1 {
            [0, 255, 0]
        } else {
            [128 * x as u8, 0, 0]
        }
    });
    let obj = format!("mtllib m.mtl\n{SQUARE}{FACE}");
    let mtl = b"newmtl paint\nKd 0.5 0.25 1\nKs 0.5 0.5 0.5\nNs 98\nillum 2\nd 0.5\nmap_Kd t.png\n";
    let folder = folder(&[("o.obj", obj.as_bytes()), ("m.mtl", mtl), ("t.png", &image)]);
    let model = ObjectModel::read(&folder.path().join("o.obj")).expect("a sound file");
    assert_eq!((model.name.as_str(), model.corners.len()), ("o", 2));
    assert_eq!(model.base(DQuat::IDENTITY), DVec3::new(1.0, 0.0, 0.0));
    assert!(model.corner_normals.iter().flatten().all(|&n| n == Vec3::Z));
    assert!(
        model.warnings.iter().any(|w| w.contains("see-through")),
        "{:?}",
        model.warnings
    );

    let material = &model.materials[model.material_of[0] as usize];
    let lobe = material.lobe.expect("a glossy material");
    assert!((lobe.roughness - 0.02f32.sqrt()).abs() < 1e-6);
    assert!((lobe.specular - 0.04).abs().max_element() < 1e-6);
    // The second triangle is (0,0), (2,4), (0,4); texel centres are at quarters of the square.
    let at = |u: f32, v: f32| {
        let (b1, b2) = (u, v - u);
        material.albedo_at(&Hit {
            t: 1.0,
            triangle: 1,
            b1,
            b2,
        })
    };
    assert!((at(0.25, 0.75) - Vec3::ZERO).length() < 1e-6);
    let first = |u: f32, v: f32| {
        let (b1, b2) = (u - v, v);
        material.albedo_at(&Hit {
            t: 1.0,
            triangle: 0,
            b1,
            b2,
        })
    };
    assert!((first(0.75, 0.25) - Vec3::new(0.0, 0.25, 0.0)).length() < 1e-6);
    let red = 0.5 * srgb_to_linear(128.0 / 255.0);
    assert!((first(0.75, 0.75) - Vec3::new(red, 0.0, 0.0)).length() < 1e-6);
}

#[test]
fn a_color_of_one_number_is_gray_and_a_texture_alone_is_the_base_color() {
    let image = png(1, 1, |_, _| [255, 0, 0]);
    let obj = format!("mtllib m.mtl\n{SQUARE}{FACE}");
    let model = |mtl: &str| {
        let files: [(&str, &[u8]); 3] = [
            ("o.obj", obj.as_bytes()),
            ("m.mtl", mtl.as_bytes()),
            ("t.png", &image),
        ];
        let folder = folder(&files);
        ObjectModel::read(&folder.path().join("o.obj"))
    };
    let color = |mtl: &str| {
        let model = model(mtl).expect("a sound file");
        let material = &model.materials[model.material_of[0] as usize];
        material.albedo_at(&Hit {
            t: 1.0,
            triangle: 0,
            b1: 0.3,
            b2: 0.3,
        })
    };
    assert_eq!(color("newmtl paint\nKd 0.25\n"), Vec3::splat(0.25));
    assert_eq!(color("newmtl paint\nmap_Kd t.png\n"), Vec3::X);
    for broken in ["Kd", "Kd 0.5 0.5", "Kd x", "Ks"] {
        let error = model(&format!("newmtl paint\n{broken}\n")).expect_err("no color");
        assert!(error.place.contains("m.mtl"), "{error}");
    }
}

/// One triangle as glTF with its buffer inline; `nodes` and `material` are JSON.
fn gltf(nodes: &str, material: &str) -> String {
    let mut bytes = Vec::new();
    for value in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0] {
        bytes.extend(value.to_le_bytes());
    }
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let base64: String = bytes
        .chunks(3)
        .flat_map(|c| {
            let n = c.iter().fold(0u32, |n, &b| n << 8 | u32::from(b));
            [18, 12, 6, 0].map(|shift| char::from(digits[(n >> shift & 63) as usize]))
        })
        .collect();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":{nodes},
        "extensionsUsed":["KHR_materials_transmission"],"materials":[{material}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
        "min":[0,0,0],"max":[1,2,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{base64}"}}]}}"#
    )
}

#[test]
fn gltf_metal_has_its_base_color_as_specular_reflectance_and_mirrored_nodes_keep_their_front() {
    let metal = r#"{"pbrMetallicRoughness":{"baseColorFactor":[0.9,0.6,0.3,1],"metallicFactor":1,
        "roughnessFactor":0.5},"alphaMode":"BLEND"}"#;
    let nodes = r#"[{"mesh":0,"scale":[-1,1,1],"translation":[5,0,0]}]"#;
    let folder = folder(&[("a.gltf", gltf(nodes, metal).as_bytes())]);
    let model = ObjectModel::read(&folder.path().join("a.gltf")).expect("a sound file");
    let material = &model.materials[0];
    assert!(matches!(material.albedo, Albedo::Constant(Vec3::ZERO)));
    let lobe = material.lobe.expect("a metal");
    assert_eq!(lobe.roughness, 0.25);
    assert!((lobe.specular - Vec3::new(0.9, 0.6, 0.3)).length() < 1e-6);
    let [a, b, c] = model.corners[0];
    assert_eq!((b - a).cross(c - a).normalize(), DVec3::Z);
    assert_eq!(model.bounds().0, DVec3::new(4.0, 0.0, 0.0));
    for word in ["KHR_materials_transmission", "see-through"] {
        assert!(
            model.warnings.iter().any(|w| w.contains(word)),
            "{:?}",
            model.warnings
        );
    }
}

#[test]
fn an_object_stands_on_its_base_turned_and_scaled_about_the_up_axis() {
    let obj = "v -1 3 -2\nv 3 3 -2\nv -1 5 4\nf 1 2 3\n";
    let folder = folder(&[("o.obj", obj.as_bytes())]);
    let model = ObjectModel::read(&folder.path().join("o.obj")).expect("a sound file");
    let base = model.base(DQuat::IDENTITY);
    assert_eq!(base, DVec3::new(1.0, 3.0, 1.0));
    let mut placement = Placement {
        scale: 0.5,
        rotate: 90.0,
        ..Placement::new("o.obj", Some(DVec3::new(10.0, 20.0, 30.0)))
    };
    let near = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-12, "{a} {b}");
    // Counter-clockwise from above, +x turns towards −z where y is up.
    let upright = placement.transform(base, DVec3::Y).expect("sound");
    near(upright.transform_point3(base), DVec3::new(10.0, 20.0, 30.0));
    near(
        upright.transform_point3(base + DVec3::X),
        DVec3::new(10.0, 20.0, 29.5),
    );
    near(
        upright.transform_point3(base + DVec3::Y),
        DVec3::new(10.0, 20.5, 30.0),
    );
    // Where z is up, the file's y goes there and +x turns towards +y.
    let tall = placement.transform(base, DVec3::Z).expect("sound");
    near(
        tall.transform_point3(base + DVec3::Y),
        DVec3::new(10.0, 20.0, 30.5),
    );
    near(
        tall.transform_point3(base + DVec3::X),
        DVec3::new(10.0, 20.5, 30.0),
    );
    // As modelled, nothing moves that is not asked to.
    placement = Placement {
        at: None,
        scale: 1.0,
        rotate: 0.0,
        ..placement
    };
    let still = placement.transform(base, DVec3::Z).expect("sound");
    near(
        still.transform_point3(DVec3::new(1.0, 2.0, 3.0)),
        DVec3::new(1.0, 2.0, 3.0),
    );
    // Tilted about z by a quarter turn, +x points up, and the lowest point is where x was least.
    let tilted = Placement {
        at: Some(DVec3::ZERO),
        tilt: DVec2::new(0.0, 90.0),
        ..placement.clone()
    };
    let lying = tilted.transform(model.base(tilted.tilt_rotation()), DVec3::Y);
    let points = model.corners[0].map(|p| lying.as_ref().expect("sound").transform_point3(p));
    near(points[0], DVec3::new(1.0, 0.0, -3.0));
    near(points[1], DVec3::new(1.0, 4.0, -3.0));
    near(points[2], DVec3::new(-1.0, 0.0, 3.0));
    for scale in [0.0, -1.0, f64::NAN] {
        let error = Placement {
            scale,
            ..placement.clone()
        }
        .transform(base, DVec3::Y);
        assert_eq!(error.expect_err("no size").exit_code(), 2);
    }
}

#[test]
fn files_that_lead_out_of_their_folder_are_refused() {
    let image = png(1, 1, |_, _| [255; 3]);
    let obj = format!("mtllib m.mtl\n{SQUARE}{FACE}");
    let escaping = format!("mtllib ../secret.mtl\n{SQUARE}{FACE}");
    let white = r#"{"pbrMetallicRoughness":{}}"#;
    let stolen = gltf(r#"[{"mesh":0}]"#, white)
        .replace(r#""uri":"data:"#, r#""uri":"%2e%2e/secret.bin","x":""#);
    let folder = folder(&[
        ("secret.png", &image),
        ("secret.mtl", b"newmtl paint\n"),
        ("secret.bin", &[0; 36]),
        ("a/o.obj", obj.as_bytes()),
        ("a/m.mtl", b"newmtl paint\nmap_Kd ../secret.png\n"),
        ("a/e.obj", escaping.as_bytes()),
        ("a/g.gltf", stolen.as_bytes()),
    ]);
    for name in ["a/o.obj", "a/e.obj", "a/g.gltf"] {
        let line = problem(&folder.path().join(name));
        assert!(line.contains("outside its own folder"), "{line}");
    }
    #[cfg(unix)]
    {
        let link = folder.path().join("a/link.png");
        std::os::unix::fs::symlink(folder.path().join("secret.png"), link).expect("links");
        let mtl = b"newmtl paint\nmap_Kd link.png\n";
        fs::write(folder.path().join("a/m.mtl"), mtl).expect("writable");
        let line = problem(&folder.path().join("a/o.obj"));
        assert!(line.contains("outside its own folder"), "{line}");
    }
}

#[test]
fn broken_files_get_one_line() {
    let white = r#"{"pbrMetallicRoughness":{}}"#;
    let whole = gltf(r#"[{"mesh":0}]"#, white);
    let cycle = gltf(r#"[{"mesh":0,"children":[1]},{"children":[0]}]"#, white);
    let long = png(20_000, 1, |_, _| [0; 3]);
    let textured = format!("mtllib m.mtl\n{SQUARE}{FACE}");
    let cases: &[(&str, &[u8], &str)] = &[
        ("a.stl", b"solid", "is no object file"),
        ("empty.obj", b"", "no triangle"),
        (
            "face.obj",
            b"v 0 0 0\nv 1 0 0\nf 1 2 9\n",
            "no readable OBJ",
        ),
        (
            "huge.obj",
            b"v 0 0 0\nf 1 99999999999999999999 1\n",
            "no readable OBJ",
        ),
        (
            "nan.obj",
            b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "no triangle",
        ),
        (
            "flat.obj",
            b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
            "no triangle",
        ),
        (
            "lost.obj",
            b"mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "gone.mtl",
        ),
        ("long.obj", textured.as_bytes(), "texture cannot be read"),
        (
            "noise.glb",
            b"glTF\x02\0\0\0\xff\xff\xff\xff\0\0\0\0",
            "is not a valid glTF",
        ),
        ("cycle.gltf", cycle.as_bytes(), "two parents"),
    ];
    let mut files: Vec<(&str, &[u8])> = cases
        .iter()
        .map(|(name, bytes, _)| (*name, *bytes))
        .collect();
    files.push(("m.mtl", b"newmtl paint\nmap_Kd long.png\n"));
    files.push(("long.png", &long));
    let folder = folder(&files);
    for (name, _, want) in cases {
        let line = problem(&folder.path().join(name));
        assert!(line.contains(want), "{name}: {line}");
    }
    problem(&folder.path().join("missing.obj"));
    for (from, to) in [
        (r#""byteLength":36,"uri""#, r#""byteLength":99,"uri""#),
        (r#""count":3"#, r#""count":4"#),
        (r#""count":3"#, r#""count":18446744073709551615"#),
        (r#""type":"VEC3""#, r#""type":"VEC2""#),
        (r#""componentType":5126"#, r#""componentType":5121"#),
    ] {
        let path = folder.path().join("changed.gltf");
        fs::write(&path, whole.replace(from, to)).expect("writable");
        problem(&path);
    }
}

/// Files with random bytes changed are read or refused, never a panic.
#[test]
fn damaged_files_never_panic() {
    let obj = format!("{SQUARE}f 1/1/1 2/2/1 3/3/1 4/4/1\n");
    let json = gltf(r#"[{"mesh":0}]"#, r#"{"pbrMetallicRoughness":{}}"#);
    let folder = folder(&[]);
    let mut stream = Stream::new(9, 0, 0, 0);
    for (name, whole) in [("d.obj", obj.as_bytes()), ("d.gltf", json.as_bytes())] {
        let path = folder.path().join(name);
        for _ in 0..500 {
            let mut bytes = whole.to_vec();
            for _ in 0..1 + stream.below(3) {
                let place = stream.below(bytes.len());
                bytes[place] = match stream.below(3) {
                    0 => b'0' + stream.below(10) as u8,
                    1 => b'-',
                    _ => stream.below(256) as u8,
                };
            }
            fs::write(&path, &bytes).expect("writable");
            if let Err(error) = ObjectModel::read(&path) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}

#[test]
fn shared_objects_are_read() {
    for (file, triangles) in [
        ("oakChair/oakChair.obj", 31_786),
        ("teddyBear/teddyBear.obj", 27_552),
        ("suzi.glb", 15_744),
    ] {
        let Some(path) = beside(&format!("objects/{file}")) else {
            continue;
        };
        let model = ObjectModel::read(&path).expect("a sound file");
        println!(
            "{file}: {} triangles, {:?}",
            model.corners.len(),
            model.warnings
        );
        assert_eq!(model.corners.len(), triangles, "{file}");
    }
}
