//! A picture of linear colours.

use glam::Vec3;

/// Linear colours, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear values; the owner defines their meaning.
    pub pixels: Vec<Vec3>,
}

impl Picture {
    /// A picture whose pixel (x, y) is `color(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut color: impl FnMut(u32, u32) -> Vec3) -> Self {
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            pixels.extend((0..width).map(|x| color(x, y)));
        }
        Self {
            width,
            height,
            pixels,
        }
    }

    /// Whether there is one colour for each pixel, and at least one pixel.
    pub fn is_whole(&self) -> bool {
        let expected = u64::from(self.width) * u64::from(self.height);
        expected > 0 && self.pixels.len() as u64 == expected
    }

    /// The picture resampled to another size by nearest neighbour.
    pub fn enlarged(&self, width: u32, height: u32) -> Self {
        let at = |i: u32, from: u32, to: u32| {
            (u64::from(i) * u64::from(from) / u64::from(to.max(1))) as usize
        };
        Self::from_fn(width, height, |x, y| {
            let (x, y) = (at(x, self.width, width), at(y, self.height, height));
            self.pixels[y * self.width as usize + x]
        })
    }
}
