//! Flows without a graphics adapter.

use crate::connection::{Recorder, idle, insertion, solve, solving, view};
use crate::input::{block, click, insert, press, retype, type_into};
use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::layout::{Pane, is_open};
use relit::app::panels::objects::SortBy;
use relit::app::picture::quantity::Quantity;
use relit::app::window::Window;
use relit::inverse::solver::Termination;
use relit::session::command::{Command, ExportFormat, Source, ViewCamera};
use relit::session::snapshot::{Event, Level, Phase};
use std::path::PathBuf;
use std::sync::Arc;

/// Objects to be shown, as the worker was told last.
fn placements(recorder: &Recorder) -> Option<usize> {
    let sent = recorder.sent();
    sent.iter().rev().find_map(|command| match command {
        Command::Insert(placements) => Some(placements.iter().filter(|p| !p.hidden).count()),
        _ => None,
    })
}

#[test]
fn the_start_page_opens_the_room_and_a_typed_path() {
    let (mut harness, recorder) = idle(Harness::builder());
    click(&mut harness, "Open the built-in room");
    assert!(matches!(
        recorder.sent()[..],
        [Command::Open(Source::BuiltInRoom)]
    ));

    let (mut harness, recorder) = idle(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("transforms.json"), "{}").expect("written");
    type_into(
        &mut harness,
        "Capture folder",
        &folder.path().to_string_lossy(),
    );
    click(&mut harness, "Open");
    let sent = recorder.sent();
    let folder = folder.path().to_owned();
    assert!(matches!(&sent[..], [Command::Open(Source::Folder(path))] if *path == folder));
    recorder.show(solve);
    harness.run_steps(3);
    assert_eq!(harness.state().app.preferences.recent, [folder]);
    assert!(harness.query_by_label("Open the built-in room").is_none());
}

#[test]
fn a_failed_open_is_said_where_it_was_typed_and_letters_typed_after_it_do_nothing_else() {
    let (mut harness, recorder) = idle(Harness::builder());
    type_into(&mut harness, "Capture folder", "/nowhere");
    click(&mut harness, "Open");
    harness.get_by_label("/nowhere: there is nothing; check the path");
    assert!(recorder.sent().is_empty());

    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("transforms.json"), "{}").expect("written");
    retype(
        &mut harness,
        "Capture folder",
        &folder.path().to_string_lossy(),
    );
    click(&mut harness, "Open");
    recorder.show(|snapshot| {
        snapshot.phase = Phase::Failed;
        snapshot.events = Arc::new(vec![Event {
            level: Level::Error,
            message: "transforms.json: no frames; name a capture that has some".into(),
        }]);
    });
    harness.run_steps(3);
    // In the page and as a notice.
    let said = "transforms.json: no frames; name a capture that has some";
    assert_eq!(harness.query_all_by_label(said).count(), 2);
    harness.get_by_label("Open the built-in room");
    // T would change the tone curve, L show the lights.
    let (tone, path) = (
        harness.state().app.view.look.tone,
        harness.state().app.view.shell.start.path.clone(),
    );
    for key in [Key::T, Key::L] {
        press(&mut harness, Modifiers::NONE, key);
    }
    assert_eq!(harness.state().app.view.look.tone, tone);
    harness.event(egui::Event::Text("x".into()));
    harness.run_steps(2);
    assert_ne!(harness.state().app.view.shell.start.path, path);
}

