//! Copying pictures, writing photographs in one go, light probes by click, and the handles of inserted objects.

use crate::connection::{Recorder, solving};
use crate::input::{block, click, insert, press, retype};
use egui::{Key, Modifiers, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::window::Window;
use relit::session::command::{Command, ExportFormat};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Runs a command of the palette.
fn palette(harness: &mut Harness<'_, Window>, name: &str) {
    press(harness, Modifiers::COMMAND, Key::P);
    harness.get_by_label("Command").type_text(name);
    harness.run_steps(2);
    press(harness, Modifiers::NONE, Key::Enter);
}

/// A point of a picture, in fractions of its size, on the screen.
fn point(harness: &Harness<'_, Window>, label: &str, at: egui::Vec2) -> Pos2 {
    let pane = harness.get_by_label(label).rect();
    let placement = harness.state().app.view.look.placement(pane, [64, 48]);
    placement.min + placement.size() * at
}

fn tap(harness: &mut Harness<'_, Window>, at: Pos2) {
    harness.hover_at(at);
    harness.run_steps(1);
    harness.drag_at(at);
    harness.run_steps(1);
    harness.drop_at(at);
    harness.run_steps(3);
}

fn drag(harness: &mut Harness<'_, Window>, from: Pos2, to: Pos2) {
    harness.hover_at(from);
    harness.run_steps(1);
    harness.drag_at(from);
    harness.run_steps(1);
    for step in 1..=4 {
        harness.hover_at(from.lerp(to, step as f32 / 4.0));
        harness.run_steps(1);
    }
    harness.drop_at(to);
    harness.run_steps(3);
}

/// Inserts a block of half a metre in the middle of the floor, and waits for its shape.
pub fn insert_block(harness: &mut Harness<'_, Window>, folder: &Path) {
    insert(harness, &block(folder));
    let at = point(harness, "Photograph picture", egui::vec2(0.5, 0.8));
    tap(harness, at);
    for _ in 0..200 {
        let app = &harness.state().app;
        let placement = &app.document.insertions.objects[0];
        let scene = &app.document.capture().expect("open").scene;
        if app
            .document
            .insertions
            .models
            .corners(placement, scene)
            .is_some()
        {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
        harness.run_steps(1);
    }
    panic!("the object was not read");
}

/// Where a point above the foot of the first object is in the photograph.
pub fn seen(harness: &Harness<'_, Window>, height: f64) -> Pos2 {
    let app = &harness.state().app;
    let scene = &app.document.capture().expect("open").scene;
    let at = app.document.insertions.objects[0].at.expect("placed");
    let point_above = at + scene.up.as_dvec3() * height - scene.origin;
    let pixel = (scene.cameras[0].project(point_above.as_vec3())).expect("in view");
    let fraction = egui::vec2(pixel.x / 64.0, pixel.y / 48.0);
    point(harness, "Photograph picture", fraction)
}

fn wait_for_batch(harness: &mut Harness<'_, Window>) {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(60) {
        harness.run_steps(1);
        if harness.state().app.jobs.batch.is_none() {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("the photographs were not written");
}

fn said(harness: &Harness<'_, Window>, part: &str) -> bool {
    let log = &harness.state().app.jobs.notices.log;
    log.iter().any(|event| event.message.contains(part))
}

#[test]
fn the_picture_under_the_pointer_is_copied_as_it_is_seen() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let pane = harness.get_by_label("Albedo picture").rect();
    harness.hover_at(pane.center());
    harness.run_steps(2);
    let modifiers = Modifiers::COMMAND | Modifiers::SHIFT;
    harness.event(egui::Event::ModifiersChanged(modifiers));
    harness.step();
    harness.event(egui::Event::Key {
        key: Key::C,
        pressed: true,
        modifiers,
        repeat: false,
        physical_key: None,
    });
    harness.step();
    let commands = &harness.output().platform_output.commands;
    let copied = commands.iter().find_map(|command| match command {
        egui::OutputCommand::CopyImage(image) => Some(image.clone()),
        _ => None,
    });
    let image = copied.expect("an image was copied");
    assert_eq!(image.size, [64, 48]);
    // Reflectance of 0.8, 0.4, 0.2 in sRGB, whatever the exposure.
    assert_eq!(image.pixels[0], egui::Color32::from_rgb(231, 170, 124));
    assert!(said(&harness, "Albedo copied"));
}

#[test]
fn all_photographs_are_written_with_the_object_and_in_the_changed_light() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("photographs");
    // There is nothing to write yet.
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::E);
    assert!(harness.query_by_label("Save photographs").is_none());

    insert_block(&mut harness, folder.path());
    click(&mut harness, "Objects");
    click(&mut harness, "Select lamp");
    press(&mut harness, Modifiers::NONE, Key::K);
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::E);
    harness.get_by_label("All 3 photographs");
    retype(&mut harness, "Samples a pixel", "2");
    retype(&mut harness, "Folder", &out.to_string_lossy());
    click(&mut harness, "Write");
    wait_for_batch(&mut harness);
    assert!(
        said(&harness, "3 photographs written"),
        "{:?}",
        harness.state().app.jobs.notices.log
    );
    for frame in 0..3 {
        for kind in [
            "relit.exr",
            "relit.png",
            "composite.exr",
            "layers.exr",
            "compare.png",
        ] {
            let file = out.join(format!("{frame:03}.{kind}"));
            assert!(file.is_file(), "{}", file.display());
        }
    }
}

