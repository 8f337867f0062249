//! Controls that several panes share, each with a name for those who do not see it, and what is chosen from lists.

use egui::emath::Numeric;
use egui::{Button, ComboBox, DragValue, Key, Response, Role, TextEdit, Ui, Widget, WidgetInfo};
use glam::{DVec3, Vec3};

/// A response with a name that is read out.
pub fn named(response: Response, role: Role, name: &str) -> Response {
    response.widget_info(|| WidgetInfo::labeled(role, true, name));
    response
}

/// A response that is on or off, with a name that is read out.
pub fn switched(response: Response, role: Role, on: bool, name: &str) -> Response {
    response.widget_info(|| WidgetInfo::selected(role, true, on, name));
    response
}

/// A control with a label before it.
pub fn labelled(ui: &mut Ui, label: &str, control: impl Widget) -> Response {
    let label = ui.label(label);
    ui.add(control).labelled_by(label.id)
}

/// A number that is dragged or typed, with a name that is read out and a help; true when changed.
///
/// A field that is left with the text it had keeps what its `decimals` do not show.
pub fn number_field<T: Numeric>(
    ui: &mut Ui,
    [name, help]: [&str; 2],
    value: &mut T,
    decimals: usize,
    shape: impl FnOnce(DragValue<'_>) -> DragValue<'_>,
) -> bool {
    let before = *value;
    let drag = DragValue::new(value).max_decimals(decimals);
    let response = ui.add(shape(drag));
    let response = match help {
        "" => response,
        help => response.on_hover_text(help),
    };
    let response = named(response, Role::SpinButton, name);
    let rounding = 0.5 * 10f64.powi(-(decimals as i32));
    if response.lost_focus() && (value.to_f64() - before.to_f64()).abs() <= rounding {
        *value = before;
        return false;
    }
    response.changed()
}

/// A field whose typed text counts once it is left: each change traces light anew.
pub fn when_left(drag: DragValue<'_>) -> DragValue<'_> {
    drag.update_while_editing(false)
}

/// Three numbers for a point of the capture, of which one is dragged by `speed` a point of the screen; true when changed.
pub fn point(ui: &mut Ui, name: &str, at: &mut DVec3, speed: f64) -> bool {
    let mut changed = false;
    for (axis, value) in ["x", "y", "z"].into_iter().zip(at.as_mut()) {
        let name = format!("{name} {axis}");
        changed |= number_field(ui, [&name, ""], value, 3, |drag| {
            drag.speed(speed).prefix(format!("{axis} "))
        });
    }
    changed
}

/// A button with a linear colour in [0, 1], which opens a picker for it; true when it was changed.
pub fn color_button(ui: &mut Ui, name: &str, help: &str, color: &mut Vec3) -> bool {
    let mut rgb = color.clamp(Vec3::ZERO, Vec3::ONE).to_array();
    let response = ui.color_edit_button_rgb(&mut rgb).on_hover_text(help);
    // The picker rounds; only what a hand changed is taken over.
    let changed = named(response, Role::ColorWell, name).changed();
    if changed {
        *color = Vec3::from_array(rgb).clamp(Vec3::ZERO, Vec3::ONE);
    }
    changed
}

/// A field for a path with a label; the field, and whether Enter was pressed in it.
pub fn path_field(
    ui: &mut Ui,
    label: &str,
    path: &mut String,
    hint: &str,
    width: f32,
) -> (Response, bool) {
    let field = TextEdit::singleline(path).hint_text(hint);
    let response = labelled(ui, label, field.desired_width(width));
    let enter = ui.input(|input| input.key_pressed(Key::Enter));
    let entered = response.lost_focus() && enter;
    (response, entered)
}

/// The two buttons at the end of a sheet: whether each was clicked.
pub fn go_or_cancel(ui: &mut Ui, go: &str, enabled: bool) -> (bool, bool) {
    ui.horizontal(|ui| {
        let cancel = ui.button("Cancel").clicked();
        let go = ui.add_enabled(enabled, Button::new(go)).clicked();
        (go, cancel)
    })
    .inner
}

/// What is chosen from a list.
pub trait Choice: Copy + PartialEq + 'static {
    /// All, in the order shown.
    const ALL: &'static [Self];

    /// Its name, and what it is in a sentence.
    fn name_and_help(self) -> (&'static str, &'static str);
}

/// A list that opens, to choose from.
pub fn choose<T: Choice>(ui: &mut Ui, name: &str, width: f32, value: &mut T) {
    let list = ComboBox::from_id_salt(name).width(width);
    let list = list.selected_text(value.name_and_help().0);
    let list = list.show_ui(ui, |ui| {
        for &choice in T::ALL {
            let (name, help) = choice.name_and_help();
            ui.selectable_value(value, choice, name).on_hover_text(help);
        }
    });
    named(list.response, Role::ComboBox, name);
}

/// Declares an enum of what a person chooses from a list: its values in the order shown, each as variant, name, what it is.
macro_rules! choices {
    ($(#[$meta:meta])* $name:ident { $($variant:ident, $text:literal, $help:literal;)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $name { $(#[doc = $help] $variant,)* }

        impl $name {
            /// All, in the order shown.
            pub const ALL: [Self; [$($text),*].len()] = [$(Self::$variant),*];

            /// The name shown.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }

            /// What it is, in a sentence.
            pub fn help(self) -> &'static str {
                match self { $(Self::$variant => $help,)* }
            }

            /// The next in order; the first after the last.
            pub fn next(self) -> Self {
                Self::ALL[(self as usize + 1) % Self::ALL.len()]
            }
        }

        impl $crate::app::controls::Choice for $name {
            const ALL: &'static [Self] = &Self::ALL;

            fn name_and_help(self) -> (&'static str, &'static str) {
                (self.name(), self.help())
            }
        }
    };
}

pub(crate) use choices;