#[test]
fn a_folder_that_is_neither_capture_nor_scan_says_what_to_choose() {
    let (mut harness, _recorder) = idle(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    type_into(
        &mut harness,
        "Capture folder",
        &folder.path().to_string_lossy(),
    );
    click(&mut harness, "Open");
    for _ in 0..400 {
        harness.run_steps(1);
        if harness
            .query_by_label_contains("no known layout is recognised")
            .is_some()
        {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("{:?}", harness.state().app.view.shell.start.problem);
}

#[test]
fn pause_run_step_reset_and_finish_reach_the_worker_and_a_full_queue_loses_none() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Pause");
    assert!(matches!(recorder.sent()[..], [Command::Pause]));
    recorder.show(|snapshot| snapshot.phase = Phase::Paused);
    harness.run_steps(2);
    press(&mut harness, Modifiers::NONE, Key::Space);
    assert!(matches!(recorder.sent()[..], [Command::Run]));

    recorder.refuse(true);
    click(&mut harness, "Step");
    click(&mut harness, "Reset");
    click(&mut harness, "Finish");
    assert!(recorder.sent().is_empty());
    recorder.refuse(false);
    harness.run_steps(2);
    assert!(matches!(
        recorder.sent()[..],
        [Command::Step, Command::Reset, Command::Finish]
    ));
}

#[test]
fn photographs_are_stepped_through_around_the_ends() {
    let (mut harness, recorder) = solving(Harness::builder());
    let asked = |recorder: &Recorder| {
        recorder
            .sent()
            .iter()
            .rev()
            .find_map(|command| match command {
                Command::View(request) => match request.camera {
                    ViewCamera::Frame(frame) => Some(frame),
                    ViewCamera::Free(_) => None,
                },
                _ => None,
            })
    };
    press(&mut harness, Modifiers::NONE, Key::OpenBracket);
    harness.get_by_label("photograph 3 of 3");
    assert_eq!(asked(&recorder), Some(2));
    click(&mut harness, "Next photograph");
    harness.get_by_label("photograph 1 of 3");
    assert_eq!(asked(&recorder), Some(0));
    click(&mut harness, "Photograph 2");
    assert_eq!(asked(&recorder), Some(1));
    // The photograph is there at once, the re-render when the worker has sent it.
    let app = &harness.state().app;
    assert!(
        app.view
            .drawn(&app.document, Quantity::Photograph)
            .is_some()
            && app.view.drawn(&app.document, Quantity::Render).is_none()
    );
    recorder.show(|snapshot| {
        let capture = snapshot.capture.clone().expect("open");
        snapshot.view = Some(Arc::new(view(&capture, 1)));
    });
    harness.run_steps(2);
    assert!(
        harness
            .state()
            .app
            .view
            .drawn(&harness.state().app.document, Quantity::Render)
            .is_some()
    );
}

#[test]
fn the_table_is_sorted_and_selects() {
    let (mut harness, _recorder) = solving(Harness::builder());
    assert_eq!(harness.state().app.view.panels.objects.sort, SortBy::Pixels);
    click(&mut harness, "Sort by Emission");
    assert_eq!(
        harness.state().app.view.panels.objects.sort,
        SortBy::Emission
    );
    assert!(harness.state().app.view.panels.objects.descending);
    let height = |harness: &Harness<'_, Window>, name: &str| {
        harness.get_by_label(&format!("Select {name}")).rect().top()
    };
    assert!(height(&harness, "lamp") < height(&harness, "floor"));
    click(&mut harness, "Sort by Emission");
    assert!(height(&harness, "lamp") > height(&harness, "floor"));
    click(&mut harness, "Select wall");
    assert_eq!(harness.state().app.view.selection.object, Some(1));
    press(&mut harness, Modifiers::NONE, Key::Escape);
    assert_eq!(harness.state().app.view.selection.object, None);
}

#[test]
fn a_click_in_a_picture_selects_the_object_there() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let pane = harness.get_by_label("Albedo picture").rect();
    for (fraction, object) in [(0.36, 1), (0.8, 0)] {
        let app = &harness.state().app;
        let placement = app.view.look.placement(pane, [64, 48]);
        let at = placement.min + placement.size() * egui::vec2(0.5, fraction);
        harness.hover_at(at);
        harness.run_steps(1);
        harness.drag_at(at);
        harness.run_steps(1);
        harness.drop_at(at);
        harness.run_steps(3);
        assert_eq!(
            harness.state().app.view.selection.object,
            Some(object),
            "at {fraction}"
        );
    }
}

