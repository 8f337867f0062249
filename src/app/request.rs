//! What panes ask of the window: an action of the menus, or a change with a value. The only way in which they change
//! the document or what runs; `perform` does it.

use crate::app::action::Action;
use crate::app::lights::Gain;
use crate::app::shell::dialogs::Ask;
use crate::app::shell::sheet::Wanted;
use crate::app::tool::Clicked;
use crate::app::trade::Stop;
use crate::compose::placement::Placement;
use crate::inverse::settings::Settings;
use crate::session::command::{Command, Source};
use crate::session::edits::ObjectEdit;
use crate::session::snapshot::Level;
use egui::{Button, Response, Ui};
use std::collections::HashSet;
use std::path::PathBuf;

#[derive(Debug, Clone)]
pub enum Request {
    Act(Action),
    /// A click in a view, on a surface or past all of them, and whether it adds to the selection.
    Click(Option<Clicked>, bool),
    /// Selects an object of the scene, or adds it to the selection.
    Select(Option<u32>, bool),
    /// Selects an object and shows it in the table.
    Reveal(u32),
    /// Shows a photograph.
    Show(usize),
    /// Shows a photograph, and the 3D view from its camera.
    LookThrough(usize),
    Open(Source),
    OpenPath(PathBuf),
    /// Goes on with a session that is kept.
    Resume(PathBuf),
    /// Ends the import of a scan; nothing is written of it.
    CancelImport,
    Browse(Ask),
    /// Adds the object in a file.
    Insert(PathBuf),
    /// Chooses an inserted object.
    Choose(usize),
    /// Places, turns or scales an inserted object, and chooses it.
    Place(usize, Placement),
    /// Hides an inserted object, or shows it again.
    Hide(usize, bool),
    /// Whether inserted objects take the blur and the grain of photographs.
    Finish(bool),
    /// Edits an object's material.
    Edit(usize, ObjectEdit),
    /// Changes the light of a lamp's objects; that from outside where there are none.
    Light(Vec<usize>, Gain),
    Rename(u32, String),
    /// Makes faces, in ascending order, an object of their own.
    CutOut(Vec<u32>),
    Set(Box<Settings>),
    /// Takes over the parameters of a curve of the trade, and stops there.
    Stop(usize, Stop),
    /// Writes the trade where it is found when the capture is opened next.
    KeepTrade,
    Photographs(Wanted),
    /// Makes a length in the capture's coordinates so many metres.
    Length(f64, f64),
    Send(Command),
    Say(Level, String),
}

impl From<Action> for Request {
    fn from(action: Action) -> Self {
        Self::Act(action)
    }
}

/// What was asked in a pass, and which actions make sense.
#[derive(Debug, Default)]
pub struct Requests {
    possible: HashSet<Action>,
    asked: Vec<Request>,
}

impl Requests {
    pub fn new(possible: HashSet<Action>) -> Self {
        let asked = Vec::new();
        Self { possible, asked }
    }

    /// Whether an action makes sense.
    pub fn can(&self, action: Action) -> bool {
        self.possible.contains(&action)
    }

    pub fn ask(&mut self, request: impl Into<Request>) {
        self.asked.push(request.into());
    }

    pub fn ask_all(&mut self, requests: impl IntoIterator<Item = Request>) {
        self.asked.extend(requests);
    }

    pub fn take(&mut self) -> Vec<Request> {
        std::mem::take(&mut self.asked)
    }

    /// Draws a button that asks for an action, enabled where it makes sense.
    pub fn button(&mut self, ui: &mut Ui, action: Action, button: Button<'_>) -> Response {
        self.button_with_help(ui, action, button, action.help())
    }

    /// Draws such a button with a help text of its own.
    pub fn button_with_help(
        &mut self,
        ui: &mut Ui,
        action: Action,
        button: Button<'_>,
        help: &str,
    ) -> Response {
        let response = ui.add_enabled(self.can(action), button).on_hover_text(help);
        if response.clicked() {
            self.ask(action);
        }
        response
    }
}
