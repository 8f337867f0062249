//! How large everything in the window is: as the screen asks for, or as a person chose.

use egui::{Context, ViewportCommand};

/// Size of the window at first, in points.
pub const WINDOW: [f32; 2] = [1280.0, 800.0];
/// A screen of this height in pixels or more, whose scale is not known, is taken for a dense one.
const DENSE: f32 = 2000.0;
/// How much larger everything is on those.
const DENSE_SIZE: f32 = 1.5;
/// Least and greatest size, and a step.
const SIZES: (f32, f32, f32) = (0.5, 4.0, 0.1);

/// The size that was set, and whether the window is still to grow with it.
#[derive(Debug, Default)]
pub struct Size {
    set: Option<f32>,
    grows: bool,
}

impl Size {
    /// Follows the size that a person chose, and remembers it in `chosen`; at first, that of the screen.
    pub fn follow(&mut self, ctx: &Context, chosen: &mut Option<f32>) {
        let now = ctx.zoom_factor();
        match (self.set, *chosen) {
            // Nothing was set yet.
            (None, Some(chosen)) => self.set(ctx, chosen),
            (None, None) => {
                let (screen, native) = ctx.input(|input| {
                    let viewport = input.viewport();
                    (viewport.monitor_size, viewport.native_pixels_per_point)
                });
                if let Some((screen, native)) = screen.zip(native) {
                    let height = screen.y * ctx.pixels_per_point();
                    let dense = native == 1.0 && height >= DENSE;
                    self.set(ctx, if dense { DENSE_SIZE } else { 1.0 });
                    self.grows = dense;
                }
            }
            // The window grows with what is in it, once that has its size.
            (Some(set), _) if set == now && self.grows => {
                self.grows = false;
                ctx.send_viewport_cmd(ViewportCommand::InnerSize(WINDOW.into()));
            }
            (Some(set), _) if set != now => (self.set, *chosen) = (Some(now), Some(now)),
            _ => {}
        }
    }

    /// Makes everything larger or smaller by steps; `None` takes the size back to that of the screen.
    pub fn resize(&mut self, ctx: &Context, chosen: &mut Option<f32>, steps: Option<f32>) {
        let Some(steps) = steps else {
            (self.set, *chosen) = (None, None);
            return;
        };
        let size = (ctx.zoom_factor() + steps * SIZES.2).clamp(SIZES.0, SIZES.1);
        let size = (size * 10.0).round() / 10.0;
        *chosen = Some(size);
        self.set(ctx, size);
    }

    fn set(&mut self, ctx: &Context, size: f32) {
        ctx.set_zoom_factor(size);
        self.set = Some(size);
    }
}
