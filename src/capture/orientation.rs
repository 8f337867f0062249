//! EXIF orientation: how a stored picture is mirrored and rotated for display.

use serde::{Deserialize, Serialize};

/// One of the eight orientations: an optional mirroring left to right, then a rotation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Orientation {
    /// Quarter turns clockwise, 0 to 3.
    pub turns: u8,
    /// Whether left and right are exchanged before the turn.
    pub mirrored: bool,
}

impl Orientation {
    /// A clockwise rotation by `turns` quarter turns.
    pub const fn turned(turns: u8) -> Self {
        Self {
            turns: turns % 4,
            mirrored: false,
        }
    }

    /// Left and right exchanged.
    pub const MIRRORED: Self = Self {
        turns: 0,
        mirrored: true,
    };

    /// The orientation of an EXIF value; `None` for values other than 1 to 8.
    pub fn from_exif(number: u32) -> Option<Self> {
        let (turns, mirrored) = match number {
            1 => (0, false),
            2 => (0, true),
            3 => (2, false),
            4 => (2, true),
            5 => (3, true),
            6 => (1, false),
            7 => (1, true),
            8 => (3, false),
            _ => return None,
        };
        Some(Self { turns, mirrored })
    }

    /// This orientation followed by `next`.
    pub fn then(self, next: Self) -> Self {
        let turns = if next.mirrored {
            4 - self.turns
        } else {
            self.turns
        };
        Self {
            turns: (turns + next.turns) % 4,
            mirrored: self.mirrored != next.mirrored,
        }
    }

    /// Width and height of the displayed picture, from those of the stored one.
    pub fn size(self, [width, height]: [u32; 2]) -> [u32; 2] {
        if self.turns.is_multiple_of(2) {
            [width, height]
        } else {
            [height, width]
        }
    }

    /// The pixels of a stored picture of `size` in display order, row by row; none of none.
    pub fn apply<T: Copy>(self, pixels: &[T], size: [u32; 2]) -> Vec<T> {
        if pixels.is_empty() {
            return Vec::new();
        }
        let [width, height] = size.map(|n| n as usize);
        let [shown_width, shown_height] = self.size(size).map(|n| n as usize);
        let stored = |x: usize, y: usize| {
            let (x, y) = match self.turns {
                0 => (x, y),
                1 => (y, height - 1 - x),
                2 => (width - 1 - x, height - 1 - y),
                _ => (width - 1 - y, x),
            };
            let x = if self.mirrored { width - 1 - x } else { x };
            pixels[y * width + x]
        };
        (0..shown_height)
            .flat_map(|y| (0..shown_width).map(move |x| (x, y)))
            .map(|(x, y)| stored(x, y))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_takes_the_left_column_to_the_top_row() {
        // 1 2 3      4 1
        // 4 5 6  ->  5 2
        //            6 3
        let shown = |orientation: Orientation| orientation.apply(&[1, 2, 3, 4, 5, 6], [3, 2]);
        assert_eq!(Orientation::turned(1).size([3, 2]), [2, 3]);
        assert_eq!(shown(Orientation::turned(1)), [4, 1, 5, 2, 6, 3]);
        assert_eq!(shown(Orientation::MIRRORED), [3, 2, 1, 6, 5, 4]);
    }

    #[test]
    fn two_orientations_in_turn_are_their_product() {
        let picture: Vec<u32> = (0..6).collect();
        let all = || (1..=8).filter_map(Orientation::from_exif);
        assert_eq!(all().count(), 8);
        for first in all() {
            for second in all() {
                let once = first.apply(&picture, [3, 2]);
                let twice = second.apply(&once, first.size([3, 2]));
                assert_eq!(first.then(second).apply(&picture, [3, 2]), twice);
            }
        }
        assert_eq!(Orientation::from_exif(9), None);
    }
}
