//! The built-in room: geometry, lights and materials, photographs and ground truth. Also rooms generated at random.
//!
//! All but the photographs is computed at start-up. They are path-traced renderings of the room, stored in
//! `assets/room` so that the program starts at once; `relit demo --seed` renders them again.

pub mod build;
pub mod cameras;
mod furniture;
pub mod generated;
mod model;
pub mod photographs;
pub mod shape;
mod texture;
pub mod truth;

pub use model::{Room, linear_photograph};

use crate::capture::Capture;
use crate::error::Result;
use crate::export::capture as folder;
use crate::export::new_folder::NewFolder;
use crate::math::picture::Picture;
use crate::scene::camera::Camera;
use crate::transport::lit::LitScene;
use photographs::{Rendering, STORED};
use std::path::Path;

/// The built-in room as a capture, ready to solve.
///
/// # Errors
/// The program file is damaged.
pub fn capture() -> Result<Capture> {
    Ok(Room::new().capture_of(photographs::stored()?, STORED.size))
}

/// Writes the room into a new or empty folder, atomically: transforms.json, mesh.obj, images, truth.json and
/// truth/albedo_NNN.exr.
///
/// The photographs are the stored ones, byte for byte, or newly rendered.
///
/// # Errors
/// The folder is not empty (see [`NewFolder`]), or a file cannot be written.
pub fn write(out: &Path, rendering: Option<&Rendering>) -> Result<()> {
    let new = NewFolder::new(out)?;
    let out = new.path();
    let room = Room::new();
    let rendering_used = rendering.unwrap_or(&STORED);
    let images = out.join("images");
    match rendering {
        Some(rendering) => photographs::write(&images, &photographs::render(&room, rendering)?)?,
        None => photographs::write_stored(&images)?,
    }
    folder::write_mesh(out, &room.mesh)?;

    let world = room.lit(rendering_used.size)?;
    write_truth(out, "room", &world, rendering_used)?;
    let cameras = cameras::cameras(&room.views, rendering_used.size);
    folder::write_transforms(out, cameras.into_iter(), world.scene.up.as_dvec3())?;
    new.commit()
}

/// Writes truth.json and the true albedo of each frame.
fn write_truth(out: &Path, name: &str, world: &LitScene, rendering: &Rendering) -> Result<()> {
    let seen_by = |camera: &Camera| truth::albedo_picture(world, camera);
    let albedo: Vec<Picture> = world.scene.cameras.iter().map(seen_by).collect();
    let truth = truth::Truth {
        name: name.to_owned(),
        renderer: format!("relit {}", env!("CARGO_PKG_VERSION")),
        max_bounces: None,
        spp: rendering.samples,
        seed: rendering.seed,
        outside_light: None,
        objects: truth::objects(world),
    };
    folder::write_truth(out, &truth, &albedo)
}
