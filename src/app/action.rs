//! Everything that can be asked of the window, once: menus, palette, shortcuts and the window of keys read this table.

use egui::{Key, KeyboardShortcut, Modifiers};

/// One row: variant, text, tooltip, menu, shortcut.
macro_rules! actions {
    ($($variant:ident, $menu:ident, $text:literal, $help:literal, $shortcut:expr;)*) => {
        /// An action of the window.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Action { $(#[doc = $help] $variant,)* }

        impl Action {
            /// All actions, in the order in which menus show them.
            pub const ALL: &'static [Action] = &[$(Action::$variant,)*];

            /// Its text in menus and in the palette.
            pub fn text(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }

            /// What it does, in a sentence.
            pub fn help(self) -> &'static str {
                match self { $(Self::$variant => $help,)* }
            }

            /// The menu that it is found in.
            pub fn menu(self) -> Menu {
                match self { $(Self::$variant => Menu::$menu,)* }
            }

            /// Its keys.
            pub fn shortcut(self) -> Option<KeyboardShortcut> {
                match self { $(Self::$variant => $shortcut,)* }
            }
        }
    };
}

/// A menu of the menu bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Menu {
    /// Captures and results.
    File,
    /// Undo and inserted objects.
    Edit,
    /// The solver.
    Solve,
    /// Pictures and the 3D view.
    View,
    /// Panes and themes.
    Window,
    /// Help.
    Help,
}

impl Menu {
    /// All menus, from the left.
    pub const ALL: [Menu; 6] = [
        Self::File,
        Self::Edit,
        Self::Solve,
        Self::View,
        Self::Window,
        Self::Help,
    ];

    /// Its title.
    pub fn title(self) -> &'static str {
        match self {
            Self::File => "File",
            Self::Edit => "Edit",
            Self::Solve => "Solve",
            Self::View => "View",
            Self::Window => "Window",
            Self::Help => "Help",
        }
    }
}

const fn key(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::NONE, key))
}

const fn ctrl(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::COMMAND, key))
}

const fn ctrl_shift(key: Key) -> Option<KeyboardShortcut> {
    let modifiers = Modifiers::COMMAND.plus(Modifiers::SHIFT);
    Some(KeyboardShortcut::new(modifiers, key))
}

