//! What a person does with mouse and keyboard, by the labels that are seen.

use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::window::Window;
use std::path::{Path, PathBuf};

/// Clicks what has a label.
pub fn click(harness: &mut Harness<'_, Window>, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(3);
}

/// Presses a key.
pub fn press(harness: &mut Harness<'_, Window>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run_steps(3);
}

/// Types into the field that has a label.
pub fn type_into(harness: &mut Harness<'_, Window>, label: &str, text: &str) {
    harness.get_by_label(label).focus();
    harness.run_steps(2);
    harness.get_by_label(label).type_text(text);
    harness.run_steps(2);
}

/// Replaces the text of a field.
pub fn retype(harness: &mut Harness<'_, Window>, label: &str, text: &str) {
    harness.get_by_label(label).focus();
    harness.run_steps(2);
    press(harness, Modifiers::COMMAND, Key::A);
    harness.get_by_label(label).type_text(text);
    harness.run_steps(2);
}

/// Inserts an object's file by its typed path, and waits until it is read.
pub fn insert(harness: &mut Harness<'_, Window>, file: &Path) {
    click(harness, "Insert");
    retype(harness, "Object file", &file.to_string_lossy());
    let before = harness.state().app.document.insertions.objects.len();
    click(harness, "Add");
    for _ in 0..400 {
        harness.run_steps(1);
        if harness.state().app.document.insertions.objects.len() > before {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("{:?}", harness.state().app.view.panels.adding.problem);
}

/// A file of an object: a block of half a metre, cut in half.
pub fn block(folder: &Path) -> PathBuf {
    let file = folder.join("block.obj");
    let text = "v -0.25 0 -0.25\nv 0.25 0 0.25\nv 0.25 0.5 0.25\nf 1 2 3\n";
    std::fs::write(&file, text).expect("written");
    file
}
