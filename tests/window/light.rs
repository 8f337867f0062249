//! Changing lamps and materials by hand.

use crate::connection::solving;
use crate::input::{click, press};
use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::Vec3;
use relit::app::lights::{Gain, place};
use relit::app::picture::quantity::Quantity;
use relit::app::window::Window;
use relit::inverse::estimate::Outside;
use relit::session::command::Command;
use relit::session::edits::Edits;
use relit::transport::surroundings::Surroundings;
use std::path::PathBuf;
use std::sync::Arc;

/// Drags a slider from one fraction of its length to another, in steps.
fn slide(harness: &mut Harness<'_, Window>, label: &str, to: f32) {
    let rect = harness.get_by_role_and_label(Role::Slider, label).rect();
    let at = |fraction: f32| egui::pos2(rect.left() + fraction * rect.width(), rect.center().y);
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

/// What is made of the lamp's light.
fn gain(harness: &Harness<'_, Window>) -> Gain {
    harness.state().app.document.gain(&[2])
}

#[test]
fn a_lamp_is_dimmed_and_switched_off_stays_in_the_list_and_each_drag_is_undone_in_one_step() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::L);
    recorder.sent();
    slide(&mut harness, "Strength of lamp", 0.125);
    let strength = gain(&harness).strength;
    assert!(strength > 0.0 && strength < 0.9, "{strength}");
    // The photograph is asked for in this light, at once.
    let sent = edits(&recorder.sent()).expect("sent").object(2);
    let emission = sent.emission.expect("an emission");
    assert!((emission - 9.0 * strength).abs().max_element() < 1e-3);
    click(&mut harness, "lamp is lit");
    assert!(edits(&recorder.sent()).expect("sent").object(2).off);
    assert!(!gain(&harness).on && gain(&harness).strength == strength);
    harness.get_by_role_and_label(Role::Slider, "Strength of lamp");

    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert!(gain(&harness).on);
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(gain(&harness).strength, 1.0);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(gain(&harness).strength, strength);
    click(&mut harness, "Reset lights");
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
}

#[test]
fn light_from_outside_is_switched_off_and_on() {
    let (mut harness, recorder) = solving(Harness::builder());
    recorder.show(|snapshot| {
        Arc::make_mut(&mut snapshot.estimate).outside = Some(Outside {
            width: 1,
            height: 1,
            pixels: vec![Vec3::ONE],
            above: None,
            surroundings: Surroundings::Far,
            sun: None,
            openings: None,
        });
    });
    press(&mut harness, Modifiers::NONE, Key::L);
    recorder.sent();
    click(&mut harness, "outside light is lit");
    let sent = edits(&recorder.sent()).expect("sent");
    assert_eq!(sent.outside(), Vec3::ZERO);
    click(&mut harness, "outside light is lit");
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
}

#[test]
fn a_lamp_of_a_scan_is_named_by_where_it_is() {
    let capture = crate::connection::room();
    let camera = &capture.scene.cameras[1];
    let place = |object| place(&capture.scene, object, camera);
    assert_eq!(place(1).as_deref(), Some("high middle"));
    assert_eq!(place(2).as_deref(), Some("above, out of view"));
    assert_eq!(place(9), None);
}

#[test]
fn a_lamp_is_selected_compared_and_its_light_saved() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::L);
    harness.get_by_label("Colour of lamp");
    harness.get_by_role_and_label(Role::Button, "lamp").click();
    harness.run_steps(3);
    assert_eq!(harness.state().app.view.selection.object, Some(2));
    press(&mut harness, Modifiers::NONE, Key::B);
    assert_eq!(
        harness.state().app.view.compare.against,
        Some(Quantity::Photograph)
    );
    harness.get_by_label("wiped pictures");
    press(&mut harness, Modifiers::NONE, Key::B);
    harness.get_by_label("Composite picture");

    recorder.sent();
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let mut sent = recorder.sent();
    // Pictures are asked for meanwhile.
    sent.retain(|command| !matches!(command, Command::View(_)));
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
    assert_eq!(app.document.estimate.objects[1].albedo.y, 0.25);
    assert_eq!(app.document.snapshot.estimate.objects[1].albedo.y, 0.7);

    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert!(!edits(&recorder.sent()).expect("sent").is_empty());
    click(&mut harness, "Reset material");
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
}

#[test]
fn a_field_that_is_left_with_the_text_it_had_changes_nothing() {
    let (mut harness, recorder) = solving(Harness::builder());
    recorder.show(|snapshot| {
        let wall = &mut Arc::make_mut(&mut snapshot.estimate).objects[1];
        wall.albedo = Vec3::new(0.70004, 0.12345, 0.33333);
    });
    click(&mut harness, "Select wall");
    press(&mut harness, Modifiers::NONE, Key::M);
    for label in [
        "Albedo red",
        "Albedo green",
        "Albedo blue",
        "Emission strength",
    ] {
        let field = harness.get_by_role_and_label(Role::SpinButton, label);
        field.click();
        harness.run_steps(3);
    }
    press(&mut harness, Modifiers::NONE, Key::Enter);
    assert!(edits(&recorder.sent()).is_none());
    // Of three channels, only the typed one changes.
    type_value(&mut harness, "Albedo green", "0.2");
    let sent = edits(&recorder.sent()).expect("sent");
    assert_eq!(
        sent.object(1).albedo,
        Some(Vec3::new(0.70004, 0.2, 0.33333))
    );
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
    let lobe =
        |harness: &Harness<'_, Window>| harness.state().app.document.estimate.objects[1].lobe();
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
    assert!(!harness.state().app.document.history.can_undo());
}

#[test]
fn a_lamp_is_switched_off_and_on_by_its_key() {
    let (mut harness, recorder) = solving(Harness::builder());
    press(&mut harness, Modifiers::NONE, Key::K);
    assert!(edits(&recorder.sent()).is_none(), "nothing is selected");
    click(&mut harness, "Select lamp");
    press(&mut harness, Modifiers::NONE, Key::K);
    assert!(edits(&recorder.sent()).expect("sent").object(2).off);
    assert_eq!(
        harness.state().app.document.estimate.objects[2].emission,
        Vec3::ZERO
    );
    press(&mut harness, Modifiers::NONE, Key::K);
    assert!(edits(&recorder.sent()).expect("sent").is_empty());
}
