//! What screen readers hear: every control of every pane, menu and sheet has a name.

use crate::connection::{insertion, solving};
use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable, by};
use relit::app::action::Action;
use relit::app::layout::Pane;
use relit::app::window::Window;
use std::collections::BTreeSet;
use std::sync::Arc;

const CONTROLS: [Role; 9] = [
    Role::Button,
    Role::CheckBox,
    Role::RadioButton,
    Role::Slider,
    Role::SpinButton,
    Role::ComboBox,
    Role::TextInput,
    Role::Link,
    Role::ColorWell,
];

/// Adds what is shown now and has no name that can be read out.
fn look(harness: &Harness<'_, Window>, place: &str, nameless: &mut BTreeSet<String>) -> usize {
    let mut count = 0;
    for role in CONTROLS {
        for node in harness.query_all(by().role(role)) {
            count += 1;
            let node = node.accesskit_node();
            let named = |text: Option<String>| {
                text.is_some_and(|text| text.chars().any(char::is_alphanumeric))
            };
            let labelled = node.labelled_by().any(|label| named(label.value()));
            if !named(node.label()) && !labelled {
                nameless.insert(format!("{place}: {role:?} {:?}", node.value()));
            }
        }
    }
    count
}

#[test]
fn every_control_has_a_name() {
    let (mut harness, recorder) = solving(Harness::builder());
    let mut nameless = BTreeSet::new();
    let mut count = 0;
    let app = &mut harness.state_mut().app;
    app.insert("chair.obj".into());
    app.view.tool.placing = false;
    app.view.selection.object = Some(2);
    recorder.show(|snapshot| snapshot.insertion = Some(Arc::new(insertion(0))));
    for pane in Pane::all() {
        harness.state_mut().app.view.layout.front = Some(pane);
        harness.run_steps(3);
        count += look(&harness, &pane.title(), &mut nameless);
    }
    for menu in ["File", "Edit", "Solve", "View", "Window", "Help"] {
        harness.get_by_label(menu).click();
        harness.run_steps(3);
        count += look(&harness, menu, &mut nameless);
        harness.get_by_label(menu).click();
        harness.run_steps(3);
    }
    let sheets = [
        Action::Save,
        Action::SaveLayers,
        Action::SavePhotographs,
        Action::Probe,
    ];
    for action in sheets
        .into_iter()
        .chain([Action::Export, Action::Palette, Action::Keys])
    {
        let ctx = harness.ctx.clone();
        harness.state_mut().app.perform(action, &ctx);
        harness.run_steps(3);
        count += look(&harness, action.text(), &mut nameless);
        harness.key_press_modifiers(Modifiers::NONE, Key::Escape);
        harness.run_steps(3);
    }
    harness.state_mut().app.view.shell.start.asked = true;
    harness.run_steps(3);
    count += look(&harness, "start page", &mut nameless);
    assert!(count > 300, "only {count} controls were seen");
    assert!(nameless.is_empty(), "{nameless:#?}");
}
