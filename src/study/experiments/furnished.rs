//! A room with and without two chairs: the built-in room, or the twin of a capture.

use crate::capture::photograph::Photograph;
use crate::compose::object::ObjectModel;
use crate::error::{Error, Result};
use crate::room::Room;
use crate::room::photographs::{Rendering, STORED, render, stored};
use crate::room::shape::Modeller;
use crate::scene::visibility::NOTHING;
use crate::study::experiments::chair::{chair, chair_model};
use crate::study::experiments::standing::{Cylinder, places, up, upright};
use crate::study::experiments::twin::Studied;
use crate::study::subject::Subject;
use crate::transport::lit::LitScene;
use crate::transport::material::{Albedo, Material};
use glam::{DAffine3, DVec3, Vec3};
use std::cmp::Reverse;
use std::sync::Arc;

/// The chairs between the red wall and the rug: name, albedo, position, and rotation in radians.
const CHAIRS: [(&str, [f32; 3], [f64; 3], f64); 2] = [
    (
        "white chair",
        [0.75, 0.74, 0.70],
        [-1.95, 0.001, -0.25],
        1.2,
    ),
    ("blue chair", [0.10, 0.22, 0.55], [-1.75, 0.001, 0.62], 2.0),
];
/// The photographs of the built-in room that see both.
const FRAMES: [usize; 2] = [5, 14];
/// Height of a chair as modelled, in metres.
const HEIGHT: f64 = 0.85;
/// Radius of a cylinder around it, in metres.
const RADIUS: f64 = 0.31;
/// Heights tried for the chairs in a twin, relative to the scene's; the largest with places for both is used.
const FRACTIONS: [f64; 5] = [0.32, 0.24, 0.16, 0.08, 0.04];
/// Largest fraction of a photograph that the chairs may cover.
const MAX_COVERED: f64 = 0.4;
/// Gap between floor and chair, relative to its height, for floors that are not quite flat.
const LIFT: f64 = 2e-3;
/// Photographs of the room without textures; those of the textured one are stored in the program.
const PLAIN: Rendering = Rendering::new(STORED.seed, 64, [320, 240]);
const QUICK: Rendering = Rendering::new(7, 32, [40, 30]);

/// A room with and without objects.
pub struct Furnished {
    pub name: String,
    /// Sentence on the room and the positions of the chairs.
    pub how: String,
    /// The room without the chairs, with photographs.
    pub subject: Subject,
    pub lit: LitScene,
    /// The room with the chairs in its mesh.
    pub furnished: LitScene,
    /// The chairs in the room's coordinates.
    pub models: Vec<Arc<ObjectModel>>,
    /// The frames that they are inserted into.
    pub frames: Vec<usize>,
}

/// The built-in room with two chairs; its textures are replaced by their means unless `textured`.
pub fn built_in(textured: bool, quick: bool) -> Result<Furnished> {
    let mut room = Room::new();
    if !textured {
        room.materials.iter_mut().for_each(flatten);
    }
    let photographs = match (quick, textured) {
        (true, _) => render(&room, &QUICK)?,
        (false, true) => stored()?,
        (false, false) => render(&room, &PLAIN)?,
    };
    let stands = CHAIRS.map(|(_, _, place, turn)| {
        DAffine3::from_translation(DVec3::from(place)) * DAffine3::from_rotation_y(turn)
    });
    let name = if textured { "textured" } else { "plain" };
    let how = format!(
        "The {}, {name}, with two chairs of known colour beside its red wall.",
        room.name
    );
    Ok(Furnished {
        name: name.to_owned(),
        how,
        frames: FRAMES.to_vec(),
        ..furnish(room, photographs, stands)?
    })
}

