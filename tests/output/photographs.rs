//! Photographs in one go: relit by the ratio of two renders, with objects in them, ended midway.

use crate::common;
use glam::{DVec3, Vec3};
use relit::math::picture::Picture;
use relit::render::{Device, Renderer};
use relit::session::command::{OpenOptions, Placement, Source};
use relit::session::edits::{Edits, ObjectEdit};
use relit::session::insertion::Inserting;
use relit::session::light::Light;
use relit::session::photographs::Photographs;
use relit::session::snapshot::OpenCapture;
use relit::transport::denoise::Denoiser;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

fn work(edits: &Edits, placements: Vec<Placement>) -> Photographs {
    let capture = OpenCapture::new(Source::BuiltInRoom, OpenOptions::default(), common::room());
    let found = Arc::new(common::truth());
    Photographs {
        capture: Arc::new(capture.expect("the room can be solved")),
        edited: Arc::new(edits.apply(&found)),
        found,
        settings: relit::inverse::settings::Settings::default(),
        placements,
        relight: !edits.is_empty(),
        samples: 16,
        denoise: None,
        finish: true,
        frames: vec![0, 1],
        renderer: Renderer::processor(),
    }
}

/// The lamp at a fraction of its strength.
fn dimmed(fraction: f32) -> Edits {
    let lamp = common::OBJECTS.len() - 1;
    let full = Vec3::from_array(common::OBJECTS[lamp].2);
    let mut edits = Edits::default();
    let emission = Some(full * fraction);
    edits.set(
        lamp,
        ObjectEdit {
            emission,
            ..ObjectEdit::default()
        },
    );
    edits
}

fn block(folder: &Path) -> Placement {
    let file = folder.join("block.obj");
    let text = "v -0.2 0 -0.2\nv 0.2 0 -0.2\nv 0.2 0.4 0.2\nv -0.2 0.4 0.2\nf 1 2 3\nf 1 3 4\n";
    std::fs::write(&file, text).expect("written");
    Placement::new(file, Some(DVec3::new(0.0, 0.0, -0.4)))
}

fn read(path: &Path) -> Picture {
    let image = image::open(path).expect("an image").to_rgb32f();
    Picture {
        width: image.width(),
        height: image.height(),
        pixels: image.pixels().map(|p| Vec3::from_array(p.0)).collect(),
    }
}

#[test]
fn a_lamp_at_half_its_strength_halves_every_photograph_and_one_that_is_off_darkens_it() {
    let folder = tempfile::tempdir().expect("a folder");
    for (fraction, name) in [(0.5, "half"), (0.0, "off")] {
        let work = work(&dimmed(fraction), Vec::new());
        let prefix = |frame: usize| folder.path().join(format!("{name}{frame}"));
        let written = work.write(&prefix, &|_| true).expect("written");
        assert_eq!((written.photographs, written.files.len()), (2, 4));
        for frame in [0, 1] {
            let relit = read(&folder.path().join(format!("{name}{frame}.relit.exr")));
            let photograph = work.capture.full_photograph(frame).expect("in memory");
            for (relit, photograph) in relit.pixels.iter().zip(&photograph.pixels) {
                let off = (*relit - *photograph * fraction).abs().max_element();
                assert!(
                    off <= 1e-4 * photograph.max_element(),
                    "{relit} {photograph}"
                );
            }
        }
    }
}

#[test]
fn composites_are_made_on_the_relit_photographs() {
    let folder = tempfile::tempdir().expect("a folder");
    let work = work(&dimmed(0.25), vec![block(folder.path())]);
    let prefix = |frame: usize| folder.path().join(format!("{frame:03}"));
    let told = AtomicUsize::new(0);
    let written = work.write(&prefix, &|doing| {
        assert!((0.0..=1.0).contains(&doing.fraction));
        told.fetch_add(1, Ordering::Relaxed);
        true
    });
    assert_eq!(written.expect("written").photographs, 2);
    assert!(told.load(Ordering::Relaxed) > 10);
    let [relit, composite] =
        ["relit", "composite"].map(|kind| read(&folder.path().join(format!("001.{kind}.exr"))));
    let same = relit
        .pixels
        .iter()
        .zip(&composite.pixels)
        .filter(|(a, b)| a == b);
    let (same, all) = (same.count(), relit.pixels.len());
    assert!(same < all, "no object is seen");
    let mean = |p: &Picture| p.pixels.iter().map(|c| c.y).sum::<f32>() / all as f32;
    let photograph = work.capture.full_photograph(1).expect("in memory");
    let whole = photograph.pixels.iter().map(|c| c.y).sum::<f32>() / all as f32;
    let fraction = mean(&composite) / whole;
    assert!((0.15..0.3).contains(&fraction), "{fraction}");
}

