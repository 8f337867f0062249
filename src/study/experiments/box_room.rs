//! A box-shaped room with a block and one lamp, of chosen mean albedo and lamp size.

use crate::error::Result;
use crate::inverse::unknowns::Unknowns;
use crate::room::Room;
use crate::room::cameras::View;
use crate::room::photographs::Rendering;
use crate::room::shape::Modeller;
use crate::scene::geometry::Hit;
use crate::study::subject::Subject;
use crate::transport::material::{Lobe, Material};
use glam::{DVec3, Vec3};

/// Mean albedo of [`standard`].
pub const ALBEDO: f64 = 0.5;
/// Half side of the lamp of [`standard`] in metres.
pub const LAMP: f64 = 0.25;
/// Random seed of the photographs; differs from those of solvers.
pub const PHOTOGRAPH_SEED: u64 = 0x626f_7865_7300;
/// Radiance times squared half side of the lamp, so that all lamps emit the same power.
const LAMP_POWER: f64 = 0.2;
const LAMP_TINT: Vec3 = Vec3::new(1.0, 0.9, 0.75);
/// Deviations of the seven reflectors' albedos from the mean, relative to the largest; their sum is zero.
const DEVIATIONS: [f64; 7] = [-1.0, 0.6, -0.3, 0.0, 0.3, -0.6, 1.0];
/// Eye and target of each photograph; together they see every object.
const VIEWS: [[[f64; 3]; 2]; 6] = [
    [[0.7, 1.1, 0.8], [-0.4, 0.7, -0.8]],
    [[-0.7, 1.2, 0.8], [0.5, 1.0, -0.8]],
    [[0.8, 1.0, -0.8], [-0.3, 1.2, 0.9]],
    [[-0.8, 0.9, 0.5], [0.9, 0.5, 0.3]],
    [[0.6, 0.4, 0.6], [-0.1, 1.9, -0.2]],
    [[0.85, 1.5, 0.0], [-0.9, 0.4, 0.0]],
];

/// The rough object of [`board_room`].
const BOARD: &str = "board";
/// Eye and target of the photographs in which it reflects the lamp.
const BOARD_VIEWS: [[[f64; 3]; 2]; 2] = [
    [[0.8, 1.5, -0.8], [0.1, 1.0, -0.1]],
    [[-0.7, 1.7, 0.5], [0.2, 1.0, -0.2]],
];

/// The box room of the studies of one room.
pub fn standard() -> Room {
    box_room("box room", ALBEDO, LAMP)
}

/// A box of 2 m with six coloured sides, a block, and a black square lamp of half side `lamp` below the ceiling. The
/// mean albedo of the seven reflectors is `albedo` in each channel.
pub fn box_room(name: &str, albedo: f64, lamp: f64) -> Room {
    let block = |modeller: &mut Modeller| {
        let half = DVec3::new(0.25, 0.3, 0.2);
        modeller.rounded_box(DVec3::new(-0.35, 0.31, -0.3), half, 0.0, 0);
    };
    furnished(name, albedo, lamp, "block", block)
}

