//! Scenes written for other programs, read back by readers that are not ours where there are any.

use crate::common;
use glam::{DVec3, Mat4, Vec2, Vec3};
use relit::export::scene::{Format, write};
use relit::inverse::estimate::{Estimate, TexelEstimate};
use relit::math::color::to_srgb8;
use relit::scene::Scene;
use relit::scene::texels::TexelLayout;
use relit::transport::material::TexelColors;
use std::path::Path;
use std::sync::Arc;

/// The test room far from the origin, its floor textured and its walls a little glossy.
fn scene_and_estimate() -> (Arc<Scene>, Estimate) {
    let mut capture = common::room();
    for position in &mut capture.mesh.positions {
        *position += DVec3::new(1000.0, 0.0, -300.0);
    }
    for frame in &mut capture.frames {
        frame.pose.center += DVec3::new(1000.0, 0.0, -300.0);
    }
    let scene = Arc::new(Scene::new(&capture).expect("a room"));
    let mut estimate = common::truth();
    estimate.objects[0].roughness = Some(0.36);
    estimate.objects[0].specular = Some(0.04);
    let levels = scene
        .object_of
        .iter()
        .map(|&object| if object == 1 { 2 } else { 0 })
        .collect();
    let layout = TexelLayout::new(levels);
    let colors: Vec<Vec3> = (0..layout.len())
        .map(|i| Vec3::new(0.3, 0.4, 0.5) * ((i % 7) as f32 / 7.0))
        .collect();
    estimate.texels = Some(Arc::new(TexelEstimate {
        stderr: vec![Vec3::ZERO; colors.len()],
        seen: vec![1; colors.len()],
        colors: Arc::new(TexelColors { layout, colors }),
        textured: vec![false, true, false, false],
    }));
    (scene, estimate)
}

fn export(format: Format, path: &Path) -> (Arc<Scene>, Estimate) {
    let (scene, estimate) = scene_and_estimate();
    write(&scene, &estimate, format, path).expect("written");
    (scene, estimate)
}

/// Twice the area vector of a triangle: tells size and winding apart.
fn area(corners: [DVec3; 3]) -> DVec3 {
    (corners[1] - corners[0]).cross(corners[2] - corners[0])
}

/// Checks an object's triangles as another program has them, all corners in a row, against the scene's.
fn assert_same_surface(scene: &Scene, name: &str, corners: &[DVec3], tolerance: f64) {
    let index = scene
        .objects
        .iter()
        .position(|o| o.name == name)
        .expect("an object of the scene");
    let sum = |points: &mut dyn Iterator<Item = [DVec3; 3]>| {
        points.fold((DVec3::ZERO, DVec3::ZERO), |(areas, moments), t| {
            let middle = (t[0] + t[1] + t[2]) / 3.0;
            let size = area(t).length();
            (areas + area(t), moments + middle * size)
        })
    };
    let theirs = sum(&mut corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]));
    let mut own = scene.objects[index]
        .triangles
        .iter()
        .map(|&t| scene.corners(t).map(|p| p.as_dvec3() + scene.origin));
    let ours = sum(&mut own);
    assert!((ours.0 - theirs.0).length() < tolerance, "{name} areas");
    assert!(
        (ours.1 - theirs.1).length() < tolerance * 1000.0,
        "{name} moments"
    );
}

/// The middle of every texel of the floor has its colour in the picture, to the last of 8 bits.
fn assert_texels_are_found(
    scene: &Scene,
    estimate: &Estimate,
    uvs: &[Vec2],
    picture: &image::RgbImage,
) {
    let texels = estimate.texels.as_ref().expect("texels");
    let layout = &texels.colors.layout;
    assert_eq!(uvs.len(), 3 * scene.objects[1].triangles.len());
    for (corners, &triangle) in uvs.chunks(3).zip(&scene.objects[1].triangles) {
        let first = layout.first[triangle as usize];
        for texel in 0..layout.first[triangle as usize + 1] - first {
            let [b1, b2] = layout.center(triangle as usize, texel);
            let uv = corners[0] * (1.0 - b1 - b2) + corners[1] * b1 + corners[2] * b2;
            let x = (uv.x * picture.width() as f32) as u32;
            let y = (uv.y * picture.height() as f32) as u32;
            let expected = to_srgb8(texels.colors.colors[(first + texel) as usize], 1.0);
            assert_eq!(picture.get_pixel(x, y).0, expected, "{triangle} {texel}");
        }
    }
}

