//! Writes the room as a capture folder, with its truth.

use crate::error::Result;
use crate::export::capture;
use crate::export::new_folder::NewFolder;
use crate::math::picture::Picture;
use crate::room::cameras;
use crate::room::model::Room;
use crate::room::photographs::{self, Rendering, STORED};
use crate::room::truth::{self, Truth};
use crate::scene::camera::Camera;
use std::path::Path;

/// Writes the room into a new or empty folder, atomically: transforms.json, mesh.obj, images, truth.json and
/// truth/albedo_NNN.exr.
///
/// The photographs are the stored ones, byte for byte, or newly rendered.
///
/// # Errors
/// The folder is not empty (see [`NewFolder`]), or a file cannot be written.
pub fn write(out: &Path, rendering: Option<&Rendering>) -> Result<()> {
    let folder = NewFolder::new(out)?;
    let out = folder.path();
    let room = Room::new();
    let rendering_used = rendering.unwrap_or(&STORED);
    let images = out.join("images");
    match rendering {
        Some(rendering) => photographs::write(&images, &photographs::render(&room, rendering)?)?,
        None => photographs::write_stored(&images)?,
    }
    capture::write_mesh(out, &room.mesh)?;

    let world = room.lit(rendering_used.size)?;
    let seen_by = |camera: &Camera| truth::albedo_picture(&world, camera);
    let albedo: Vec<Picture> = world.scene.cameras.iter().map(seen_by).collect();
    let truth = Truth {
        name: "room",
        renderer: format!("relit {}", env!("CARGO_PKG_VERSION")),
        max_bounces: None,
        spp: rendering_used.samples,
        seed: rendering_used.seed,
        outside_light: None,
        objects: truth::objects(&world),
    };
    capture::write_truth(out, &truth, &albedo)?;
    let cameras = cameras::cameras(&room.views, rendering_used.size);
    capture::write_transforms(out, cameras.into_iter(), world.scene.up.as_dvec3())?;
    folder.commit()
}
