//! Mixing the light of lamps, and changing lamps and materials by hand.

use crate::connection::{solving, view};
use crate::input::{click, press};
use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::Vec3;
use relit::app::picture::quantity::Quantity;
use relit::app::window::Window;
use relit::session::command::Command;
use relit::session::edits::Edits;
use relit::session::snapshot::LightSource;
use std::path::PathBuf;
use std::sync::Arc;

/// Drags a slider from one share of its length to another, in steps.
fn slide(harness: &mut Harness<'_, Window>, label: &str, to: f32) {
    let rect = harness.get_by_role_and_label(Role::Slider, label).rect();
    let at = |share: f32| egui::pos2(rect.left() + share * rect.width(), rect.center().y);
    harness.hover_at(at(0.25));
    harness.run_steps(1);
    harness.drag_at(at(0.25));
    for step in 1..=4 {
        harness.hover_at(at(0.25 + (to - 0.25) * step as f32 / 4.0));
        harness.run_steps(1);
    }
    harness.drop_at(at(to));
    harness.run_steps(3);
}

/// The value of the mixed picture.
fn relit(harness: &Harness<'_, Window>) -> Vec3 {
    let drawn = harness.state().app.drawn(Quantity::Relit);
    drawn.expect("a mixed picture").picture.pixels[0]
}

fn near(value: Vec3, expected: f32) -> bool {
    (value - Vec3::splat(expected)).abs().max_element() < 1e-6
}

#[test]
fn lamps_are_mixed_without_the_worker_and_each_drag_is_undone_in_one_step() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::L);
    // Only now is the light asked for apart.
    let sent = recorder.sent();
    let asked = sent.iter().rev().find_map(|command| match command {
        Command::View(request) => Some(request.layers),
        _ => None,
    });
    assert_eq!(asked, Some(true), "{sent:?}");
    assert!(near(relit(&harness), 0.25));

    slide(&mut harness, "Strength of lamp", -0.2);
    let gain =
        |harness: &Harness<'_, Window>| harness.state().app.mixer.mix.gain(LightSource::Lamp(2));
    assert_eq!(gain(&harness).strength, 0.0);
    assert!(near(relit(&harness), 0.05), "{}", relit(&harness));
    click(&mut harness, "outside light is lit");
    assert!(near(relit(&harness), 0.0));
    assert!(recorder.sent().is_empty(), "the worker has nothing to do");

    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert!(near(relit(&harness), 0.05));
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert!(near(relit(&harness), 0.25));
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert!(near(relit(&harness), 0.05));
    click(&mut harness, "Reset mix");
    assert!(near(relit(&harness), 0.25));
}

#[test]
fn a_mix_goes_along_to_the_next_photograph_and_ends_with_the_pane() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::L);
    click(&mut harness, "lamp is lit");
    assert!(near(relit(&harness), 0.05));
    press(&mut harness, Modifiers::NONE, Key::CloseBracket);
    assert!(harness.state().app.drawn(Quantity::Relit).is_none());
    recorder.show(|snapshot| {
        let capture = snapshot.capture.clone().expect("open");
        snapshot.view = Some(Arc::new(view(&capture, 1)));
    });
    harness.run_steps(3);
    assert!(near(relit(&harness), 0.05));

    recorder.sent();
    click(&mut harness, "Objects");
    harness.run_steps(3);
    let sent = recorder.sent();
    assert!(
        matches!(&sent[..], [Command::View(request)] if !request.layers),
        "{sent:?}"
    );
}

#[test]
fn a_lamp_is_selected_compared_and_its_light_saved() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::L);
    harness.get_by_label("Colour of lamp");
    click(&mut harness, "lamp");
    assert_eq!(harness.state().app.selected, Some(2));
    press(&mut harness, Modifiers::NONE, Key::B);
    let compare = &harness.state().app.compare;
    assert_eq!(
        (compare.left, compare.right),
        (Quantity::Render, Quantity::Relit)
    );
    harness.get_by_label("wiped pictures");

    recorder.sent();
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let sent = recorder.sent();
    let file = PathBuf::from("small-room-lights.exr");
    assert!(
        matches!(&sent[..], [Command::SaveLayers(path)] if *path == file),
        "{sent:?}"
    );
}

/// The changes that were sent last.
fn edits(sent: &[Command]) -> Option<Edits> {
    sent.iter().rev().find_map(|command| match command {
        Command::Edit(edits) => Some(edits.clone()),
        _ => None,
    })
}

fn type_value(harness: &mut Harness<'_, Window>, label: &str, text: &str) {
    let field = |harness: &Harness<'_, Window>| {
        harness
            .get_by_role_and_label(Role::SpinButton, label)
            .focus();
    };
    field(harness);
    harness.run_steps(2);
    harness
        .get_by_role_and_label(Role::SpinButton, label)
        .type_text(text);
    harness.run_steps(2);
    press(harness, Modifiers::NONE, Key::Enter);
}

#[test]
fn a_wall_is_recoloured_taken_back_and_reset() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::M);
    harness.get_by_label("Select an object by a click in a picture or in the table");
    click(&mut harness, "Select wall");
    harness.get_by_label("Albedo colour");
    type_value(&mut harness, "Albedo green", "0.25");
    let sent = edits(&recorder.sent()).expect("sent");
    assert_eq!(sent.object(1).albedo, Some(Vec3::new(0.7, 0.25, 0.7)));
    // The table shows what was changed, the estimate stays.
    let app = &harness.state().app;
    assert_eq!(app.estimate.objects[1].albedo.y, 0.25);
    assert_eq!(app.snapshot.estimate.objects[1].albedo.y, 0.7);

    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert!(!edits(&recorder.sent()).expect("sent").is_empty());
    click(&mut harness, "Reset material");
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
}

