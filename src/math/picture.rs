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

/// The pixels of a picture of a width and height that lie within `radius` rows and columns of one, itself included, row by row.
pub fn around(
    [width, height]: [usize; 2],
    pixel: usize,
    radius: usize,
) -> impl Iterator<Item = usize> {
    let near = move |at: usize, side: usize| at.saturating_sub(radius)..(at + radius + 1).min(side);
    near(pixel / width, height)
        .flat_map(move |y| near(pixel % width, width).map(move |x| y * width + x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_around_a_pixel_ends_at_the_edges() {
        let near = |pixel, radius| around([4, 3], pixel, radius).collect::<Vec<_>>();
        assert_eq!(near(0, 1), [0, 1, 4, 5]);
        assert_eq!(near(6, 1), [1, 2, 3, 5, 6, 7, 9, 10, 11]);
        assert_eq!(near(11, 2), [1, 2, 3, 5, 6, 7, 9, 10, 11]);
        assert_eq!(near(5, 0), [5]);
    }
}
