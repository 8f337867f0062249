//! The built-in room, and the same with two chairs in it.

use crate::capture::mesh::Mesh;
use crate::compose::object::ObjectModel;
use crate::compose::placement::Placement;
use crate::error::Result;
use crate::room::Room;
use crate::room::photographs::{KEPT, Rendering, kept, render};
use crate::room::shape::Modeller;
use crate::study::experiments::chair::chair;
use crate::study::experiments::subject::Subject;
use crate::transport::lit::Lit;
use crate::transport::material::{Albedo, Material};
use glam::{DAffine3, DVec3, Vec3};
use std::path::PathBuf;
use std::sync::Arc;

/// The chairs: name, albedo, place on the floor, and turn in radians. They stand between the red wall and the rug.
const CHAIRS: [(&str, [f32; 3], [f64; 3], f64); 2] = [
    (
        "white chair",
        [0.75, 0.74, 0.70],
        [-1.95, 0.001, -0.25],
        1.2,
    ),
    ("blue chair", [0.10, 0.22, 0.55], [-1.75, 0.001, 0.62], 2.0),
];
/// How the room without textures is photographed; the one with them has photographs in the program.
const PLAIN: Rendering = Rendering {
    samples: 64,
    ..KEPT
};
const QUICK: Rendering = Rendering {
    seed: 7,
    samples: 32,
    size: [40, 30],
};

/// A room with and without objects.
pub struct Furnished {
    /// In words.
    pub name: &'static str,
    /// The room without them, photographed.
    pub subject: Subject,
    /// Its true light.
    pub lit: Lit,
    /// The room with them in its mesh.
    pub furnished: Lit,
    /// The objects, in the room's coordinates.
    pub models: Vec<Arc<ObjectModel>>,
    /// Where they stand: as modelled.
    pub placement: Placement,
}

/// The built-in room with two chairs, with its textures or with their mean colours.
///
/// # Errors
/// The program file is damaged.
pub fn built_in(textured: bool, quick: bool) -> Result<Furnished> {
    let mut room = Room::new();
    if !textured {
        room.materials.iter_mut().for_each(flatten);
    }
    let photographs = match (quick, textured) {
        (true, _) => render(&room, &QUICK)?,
        (false, true) => kept()?,
        (false, false) => render(&room, &PLAIN)?,
    };
    let subject = Subject::of_photographs(&room, photographs)?;
    let size = if quick { QUICK.size } else { KEPT.size };
    let lit = room.lit(size)?;
    let chairs = chairs();
    let material = |color: [f32; 3]| Material::diffuse(color.into(), Vec3::ZERO);
    let models = (CHAIRS.iter().enumerate())
        .map(|(index, (name, color, ..))| {
            let corners = corners_of(&chairs, index as u32);
            ObjectModel::from_corners(name, corners, material(*color)).map(Arc::new)
        })
        .collect::<Result<_>>()?;
    let colors = CHAIRS.iter().map(|(_, color, ..)| material(*color));
    room.materials.extend(colors);
    append(&mut room.mesh, chairs);
    Ok(Furnished {
        name: if textured { "textured" } else { "plain" },
        subject,
        lit,
        furnished: room.lit(size)?,
        models,
        placement: Placement {
            file: PathBuf::from("chairs"),
            at: None,
            scale: 1.0,
            rotate: 0.0,
            hidden: false,
        },
    })
}

/// One colour in the place of a texture: its mean.
fn flatten(material: &mut Material) {
    if let Albedo::Image(texture, tint) = &material.albedo {
        let sum: Vec3 = texture.pixels.iter().sum();
        let mean = sum / texture.pixels.len().max(1) as f32 * *tint;
        material.albedo = Albedo::Constant(mean);
    }
}

fn chairs() -> Mesh {
    let mut modeller = Modeller::default();
    for (name, _, place, turn) in CHAIRS {
        modeller.object(name);
        let stand = DAffine3::from_translation(DVec3::from(place));
        modeller.placed(stand * DAffine3::from_rotation_y(turn), chair);
    }
    modeller.mesh
}

fn corners_of(mesh: &Mesh, object: u32) -> Vec<[DVec3; 3]> {
    let triangles = mesh.triangles.iter().zip(&mesh.object_of);
    triangles
        .filter(|(_, of)| **of == object)
        .map(|(corners, _)| corners.map(|i| mesh.positions[i as usize]))
        .collect()
}

/// Adds the objects of a mesh after those of another.
fn append(mesh: &mut Mesh, other: Mesh) {
    let (corners, objects) = (mesh.positions.len() as u32, mesh.objects.len() as u32);
    mesh.positions.extend(other.positions);
    mesh.objects.extend(other.objects);
    let triangles = other.triangles.into_iter();
    mesh.triangles
        .extend(triangles.map(|t| t.map(|i| i + corners)));
    let object_of = other.object_of.into_iter();
    mesh.object_of.extend(object_of.map(|k| k + objects));
    mesh.corner_uvs.extend(other.corner_uvs);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chairs_stand_free_in_the_room_and_are_seen() {
        let room = built_in(false, true).expect("a room");
        let scene = &room.furnished.scene;
        assert_eq!(scene.objects.len(), room.lit.scene.objects.len() + 2);
        assert_eq!(scene.origin, room.lit.scene.origin);
        let first = room.lit.scene.objects.len() as u32;
        let seen = crate::room::truth::seen_pixels(&room.furnished);
        assert!(seen[first as usize..].iter().all(|&n| n > 20), "{seen:?}");
        // Each edge of a chair's triangles meets nothing but its own chair.
        for (triangle, &object) in scene.object_of.iter().enumerate() {
            if object < first {
                continue;
            }
            let corners = scene.corners(triangle as u32);
            for i in 0..3 {
                let (from, to) = (corners[i], corners[(i + 1) % 3]);
                let direction = to - from;
                let ray = crate::scene::geometry::Ray {
                    t_max: direction.length(),
                    ..crate::scene::geometry::Ray::new(from, direction.normalize_or_zero())
                };
                let hit = room.lit.scene.intersect(&ray);
                assert!(hit.is_none(), "{object} {hit:?}");
            }
        }
    }
}
