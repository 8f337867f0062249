//! What is written while a solve runs: nothing that results or a resume need is missing, nothing old stays.

use crate::common;
use glam::Vec3;
use relit::inverse::estimate::{Estimate, ObjectEstimate, TexelEstimate};
use relit::inverse::settings::Settings;
use relit::inverse::solver::{Checkpoint, Progress};
use relit::render::Renderer;
use relit::scene::texels::TexelLayout;
use relit::session::command::{OpenOptions, Source};
use relit::session::edits::Edits;
use relit::session::save::pictures::Frames;
use relit::session::save::{Results, load, load_checkpoint, write, write_checkpoint};
use relit::session::snapshot::OpenCapture;
use relit::transport::material::TexelColors;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Results in which every triangle has the same albedo, and all are kept in maps.
fn results(albedo: f32) -> Results {
    let capture = OpenCapture::new(Source::BuiltInRoom, OpenOptions::default(), common::room())
        .expect("the room is whole");
    let triangles = capture.scene.triangles.len();
    let objects = capture.scene.objects.len();
    let texels = TexelEstimate {
        colors: Arc::new(TexelColors {
            layout: TexelLayout::new(vec![0; triangles]),
            colors: vec![Vec3::splat(albedo); triangles],
        }),
        stderr: vec![Vec3::ONE; triangles],
        seen: vec![1; triangles],
        textured: vec![true; objects],
    };
    let estimate = Estimate {
        objects: vec![ObjectEstimate::default(); objects],
        texels: Some(Arc::new(texels)),
        common_error: 0.25,
        ..Estimate::default()
    };
    let progress = Arc::new(Progress::default());
    Results {
        capture: Arc::new(capture),
        settings: Settings::default(),
        estimate: Arc::new(estimate),
        edits: Edits::default(),
        checkpoint: Some(Checkpoint::new(&progress, &albedo)),
        progress,
        stopped_because: None,
        views: Frames::AtMost(0),
        renderer: Renderer::processor(),
        denoiser: None,
        started: Instant::now(),
        seconds_load: 0.0,
    }
}

/// The maps in a folder.
fn maps(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).expect("lists");
    let names = entries.map(|e| e.expect("an entry").file_name().into_string());
    names
        .map(|name| name.expect("plain names"))
        .filter(|name| name.starts_with("maps-"))
        .collect()
}

fn albedo(estimate: &Estimate) -> f32 {
    let texels = estimate.texels.as_ref().expect("they have maps");
    texels.colors.colors[0].x
}

#[test]
fn a_checkpoint_takes_the_place_of_the_one_before_and_leaves_finished_results_their_maps() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let capture = results(0.0).capture;

    // Checkpoints alone: one file of maps, the newest's.
    for value in [0.1, 0.2] {
        write_checkpoint(at, &results(value)).expect("writes");
        assert_eq!(maps(at).len(), 1, "{value}");
        let saved = load_checkpoint(at).expect("reads");
        let estimate = saved.estimate_for(&capture).expect("the same");
        assert_eq!((albedo(&estimate), estimate.common_error), (value, 0.25));
    }

    // Beside finished results: theirs too.
    write(at, &results(0.5)).expect("writes");
    let finished = maps(at);
    assert_eq!(finished.len(), 1);
    for value in [0.6, 0.7] {
        write_checkpoint(at, &results(value)).expect("writes");
        assert!(
            maps(at).is_superset(&finished) && maps(at).len() == 2,
            "{value}"
        );
        let (saved, running) = (
            load(at).expect("reads"),
            load_checkpoint(at).expect("reads"),
        );
        assert_eq!(
            albedo(&saved.estimate_for(&capture).expect("the same")),
            0.5
        );
        assert_eq!(
            albedo(&running.estimate_for(&capture).expect("the same")),
            value
        );
    }
}
