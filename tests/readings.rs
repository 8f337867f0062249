//! Mistakes that all photographs of a capture share are found before anything is solved, and sound captures are not refused.

use relit::capture::Capture;
use relit::room;
use relit::room::generated::generate;
use relit::study::experiments::readings::{judge, mistakes};

/// Judges all mistakes on a capture; the names of those that were not found with their remedy.
fn missed(capture: &Capture) -> Vec<String> {
    let sound = judge(capture, None).expect("a capture");
    println!("{}: sound: {:?}", capture.name, sound.alignment);
    let mut missed = Vec::new();
    if sound.detected {
        missed.push("sound, and refused".to_owned());
    }
    for mistake in mistakes() {
        let outcome = judge(capture, Some(&mistake)).expect("a capture");
        println!(
            "{}: {}: {} {} {:?}",
            capture.name, mistake.name, outcome.detected, outcome.right_remedy, outcome.alignment
        );
        if !outcome.right_remedy {
            missed.push(mistake.name.to_owned());
        }
    }
    missed
}

#[test]
fn every_mistake_is_found_in_the_built_in_room() {
    let capture = room::capture().expect("the room");
    assert_eq!(missed(&capture), Vec::<String>::new());
}

#[test]
fn nearly_every_mistake_is_found_in_generated_rooms() {
    for seed in 1..=5 {
        let (room, rendering) = generate(seed, [96, 72]);
        let capture = room.photographed(&rendering).expect("a room");
        println!("{:?}", missed(&capture));
    }
}
