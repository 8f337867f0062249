//! Which frames get pictures.

/// Long side of the pictures in pixels if their number is limited.
const LONG_SIDE: u32 = 1024;
/// Which frames get pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// Every frame, at the photograph's size.
    All,
    /// At most this many, evenly spaced, of limited size.
    AtMost(usize),
}

impl Default for Frames {
    fn default() -> Self {
        Self::AtMost(16)
    }
}

impl Frames {
    /// The indices of the chosen frames among `count`.
    pub fn chosen(self, count: usize) -> Vec<usize> {
        match self {
            Self::AtMost(max) if max < count => (0..max).map(|i| i * count / max).collect(),
            _ => (0..count).collect(),
        }
    }

    /// Long side of the pictures in pixels, at most.
    pub fn long_side(self) -> u32 {
        match self {
            Self::All => u32::MAX,
            Self::AtMost(_) => LONG_SIDE,
        }
    }
}