#[test]
fn glb_holds_nodes_materials_strengths_colours_and_cameras() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("scene.glb");
    let (scene, estimate) = export(Format::Glb, &path);
    let (document, buffers, images) = gltf::import(&path).expect("valid glTF");

    for (index, object) in scene.objects.iter().enumerate() {
        let node = document
            .nodes()
            .find(|n| n.name() == Some(&object.name))
            .expect("a node an object");
        let mesh = node.mesh().expect("a mesh");
        let primitive = mesh.primitives().next().expect("a primitive");
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
        let positions: Vec<DVec3> = reader
            .read_positions()
            .expect("positions")
            .map(|p| Vec3::from(p).as_dvec3())
            .collect();
        let corners: Vec<DVec3> = reader
            .read_indices()
            .expect("indices")
            .into_u32()
            .map(|i| positions[i as usize])
            .collect();
        // f32 a kilometre from the origin.
        assert_same_surface(&scene, &object.name, &corners, 2e-3);

        let known = &estimate.objects[index];
        let material = primitive.material();
        let surface = material.pbr_metallic_roughness();
        let strength = material.emissive_strength().unwrap_or(1.0);
        let emission = Vec3::from(material.emissive_factor()) * strength;
        assert!((emission - known.emission).length() <= 1e-5 * known.emission.length());
        assert!(material.emissive_factor().iter().all(|&v| v <= 1.0));
        assert_eq!(surface.metallic_factor(), 0.0);
        let roughness = if index == 0 { 0.6 } else { 1.0 };
        assert!((surface.roughness_factor() - roughness).abs() < 1e-6);
        let Some(uvs) = reader.read_tex_coords(0) else {
            let base = Vec3::from_slice(&surface.base_color_factor());
            assert_eq!(base, known.albedo);
            assert!(surface.base_color_texture().is_none());
            continue;
        };
        assert_eq!(index, 1, "only the floor is textured");
        assert_eq!(surface.base_color_factor(), [1.0; 4]);
        let texture = surface.base_color_texture().expect("a texture").texture();
        let uvs: Vec<Vec2> = uvs.into_f32().map(Vec2::from).collect();
        let picture = &images[texture.source().index()];
        assert_eq!(picture.format, gltf::image::Format::R8G8B8);
        let (width, height) = (picture.width, picture.height);
        let picture = image::RgbImage::from_raw(width, height, picture.pixels.clone());
        assert_texels_are_found(&scene, &estimate, &uvs, &picture.expect("all pixels"));
    }

    for (index, camera) in scene.cameras.iter().enumerate() {
        let name = format!("camera {index:03}");
        let node = document
            .nodes()
            .find(|n| n.name() == Some(&name))
            .expect("a node a camera");
        let pose = Mat4::from_cols_array_2d(&node.transform().matrix());
        let ahead = pose.transform_vector3(Vec3::NEG_Z);
        assert!((ahead - camera.forward()).length() < 1e-6);
        let center = camera.center.as_dvec3() + scene.origin;
        assert!((pose.w_axis.truncate().as_dvec3() - center).length() < 1e-3);
        let lens = node.camera().expect("a camera");
        let gltf::camera::Projection::Perspective(lens) = lens.projection() else {
            panic!("a perspective camera");
        };
        let tangent = f64::from(camera.intrinsics.height) * 0.5 / camera.intrinsics.fy;
        assert!((f64::from(lens.yfov() * 0.5).tan() - tangent).abs() < 1e-6);
    }
}