#[test]
fn what_is_ended_midway_leaves_whole_photographs_and_nothing_of_the_next() {
    let folder = tempfile::tempdir().expect("a folder");
    let work = work(&dimmed(0.5), vec![block(folder.path())]);
    let prefix = |frame: usize| folder.path().join(format!("{frame:03}"));
    let written = work
        .write(&prefix, &|doing| doing.frame == 0)
        .expect("written");
    assert_eq!(written.photographs, 1);
    assert!(written.files.iter().all(|file| file.is_file()));
    let mut names = std::fs::read_dir(folder.path())
        .expect("a folder")
        .flatten();
    assert!(!names.any(|entry| entry.file_name().to_string_lossy().starts_with("001")));
}

#[test]
fn the_screen_shows_what_the_files_hold() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut edits = dimmed(0.25);
    let red = ObjectEdit {
        albedo: Some(Vec3::new(0.8, 0.1, 0.1)),
        ..ObjectEdit::default()
    };
    edits.set(0, red);
    let mut work = work(&edits, vec![block(folder.path())]);
    (work.samples, work.denoise, work.frames) = (256, Some(Denoiser::Builtin), vec![1]);
    let light = Light::new(work.found.clone(), work.edited.clone(), &work.settings);
    let shown = |placements: &[Placement]| {
        let mut inserting = Inserting::default();
        inserting.show(1, u32::MAX);
        inserting.place(placements.to_vec());
        while inserting.is_busy() {
            inserting
                .draw(&work.renderer, &work.capture, &light)
                .expect("drawn");
        }
        inserting.shown().expect("a composite")
    };
    let prefix = |_: usize| folder.path().join("file");
    assert_eq!(
        work.write(&prefix, &|_| true).expect("written").photographs,
        1
    );
    let file = |kind: &str| read(&folder.path().join(format!("file.{kind}.exr")));

    // Without objects the composite is the photograph in the changed light.
    let (relit, empty) = (file("relit"), shown(&[]));
    assert!(relit == *empty.composite && relit == *empty.naive);
    // With objects it is what the file holds but for their own noise, which is smoothed in files only.
    let (composite, full) = (file("composite"), shown(&work.placements));
    assert!(file("naive") == *full.naive && *full.naive != relit);
    let pixels = composite.pixels.iter().zip(&full.composite.pixels);
    let error = pixels.map(|(file, screen)| (*file - *screen).abs().max_element());
    let brightest = relit.pixels.iter().map(|p| p.max_element());
    let brightest = brightest.fold(0.0, f32::max);
    let mean = error.sum::<f32>() / composite.pixels.len() as f32;
    assert!(mean < 0.01 * brightest, "{mean} of {brightest}");
}

/// Differences are those of rounding, which can send a path elsewhere.
#[test]
fn a_graphics_card_shows_the_processors_composite() {
    let demanded = std::env::var_os("RELIT_REQUIRE_ADAPTER").is_some_and(|value| value == "1");
    let by_card = match Renderer::find(Device::Gpu) {
        Ok(renderer) => renderer,
        Err(error) => {
            assert!(!demanded, "{error}");
            println!("skipped: no graphics adapter");
            return;
        }
    };
    let folder = tempfile::tempdir().expect("a folder");
    let mut work = work(&dimmed(0.5), vec![block(folder.path())]);
    work.samples = 32;
    let light = Light::new(work.found.clone(), work.edited.clone(), &work.settings);
    let shown = |renderer: &Renderer| {
        let mut inserting = Inserting::default();
        inserting.show(1, u32::MAX);
        inserting.place(work.placements.clone());
        let samples = |inserting: &Inserting| inserting.shown().and_then(|shown| shown.samples);
        while samples(&inserting).is_none_or(|samples| samples < work.samples) {
            let drawn = inserting.draw(renderer, &work.capture, &light);
            drawn.expect("drawn");
            // The card gets objects that rest.
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        inserting.shown().expect("a composite").composite.clone()
    };
    let [a, b] = [&Renderer::processor(), &by_card].map(shown);
    assert_eq!(by_card.take_warnings(), Vec::<String>::new());
    assert_ne!(a.pixels, b.pixels, "the card did nothing");
    let pairs = a.pixels.iter().zip(&b.pixels);
    let alike = pairs.filter(|(a, b)| (**a - **b).abs().max_element() < 0.01);
    let alike = alike.count() as f64 / a.pixels.len() as f64;
    println!("{:.1} % of pixels alike", 100.0 * alike);
    assert!(alike > 0.95, "{alike}");
}