actions! {
    OpenFolder, File, "Open capture…", "Chooses a capture's folder with a file dialog", ctrl(Key::O);
    OpenRoom, File, "Open built-in room", "Opens the room that is built into the program", ctrl_shift(Key::O);
    Sessions, File, "Sessions…", "Lists all sessions that are kept, to go on with one", None;
    StartPage, File, "Start page", "Shows recent captures and the field for a typed path", ctrl(Key::N);
    Save, File, "Save results…", "Writes estimate, report and pictures into a folder", ctrl(Key::S);
    Export, File, "Export…", "Writes one file for another program", ctrl(Key::E);
    SaveLayers, File, "Save light layers…", "Writes the light of each lamp as a layer of one OpenEXR file", ctrl_shift(Key::S);
    SavePhotographs, File, "Save photographs…", "Writes all photographs, or one, with the inserted objects and in the changed light", ctrl_shift(Key::E);
    CancelPhotographs, File, "Cancel photographs", "Ends the writing of photographs; those that are done stay", None;
    Probe, File, "Light probe by click…", "The light at the place of the next click as a panorama (.hdr or .exr), for other programs", None;
    SetScale, Edit, "Set the scale by two clicks…", "Two clicks in a view and the length between them make the capture's unit a metre", None;
    SetGround, Edit, "Set the ground by a click", "The clicked surface lies at height 0, and up is its normal", None;
    Screenshot, File, "Screenshot of the window", "Writes a picture of the whole window into the current folder", key(Key::F12);
    Quit, File, "Quit", "Closes the window", ctrl(Key::Q);

    Undo, Edit, "Undo", "Takes back the last change to objects or light", ctrl(Key::Z);
    Redo, Edit, "Redo", "Makes the last change that was undone again", ctrl_shift(Key::Z);
    CopyPicture, Edit, "Copy picture", "Copies the picture under the pointer, whole and as it is seen, to the clipboard", ctrl_shift(Key::C);
    InsertObject, Edit, "Insert object…", "Shows the panel that puts OBJ and GLB objects into the photographs", ctrl(Key::I);
    Place, Edit, "Place by click", "The next click in a view puts the chosen object there", key(Key::G);
    Duplicate, Edit, "Duplicate object", "Copies the chosen inserted object", ctrl(Key::D);
    Delete, Edit, "Delete object", "Takes the chosen inserted object away", key(Key::Delete);
    NaiveBesideOurs, Edit, "Naive beside ours", "Shows the naive composite and ours side by side", None;
    WipeNaiveOurs, Edit, "Wipe naive and ours", "Shows the naive composite and ours under a wipe", ctrl(Key::W);
    BeforeAfter, Edit, "Before and after", "Shows the photograph as taken and as it was changed under a wipe", key(Key::B);
    WipeRender, Edit, "Wipe with the re-render", "Shows the re-render and the changed photograph under a wipe", ctrl(Key::B);
    Lights, Edit, "Lights", "Shows a switch, a strength and a colour for the light of each lamp", key(Key::L);
    ResetLights, Edit, "Reset all lights", "Puts all lamps and the light from outside back to what was found", None;
    Material, Edit, "Material", "Shows albedo, emission and gloss of the selected object, to be changed", key(Key::M);
    SwitchLamp, Edit, "Switch lamp off / on", "Switches the selected lamp off, or on again", key(Key::K);
    SolveOn, Solve, "Solve on with pinned values", "Holds the pinned values and solves the rest on from the last stage", ctrl_shift(Key::R);
    ResetMaterial, Edit, "Reset material", "Puts the selected object back to what was found", None;
    ResetEdits, Edit, "Reset all materials", "Puts all objects and the light from outside back to what was found", None;
    JoinObjects, Edit, "Join objects", "Makes one object of those that are chosen; Ctrl and a click choose more than one", ctrl(Key::J);
    CutOut, Edit, "Cut out by lasso…", "A line drawn around faces in the 3D view makes them an object of their own, of the chosen objects alone where any are", ctrl_shift(Key::X);
    RenameObject, Edit, "Rename object", "Puts the name of the selected object up for change, in the table of objects", key(Key::F2);
    Deselect, Edit, "Deselect", "Selects nothing and ends placing", key(Key::Escape);

    RunPause, Solve, "Run / Pause", "Starts, holds or goes on with the solve", key(Key::Space);
    Step, Solve, "Step", "One iteration, then pause", key(Key::Period);
    Finish, Solve, "Finish", "Ends the solve and keeps the estimate", None;
    Reset, Solve, "Reset", "Solves anew, with changes and objects as they are; the session so far is kept under File > Sessions", ctrl(Key::R);
    StartOver, Solve, "Start over", "Solves as if nothing had been done; the session so far is kept under File > Sessions", None;
    MeasureTrade, Solve, "Measure / cancel the trade", "Measures what exactness costs in seconds on this capture, or ends the measurement", ctrl(Key::M);

    PreviousFrame, View, "Previous photograph", "Steps to the photograph before", key(Key::OpenBracket);
    NextFrame, View, "Next photograph", "Steps to the next photograph", key(Key::CloseBracket);
    ShowPhotograph, View, "Hold to see the photograph", "While the key is down all pictures show the photograph", key(Key::P);
    Flip, View, "Flip", "Swaps the two pictures of the comparison", key(Key::X);
    CompareMode, View, "Wipe / flip / side by side", "Steps through the ways to compare two pictures", key(Key::C);
    Brighter, View, "Brighter", "Half a stop more exposure", key(Key::Plus);
    Darker, View, "Darker", "Half a stop less exposure", key(Key::Minus);
    AutoExposure, View, "Automatic exposure", "Puts the photograph's 99th percentile at 1", key(Key::Num0);
    ToneCurve, View, "Next tone curve", "Steps through none, Reinhard and filmic", key(Key::T);
    FitPictures, View, "Fit pictures", "Shows whole pictures", key(Key::Home);
    FrameSelection, View, "Frame selection", "Turns the 3D view to the selected object, or to the whole scene", key(Key::F);
    JumpToFrame, View, "View from photograph", "Puts the 3D view's camera where the photograph was taken", key(Key::J);
    RenderFromHere, View, "Re-render from 3D view", "Re-renders from the 3D view's camera instead of the photograph's", key(Key::R);

    Compose, Window, "Compose", "Shows the photograph as you change it, large", ctrl(Key::Num1);
    Inspect, Window, "Inspect", "Shows all pictures of the view in a grid", ctrl(Key::Num2);
    Thumbnails, Window, "Thumbnails", "Shows or hides the strip of photographs", ctrl(Key::T);
    ResetLayout, Window, "Reset layout", "Puts all panes back where they were at first", None;
    Larger, Window, "Larger interface", "Makes everything in the window larger", ctrl(Key::Plus);
    Smaller, Window, "Smaller interface", "Makes everything in the window smaller", ctrl(Key::Minus);
    OwnSize, Window, "Interface as large as the screen asks for", "Takes the size of everything in the window back to that of the screen", ctrl(Key::Num0);
    Theme, Window, "Light / dark theme", "Changes between the light and the dark theme", ctrl(Key::L);

    Palette, Help, "Command palette", "Finds any command by name", ctrl(Key::P);
    Keys, Help, "Keys and mouse", "Shows what keys and mouse do", key(Key::Questionmark);
}

