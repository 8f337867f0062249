//! How large everything in the window is: as the screen asks for, or as a person chose.

use crate::app::run::WINDOW;
use crate::app::state::App;
use egui::ViewportCommand;

/// Screens from so many pixels high on, whose own scale is not known, are taken for dense ones.
const DENSE: f32 = 2000.0;
/// How much larger everything is on those.
const DENSE_SIZE: f32 = 1.5;
/// Least and greatest size, and a step.
const SIZES: (f32, f32, f32) = (0.5, 4.0, 0.1);

impl App {
    /// Follows the size that a person chose, and remembers it; at first, that of the screen.
    pub fn follow_size(&mut self, ctx: &egui::Context) {
        let now = ctx.zoom_factor();
        match (self.size, self.preferences.size) {
            // Nothing was set yet.
            (None, Some(chosen)) => self.set_size(ctx, chosen),
            (None, None) => {
                let (screen, native) = ctx.input(|input| {
                    let viewport = input.viewport();
                    (viewport.monitor_size, viewport.native_pixels_per_point)
                });
                if let Some((screen, native)) = screen.zip(native) {
                    let height = screen.y * ctx.pixels_per_point();
                    let dense = native == 1.0 && height >= DENSE;
                    self.set_size(ctx, if dense { DENSE_SIZE } else { 1.0 });
                    self.grows = dense;
                }
            }
            // The window grows with what is in it, once that has its size.
            (Some(set), _) if set == now && self.grows => {
                self.grows = false;
                ctx.send_viewport_cmd(ViewportCommand::InnerSize(WINDOW.into()));
            }
            (Some(set), _) if set != now => {
                self.size = Some(now);
                self.preferences.size = Some(now);
            }
            _ => {}
        }
    }

    /// Makes everything larger or smaller by steps; `None` takes the size back to that of the screen.
    pub fn resize(&mut self, ctx: &egui::Context, steps: Option<f32>) {
        let Some(steps) = steps else {
            (self.size, self.preferences.size) = (None, None);
            return;
        };
        let size = (ctx.zoom_factor() + steps * SIZES.2).clamp(SIZES.0, SIZES.1);
        let size = (size * 10.0).round() / 10.0;
        self.preferences.size = Some(size);
        self.set_size(ctx, size);
    }

    fn set_size(&mut self, ctx: &egui::Context, size: f32) {
        ctx.set_zoom_factor(size);
        self.size = Some(size);
    }
}
