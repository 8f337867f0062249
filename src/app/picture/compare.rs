//! Two pictures at a time: under a wipe, flipped, or side by side, with one exposure and tone curve.

use crate::app::picture::canvas::{self, Drawn};
use crate::app::picture::quantity::Quantity;
use crate::app::state::App;
use crate::app::theme;
use egui::{Align2, Color32, ComboBox, FontId, Rect, Sense, Ui, pos2, vec2};

/// How two pictures are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// A line that can be dragged divides them.
    Wipe,
    /// One at a time.
    Flip,
    /// Both in full.
    SideBySide,
}

impl Mode {
    const ALL: [Mode; 3] = [Self::Wipe, Self::Flip, Self::SideBySide];

    fn name(self) -> &'static str {
        match self {
            Self::Wipe => "Wipe",
            Self::Flip => "Flip",
            Self::SideBySide => "Side by side",
        }
    }
}

/// The pictures compared, and how.
#[derive(Debug, Clone)]
pub struct Compare {
    /// The left or first picture.
    pub left: Quantity,
    /// The right or second picture.
    pub right: Quantity,
    /// How.
    pub mode: Mode,
    /// Where the wipe is, as a fraction of the pane's width.
    pub split: f32,
}

impl Default for Compare {
    fn default() -> Self {
        Self {
            left: Quantity::Photograph,
            right: Quantity::Render,
            mode: Mode::Wipe,
            split: 0.5,
        }
    }
}

impl Compare {
    /// Swaps the two.
    pub fn flip(&mut self) {
        std::mem::swap(&mut self.left, &mut self.right);
    }

    /// Goes on to the next way of comparing.
    pub fn next_mode(&mut self) {
        self.mode = match self.mode {
            Mode::Wipe => Mode::Flip,
            Mode::Flip => Mode::SideBySide,
            Mode::SideBySide => Mode::Wipe,
        };
    }
}

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    app.need(app.compare.left);
    app.need(app.compare.right);
    theme::strip(ui).show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        controls(ui, app);
    });
    let rect = ui.available_rect_before_wrap();
    let left = if app.look.photograph {
        Quantity::Photograph
    } else {
        app.compare.left
    };
    match app.compare.mode {
        Mode::Flip => one(ui, app, rect, left, "compared picture"),
        Mode::SideBySide => {
            let (a, b) = rect.split_left_right_at_fraction(0.5);
            one(
                ui,
                app,
                a.with_max_x(a.right() - 1.0),
                left,
                "first picture",
            );
            one(ui, app, b, app.compare.right, "second picture");
        }
        Mode::Wipe => wipe(ui, app, rect, left, app.compare.right),
    }
}

fn controls(ui: &mut Ui, app: &mut App) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        ui.spacing_mut().button_padding.x = 6.0;
        pick(ui, "First picture", &mut app.compare.left);
        let swap = ui.button("‹ ›").on_hover_text("Swaps the two pictures (X)");
        swap.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, "Swap"));
        if swap.clicked() {
            app.compare.flip();
        }
        pick(ui, "Second picture", &mut app.compare.right);
        for mode in Mode::ALL {
            ui.selectable_value(&mut app.compare.mode, mode, mode.name());
        }
    });
}

fn pick(ui: &mut Ui, name: &str, quantity: &mut Quantity) {
    let response = ComboBox::from_id_salt(name)
        .selected_text(quantity.name())
        .width(88.0)
        .show_ui(ui, |ui| {
            for choice in Quantity::ALL {
                ui.selectable_value(quantity, choice, choice.name())
                    .on_hover_text(choice.help());
            }
        })
        .response;
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, name));
}

fn one(ui: &mut Ui, app: &mut App, rect: Rect, quantity: Quantity, name: &str) {
    match app.drawn(quantity) {
        Some(drawn) => {
            canvas::interact(ui, app, rect, &drawn, name);
            canvas::paint(ui, app, rect, &drawn, egui::Id::unique(("compare", name)));
            canvas::overlay(ui, app, rect, &drawn);
            title(ui, rect, quantity, Align2::LEFT_TOP);
        }
        None => {
            let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(rect));
            canvas::missing(&mut ui, app, quantity);
        }
    }
}

/// Draws two pictures under a line that can be dragged.
pub fn wipe(ui: &mut Ui, app: &mut App, rect: Rect, left: Quantity, right: Quantity) {
    let (Some(a), Some(b)) = (app.drawn(left), app.drawn(right)) else {
        let absent = if app.drawn(left).is_none() {
            left
        } else {
            right
        };
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(rect));
        canvas::missing(&mut ui, app, absent);
        return;
    };
    canvas::interact(ui, app, rect, &a, "wiped pictures");
    let handle_x = rect.left() + rect.width() * app.compare.split;
    let handle = Rect::from_center_size(pos2(handle_x, rect.center().y), vec2(12.0, rect.height()));
    let response = ui
        .interact(handle, ui.scope_id().with("wipe"), Sense::drag())
        .on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
    response.widget_info(|| {
        egui::WidgetInfo::slider(true, f64::from(app.compare.split), "Wipe position")
    });
    if response.dragged()
        && let Some(pointer) = response.interact_pointer_pos()
    {
        app.compare.split = ((pointer.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
    }

    // Both are drawn over the whole pane and clipped at the line.
    let x = rect.left() + rect.width() * app.compare.split;
    let halves: [(&Drawn, Rect, Align2, &str); 2] = [
        (&a, rect.with_max_x(x), Align2::LEFT_TOP, "wipe left"),
        (&b, rect.with_min_x(x), Align2::RIGHT_TOP, "wipe right"),
    ];
    for (drawn, clip, align, slot) in halves {
        let mut half = ui.new_child(egui::UiBuilder::new().max_rect(rect));
        half.shrink_clip_rect(clip);
        canvas::paint(&half, app, rect, drawn, egui::Id::unique(slot));
        canvas::overlay(&half, app, rect, drawn);
        title(&half, rect, drawn.quantity, align);
    }
    let tokens = theme::tokens(ui);
    let painter = ui.painter();
    painter.vline(x, rect.y_range(), (3.0, Color32::from_black_alpha(140)));
    painter.vline(x, rect.y_range(), (1.0, tokens.strong));
    painter.circle(
        pos2(x, rect.center().y),
        5.0,
        tokens.accent,
        (1.0, Color32::BLACK),
    );
}

/// Names a picture in a corner of its pane.
fn title(ui: &Ui, rect: Rect, quantity: Quantity, align: Align2) {
    let inner = rect.shrink(6.0);
    let at = align.pos_in_rect(&inner);
    let painter = ui.painter();
    let galley = painter.layout_no_wrap(
        quantity.name().to_owned(),
        FontId::proportional(12.0),
        Color32::WHITE,
    );
    let text = align.anchor_size(at, galley.size());
    painter.rect_filled(
        text.expand2(vec2(5.0, 2.0)),
        3.0,
        Color32::from_black_alpha(170),
    );
    painter.galley(text.min, galley, Color32::WHITE);
}
