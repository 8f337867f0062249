//! Which two pictures are compared, and how.

use crate::app::picture::quantity::Quantity;

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
    /// All, in order.
    pub const ALL: [Mode; 3] = [Self::Wipe, Self::Flip, Self::SideBySide];

    /// Name shown to people.
    pub fn name(self) -> &'static str {
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

    /// Goes on to the next way of comparing.
    pub fn next_mode(&mut self) {
        self.mode = match self.mode {
            Mode::Wipe => Mode::Flip,
            Mode::Flip => Mode::SideBySide,
            Mode::SideBySide => Mode::Wipe,
        };
    }
}