#[test]
fn obj_and_mtl_come_back_with_names_colours_and_exact_coordinates() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("scene.obj");
    let (scene, estimate) = export(Format::Obj, &path);
    let (models, materials) = tobj::load_obj(&path, &tobj::LoadOptions::default()).expect("an OBJ");
    let materials = materials.expect("an MTL");
    assert_eq!(models.len(), scene.objects.len());
    let mut textured = 0;
    for (index, model) in models.iter().enumerate() {
        let object = &scene.objects[index];
        assert_eq!(model.name, object.name);
        let corners: Vec<DVec3> = model
            .mesh
            .indices
            .iter()
            .map(|&i| DVec3::from_slice(&model.mesh.positions[3 * i as usize..]))
            .collect();
        assert_same_surface(&scene, &object.name, &corners, 1e-9);
        let material = &materials[model.mesh.material_id.expect("a material")];
        let known = &estimate.objects[index];
        let kd = Vec3::from(material.diffuse.expect("Kd").map(|v| v as f32));
        let ke = material.emissive.expect("Ke").map(|v| v as f32);
        assert_eq!(Vec3::from(ke), known.emission);
        let Some(image) = &material.diffuse_texture else {
            assert_eq!(kd, known.albedo);
            continue;
        };
        assert_eq!((index, kd), (1, Vec3::ONE));
        let picture = image::open(folder.path().join(image))
            .expect("a PNG")
            .to_rgb8();
        let uvs: Vec<Vec2> = (model.mesh.texcoord_indices.iter())
            .map(|&i| model.mesh.texcoords[2 * i as usize..][..2].to_vec())
            .map(|uv| Vec2::new(uv[0] as f32, 1.0 - uv[1] as f32))
            .collect();
        assert_texels_are_found(&scene, &estimate, &uvs, &picture);
        textured += 1;
    }
    assert_eq!(textured, 1);
    let text = std::fs::read_to_string(&path).expect("text");
    let mapped = text
        .lines()
        .filter(|l| l.starts_with("f ") && l.contains('/'));
    assert_eq!(mapped.count(), scene.objects[1].triangles.len());
    // The linear picture beside it shows the same, exactly enough.
    let linear = image::open(folder.path().join("scene.albedo.exr"))
        .expect("an EXR")
        .to_rgb32f();
    let shown = image::open(folder.path().join("scene.albedo.png"))
        .expect("a PNG")
        .to_rgb8();
    for (linear, shown) in linear.pixels().zip(shown.pixels()) {
        let expected = to_srgb8(Vec3::from(linear.0), 1.0);
        assert!((0..3).all(|c| expected[c].abs_diff(shown.0[c]) <= 1));
    }
}

#[test]
fn ply_is_a_mesh_that_a_capture_can_have() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("mesh.ply");
    let (scene, estimate) = export(Format::Ply, &path);
    let transforms = r#"{"camera_model": "PINHOLE", "w": 2, "h": 2, "fl_x": 2, "fl_y": 2, "cx": 1, "cy": 1,
        "frames": [{"file_path": "a.png", "transform_matrix": [[1,0,0,1000],[0,1,0,1],[0,0,1,-300],[0,0,0,1]]}]}"#;
    std::fs::write(folder.path().join("transforms.json"), transforms).expect("written");
    image::RgbImage::new(2, 2)
        .save(folder.path().join("a.png"))
        .expect("written");
    let capture = relit::capture::read::read(folder.path(), &Default::default()).expect("readable");
    let mesh = &capture.mesh;
    for (index, object) in scene.objects.iter().enumerate() {
        let own = mesh
            .objects
            .iter()
            .position(|name| *name == object.name)
            .expect("the name");
        let corners: Vec<DVec3> = mesh
            .triangles
            .iter()
            .zip(&mesh.object_of)
            .filter(|(_, o)| **o as usize == own)
            .flat_map(|(t, _)| t.map(|i| mesh.positions[i as usize]))
            .collect();
        assert_same_surface(&scene, &object.name, &corners, 1e-9);
        if index != 1 {
            let face = mesh
                .object_of
                .iter()
                .position(|&o| o as usize == own)
                .expect("a face");
            let color = mesh.vertex_colors[mesh.triangles[face][0] as usize];
            assert!((color - estimate.objects[index].albedo).abs().max_element() < 0.6 / 255.0);
        }
    }
}