#[test]
fn one_photograph_is_written_alone_and_a_batch_is_cancelled() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert_block(&mut harness, folder.path());
    press(&mut harness, Modifiers::NONE, Key::CloseBracket);
    let [one, many] = ["one", "many"].map(|name| folder.path().join(name));
    palette(&mut harness, "save photographs");
    click(&mut harness, "Photograph 2 alone, as 001");
    retype(&mut harness, "Samples a pixel", "2");
    retype(&mut harness, "Folder", &one.to_string_lossy());
    press(&mut harness, Modifiers::NONE, Key::Enter);
    wait_for_batch(&mut harness);
    assert!(one.join("001.composite.png").is_file() && !one.join("000.composite.png").is_file());

    palette(&mut harness, "save photographs");
    retype(&mut harness, "Samples a pixel", "4096");
    retype(&mut harness, "Folder", &many.to_string_lossy());
    press(&mut harness, Modifiers::NONE, Key::Enter);
    click(&mut harness, "Cancel photographs");
    wait_for_batch(&mut harness);
    assert!(said(&harness, "of 3 photographs"));
    assert!(!many.join("002.composite.png").is_file());
}

fn exported(recorder: &Recorder) -> Option<(ExportFormat, PathBuf)> {
    let sent = recorder.sent();
    sent.iter().rev().find_map(|command| match command {
        Command::Export(request) => Some((request.format, request.path.clone())),
        _ => None,
    })
}

#[test]
fn the_light_at_a_clicked_point_is_exported() {
    let (mut harness, recorder) = solving(Harness::builder());
    palette(&mut harness, "light probe by click");
    harness.get_by_label("Click where the light is to be taken");
    let floor = point(&harness, "Albedo picture", egui::vec2(0.5, 0.8));
    tap(&mut harness, floor);
    harness.get_by_label("Point y");
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let (format, path) = exported(&recorder).expect("an export");
    let ExportFormat::Probe { at } = format else {
        panic!("{format:?}");
    };
    // A little above the floor, where it was clicked.
    assert!(at.y > 0.01 && at.y < 0.1 && at.x.abs() < 0.3, "{at}");
    assert_eq!(path, PathBuf::from("small-room-light.hdr"));
    // The click selected nothing.
    assert_eq!(harness.state().app.view.selection.object, None);
}

#[test]
fn two_clicks_and_a_length_set_the_scale_and_one_click_the_ground() {
    let (mut harness, recorder) = solving(Harness::builder());
    let reframed = |recorder: &Recorder| {
        recorder
            .sent()
            .into_iter()
            .find_map(|command| match command {
                Command::Reframe(options) => Some(options),
                _ => None,
            })
    };
    palette(&mut harness, "set the scale");
    for (x, y) in [(0.3, 0.8), (0.7, 0.8)] {
        let at = point(&harness, "Albedo picture", egui::vec2(x, y));
        tap(&mut harness, at);
    }
    let relit::app::shell::sheet::Sheet::Length { found, .. } =
        harness.state().app.view.shell.sheet
    else {
        panic!("no length is asked for");
    };
    assert!((0.5..2.5).contains(&found), "{found}");
    retype(&mut harness, "Length", "3.5");
    press(&mut harness, Modifiers::NONE, Key::Enter);
    click(&mut harness, "Set");
    let options = reframed(&recorder).expect("a scale");
    let scale = options.coordinates.scale.expect("a scale");
    assert!((scale - 3.5 / found).abs() < 1e-9, "{scale}");

    // The wall at z = −1, as if it were the ground.
    palette(&mut harness, "set the ground");
    let wall = point(&harness, "Albedo picture", egui::vec2(0.5, 0.36));
    tap(&mut harness, wall);
    let options = reframed(&recorder).expect("a ground");
    let up = options.up.expect("an up axis");
    assert!((up - glam::DVec3::Z).length() < 1e-6, "{up}");
    assert!((options.coordinates.ground.expect("a height") + 1.0).abs() < 1e-5);
}

#[test]
fn an_object_is_scaled_and_raised_by_its_handles_one_step_of_undo_each() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert_block(&mut harness, folder.path());
    let placement =
        |harness: &Harness<'_, Window>| harness.state().app.document.insertions.objects[0].clone();
    let before = placement(&harness);
    // The handle stands a little above the block: 0.5 m, and a fifth of that more.
    let (top, foot) = (seen(&harness, 0.6), seen(&harness, 0.0));
    drag(&mut harness, top, foot.lerp(top, 0.5));
    let scale = placement(&harness).scale;
    assert!((0.4..0.65).contains(&scale), "{scale}");
    let raised = seen(&harness, 0.3);
    harness.event(egui::Event::ModifiersChanged(Modifiers::SHIFT));
    drag(&mut harness, foot, raised);
    harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    let moved = placement(&harness).at.expect("placed") - before.at.expect("placed");
    assert!(
        (moved.y - 0.3).abs() < 0.02 && moved.x.hypot(moved.z) < 1e-6,
        "{moved}"
    );
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(placement(&harness), before);
}
