//! Mistakes that all photographs of a capture share are found before anything is solved, and sound captures are not refused.
//! `relit study readings` measures the same over many rooms.

use relit::calibrate::alignment::Verdict;
use relit::room;
use relit::room::generated::generate;
use relit::study::experiments::readings::{judge, mistakes};

#[test]
fn mistakes_in_the_built_in_room_are_found_with_their_remedies() {
    let capture = room::capture().expect("the room");
    for name in [
        "mesh 5 % too large",
        "mesh in centimetres",
        "focal length × 1.2",
        "photographs upside down",
        "photographs mirrored",
        "photographs shifted by one",
        "poses with OpenCV's axes",
        "mesh with z up, poses with y up",
    ] {
        let all = mistakes();
        let mistake = all.iter().find(|m| m.name == name).expect("a mistake");
        let outcome = judge(&capture, Some(mistake)).expect("a capture");
        assert!(outcome.right_remedy, "{name}: {outcome:?}");
    }
}

#[test]
fn sound_rooms_are_taken_for_sound() {
    let mut rooms = vec![room::capture().expect("the room")];
    for seed in 1..=6 {
        let (room, rendering) = generate(seed, [96, 72]);
        rooms.push(room.photographed(&rendering).expect("a room"));
    }
    for capture in rooms {
        let outcome = judge(&capture, None).expect("a capture");
        assert_eq!(
            outcome.alignment.verdict,
            Verdict::Sound,
            "{}",
            capture.name
        );
        assert!(outcome.alignment.agreement > 5.0, "{}", capture.name);
    }
}

/// Where nothing of the room is in the photographs, that is said: they are noise.
#[test]
fn photographs_of_nothing_agree_with_nothing() {
    use relit::capture::photograph::{Photograph, PhotographSource};
    use relit::math::rng::Stream;
    use std::sync::Arc;
    let mut capture = room::capture().expect("the room");
    for (index, frame) in capture.frames.iter_mut().enumerate() {
        let shown = frame.load().expect("a photograph");
        let mut stream = Stream::new(82, index as u64, 0, 0);
        let pixels = shown
            .pixels
            .iter()
            .map(|_| glam::Vec3::splat(stream.uniform()));
        frame.photograph = PhotographSource::Memory(Arc::new(Photograph {
            pixels: pixels.collect(),
            ..(*shown).clone()
        }));
    }
    let outcome = judge(&capture, None).expect("a capture");
    assert_eq!(outcome.alignment.verdict, Verdict::Doubtful, "{outcome:?}");
}
