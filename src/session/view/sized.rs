//! Photographs at the size of a view.

use crate::math::picture::Picture;
use glam::Vec3;
use rayon::prelude::*;

/// Box-filters a picture to a smaller size: each new pixel is the mean over its area.
pub fn box_filter(from: &Picture, width: u32, height: u32) -> Picture {
    if (from.width, from.height) == (width, height) {
        return from.clone();
    }
    let columns = fractions(from.width, width);
    let rows = fractions(from.height, height);
    let pixels = rows
        .par_iter()
        .flat_map_iter(|row| {
            columns.iter().map(move |column| {
                let mut sum = Vec3::ZERO;
                for &(y, wy) in row {
                    let line = &from.pixels[y * from.width as usize..][..from.width as usize];
                    for &(x, wx) in column {
                        sum += line[x] * (wx * wy);
                    }
                }
                sum
            })
        })
        .collect();
    Picture {
        width,
        height,
        pixels,
    }
}

/// For each of `to` intervals over `from` cells: the cells that it covers, with weights that sum to 1.
fn fractions(from: u32, to: u32) -> Vec<Vec<(usize, f32)>> {
    let step = f64::from(from) / f64::from(to.max(1));
    (0..to)
        .map(|i| {
            let (low, high) = (f64::from(i) * step, f64::from(i + 1) * step);
            let last = (high.ceil() as usize).min(from as usize);
            (low as usize..last)
                .map(|cell| {
                    let overlap = high.min(cell as f64 + 1.0) - low.max(cell as f64);
                    (cell, (overlap.max(0.0) / step) as f32)
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_filtering_keeps_the_mean_and_gives_each_pixel_its_area() {
        let from = Picture::from_fn(5, 3, |x, y| Vec3::splat((5 * y + x) as f32));
        let to = box_filter(&from, 2, 3);
        // The first new pixel of a row covers two and a half old ones.
        assert!((to.pixels[0].x - (0.0 + 1.0 + 0.5 * 2.0) / 2.5).abs() < 1e-6);
        let mean = |p: &Picture| p.pixels.iter().map(|c| c.x).sum::<f32>() / p.pixels.len() as f32;
        assert!((mean(&to) - mean(&from)).abs() < 1e-5);
        let back = to.enlarged(5, 3);
        assert_eq!(back.pixels[0], to.pixels[0]);
        assert_eq!(back.pixels[14], to.pixels[5]);
    }
}