#[test]
fn exposure_and_tone_curve_follow_their_keys() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let before = harness.state().app.view.look.exposure;
    press(&mut harness, Modifiers::NONE, Key::Plus);
    assert_eq!(harness.state().app.view.look.exposure, before + 0.5);
    press(&mut harness, Modifiers::NONE, Key::Minus);
    press(&mut harness, Modifiers::NONE, Key::Minus);
    assert_eq!(harness.state().app.view.look.exposure, before - 0.5);
    click(&mut harness, "Auto");
    assert_eq!(harness.state().app.view.look.exposure, before);
    let tone = harness.state().app.view.look.tone;
    press(&mut harness, Modifiers::NONE, Key::T);
    assert_ne!(harness.state().app.view.look.tone, tone);
}

#[test]
fn two_pictures_are_wiped_flipped_and_shown_side_by_side() {
    let (mut harness, _recorder) = solving(Harness::builder());
    click(&mut harness, "Compare");
    harness.get_by_label("Wipe position");
    let pane = harness.get_by_label("wiped pictures").rect();
    let line = pane.center();
    harness.hover_at(line);
    harness.run_steps(1);
    harness.drag_at(line);
    harness.run_steps(1);
    harness.hover_at(line + egui::vec2(pane.width() * 0.25, 0.0));
    harness.run_steps(1);
    harness.drop_at(line + egui::vec2(pane.width() * 0.25, 0.0));
    harness.run_steps(2);
    let split = harness.state().app.view.compare.split;
    assert!((split - 0.75).abs() < 0.02, "{split}");
    click(&mut harness, "Swap");
    assert_eq!(harness.state().app.view.compare.left, Quantity::Render);
    click(&mut harness, "Side by side");
    harness.get_by_label("second picture");
    press(&mut harness, Modifiers::NONE, Key::C);
    press(&mut harness, Modifiers::NONE, Key::C);
    harness.get_by_label("compared picture");
}

