//! Saved sessions: the line that names the continued one, and the list of all.

use crate::app::action::Action;
use crate::app::controls::named;
use crate::app::request::Request;
use crate::app::shell::Sessions;
use crate::app::shell::status::ending;
use crate::app::view::Parts;
use crate::session::command::Command;
use crate::session::store::{Kept, State, THUMBNAIL};
use egui::{Button, Image, Role, ScrollArea, TextureHandle, TextureOptions, Ui, vec2};
use std::time::{Duration, SystemTime};

/// Height of a session's picture, in points.
const HEIGHT: f32 = 40.0;

pub fn line(ui: &mut Ui, parts: &mut Parts<'_>, name: &str) {
    ui.horizontal(|ui| {
        ui.label(format!(
            "This goes on with {name}, with its changes and objects."
        ));
        let over = Button::new(Action::StartOver.text());
        parts.requests.button(ui, Action::StartOver, over);
        let close = ui.button("Hide").on_hover_text("Hides this line");
        parts.view.shell.sessions.closed |= close.clicked();
    });
}

/// Draws the sheet of all sessions; true when it is to close.
pub fn sheet(ui: &mut Ui, parts: &mut Parts<'_>) -> bool {
    ui.heading("Sessions");
    let kept = &parts.document.snapshot.kept;
    let chosen = list(ui, parts, kept);
    chosen || ui.button("Cancel").clicked()
}

/// Draws sessions; true when one is chosen.
pub fn list(ui: &mut Ui, parts: &mut Parts<'_>, kept: &[Kept]) -> bool {
    if kept.is_empty() {
        ui.weak("None is kept yet");
        return false;
    }
    let mut chosen = false;
    ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
        for session in kept {
            ui.horizontal(|ui| chosen |= row(ui, parts, session));
        }
    });
    chosen
}

fn row(ui: &mut Ui, parts: &mut Parts<'_>, session: &Kept) -> bool {
    let (sessions, requests) = (&mut parts.view.shell.sessions, &mut *parts.requests);
    let place = vec2(HEIGHT * 1.5, HEIGHT);
    match sessions.picture(ui, session) {
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
    let open = named(open, Role::Button, &format!("Go on with {}", session.name));
    let help = "Goes on with this session; the open one is kept";
    let chosen = open.on_hover_text(help).clicked();
    if chosen {
        requests.ask(Request::Resume(session.folder.clone()));
    }
    let removing = sessions.removing.as_ref() == Some(&session.folder);
    let text = if removing { "For good?" } else { "Remove" };
    let remove = ui.add(Button::new(text).small());
    let remove = named(remove, Role::Button, &format!("{text} {}", session.name));
    if remove.clicked() && removing {
        sessions.removing = None;
        requests.ask(Request::Send(Command::Remove(session.folder.clone())));
    } else if remove.clicked() {
        sessions.removing = Some(session.folder.clone());
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
        let image = image::open(session.folder.join(THUMBNAIL)).ok();
        let read = image.map(|image| {
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

fn age(at: SystemTime) -> String {
    let seconds = at.elapsed().unwrap_or(Duration::ZERO).as_secs();
    match seconds {
        0..60 => "just now".to_owned(),
        60..3600 => format!("{} min ago", seconds / 60),
        3600..172_800 => format!("{} h ago", seconds / 3600),
        _ => format!("{} days ago", seconds / 86_400),
    }
}
