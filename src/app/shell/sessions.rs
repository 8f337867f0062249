//! Sessions that are kept: the line that says which one is gone on with, and the list of all.

use crate::app::action::Action;
use crate::app::shell::status::ending;
use crate::app::state::App;
use crate::app::theme;
use crate::session::command::Command;
use crate::session::keep::{Kept, State, THUMBNAIL};
use egui::{Button, Image, Role, ScrollArea, TextureHandle, TextureOptions, Ui, WidgetInfo, vec2};
use std::collections::HashMap;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// Height of a session's picture, in points.
const HEIGHT: f32 = 40.0;

/// What the list shows beside what the worker tells.
#[derive(Default)]
pub struct Sessions {
    /// Whether the line that says which session is gone on with was closed.
    pub closed: bool,
    /// The session whose button to remove it was clicked once.
    doomed: Option<PathBuf>,
    pictures: HashMap<PathBuf, (SystemTime, Option<TextureHandle>)>,
}

/// Whether there is a line to draw.
pub fn has_line(app: &App) -> bool {
    app.snapshot.continued.is_some() && !app.sessions.closed && !app.shows_start_page()
}

/// Draws the line that says which session is gone on with.
pub fn line(ui: &mut Ui, app: &mut App) {
    let name = app.snapshot.continued.clone().unwrap_or_default();
    ui.horizontal(|ui| {
        ui.label(format!(
            "This goes on with {name}, with its changes and objects."
        ));
        let over = ui.button(Action::StartOver.text());
        if over.on_hover_text(Action::StartOver.help()).clicked() {
            app.perform(Action::StartOver, &ui.ctx().clone());
        }
        let close = ui.button("Hide").on_hover_text("Hides this line");
        app.sessions.closed |= close.clicked();
    });
}

/// Draws the sheet of all sessions; true when it is to close.
pub fn sheet(ui: &mut Ui, app: &mut App) -> bool {
    ui.heading("Sessions");
    let chosen = list(ui, app, usize::MAX);
    chosen || ui.button("Cancel").clicked()
}

/// Draws the newest sessions, at most so many; true when one is chosen.
pub fn list(ui: &mut Ui, app: &mut App, most: usize) -> bool {
    let kept = app.snapshot.kept.clone();
    if kept.is_empty() {
        ui.weak("None is kept yet");
        return false;
    }
    let mut chosen = false;
    ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
        for session in kept.iter().take(most) {
            ui.horizontal(|ui| chosen |= row(ui, app, session));
        }
    });
    chosen
}

fn row(ui: &mut Ui, app: &mut App, session: &Kept) -> bool {
    let picture = app.sessions.picture(ui, session);
    let place = vec2(HEIGHT * 1.5, HEIGHT);
    match picture {
        Some(texture) => ui.add(Image::new(&texture).fit_to_exact_size(place)),
        None => ui.allocate_response(place, egui::Sense::hover()),
    };
    let state = match session.state {
        State::Solving => "not at its end",
        State::Paused => "paused",
        State::Finished(why) => ending(why),
    };
    let text = format!("{}\n{state}, {}", session.name, age(session.saved));
    let open = ui.add(Button::new(text).min_size(vec2(220.0, HEIGHT)));
    open.widget_info(|| {
        WidgetInfo::labeled(Role::Button, true, format!("Go on with {}", session.name))
    });
    let chosen = open
        .on_hover_text("Goes on with this session; the open one is kept")
        .clicked();
    if chosen {
        app.start_page = false;
        app.send(Command::Resume(session.folder.clone()));
    }
    let doomed = app.sessions.doomed.as_ref() == Some(&session.folder);
    let text = if doomed { "For good?" } else { "Remove" };
    let remove = ui.add(Button::new(text).small());
    remove.widget_info(|| {
        WidgetInfo::labeled(Role::Button, true, format!("{text} {}", session.name))
    });
    if remove.clicked() && doomed {
        app.sessions.doomed = None;
        app.send(Command::Remove(session.folder.clone()));
    } else if remove.clicked() {
        app.sessions.doomed = Some(session.folder.clone());
    }
    chosen
}

impl Sessions {
    /// The small picture of a session, read once after each save.
    fn picture(&mut self, ui: &Ui, session: &Kept) -> Option<TextureHandle> {
        let known = self.pictures.get(&session.folder);
        if let Some((_, picture)) = known.filter(|(saved, _)| *saved == session.saved) {
            return picture.clone();
        }
        let read = image::open(session.folder.join(THUMBNAIL))
            .ok()
            .map(|image| {
                let image = image.to_rgb8();
                let size = [image.width() as usize, image.height() as usize];
                let image = egui::ColorImage::from_rgb(size, image.as_raw());
                let name = session.folder.display().to_string();
                ui.ctx().load_texture(name, image, TextureOptions::LINEAR)
            });
        let entry = (session.saved, read.clone());
        self.pictures.insert(session.folder.clone(), entry);
        read
    }
}

/// How long ago something was.
fn age(at: SystemTime) -> String {
    let seconds = at.elapsed().unwrap_or(Duration::ZERO).as_secs();
    match seconds {
        0..60 => "just now".to_owned(),
        60..3600 => format!("{} min ago", seconds / 60),
        3600..172_800 => format!("{} h ago", seconds / 3600),
        _ => format!("{} days ago", seconds / 86_400),
    }
}

/// Height of the line in the window.
pub const LINE: f32 = theme::ROW + 8.0;
