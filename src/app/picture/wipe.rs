//! Two pictures at a time: under a wipe, flipped, or side by side, with one exposure and tone curve.

use crate::app::controls::{choose, named};
use crate::app::picture::canvas;
use crate::app::picture::look::{Compare, Mode};
use crate::app::picture::quantity::Quantity;
use crate::app::theme;
use crate::app::view::Parts;
use egui::{Align2, Color32, FontId, Id, Rect, Role, Sense, Ui, UiBuilder, WidgetInfo, pos2, vec2};

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>) {
    let view = &mut *parts.view;
    view.needed.note(view.compare.left);
    view.needed.note(view.compare.right);
    theme::strip(ui, |ui| controls(ui, &mut view.compare));
    let rect = ui.available_rect_before_wrap();
    let (left, right) = (view.look.held(view.compare.left), view.compare.right);
    let shown = match view.compare.mode {
        Mode::Wipe => return wipe(ui, parts, rect, [left, right]),
        Mode::Flip => vec![(rect, left, "compared picture")],
        Mode::SideBySide => {
            let (a, b) = rect.split_left_right_at_fraction(0.5);
            let a = a.with_max_x(a.right() - 1.0);
            vec![(a, left, "first picture"), (b, right, "second picture")]
        }
    };
    for (rect, quantity, name) in shown {
        let Some(drawn) = parts.view.drawn(parts.document, quantity) else {
            canvas::missing(ui, parts, rect, quantity);
            continue;
        };
        canvas::interact(ui, parts, rect, &drawn, name);
        canvas::paint(ui, parts, rect, &drawn, Id::unique(("compare", name)));
        title(ui, rect, quantity, Align2::LEFT_TOP);
    }
}

fn controls(ui: &mut Ui, compare: &mut Compare) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        ui.spacing_mut().button_padding.x = 6.0;
        choose(ui, "First picture", 88.0, &mut compare.left);
        let swap = ui.button("‹ ›").on_hover_text("Swaps the two pictures (X)");
        if named(swap, Role::Button, "Swap").clicked() {
            compare.flip();
        }
        choose(ui, "Second picture", 88.0, &mut compare.right);
        for mode in Mode::ALL {
            ui.selectable_value(&mut compare.mode, mode, mode.name())
                .on_hover_text(mode.help());
        }
    });
}

/// Draws two pictures under a line that can be dragged.
pub fn wipe(ui: &mut Ui, parts: &mut Parts<'_>, rect: Rect, shown: [Quantity; 2]) {
    let pair = shown.map(|quantity| parts.view.drawn(parts.document, quantity));
    let [Some(a), Some(b)] = &pair else {
        let absent = shown[usize::from(pair[0].is_some())];
        canvas::missing(ui, parts, rect, absent);
        return;
    };
    canvas::interact(ui, parts, rect, a, "wiped pictures");
    let split = &mut parts.view.compare.split;
    let middle = pos2(rect.left() + rect.width() * *split, rect.center().y);
    let handle = Rect::from_center_size(middle, vec2(12.0, rect.height()));
    let response = ui
        .interact(handle, ui.scope_id().with("wipe"), Sense::drag())
        .on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
    response.widget_info(|| WidgetInfo::slider(true, f64::from(*split), "Wipe position"));
    if response.dragged()
        && let Some(pointer) = response.interact_pointer_pos()
    {
        *split = ((pointer.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
    }

    // Both are drawn over the whole pane and clipped at the line.
    let x = rect.left() + rect.width() * *split;
    for (drawn, clip, align, slot) in [
        (a, rect.with_max_x(x), Align2::LEFT_TOP, "wipe left"),
        (b, rect.with_min_x(x), Align2::RIGHT_TOP, "wipe right"),
    ] {
        let mut half = ui.new_child(UiBuilder::new().max_rect(rect));
        half.shrink_clip_rect(clip);
        canvas::paint(&half, parts, rect, drawn, Id::unique(slot));
        title(&half, rect, drawn.quantity, align);
    }
    let (painter, tokens) = (ui.painter(), theme::tokens(ui));
    painter.vline(x, rect.y_range(), (3.0, Color32::from_black_alpha(140)));
    painter.vline(x, rect.y_range(), (1.0, tokens.strong));
    let grip = pos2(x, rect.center().y);
    painter.circle(grip, 5.0, tokens.accent, (1.0, Color32::BLACK));
}

/// Names a picture in a corner of its pane.
fn title(ui: &Ui, rect: Rect, quantity: Quantity, align: Align2) {
    let (painter, font) = (ui.painter(), FontId::proportional(12.0));
    let galley = painter.layout_no_wrap(quantity.name().to_owned(), font, Color32::WHITE);
    let at = align.pos_in_rect(&rect.shrink(6.0));
    let text = align.anchor_size(at, galley.size());
    let behind = text.expand2(vec2(5.0, 2.0));
    painter.rect_filled(behind, 3.0, Color32::from_black_alpha(170));
    painter.galley(text.min, galley, Color32::WHITE);
}