#[test]
fn mitsuba_names_every_mesh_file_and_mirrors_the_cameras() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("scene.xml");
    let (scene, _) = export(Format::Mitsuba, &path);
    let xml = std::fs::read_to_string(&path).expect("written");
    let values = |name: &str| -> Vec<String> {
        let marker = format!("name=\"{name}\" value=\"");
        xml.split(&marker)
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap_or("").to_owned())
            .collect()
    };
    let files = values("filename");
    assert_eq!(files.len(), scene.objects.len());
    assert!(files.iter().all(|file| folder.path().join(file).is_file()));
    assert_eq!(values("radiance"), ["9, 8, 6"]);
    assert_eq!(xml.matches("mesh_attribute").count(), 1);
    assert_eq!(xml.matches("<sensor ").count(), scene.cameras.len());
    // The third column of a Mitsuba camera is its viewing direction.
    let matrix: Vec<f32> = xml
        .split("<matrix value=\"")
        .nth(1)
        .and_then(|rest| rest.split('"').next())
        .expect("a matrix")
        .split(' ')
        .map(|v| v.parse().expect("a number"))
        .collect();
    let ahead = Vec3::new(matrix[2], matrix[6], matrix[10]);
    assert!((ahead - scene.cameras[0].forward()).length() < 1e-6);
}

#[test]
fn csv_has_a_row_an_object() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("objects.csv");
    let (scene, estimate) = export(Format::Csv, &path);
    let text = std::fs::read_to_string(&path).expect("written");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 1 + scene.objects.len());
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    let column = rows[0]
        .iter()
        .position(|&c| c == "emission_g")
        .expect("the column");
    assert_eq!(rows[4][column].parse(), Ok(estimate.objects[3].emission.y));
}

/// Inside a closed furnace of emission e and albedo a every direction shows e / (1 − a).
#[test]
fn a_probe_in_a_furnace_is_constant_and_its_file_holds_it() {
    let (scene, mut estimate) = scene_and_estimate();
    estimate.texels = None;
    for object in &mut estimate.objects {
        object.albedo = Vec3::splat(0.2);
        object.emission = Vec3::new(1.0, 2.0, 3.0);
        object.roughness = None;
    }
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("light.hdr");
    let probe = Format::Probe { at: scene.origin };
    write(&scene, &estimate, probe, &path).expect("written");
    let picture = image::open(&path).expect("an image").to_rgb32f();
    assert_eq!(picture.width(), 2 * picture.height());
    let count = f64::from(picture.width() * picture.height());
    for channel in 0..3 {
        let values = picture.pixels().map(|p| f64::from(p.0[channel]));
        let ratio = values.sum::<f64>() / count / (1.25 * (channel + 1) as f64);
        // The format's common exponent leaves 8 bits, rounded down by this encoder.
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    }
    let wrong = folder.path().join("light.jpg");
    assert!(write(&scene, &estimate, probe, &wrong).is_err());
}

/// The lamp is overhead: the panorama's first row shows it and its last row does not.
#[test]
fn a_probe_has_up_at_its_top() {
    let (scene, estimate) = scene_and_estimate();
    let world = estimate.lit(&scene);
    let picture = relit::export::probe::panorama(&world, Vec3::ZERO, 16, 8, 1);
    assert_eq!(picture.pixels[0], Vec3::new(9.0, 8.0, 6.0));
    assert!(picture.pixels[31 * 16].max_element() < 5.0);
}