#[test]
fn a_file_that_is_no_object_is_said_where_it_was_typed_and_joins_nothing() {
    let (mut harness, recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("broken.glb");
    std::fs::write(&broken, "glTF, but not really").expect("written");
    click(&mut harness, "Insert");
    for (file, word) in [
        ("/nowhere/chair.glb".to_owned(), "/nowhere/chair.glb"),
        (broken.display().to_string(), "broken.glb"),
        (
            "/objects/chair.fbx".to_owned(),
            "save it as GLB, glTF or OBJ",
        ),
    ] {
        retype(&mut harness, "Object file", &file);
        click(&mut harness, "Add");
        for _ in 0..200 {
            harness.run_steps(1);
            if harness.query_by_label_contains(word).is_some() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let problem = harness.state().app.view.panels.adding.problem.clone();
        assert!(problem.is_some_and(|line| line.contains(word)), "{file}");
        harness.get_by_label_contains(word);
        assert!(harness.state().app.document.insertions.objects.is_empty());
    }
    assert_eq!(placements(&recorder), None);
}

#[test]
fn an_added_object_stands_on_the_floor_in_view_and_says_its_size() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert(&mut harness, &block(folder.path()));
    let at = harness.state().app.document.insertions.objects[0].at;
    let at = at.expect("a place");
    assert!(at.y.abs() < 1e-5 && at.x.abs() < 0.5, "{at}");
    harness.get_by_label("0.50 m wide, 0.50 m high, 0.50 m deep");
}

#[test]
fn objects_are_inserted_moved_duplicated_deleted_and_brought_back() {
    let (mut harness, recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert(&mut harness, &block(folder.path()));
    harness.run_steps(2);
    assert_eq!(placements(&recorder), Some(1));
    assert!(harness.state().app.view.tool.placing);

    // A click on the floor places it.
    let pane = harness.get_by_label("Photograph picture").rect();
    let placement = harness.state().app.view.look.placement(pane, [64, 48]);
    let at = placement.min + placement.size() * egui::vec2(0.5, 0.8);
    harness.hover_at(at);
    harness.run_steps(1);
    harness.drag_at(at);
    harness.run_steps(1);
    harness.drop_at(at);
    harness.run_steps(3);
    let point = harness.state().app.document.insertions.objects[0].at;
    assert!(point.is_some_and(|p| p.y.abs() < 1e-5), "{point:?}");
    assert!(!harness.state().app.view.tool.placing);

    click(&mut harness, "Blur and grain of the photograph");
    let matched = |command: &Command| matches!(command, Command::Match(false));
    assert!(recorder.sent().iter().any(matched));
    click(&mut harness, "Duplicate");
    assert_eq!(placements(&recorder), Some(2));
    click(&mut harness, "Delete");
    click(&mut harness, "Delete");
    assert_eq!(placements(&recorder), Some(0));
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(placements(&recorder), Some(1));
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(placements(&recorder), Some(0));
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    click(&mut harness, "Show block 1");
    assert_eq!(placements(&recorder), Some(0));

    recorder.show(|snapshot| snapshot.insertion = Some(Arc::new(insertion(0))));
    harness.run_steps(2);
    click(&mut harness, "Naive beside ours");
    let compare = &harness.state().app.view.compare;
    assert_eq!(
        (compare.left, compare.right),
        (Quantity::Naive, Quantity::Composite)
    );
    harness.get_by_label("first picture");
}

#[test]
fn an_object_takes_a_material_and_a_tilt_that_undo_takes_back() {
    let (mut harness, recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert(&mut harness, &block(folder.path()));
    let object =
        |harness: &Harness<'_, Window>| harness.state().app.document.insertions.objects[0].clone();
    assert_eq!(object(&harness).material, None);
    click(&mut harness, "Own material");
    let own = object(&harness).material.expect("the material of the file");
    assert_eq!((own.metallic, own.roughness), (0.0, None));
    click(&mut harness, "Object gloss");
    let glossy = object(&harness).material.and_then(|own| own.roughness);
    assert!(glossy.is_some());
    retype(&mut harness, "Object metallic", "1");
    assert_eq!(object(&harness).material.map(|own| own.metallic), Some(1.0));
    retype(&mut harness, "Tilt z", "90");
    assert_eq!(object(&harness).tilt, glam::DVec2::new(0.0, 90.0));
    for _ in 0..4 {
        press(&mut harness, Modifiers::COMMAND, Key::Z);
    }
    assert_eq!(
        (object(&harness).material, object(&harness).tilt),
        (None, glam::DVec2::ZERO)
    );
    assert_eq!(placements(&recorder), Some(1));
}

#[test]
fn keys_of_blender_scale_an_object_until_a_click_or_escape() {
    let (mut harness, recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert(&mut harness, &block(folder.path()));
    press(&mut harness, Modifiers::NONE, Key::Escape);
    let scale =
        |harness: &Harness<'_, Window>| harness.state().app.document.insertions.objects[0].scale;
    let pane = harness.get_by_label("Photograph picture").rect();
    let placement = harness.state().app.view.look.placement(pane, [64, 48]);
    let at = |x, y| placement.min + placement.size() * egui::vec2(x, y);
    // Without the choice, S scales nothing.
    harness.hover_at(at(0.2, 0.2));
    press(&mut harness, Modifiers::NONE, Key::S);
    assert!(harness.state().app.view.tool.transform.is_none());
    harness.state_mut().app.preferences.blender_keys = true;
    for (key, kept) in [(Key::Escape, false), (Key::Enter, true)] {
        let before = scale(&harness);
        press(&mut harness, Modifiers::NONE, Key::S);
        harness.hover_at(at(0.2, 0.2));
        harness.run_steps(2);
        harness.hover_at(at(0.05, 0.05));
        harness.run_steps(2);
        assert!(
            scale(&harness) > before,
            "{} from {before}",
            scale(&harness)
        );
        press(&mut harness, Modifiers::NONE, key);
        harness.hover_at(at(0.9, 0.9));
        harness.run_steps(2);
        assert_eq!(scale(&harness) > before, kept);
    }
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(scale(&harness), 1.0);
    assert_eq!(placements(&recorder), Some(1));
}

#[test]
fn an_object_that_is_deleted_while_the_pointer_scales_it_leaves_the_others_alone() {
    let (mut harness, _recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert(&mut harness, &block(folder.path()));
    click(&mut harness, "Duplicate");
    press(&mut harness, Modifiers::NONE, Key::Escape);
    harness.state_mut().app.preferences.blender_keys = true;
    harness.state_mut().app.document.insertions.chosen = Some(0);
    let others = harness.state().app.document.insertions.objects[1..].to_vec();
    let pane = harness.get_by_label("Photograph picture").rect();
    harness.hover_at(pane.center());
    press(&mut harness, Modifiers::NONE, Key::S);
    harness.hover_at(pane.center() - pane.size() * 0.2);
    harness.run_steps(2);
    press(&mut harness, Modifiers::NONE, Key::Delete);
    harness.hover_at(pane.center() - pane.size() * 0.4);
    harness.run_steps(2);
    assert_eq!(harness.state().app.document.insertions.objects, others);
}

#[test]
fn a_drag_is_one_step_of_undo() {
    let (mut harness, recorder) = solving(Harness::builder());
    let folder = tempfile::tempdir().expect("a folder");
    insert(&mut harness, &block(folder.path()));
    let turn = harness
        .get_by_role_and_label(Role::SpinButton, "Turn")
        .rect()
        .center();
    harness.hover_at(turn);
    harness.run_steps(1);
    harness.drag_at(turn);
    for step in 1..=5 {
        harness.hover_at(turn + egui::vec2(8.0 * step as f32, 0.0));
        harness.run_steps(1);
    }
    harness.drop_at(turn + egui::vec2(40.0, 0.0));
    harness.run_steps(3);
    assert!(harness.state().app.document.insertions.objects[0].rotate > 10.0);
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(
        harness.state().app.document.insertions.objects[0].rotate,
        0.0
    );
    assert_eq!(placements(&recorder), Some(1));
}

#[test]
fn the_palette_finds_and_does() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::COMMAND, Key::P);
    type_into(&mut harness, "Command", "built room");
    press(&mut harness, Modifiers::NONE, Key::Enter);
    assert!(matches!(
        recorder.sent()[..],
        [Command::Open(Source::BuiltInRoom)]
    ));
    assert!(harness.state().app.view.shell.palette.is_none());
}

#[test]
fn results_are_saved_and_exported_to_typed_paths() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::COMMAND, Key::S);
    // The field has the keys at once, and Enter is enough.
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let sent = recorder.sent();
    assert!(matches!(&sent[..], [Command::Save(folder)] if folder.ends_with("small-room")));
    press(&mut harness, Modifiers::COMMAND, Key::E);
    click(&mut harness, "Mitsuba 3");
    harness
        .get_by_role_and_label(Role::Button, "Export")
        .click();
    harness.run_steps(3);
    let sent = recorder.sent();
    let [Command::Export(request)] = &sent[..] else {
        panic!("{sent:?}");
    };
    assert_eq!(request.format, ExportFormat::Mitsuba);
    assert_eq!(request.path, PathBuf::from("small-room.xml"));
}

#[test]
fn a_changed_parameter_is_sent() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Settings");
    harness
        .get_by_role_and_label(Role::SpinButton, "Batch")
        .focus();
    harness.run_steps(2);
    harness
        .get_by_role_and_label(Role::SpinButton, "Batch")
        .type_text("32");
    harness.run_steps(2);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let sent = recorder.sent();
    let batch = sent.iter().rev().find_map(|command| match command {
        Command::Set(settings) => Some(settings.batch),
        _ => None,
    });
    assert_eq!(batch, Some(32), "{sent:?}");
}

