//! Mistakes that all photographs of a capture share are found before anything is solved, and sound captures are not refused.
//! `relit study readings` measures the same over many rooms.

use crate::beside;
use relit::calibrate::alignment::{Decision, Evidence, MispairedPhotograph};
use relit::capture::Capture;
use relit::capture::read::{ReadOptions, read};
use relit::inverse::estimate::{Estimate, ObjectEstimate};
use relit::room;
use relit::room::generated::generate;
use relit::session::command::{OpenOptions, Source};
use relit::session::snapshot::OpenCapture;
use relit::study::experiments::readings::{decide, mistakes};

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
        "all photographs the same",
        "poses with OpenCV's axes",
        "mesh with z up, poses with y up",
    ] {
        let all = mistakes();
        let mistake = all.iter().find(|m| m.name == name).expect("a mistake");
        let outcome = decide(&capture, Some(mistake)).expect("a capture");
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
        let outcome = decide(&capture, None).expect("a capture");
        assert_eq!(
            outcome.alignment.decision,
            Decision::Sound,
            "{}",
            capture.name
        );
        assert!(outcome.alignment.agreement > 5.0, "{}", capture.name);
        assert_eq!(outcome.alignment.mispaired, [], "{}", capture.name);
    }
}

/// A box looks much alike from all sides; its edges fit a wrong reading somewhat.
#[test]
fn mistakes_in_a_box_with_five_photographs_are_found() {
    let Some(folder) = beside::beside("captures/cornell") else {
        return;
    };
    let capture = read(&folder, &ReadOptions::default()).expect("a capture");
    let sound = decide(&capture, None).expect("a capture");
    assert_eq!(sound.alignment.decision, Decision::Sound);
    assert_eq!(sound.alignment.mispaired, []);
    for name in ["mesh with z up, poses with y up", "photographs mirrored"] {
        let all = mistakes();
        let mistake = all.iter().find(|m| m.name == name).expect("a mistake");
        let outcome = decide(&capture, Some(mistake)).expect("a capture");
        assert!(outcome.right_remedy, "{name}: {outcome:?}");
    }
    // One of the five has the pose of another one, and its own is lost.
    for (frame, other) in [(0, 1), (1, 3), (2, 0), (3, 4), (4, 0)] {
        let wrong = with_pose_of(&capture, frame, other);
        let outcome = decide(&wrong, None).expect("a capture");
        let evidence = Evidence::SharesPoseWith(other);
        assert_eq!(
            outcome.alignment.mispaired,
            [MispairedPhotograph { frame, evidence }]
        );
    }
}

/// A capture as a solve opens it.
fn open(capture: &Capture, check_alignment: bool) -> OpenCapture {
    let options = OpenOptions {
        check_alignment,
        ..OpenOptions::default()
    };
    OpenCapture::new(Source::BuiltInRoom, options, capture.clone()).expect("opens")
}

fn with_pose_of(capture: &Capture, frame: usize, other: usize) -> Capture {
    let mut wrong = capture.clone();
    wrong.frames[frame].pose = wrong.frames[other].pose;
    wrong
}

#[test]
fn a_photograph_with_the_pose_of_another_one_is_left_out_and_named() {
    let sound = room::capture().expect("the room");
    let mut exchanged = sound.clone();
    (exchanged.frames[2].pose, exchanged.frames[9].pose) =
        (sound.frames[9].pose, sound.frames[2].pose);
    let mispaired = decide(&exchanged, None)
        .expect("a capture")
        .alignment
        .mispaired;
    let shows = |frame, other| MispairedPhotograph {
        frame,
        evidence: Evidence::ShowsViewOf(other),
    };
    assert_eq!(mispaired, [shows(2, 9), shows(9, 2)]);

    let opened = open(&with_pose_of(&sound, 3, 7), true);
    let used = |frame: usize| {
        let photograph = &opened.photographs[frame];
        (0..photograph.pixels.len()).any(|pixel| photograph.is_usable(pixel))
    };
    assert_eq!(
        (0..16).filter(|&frame| !used(frame)).collect::<Vec<_>>(),
        [3]
    );
    let warned = |opened: &OpenCapture, words: &str| {
        let named = opened
            .warnings
            .iter()
            .filter(|w| w.starts_with("frame 003 "));
        named.filter(|w| w.contains(words)).count()
    };
    assert_eq!(
        warned(&opened, "it is left out"),
        1,
        "{:?}",
        opened.warnings
    );

    // Of three photographs none is left out, although one is wrong.
    let mut few = with_pose_of(&sound, 3, 7);
    few.frames = [3, 7, 5].map(|frame| few.frames[frame].clone()).to_vec();
    let opened = open(&few, true);
    let said: Vec<_> = opened
        .warnings
        .iter()
        .filter(|w| w.contains("frame 000"))
        .collect();
    assert!(
        said.len() == 1 && said[0].contains("check its pose"),
        "{:?}",
        opened.warnings
    );
    assert!((0..3).all(|frame| opened.photographs[frame].is_usable(1000)));
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
    let outcome = decide(&capture, None).expect("a capture");
    assert_eq!(
        outcome.alignment.decision,
        Decision::Doubtful,
        "{outcome:?}"
    );

    // What is solved for is as uncertain as a guess.
    let exact = Estimate {
        objects: vec![ObjectEstimate::default()],
        ..Estimate::default()
    };
    let held = |capture: &OpenCapture| capture.marked_doubtful(exact.clone()).objects.remove(0);
    let doubted = held(&open(&capture, true));
    assert!(!doubted.identifiable && doubted.albedo_stderr.min_element() > 0.25);
    assert!(doubted.note.contains("poses"), "{}", doubted.note);
    let trusted = held(&open(&capture, false));
    assert_eq!(trusted, ObjectEstimate::default());
    let sound = room::capture().expect("the room");
    assert_eq!(held(&open(&sound, true)), ObjectEstimate::default());
}
