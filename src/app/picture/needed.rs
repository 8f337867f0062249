//! What the panes of one pass show, which is what the worker is asked for.

use crate::app::picture::quantity::Quantity;

/// What the panes of a pass need.
#[derive(Debug, Clone, Copy, Default)]
pub struct Needed {
    /// The most pixels that a pane shows along a side.
    pub pixels: f32,
    /// Whether a pane shows a composite.
    pub composite: bool,
    /// Whether a pane shows the re-render, or what is made of it.
    pub render: bool,
    /// Whether the light of each lamp is asked for apart.
    pub layers: bool,
    /// Whether a pane shows the irradiance.
    pub irradiance: bool,
}

impl Needed {
    /// Notes that a picture is shown.
    pub fn note(&mut self, quantity: Quantity) {
        use Quantity::{Composite, Error, Irradiance, Naive, NaiveEstimate, Render};
        self.composite |= matches!(quantity, Composite | Naive | NaiveEstimate);
        self.render |= matches!(quantity, Render | Error | Irradiance);
        self.irradiance |= quantity == Irradiance;
    }
}