/// The twin of a capture with two chairs on its floor, as large as they fit, and the photographs that see most of them.
///
/// # Errors
/// There is no free place for the chairs.
pub fn of_twin(twin: Studied) -> Result<Furnished> {
    let scene = twin.room.lit(twin.rendering.size)?.scene;
    let up = up(&scene);
    let levels = || scene.positions.iter().map(|p| p.dot(up));
    let tall = f64::from(levels().fold(f32::MIN, f32::max) - levels().fold(f32::MAX, f32::min));
    let found = FRACTIONS.iter().find_map(|fraction| {
        let height = fraction * tall;
        let cylinder = Cylinder {
            radius: (height * RADIUS / HEIGHT) as f32,
            height: height as f32,
        };
        let [a, b] = places(&scene, up, cylinder, CHAIRS.len())[..] else {
            return None;
        };
        Some(([a, b], height))
    });
    let (places, height) = found.ok_or_else(|| {
        Error::new(
            &twin.room.name,
            "it has no free, visible and level floor for two chairs",
            "run the study on rooms of its own",
        )
    })?;
    let upwards = up.as_dvec3().normalize_or(DVec3::Y);
    let stand = |index: usize| {
        let at = places[index].as_dvec3() + scene.origin + upwards * (LIFT * height);
        DAffine3::from_translation(at)
            * upright(up)
            * DAffine3::from_rotation_y(CHAIRS[index].3)
            * DAffine3::from_scale(DVec3::splat(height / HEIGHT))
    };
    let photographs = render(&twin.room, &twin.rendering)?;
    let mut furnished = furnish(twin.room, photographs, [stand(0), stand(1)])?;
    furnished.frames = most_seen(&furnished);
    if furnished.frames.is_empty() {
        return Err(Error::new(
            &furnished.name,
            "no photograph shows both chairs from far enough away",
            "run the study on rooms of its own",
        ));
    }
    furnished.how = format!(
        "{}. Two chairs of known colour, {height:.2} high, stand where its ground is level, free and seen.",
        twin.words
    );
    Ok(furnished)
}

/// The (at most two) photographs that see most of the chairs, without those that they nearly fill.
fn most_seen(furnished: &Furnished) -> Vec<usize> {
    let scene = &furnished.furnished.scene;
    let first = scene.objects.len() - CHAIRS.len();
    let seen = |frame: &Vec<u32>| {
        let triangles = frame.iter().filter(|&&triangle| triangle != NOTHING);
        let of_chairs = triangles.filter(|&&t| scene.object_of[t as usize] as usize >= first);
        of_chairs.count()
    };
    let mut frames: Vec<(usize, usize)> = (scene.ids().triangles.iter().map(seen))
        .enumerate()
        .collect();
    let pixels = scene.ids().triangles.first().map_or(0, Vec::len) as f64;
    frames.retain(|(_, count)| *count > 0 && *count as f64 <= MAX_COVERED * pixels);
    frames.sort_by_key(|&(frame, count)| (Reverse(count), frame));
    let best = frames.into_iter().take(FRAMES.len());
    best.map(|(frame, _)| frame).collect()
}

/// Adds the chairs, as modelled, to a photographed room.
fn furnish(
    mut room: Room,
    photographs: Vec<Photograph>,
    stands: [DAffine3; 2],
) -> Result<Furnished> {
    let size = photographs.first().map_or([0; 2], |p| [p.width, p.height]);
    let subject = Subject::of_photographs(&room, photographs)?;
    let lit = room.lit(size)?;
    let is_textured = !room.mesh.corner_uvs.is_empty();
    let mut modeller = Modeller {
        mesh: room.mesh,
        ..Modeller::default()
    };
    let mut models = Vec::new();
    for ((name, color, ..), stand) in CHAIRS.into_iter().zip(stands) {
        let color = Vec3::from(color);
        modeller.object(name);
        modeller.placed(stand, chair);
        room.materials.push(Material::diffuse(color, Vec3::ZERO));
        models.push(chair_model(name, stand, color)?);
    }
    room.mesh = modeller.mesh;
    if !is_textured {
        room.mesh.corner_uvs.clear();
    }
    Ok(Furnished {
        name: room.name.clone(),
        how: String::new(),
        frames: Vec::new(),
        subject,
        lit,
        furnished: room.lit(size)?,
        models,
    })
}

/// Replaces a texture by its mean.
fn flatten(material: &mut Material) {
    if let Albedo::Image(texture, tint) = &material.albedo {
        let sum: Vec3 = texture.pixels.iter().sum();
        let mean = sum / texture.pixels.len().max(1) as f32 * *tint;
        material.albedo = Albedo::Constant(mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::Ray;

    #[test]
    fn chairs_stand_free_in_the_room_and_are_seen() {
        let room = built_in(false, true).expect("a room");
        let scene = &room.furnished.scene;
        assert_eq!(scene.objects.len(), room.lit.scene.objects.len() + 2);
        assert_eq!(scene.origin, room.lit.scene.origin);
        let first = room.lit.scene.objects.len() as u32;
        let seen = crate::room::truth::seen_pixels(&room.furnished);
        assert!(seen[first as usize..].iter().all(|&n| n > 20), "{seen:?}");
        // No edge of a chair's triangles meets anything but the chair itself.
        for (triangle, &object) in scene.object_of.iter().enumerate() {
            if object < first {
                continue;
            }
            let corners = scene.corners(triangle as u32);
            for i in 0..3 {
                let hit =
                    (room.lit.scene).intersect(&Ray::between(corners[i], corners[(i + 1) % 3]));
                assert!(hit.is_none(), "{object} {hit:?}");
            }
        }
    }
}
