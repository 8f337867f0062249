//! The command palette: any action by a few letters of its name.

use crate::app::action::Action;
use crate::app::controls::named;
use crate::app::request::Requests;
use egui::{Align, Button, Id, Key, Modal, Modifiers, Role, ScrollArea, TextEdit};

/// What is typed, and which of the matches is marked.
#[derive(Debug, Clone, Default)]
pub struct Palette {
    pub query: String,
    /// Index among the matches.
    pub marked: usize,
}

/// Actions whose text or help holds all typed words; those whose text begins with what is typed come first.
pub fn matches(query: &str) -> Vec<Action> {
    let query = query.to_lowercase();
    let mut found: Vec<Action> = Action::ALL
        .iter()
        .copied()
        .filter(|action| {
            let text = format!("{} {}", action.text(), action.help()).to_lowercase();
            *action != Action::Palette && query.split_whitespace().all(|word| text.contains(word))
        })
        .collect();
    found.sort_by_key(|action| {
        let text = action.text().to_lowercase();
        (!text.starts_with(&query), !text.contains(&query))
    });
    found
}

pub fn show(ctx: &egui::Context, open: &mut Option<Palette>, requests: &mut Requests) {
    let Some(mut palette) = open.take() else {
        return;
    };
    let found = matches(&palette.query);
    let [down, up, enter] = [Key::ArrowDown, Key::ArrowUp, Key::Enter]
        .map(|key| ctx.input_mut(|input| input.consume_key(Modifiers::NONE, key)));
    if !found.is_empty() {
        let step = usize::from(down) + (found.len() - 1) * usize::from(up);
        palette.marked = (palette.marked.min(found.len() - 1) + step) % found.len();
    }
    let mut chosen = found.get(palette.marked).copied().filter(|_| enter);
    let modal = Modal::new(Id::unique("palette")).show(ctx, |ui| {
        ui.set_width(440.0);
        let field = TextEdit::singleline(&mut palette.query)
            .hint_text("Type a command")
            .desired_width(f32::INFINITY);
        let response = named(ui.add(field), Role::TextInput, "Command");
        if response.changed() {
            palette.marked = 0;
        }
        response.request_focus();
        ScrollArea::vertical()
            .max_height(320.0)
            .min_scrolled_height(320.0)
            .show(ui, |ui| {
                ui.with_layout(egui::Layout::top_down_justified(Align::Min), |ui| {
                    for (index, &action) in found.iter().enumerate() {
                        let button = Button::selectable(index == palette.marked, action.text())
                            .right_text(egui::RichText::new(action.keys(ctx)).weak());
                        let response = ui.add_enabled(requests.can(action), button);
                        if index == palette.marked && (up || down) {
                            response.scroll_to_me(None);
                        }
                        if response.on_hover_text(action.help()).clicked() {
                            chosen = Some(action);
                        }
                    }
                });
            });
    });
    if let Some(action) = chosen {
        requests.ask(action);
    } else if !modal.should_close() {
        *open = Some(palette);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_in_any_order_find_an_action_and_beginnings_come_first() {
        assert_eq!(matches("room built")[0], Action::OpenRoom);
        assert_eq!(matches("re")[0], Action::Redo);
        assert_eq!(matches("EXPORT")[0], Action::Export);
        assert!(matches("no such thing").is_empty());
        assert_eq!(matches("").len(), Action::ALL.len() - 1);
    }
}
