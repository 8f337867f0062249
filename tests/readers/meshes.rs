//! OBJ and glTF meshes. (PLY is tested beside its reader.)

use crate::{OBJ, folder, open, transforms, with_mesh, write};
use glam::{DVec3, Vec2, Vec3};
use serde_json::{Value, json};

#[test]
fn obj_objects_colours_and_texture_coordinates_are_read() {
    let text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        g quad\nf 1/1 2/2 3/3 4/4\no back\nf -4/-4 -2/-2 -3/-3\no quad\nl 1 2\nf 1/1 2/2 3/3\n";
    let capture = with_mesh("scan.obj", text.as_bytes()).unwrap();
    let mesh = &capture.mesh;
    // A name that comes again goes on with its object.
    assert_eq!(mesh.objects, ["quad", "back"]);
    assert_eq!(mesh.object_of, [0, 0, 1, 0]);
    let corners = |t: usize| mesh.triangles[t].map(|i| mesh.positions[i as usize]);
    assert_eq!(
        corners(1),
        [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]
    );
    assert_eq!(
        corners(2),
        [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::X]
    );
    assert_eq!(mesh.vertex_colors[mesh.triangles[1][2] as usize], Vec3::ONE);
    assert_eq!(mesh.corner_uvs[1], [Vec2::ZERO, Vec2::ONE, Vec2::Y]);
    let warned = |word: &str| capture.warnings.iter().any(|w| w.contains(word));
    assert!(
        warned("2 triangles lie exactly upon another"),
        "{:?}",
        capture.warnings
    );
}

#[test]
fn obj_flaws_name_the_line_or_the_vertex() {
    for (from, to, word) in [
        ("v 1 -1 -2", "v 1 x -2", "line 3"),
        ("v 1 -1 -2", "v 1 -1", "line 3"),
        ("v 1 -1 -2", "v NaN -1 -2", "vertex 1"),
        ("v 1 -1 -2", "v 1 inf -2", "vertex 1"),
        ("f 1 2 3", "f 1 2 9", "object that ends"),
        ("f 1 2 3", "f 0 1 2", "object that ends"),
        ("f 1 2 3", "f 1 b 3", "line 5"),
        ("f 1 2 3", "", "no triangles"),
    ] {
        let error = with_mesh("scan.obj", OBJ.replace(from, to).as_bytes()).unwrap_err();
        assert!(
            error.place.contains("scan.obj") && error.problem.contains(word),
            "{to}: {error}"
        );
    }
    let flat = with_mesh("scan.obj", OBJ.replace("v 0 1 -2", "v 0 -1 -2").as_bytes()).unwrap();
    assert!(
        flat.warnings
            .iter()
            .any(|w| w.contains("1 triangles have no area"))
    );
}

#[test]
fn single_precision_far_from_the_origin_is_said_with_its_rounding() {
    let ply = |kind: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
             element face 1\nproperty list uchar int vertex_index\nend_header\n1000000 0 0\n1000001 0 0\n1000000 1 0\n3 0 1 2\n"
        )
    };
    let warned = |kind: &str| {
        let capture = with_mesh("scan.ply", ply(kind).as_bytes()).unwrap();
        capture
            .warnings
            .iter()
            .any(|w| w.contains("rounded by up to 3.0e-2"))
    };
    assert!(warned("float") && !warned("double"));
}

/// A GLB of one triangle under two nodes: the second, a child of the first, is mirrored.
pub fn glb(change: impl Fn(&mut Value)) -> Vec<u8> {
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut bin: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    bin.extend([0u16, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    bin.extend([0, 0]);
    let mut root = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "wall", "mesh": 0, "translation": [10.0, 0.0, 0.0], "children": [1]},
            {"mesh": 0, "scale": [-2.0, 2.0, 2.0]}
        ],
        "meshes": [{"name": "shape", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6}
        ],
        "buffers": [{"byteLength": 42}]
    });
    change(&mut root);
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + json.len() + 8 + bin.len();
    let mut bytes = b"glTF".to_vec();
    bytes.extend(
        [2u32, length as u32, json.len() as u32]
            .map(u32::to_le_bytes)
            .concat(),
    );
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(bin);
    bytes
}

#[test]
fn gltf_nodes_are_objects_with_their_transforms() {
    let mesh = with_mesh("scan.glb", &glb(|_| {})).unwrap().mesh;
    assert_eq!(mesh.objects, ["wall", "shape"]);
    let corners = |t: usize| mesh.triangles[t].map(|i| mesh.positions[i as usize]);
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    assert_eq!(corners(0), [at(10.0, 0.0), at(11.0, 0.0), at(10.0, 1.0)]);
    // Mirrored, so that the winding is turned to keep the front in front.
    assert_eq!(corners(1), [at(10.0, 0.0), at(10.0, 2.0), at(8.0, 0.0)]);
}

#[test]
fn gltf_flaws_are_errors() {
    let past = "reaches past the end";
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 9] = [
        ("ancestor", |g| g["nodes"][1]["children"] = json!([0])),
        ("ancestor", |g| g["scenes"][0]["nodes"] = json!([0, 0])),
        (past, |g| g["accessors"][0]["count"] = json!(1_000_000)),
        (past, |g| {
            g["accessors"][0]["count"] = json!(4_611_686_018_427_387_904_u64)
        }),
        (past, |g| g["bufferViews"][0]["byteOffset"] = json!(40)),
        (past, |g| {
            g["bufferViews"][1]["byteLength"] = json!(18_446_744_073_709_551_615_u64)
        }),
        ("declared", |g| {
            g["buffers"][0]["byteLength"] = json!(1_000_000)
        }),
        ("leaves", |g| {
            g["buffers"][0]["uri"] = json!("../../etc/passwd")
        }),
        ("valid", |g| {
            g["meshes"][0]["primitives"][0]["indices"] = json!(7)
        }),
    ];
    for (word, change) in cases {
        let error = with_mesh("scan.glb", &glb(change)).unwrap_err();
        assert!(error.to_string().contains(word), "{word}: {error}");
    }
}

/// A few megabytes that name the same triangle 40 million times.
#[test]
fn gltf_nodes_that_use_a_mesh_over_and_over_are_refused_before_it_is_read() {
    let bytes = glb(|g| {
        let primitive = g["meshes"][0]["primitives"][0].clone();
        g["meshes"][0]["primitives"] = json!(vec![primitive; 10_000]);
        g["nodes"] = json!(vec![json!({"mesh": 0}); 4_000]);
        g["scenes"][0]["nodes"] = json!((0..4_000).collect::<Vec<_>>());
    });
    let started = std::time::Instant::now();
    let error = with_mesh("scan.glb", &bytes).unwrap_err();
    assert!(error.problem.contains("instance meshes"), "{error}");
    let folder = folder("");
    write(folder.path(), "object.glb", &bytes);
    let error = relit::compose::object::ObjectModel::read(&folder.path().join("object.glb"));
    let error = error.unwrap_err();
    assert!(error.problem.contains("instance meshes"), "{error}");
    assert!(started.elapsed().as_secs() < 10);
}

#[test]
fn the_mesh_is_glb_then_ply_then_obj() {
    let folder = folder(&transforms(""));
    assert_eq!(open(folder.path()).unwrap().mesh.objects, ["triangle"]);
    write(folder.path(), "mesh.glb", &glb(|_| {}));
    assert_eq!(open(folder.path()).unwrap().mesh.objects, ["wall", "shape"]);
}
