//! The tiny room as a capture in files.

use crate::common;
use relit::capture::photograph::PhotographSource;
use relit::export::exr::{Precision, write_rgb};
use relit::math::picture::Picture;
use std::fs;
use std::path::Path;

/// Writes the tiny room as a capture with its truth.
pub fn write_capture(folder: &Path) {
    let capture = common::room();
    fs::create_dir_all(folder.join("images")).expect("writes");
    let mut obj = String::new();
    for p in &capture.mesh.positions {
        obj += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    for (index, name) in capture.mesh.objects.iter().enumerate() {
        obj += &format!("o {name}\n");
        for (t, _) in (capture.mesh.triangles.iter().zip(&capture.mesh.object_of))
            .filter(|(_, object)| **object as usize == index)
        {
            obj += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
        }
    }
    fs::write(folder.join("mesh.obj"), obj).expect("writes");

    let mut frames = Vec::new();
    for (index, frame) in capture.frames.iter().enumerate() {
        let name = format!("images/{index:03}.exr");
        let PhotographSource::Memory(photograph) = &frame.photograph else {
            panic!("the room is in memory");
        };
        let picture = Picture {
            width: photograph.width,
            height: photograph.height,
            pixels: photograph.pixels.clone(),
        };
        write_rgb(&folder.join(&name), &picture, Precision::Float).expect("writes");
        let (r, c) = (frame.pose.rotation, frame.pose.center);
        let row = |i: usize| vec![r.x_axis[i], r.y_axis[i], r.z_axis[i], c[i]];
        let matrix = [row(0), row(1), row(2), vec![0.0, 0.0, 0.0, 1.0]];
        frames.push(serde_json::json!({"file_path": name, "transform_matrix": matrix}));
    }
    let k = &capture.frames[0].intrinsics;
    let transforms = serde_json::json!({
        "camera_model": "PINHOLE", "w": k.width, "h": k.height, "fl_x": k.fx, "fl_y": k.fy,
        "cx": k.cx, "cy": k.cy, "mesh_path": "mesh.obj", "frames": frames,
    });
    fs::write(folder.join("transforms.json"), transforms.to_string()).expect("writes");

    let mut objects = serde_json::Map::new();
    for (name, albedo, emission) in common::OBJECTS {
        objects.insert(
            name.to_owned(),
            serde_json::json!({"albedo": albedo, "emission": emission, "roughness": null}),
        );
    }
    let truth = serde_json::json!({ "objects": objects });
    fs::write(folder.join("truth.json"), truth.to_string()).expect("writes");
}
