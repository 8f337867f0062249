//! Which two pictures are compared, and how.

use crate::app::choices::choices;
use crate::app::picture::quantity::Quantity;

choices! {
    /// How two pictures are compared.
    Mode {
        Wipe, "Wipe", "A line that can be dragged divides them";
        Flip, "Flip", "One at a time";
        SideBySide, "Side by side", "Both in full";
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
    /// What the photograph as it was changed is wiped against, in its own pane.
    pub against: Option<Quantity>,
}

impl Default for Compare {
    fn default() -> Self {
        Self {
            left: Quantity::Photograph,
            right: Quantity::Render,
            mode: Mode::Wipe,
            split: 0.5,
            against: None,
        }
    }
}

impl Compare {
    /// Swaps the two.
    pub fn flip(&mut self) {
        std::mem::swap(&mut self.left, &mut self.right);
    }
}
