//! Everything that can be asked of the window, once: menus, palette, shortcuts and the window of keys read this table.

use crate::app::controls::choices;
use egui::{Key, KeyboardShortcut, Modifiers};

/// One row: variant, menu, what it needs, text, tooltip, shortcut.
macro_rules! actions {
    ($($variant:ident, $menu:ident, $needs:ident, $text:literal, $help:literal, $shortcut:expr;)*) => {
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

            /// What must be there.
            pub fn needs(self) -> Needs {
                match self { $(Self::$variant => Needs::$needs,)* }
            }

            /// Its keys.
            pub fn shortcut(self) -> Option<KeyboardShortcut> {
                match self { $(Self::$variant => $shortcut,)* }
            }
        }
    };
}

choices! {
    /// A menu of the menu bar, from the left.
    Menu {
        File, "File", "Captures and results";
        Edit, "Edit", "Undo and inserted objects";
        Solve, "Solve", "The solver";
        View, "View", "Pictures and the 3D view";
        Window, "Window", "Panes and themes";
        Help, "Help", "Help";
    }
}

/// What must be there for an action to make sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    /// Nothing.
    Nothing,
    /// An open capture.
    Capture,
    /// An open capture with its objects regrouped as asked: edits go by an object's index.
    CurrentObjects,
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
    OpenFolder, File, Nothing, "Open capture…", "Chooses a capture's folder with a file dialog", ctrl(Key::O);
    OpenRoom, File, Nothing, "Open built-in room", "Opens the room that is built into the program", ctrl_shift(Key::O);
    Sessions, File, Nothing, "Sessions…", "Lists all sessions that are kept, to go on with one", None;
    StartPage, File, Nothing, "Start page", "Shows recent captures and the field for a typed path", ctrl(Key::N);
    Save, File, CurrentObjects, "Save results…", "Writes estimate, report and pictures into a folder", ctrl(Key::S);
    Export, File, CurrentObjects, "Export…", "Writes one file for another program", ctrl(Key::E);
    SaveLayers, File, CurrentObjects, "Save light layers…", "Writes the light of each lamp as a layer of one OpenEXR file", ctrl_shift(Key::S);
    SavePhotographs, File, CurrentObjects, "Save photographs…", "Writes all photographs, or one, with the inserted objects and in the changed light", ctrl_shift(Key::E);
    CancelPhotographs, File, Nothing, "Cancel photographs", "Ends the writing of photographs; those that are done stay", None;
    Probe, File, Capture, "Light probe by click…", "The light at the place of the next click as a panorama (.hdr or .exr), for other programs", None;
    SetScale, Edit, CurrentObjects, "Set the scale by two clicks…", "Two clicks in a view and the length between them make the capture's unit a metre", None;
    SetGround, Edit, CurrentObjects, "Set the ground by a click", "The clicked surface lies at height 0, and up is its normal", None;
    Quit, File, Nothing, "Quit", "Closes the window", ctrl(Key::Q);

    Undo, Edit, CurrentObjects, "Undo", "Takes back the last change to objects or light", ctrl(Key::Z);
    Redo, Edit, CurrentObjects, "Redo", "Makes the last change that was undone again", ctrl_shift(Key::Z);
    CopyPicture, Edit, Capture, "Copy picture", "Copies the picture under the pointer, whole and as it is seen, to the clipboard", ctrl_shift(Key::C);
    InsertObject, Edit, Capture, "Insert object…", "Shows the panel that puts OBJ and GLB objects into the photographs", ctrl(Key::I);
    Place, Edit, Nothing, "Place by click", "The next click in a view puts the chosen object there", key(Key::G);
    Duplicate, Edit, Nothing, "Duplicate object", "Copies the chosen inserted object", ctrl(Key::D);
    Delete, Edit, Nothing, "Delete object", "Takes the chosen inserted object away", key(Key::Delete);
    NaiveBesideOurs, Edit, Nothing, "Naive beside ours", "Shows the naive composite and ours side by side", None;
    WipeNaiveOurs, Edit, Capture, "Wipe naive and ours", "Shows the naive composite and ours under a wipe", ctrl(Key::W);
    BeforeAfter, Edit, Capture, "Before and after", "Shows the photograph as taken and as it was changed under a wipe", key(Key::B);
    WipeRender, Edit, Capture, "Wipe with the re-render", "Shows the re-render and the changed photograph under a wipe", ctrl(Key::B);
    Lights, Edit, Capture, "Lights", "Shows a switch, a strength and a colour for the light of each lamp", key(Key::L);
    ResetLights, Edit, CurrentObjects, "Reset all lights", "Puts all lamps and the light from outside back to what was found", None;
    Material, Edit, Capture, "Material", "Shows albedo, emission and gloss of the selected object, to be changed", key(Key::M);
    SwitchLamp, Edit, CurrentObjects, "Switch lamp off / on", "Switches the selected lamp off, or on again", key(Key::K);
    SolveOn, Solve, CurrentObjects, "Solve on with pinned values", "Holds the pinned values and solves the rest on from the last stage", ctrl_shift(Key::R);
    ResetMaterial, Edit, CurrentObjects, "Reset material", "Puts the selected object back to what was found", None;
    ResetEdits, Edit, CurrentObjects, "Reset all materials", "Puts all objects and the light from outside back to what was found", None;
    JoinObjects, Edit, CurrentObjects, "Join objects", "Makes one object of those that are chosen; Ctrl and a click choose more than one", ctrl(Key::J);
    CutOut, Edit, CurrentObjects, "Cut out by lasso…", "A line drawn around faces in the 3D view makes them an object of their own, of the chosen objects alone where any are", ctrl_shift(Key::X);
    RenameObject, Edit, CurrentObjects, "Rename object", "Puts the name of the selected object up for change, in the table of objects", key(Key::F2);
    Deselect, Edit, Nothing, "Deselect", "Selects nothing and ends placing", key(Key::Escape);

    RunPause, Solve, Capture, "Run / Pause", "Starts, holds or goes on with the solve", key(Key::Space);
    Step, Solve, Capture, "Step", "One iteration, then pause", key(Key::Period);
    Finish, Solve, Nothing, "Finish", "Ends the solve and keeps the estimate", None;
    Reset, Solve, Capture, "Reset", "Solves anew, with changes and objects as they are; the session so far is kept under File > Sessions", ctrl(Key::R);
    StartOver, Solve, Capture, "Start over", "Solves as if nothing had been done; the session so far is kept under File > Sessions", None;
    MeasureTrade, Solve, Nothing, "Measure / cancel the trade", "Measures what exactness costs in seconds on this capture, or ends the measurement", ctrl(Key::M);

    PreviousFrame, View, Capture, "Previous photograph", "Steps to the photograph before", key(Key::OpenBracket);
    NextFrame, View, Capture, "Next photograph", "Steps to the next photograph", key(Key::CloseBracket);
    ShowPhotograph, View, Nothing, "Hold to see the photograph", "While the key is down all pictures show the photograph", key(Key::P);
    Flip, View, Nothing, "Flip", "Swaps the two pictures of the comparison", key(Key::X);
    CompareMode, View, Nothing, "Wipe / flip / side by side", "Steps through the ways to compare two pictures", key(Key::C);
    Brighter, View, Nothing, "Brighter", "Half a stop more exposure", key(Key::Plus);
    Darker, View, Nothing, "Darker", "Half a stop less exposure", key(Key::Minus);
    AutoExposure, View, Capture, "Automatic exposure", "Puts the photograph's 99th percentile at 1", key(Key::Num0);
    ToneCurve, View, Nothing, "Next tone curve", "Steps through none, Reinhard and filmic", key(Key::T);
    FitPictures, View, Nothing, "Fit pictures", "Shows whole pictures", key(Key::Home);
    FrameSelection, View, Capture, "Frame selection", "Turns the 3D view to the selected object, or to the whole scene", key(Key::F);
    JumpToFrame, View, Capture, "View from photograph", "Puts the 3D view's camera where the photograph was taken", key(Key::J);
    RenderFromHere, View, Capture, "Re-render from 3D view", "Re-renders from the 3D view's camera instead of the photograph's", key(Key::R);

    Compose, Window, Nothing, "Compose", "Shows the photograph as you change it, large", ctrl(Key::Num1);
    Inspect, Window, Nothing, "Inspect", "Shows all pictures of the view in a grid", ctrl(Key::Num2);
    Thumbnails, Window, Nothing, "Thumbnails", "Shows or hides the strip of photographs", ctrl(Key::T);
    ResetLayout, Window, Nothing, "Reset layout", "Puts all panes back where they were at first", None;
    Larger, Window, Nothing, "Larger interface", "Makes everything in the window larger", ctrl(Key::Plus);
    Smaller, Window, Nothing, "Smaller interface", "Makes everything in the window smaller", ctrl(Key::Minus);
    OwnSize, Window, Nothing, "Interface as large as the screen asks for", "Takes the size of everything in the window back to that of the screen", ctrl(Key::Num0);
    Theme, Window, Nothing, "Light / dark theme", "Changes between the light and the dark theme", ctrl(Key::L);
    BlenderKeys, Window, Nothing, "Blender's keys on / off", "G, R and S move, rotate and scale the chosen object as in Blender; X, Y and Z hold an axis", None;

    Palette, Help, Nothing, "Command palette", "Finds any command by name", ctrl(Key::P);
    Keys, Help, Nothing, "Keys and mouse", "Shows what keys and mouse do", key(Key::Questionmark);
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
    // Keys that arrive together with a click belong to the field that was clicked.
    let clicked = ctx.input(|input| input.pointer.any_pressed() || input.pointer.any_released());
    let typing = start_page || clicked || ctx.text_edit_focused();
    // Longer combinations first, so that Ctrl+Shift+Z is not taken for Ctrl+Z.
    let length =
        |keys: KeyboardShortcut| u8::from(keys.modifiers.command) + u8::from(keys.modifiers.shift);
    let mut by_length = Action::ALL.to_vec();
    by_length.sort_by_key(|action| std::cmp::Reverse(action.shortcut().map_or(0, length)));
    by_length.retain(|action| {
        action.shortcut().is_some_and(|keys| {
            let plain = keys.modifiers.is_none() && keys.logical_key != Key::Escape;
            // The tool bar reads this key, which is held rather than pressed.
            let left = (plain && typing) || *action == Action::ShowPhotograph;
            !left && ctx.input_mut(|input| input.consume_shortcut(&keys))
        })
    });
    by_length
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
            let text = action.text();
            assert!(texts.insert(text) && !action.help().is_empty(), "{text}");
            let new = |s: KeyboardShortcut| {
                keys.insert((s.modifiers.command, s.modifiers.shift, s.logical_key))
            };
            assert!(
                action.shortcut().is_none_or(new),
                "{text} has keys of another"
            );
        }
        for menu in Menu::ALL {
            assert!(Action::ALL.iter().any(|action| action.menu() == menu));
        }
    }
}