#[test]
fn a_wall_is_given_gloss_polished_made_dull_and_taken_back() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Select wall");
    press(&mut harness, Modifiers::NONE, Key::M);
    assert!(harness.query_by_label("roughness").is_none());
    let switch_gloss = |harness: &mut Harness<'_, Window>| {
        harness
            .get_by_role_and_label(Role::CheckBox, "Gloss")
            .click();
        harness.run_steps(3);
    };
    switch_gloss(&mut harness);
    let lobe = |harness: &Harness<'_, Window>| harness.state().app.estimate.objects[1].lobe();
    assert_eq!(lobe(&harness), Some((0.3, 0.04)));
    type_value(&mut harness, "roughness", "0.1");
    type_value(&mut harness, "specular", "0.6");
    assert_eq!(lobe(&harness), Some((0.1, 0.6)));
    let sent = edits(&recorder.sent()).expect("sent").object(1);
    assert_eq!((sent.roughness, sent.specular), (Some(0.1), Some(0.6)));
    assert_eq!(sent.albedo, None);
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(lobe(&harness), Some((0.1, 0.04)));
    switch_gloss(&mut harness);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());

    // What was found glossy can be made dull.
    recorder.show(|snapshot| {
        let estimate = Arc::make_mut(&mut snapshot.estimate);
        let wall = &mut estimate.objects[1];
        (wall.roughness, wall.specular) = (Some(0.2), Some(0.5));
    });
    harness.run_steps(3);
    harness.get_by_label_contains("specular reflectance 0.5");
    switch_gloss(&mut harness);
    assert_eq!(lobe(&harness), None);
    switch_gloss(&mut harness);
    assert_eq!(lobe(&harness), Some((0.2, 0.5)));
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
}

#[test]
fn a_drag_of_a_material_is_one_step_of_undo() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Select lamp");
    press(&mut harness, Modifiers::NONE, Key::M);
    let field = harness
        .get_by_role_and_label(Role::SpinButton, "Emission strength")
        .rect()
        .center();
    harness.hover_at(field);
    harness.run_steps(1);
    harness.drag_at(field);
    for step in 1..=5 {
        harness.hover_at(field + egui::vec2(-8.0 * step as f32, 0.0));
        harness.run_steps(1);
    }
    harness.drop_at(field - egui::vec2(40.0, 0.0));
    harness.run_steps(3);
    let sent = edits(&recorder.sent()).expect("sent");
    let emission = sent.object(2).emission.expect("an emission");
    assert!(
        emission.x < 8.0 && emission == Vec3::splat(emission.x),
        "{emission}"
    );
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
    assert!(!harness.state().app.history.can_undo());
}

#[test]
fn a_lamp_is_switched_off_and_on_and_takes_up_the_mixed_light() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::K);
    assert!(edits(&recorder.sent()).is_none(), "nothing is selected");
    click(&mut harness, "Select lamp");
    press(&mut harness, Modifiers::NONE, Key::K);
    assert!(edits(&recorder.sent()).expect("sent").object(2).off);
    assert_eq!(harness.state().app.estimate.objects[2].emission, Vec3::ZERO);
    press(&mut harness, Modifiers::NONE, Key::K);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());

    press(&mut harness, Modifiers::NONE, Key::L);
    slide(&mut harness, "Strength of lamp", -0.2);
    click(&mut harness, "Give lamps this light");
    let sent = edits(&recorder.sent()).expect("sent");
    assert_eq!(sent.object(2).emission, Some(Vec3::ZERO));
    assert!(harness.state().app.mixer.mix.is_neutral());
    // One step brings back both the lamp and the mix.
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
    assert!(!harness.state().app.mixer.mix.is_neutral());
}

#[test]
fn files_are_written_in_the_mixed_light_unless_that_is_declined() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::L);
    slide(&mut harness, "Strength of lamp", -0.2);
    let exported = |recorder: &crate::connection::Recorder| {
        let sent = recorder.sent();
        sent.iter().rev().find_map(|command| match command {
            Command::Export(request) => Some(request.edits.clone()),
            _ => None,
        })
    };
    press(&mut harness, Modifiers::COMMAND, Key::E);
    harness
        .get_by_role_and_label(Role::Button, "Export")
        .click();
    harness.run_steps(3);
    let edits = exported(&recorder).expect("an export").expect("the mix");
    assert_eq!(edits.object(2).emission, Some(Vec3::ZERO));
    assert!(harness.state().app.edits.is_empty(), "the lamp stays");
    press(&mut harness, Modifiers::COMMAND, Key::E);
    click(&mut harness, "In the light of the mixer");
    harness
        .get_by_role_and_label(Role::Button, "Export")
        .click();
    harness.run_steps(3);
    assert_eq!(exported(&recorder).expect("an export"), None);

    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::E);
    harness.get_by_label("At full size, in the light as you changed it.");
    click(&mut harness, "In the light of the mixer");
    harness.get_by_label("Insert an object, or change a lamp or a material first.");
    // Reset, there is nothing to decline.
    press(&mut harness, Modifiers::NONE, Key::Escape);
    click(&mut harness, "Reset mix");
    press(&mut harness, Modifiers::COMMAND, Key::E);
    assert!(
        harness
            .query_by_label("In the light of the mixer")
            .is_none()
    );
}
