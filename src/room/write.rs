//! The room as a capture folder, with its truth.

use crate::capture::camera::{Intrinsics, Pose};
use crate::error::{Error, Result};
use crate::export::atomic::{write_atomically, write_bytes};
use crate::export::exr::{Precision, write_rgb};
use crate::room::photographs::{self, KEPT, Rendering};
use crate::room::truth::{self, Truth};
use crate::room::{Room, cameras};
use crate::scene::Scene;
use glam::DMat4;
use serde_json::json;
use std::io::Write;
use std::path::Path;

/// Writes the room into a folder: transforms.json, mesh.obj, images, truth.json and truth/albedo_NNN.exr.
///
/// The photographs are the kept ones, byte for byte, or newly rendered.
///
/// # Errors
/// A file cannot be written.
pub fn write(out: &Path, rendering: Option<&Rendering>) -> Result<()> {
    let room = Room::new();
    let made = rendering.unwrap_or(&KEPT);
    let images = out.join("images");
    match rendering {
        Some(rendering) => photographs::write(&images, &photographs::render(&room, rendering)?)?,
        None => photographs::write_kept(&images)?,
    }
    write_mesh(&out.join("mesh.obj"), &room)?;

    let world = room.lit(made.size)?;
    for (index, camera) in world.scene.cameras.iter().enumerate() {
        let path = out.join(format!("truth/albedo_{index:03}.exr"));
        write_rgb(
            &path,
            &truth::albedo_picture(&world, camera),
            Precision::Float,
        )?;
    }
    let truth = Truth {
        name: "room",
        renderer: format!("relit {}", env!("CARGO_PKG_VERSION")),
        max_bounces: None,
        spp: made.samples,
        seed: made.seed,
        outside_light: None,
        objects: truth::objects(&world),
    };
    write_json(&out.join("truth.json"), &truth)?;
    // Last, so that a folder with transforms.json is a whole capture.
    let cameras = cameras::cameras(&room.views, made.size);
    write_transforms(&out.join("transforms.json"), &cameras, &world.scene)
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| Error::file(path, error, "nothing was written there"))?;
    write_bytes(path, text.as_bytes())
}

fn write_transforms(path: &Path, cameras: &[(Intrinsics, Pose)], scene: &Scene) -> Result<()> {
    let Some((lens, _)) = cameras.first() else {
        return Err(Error::file(path, "the room has no cameras", ""));
    };
    let frames: Vec<_> = cameras
        .iter()
        .enumerate()
        .map(|(index, (_, pose))| {
            let [x, y, z] = [0, 1, 2].map(|i| pose.rotation.col(i).extend(0.0));
            let rows = DMat4::from_cols(x, y, z, pose.center.extend(1.0)).transpose();
            json!({
                "file_path": format!("images/{index:03}.exr"),
                "transform_matrix": rows.to_cols_array_2d(),
            })
        })
        .collect();
    let transforms = json!({
        "camera_model": "PINHOLE",
        "w": lens.width,
        "h": lens.height,
        "fl_x": lens.fx,
        "fl_y": lens.fy,
        "cx": lens.cx,
        "cy": lens.cy,
        "mesh_path": "mesh.obj",
        "up": scene.up.to_array(),
        "frames": frames,
    });
    write_json(path, &transforms)
}

fn write_mesh(path: &Path, room: &Room) -> Result<()> {
    let mesh = &room.mesh;
    write_atomically(path, |out| {
        for p in &mesh.positions {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for uv in mesh.corner_uvs.iter().flatten() {
            writeln!(out, "vt {} {}", uv.x, uv.y)?;
        }
        let mut object = None;
        for (index, (triangle, &owner)) in mesh.triangles.iter().zip(&mesh.object_of).enumerate() {
            if object != Some(owner) {
                object = Some(owner);
                writeln!(out, "o {}", mesh.objects[owner as usize])?;
            }
            let [a, b, c] = triangle.map(|i| i + 1);
            let uv = 3 * index + 1;
            writeln!(out, "f {a}/{uv} {b}/{} {c}/{}", uv + 1, uv + 2)?;
        }
        Ok(())
    })
}
