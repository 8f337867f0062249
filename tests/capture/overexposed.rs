//! Lamps that photographs show saturated, and the pixels at their edges.

use glam::{BVec3, Vec3};
use relit::calibrate::censored::bounded;
use relit::calibrate::gbuffer::GBuffer;
use relit::calibrate::held_out::HoldOut;
use relit::calibrate::problem::Problem;
use relit::capture::photograph::Photograph;
use relit::inverse::settings::Settings;
use relit::room::Room;
use relit::room::photographs::Rendering;
use std::sync::Arc;

#[test]
fn the_edges_of_a_saturated_lamp_are_bounds_and_a_wall_stays_measured() {
    let room = Room::new();
    let rendering = Rendering {
        seed: 3,
        samples: 1,
        size: [64, 48],
    };
    let lit = room.lit(rendering.size).expect("a room");
    // White is what lamps and their edges show, grey all else; white saturates, in red and green alone.
    let photographs = relit::room::photographs::render(&room, &rendering).expect("photographs");
    let photographs: Vec<Photograph> = (photographs.into_iter())
        .map(|photograph| Photograph {
            saturation: Vec3::new(1.0, 1.0, 9.0),
            ..photograph
        })
        .collect();
    let problem = |photographs: &[Photograph]| Problem {
        scene: lit.scene.clone(),
        photographs: photographs.iter().cloned().map(Arc::new).collect(),
    };
    let unsaturated: Vec<Photograph> = (photographs.iter())
        .map(|photograph| Photograph {
            saturation: Vec3::INFINITY,
            ..photograph.clone()
        })
        .collect();
    let plain = problem(&unsaturated);
    let settings = Settings::default();
    let gbuffer = GBuffer::new(&plain, HoldOut::from(&settings), settings.seed, usize::MAX);
    assert!(bounded(&plain, &gbuffer).is_none());
    // Pixels of lamps are at 2 inside, 0.4 at the edge; of all else at 0.3.
    let emits = |object: u32| {
        let material = lit.materials.get(object as usize);
        material.is_some_and(|m| m.emission != Vec3::ZERO)
    };
    let mut painted = photographs;
    for pixel in &gbuffer.pixels {
        let value = match (emits(pixel.object), pixel.pure) {
            (true, true) => 1.0,
            (true, false) => 0.4,
            _ => 0.3,
        };
        painted[pixel.frame as usize].pixels[pixel.pixel as usize] = Vec3::splat(value);
    }
    let given = problem(&painted);
    let bounded = bounded(&given, &gbuffer).expect("lamps are saturated");
    let mut edges = 0;
    for pixel in &gbuffer.pixels {
        let photograph = &bounded.photographs[pixel.frame as usize];
        let bound = photograph.saturated(pixel.pixel as usize);
        let wanted = BVec3::new(emits(pixel.object), emits(pixel.object), false);
        assert_eq!(bound, wanted, "{pixel:?}");
        edges += u32::from(wanted.any() && !pixel.pure);
    }
    assert!(edges > 30, "{edges}");
}
