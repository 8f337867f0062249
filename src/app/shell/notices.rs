//! Events as they are shown: for a while as toasts, for good in the log.

use crate::app::theme;
use crate::session::snapshot::{Event, Level};
use egui::{Align2, Area, Color32, Frame, Order, Ui};
use std::time::{Duration, Instant};

/// How long a toast stays.
const SHOWN: Duration = Duration::from_secs(6);
/// Toasts at a time.
const TOASTS: usize = 4;

/// What happened, from the worker and from the window.
#[derive(Debug, Default)]
pub struct Notices {
    /// All, oldest first.
    pub log: Vec<Event>,
    toasts: Vec<(Event, Instant)>,
    taken: usize,
}

impl Notices {
    /// Takes over what the worker has added to its events since the last call.
    pub fn take(&mut self, events: &[Event]) {
        // A shorter list belongs to a new session.
        let new = events.get(self.taken..).unwrap_or(events).to_vec();
        self.taken = events.len();
        for event in new {
            self.add(event);
        }
    }

    /// Says something of the window's own.
    pub fn say(&mut self, level: Level, message: impl Into<String>) {
        self.add(Event {
            level,
            message: message.into(),
        });
    }

    fn add(&mut self, event: Event) {
        self.toasts.push((event.clone(), Instant::now()));
        if self.toasts.len() > TOASTS {
            self.toasts.remove(0);
        }
        self.log.push(event);
    }

    /// Draws the toasts above the status bar.
    pub fn show(&mut self, ctx: &egui::Context) {
        self.toasts.retain(|(_, since)| since.elapsed() < SHOWN);
        if self.toasts.is_empty() {
            return;
        }
        Area::new(egui::Id::unique("toasts"))
            .order(Order::Foreground)
            .anchor(Align2::RIGHT_BOTTOM, [-12.0, -64.0])
            .show(ctx, |ui| {
                ui.set_max_width(420.0);
                self.toasts.retain(|(event, _)| !toast(ui, event));
            });
        // The next to go is the oldest.
        if let Some((_, since)) = self.toasts.first() {
            ctx.request_repaint_after(SHOWN.saturating_sub(since.elapsed()));
        }
    }
}

/// Draws one toast; true when it is clicked away.
fn toast(ui: &mut Ui, event: &Event) -> bool {
    let color = level_color(ui, event.level);
    let frame = Frame::popup(ui.style()).stroke(egui::Stroke::new(1.0, color));
    let shown = frame.show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.colored_label(color, format!("{:?}", event.level));
            ui.add(egui::Label::new(&event.message).wrap().selectable(false));
        });
    });
    let response = shown.response.interact(egui::Sense::click());
    response.clicked()
}

pub fn level_color(ui: &Ui, level: Level) -> Color32 {
    let tokens = theme::tokens(ui);
    match level {
        Level::Info => tokens.train,
        Level::Warning => tokens.warning,
        Level::Error => tokens.error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_taken_once_and_a_shorter_list_starts_anew() {
        let event = |message: &str| Event {
            level: Level::Info,
            message: message.to_owned(),
        };
        let mut notices = Notices::default();
        notices.take(&[event("a")]);
        notices.take(&[event("a"), event("b")]);
        notices.take(&[event("a"), event("b")]);
        notices.take(&[event("c")]);
        let messages: Vec<_> = notices.log.iter().map(|e| e.message.as_str()).collect();
        assert_eq!(messages, ["a", "b", "c"]);
    }
}