#[test]
fn every_pane_draws_in_both_themes_with_the_fonts_shipped() {
    let (mut harness, recorder) = solving(Harness::builder());
    recorder.show(|snapshot| snapshot.insertion = Some(Arc::new(insertion(0))));
    for light in [false, true] {
        assert_eq!(harness.state().app.preferences.light, light);
        for pane in Pane::all() {
            harness.state_mut().app.view.layout.front = Some(pane);
            harness.run_steps(2);
            assert!(is_open(&harness.state().tree, pane), "{pane:?}");
        }
        press(&mut harness, Modifiers::COMMAND, Key::L);
    }
    press(&mut harness, Modifiers::NONE, Key::Questionmark);
    assert!(harness.query_all_by_label("Keys and mouse").count() > 0);
    harness.state_mut().app.view.shell.keys = false;
    harness.run_steps(2);
    for menu in ["File", "Edit", "Solve", "View", "Help", "Window"] {
        click(&mut harness, menu);
        click(&mut harness, menu);
    }
}

#[test]
fn the_layout_is_reset() {
    let (mut harness, _recorder) = solving(Harness::builder());
    relit::app::layout::close(&mut harness.state_mut().tree, Pane::Model);
    harness.run_steps(2);
    assert!(harness.query_by_label("3D view").is_none());
    harness.state_mut().app.view.layout.reset = true;
    harness.run_steps(2);
    assert!(is_open(&harness.state().tree, Pane::Model));
}