impl Action {
    /// Its keys in words, or an empty text.
    pub fn keys(self, ctx: &egui::Context) -> String {
        self.shortcut()
            .map(|shortcut| ctx.format_shortcut(&shortcut))
            .unwrap_or_default()
    }
}

/// The actions whose keys were pressed this frame, taken out of the input.
///
/// Plain keys are left to a focused text field.
pub fn pressed(ctx: &egui::Context, start_page: bool) -> Vec<Action> {
    // On the start page every letter belongs to the path.
    // What comes together with a click belongs to the field that was clicked.
    let clicked = ctx.input(|input| input.pointer.any_pressed() || input.pointer.any_released());
    let typing = start_page || clicked || ctx.text_edit_focused();
    let mut actions = Vec::new();
    // Longer combinations first, so that Ctrl+Shift+Z is not taken for Ctrl+Z.
    let mut by_length: Vec<Action> = Action::ALL.to_vec();
    by_length.sort_by_key(|action| {
        std::cmp::Reverse(action.shortcut().map_or(0, |s| {
            u8::from(s.modifiers.command) + u8::from(s.modifiers.shift)
        }))
    });
    for action in by_length {
        let Some(shortcut) = action.shortcut() else {
            continue;
        };
        // Held rather than pressed; see `App::show_photograph`.
        if action == Action::ShowPhotograph {
            continue;
        }
        let plain = shortcut.modifiers.is_none();
        if plain && typing && !matches!(shortcut.logical_key, Key::F12 | Key::Escape) {
            continue;
        }
        if ctx.input_mut(|input| input.consume_shortcut(&shortcut)) {
            actions.push(action);
        }
    }
    actions
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn no_two_actions_share_text_or_keys() {
        let mut texts = HashSet::new();
        let mut keys = HashSet::new();
        for action in Action::ALL {
            assert!(texts.insert(action.text()), "{}", action.text());
            assert!(!action.help().is_empty());
            if let Some(shortcut) = action.shortcut() {
                let press = (
                    shortcut.modifiers.command,
                    shortcut.modifiers.shift,
                    shortcut.logical_key,
                );
                assert!(
                    keys.insert(press),
                    "{} has keys of another action",
                    action.text()
                );
            }
        }
        assert!(
            Menu::ALL
                .iter()
                .all(|menu| Action::ALL.iter().any(|a| a.menu() == *menu))
        );
    }
}