/// The same with another object instead of the block.
pub fn furnished(
    name: &str,
    albedo: f64,
    lamp: f64,
    object: &str,
    shapes: impl FnOnce(&mut Modeller),
) -> Room {
    let mut modeller = Modeller::default();
    let mut materials = Vec::new();
    let reach = 0.6 * albedo.min(0.98 - albedo);
    let color = |index: usize| {
        let channel = |c: usize| albedo + reach * DEVIATIONS[(index + 2 * c) % DEVIATIONS.len()];
        Vec3::from_array([0, 1, 2].map(|c| channel(c) as f32))
    };

    // Six sides that face inwards.
    let (low, high) = (DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 2.0, 1.0));
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * 2.0);
    let sides = [
        ("floor", [low, z, x]),
        ("ceiling", [high, -x, -z]),
        ("back", [low, x, y]),
        ("right", [high, -z, -y]),
        ("left", [low, y, z]),
        ("front", [high, -y, -x]),
    ];
    for (name, [corner, u, v]) in sides {
        modeller.object(name);
        modeller.grid(corner, u, v, 1, 1);
        materials.push(Material::diffuse(color(materials.len()), Vec3::ZERO));
    }

    modeller.object(object);
    shapes(&mut modeller);
    materials.push(Material::diffuse(color(materials.len()), Vec3::ZERO));
    modeller.object("lamp");
    let corner = DVec3::new(0.1 - lamp, 1.9, -0.1 - lamp);
    modeller.grid(corner, DVec3::X * 2.0 * lamp, DVec3::Z * 2.0 * lamp, 1, 1);
    let emission = LAMP_TINT * (LAMP_POWER / (lamp * lamp)) as f32;
    materials.push(Material::diffuse(Vec3::ZERO, emission));
    Room {
        name: name.to_owned(),
        mesh: modeller.mesh,
        materials,
        views: View::all(&VIEWS),
    }
}

/// The same with a rough board below the lamp instead of the block, and two more photographs of it.
pub fn board_room(name: &str, albedo: f64, lamp: f64, lobe: Lobe) -> Room {
    let board = |modeller: &mut Modeller| {
        let (middle, half) = (DVec3::new(0.1, 0.95, -0.1), DVec3::new(0.5, 0.05, 0.5));
        modeller.rounded_box(middle, half, 0.0, 0);
    };
    let mut room = furnished(name, albedo, lamp, BOARD, board);
    let objects = room.mesh.objects.iter().zip(&mut room.materials);
    for (_, material) in objects.filter(|(object, _)| *object == BOARD) {
        material.lobe = Some(lobe);
    }
    room.views.extend(View::all(&BOARD_VIEWS));
    room
}

/// A room's true values, for materials of constant albedo.
pub fn truth(room: &Room) -> Unknowns {
    let anywhere = Hit::default();
    let materials = || room.materials.iter();
    Unknowns {
        albedo: materials().map(|m| m.albedo_at(&anywhere)).collect(),
        emission: materials().map(|m| m.emission).collect(),
    }
}

/// The [`standard`] room with photographs of all bounces, rendered as by [`rendering`].
pub fn photographed(quick: bool) -> Result<Subject> {
    Subject::of_room(&standard(), &rendering(quick))
}

/// Settings of these rooms' photographs; smaller and noisier if `quick`.
pub fn rendering(quick: bool) -> Rendering {
    match quick {
        true => Rendering::new(PHOTOGRAPH_SEED, 32, [32, 24]),
        false => Rendering::new(PHOTOGRAPH_SEED, 128, [64, 48]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_albedo_is_what_was_asked_for_and_every_view_looks_at_fronts() {
        for albedo in [0.3, 0.95] {
            let room = box_room("room", albedo, 0.25);
            let world = room.lit([16, 12]).expect("a scene");
            let sum: Vec3 = truth(&room).albedo[..DEVIATIONS.len()].iter().sum();
            let mean = sum / DEVIATIONS.len() as f32;
            assert!((mean - albedo as f32).abs().max_element() < 1e-5, "{mean}");
            let seen = crate::room::truth::seen_pixels(&world);
            let pixels = 16 * 12 * VIEWS.len() as u64;
            assert_eq!(seen.iter().sum::<u64>(), pixels);
            assert!(seen.iter().all(|&n| n > 0), "{seen:?}");
            for camera in &world.scene.cameras {
                for pixel in 0..16 * 12 {
                    let at = glam::Vec2::new((pixel % 16) as f32, (pixel / 16) as f32) + 0.5;
                    let ray = camera.ray(at);
                    let hit = world.scene.intersect(&ray).expect("closed");
                    let normal = world.scene.normals[hit.triangle as usize];
                    assert!(normal.dot(ray.direction) <= 0.0);
                }
            }
        }
    }
}