#[test]
fn states_do_not_contradict_each_other() {
    let (mut harness, recorder) = solving(Harness::builder());
    recorder.show(|snapshot| snapshot.phase = Phase::Finished(Termination::Cancelled));
    harness.run_steps(2);
    harness.get_by_label("Stopped");
    assert!(harness.query_by_label_contains("cancelled").is_none());
    click(&mut harness, "Settings");
    assert!(harness.query_by_label_contains("0.000000").is_none());

    let (mut harness, recorder) = idle(Harness::builder());
    recorder.show(|snapshot| snapshot.phase = Phase::Loading);
    harness.run_steps(3);
    assert!(harness.query_by_label("No capture is open").is_none());
    assert!(harness.query_all_by_label("Reading the capture…").count() > 0);
}

#[test]
fn the_photograph_as_changed_is_the_largest_picture_and_grids_are_a_workspace_of_their_own() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::COMMAND, Key::Num1);
    let hero = harness.get_by_label("Composite picture").rect();
    assert!(hero.area() > 0.35 * 1280.0 * 800.0, "{hero}");
    assert!(harness.query_by_label("Albedo picture").is_none());
    // It is the photograph while nothing is changed, and what the worker makes of it then.
    let pixel = |harness: &Harness<'_, Window>| {
        let drawn = harness
            .state()
            .app
            .view
            .drawn(&harness.state().app.document, Quantity::Composite);
        drawn.expect("a picture").picture.pixels[0].x
    };
    assert_eq!(pixel(&harness), 0.0);
    recorder.show(|snapshot| snapshot.insertion = Some(Arc::new(insertion(0))));
    harness.run_steps(2);
    assert_eq!(pixel(&harness), 0.9);
    harness.get_by_label("16 samples a pixel");
    // It is asked for at the size at which it is shown, up to that of its file.
    let asked = recorder
        .sent()
        .into_iter()
        .rev()
        .find_map(|command| match command {
            Command::View(request) => Some(request.composite),
            _ => None,
        });
    assert_eq!(asked, Some(64));
    press(&mut harness, Modifiers::COMMAND, Key::B);
    assert_eq!(
        harness.state().app.view.compare.against,
        Some(Quantity::Render)
    );
    harness.get_by_label("Wipe position");
    click(&mut harness, "Inspect");
    harness.get_by_label("Albedo picture");
}
