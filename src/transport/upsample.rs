//! Enlarges a small render to the size of its view, guided by what each pixel sees (joint bilateral upsampling, Kopf et al. 2007).

use crate::math::picture::Picture;
use crate::transport::denoise::similarity;
use crate::transport::guide::Guide;
use glam::Vec3;
use rayon::prelude::*;

/// Weight of a pixel of the small render that sees another surface, so that a thin surface that it missed gets some light.
const OTHER_SURFACE: f32 = 1e-4;

/// The picture of a view from a smaller render of it. `seen` and `seen_small` are the features of both pictures' pixels.
///
/// Light, which is radiance over albedo, is averaged over the nearest 3 × 3 pixels of the small render by a quadratic B-spline and
/// by how alike the surfaces are. Emitters get their own radiance, and the background that of the small render.
pub fn upsample(
    small: &Picture,
    seen_small: &[Option<Guide>],
    size: [u32; 2],
    seen: &[Option<Guide>],
) -> Picture {
    let [width, height] = size;
    let light: Vec<Vec3> = (small.pixels.iter().zip(seen_small))
        .map(|(&radiance, guide)| match guide {
            Some(guide) => guide.demodulated(radiance),
            None => radiance,
        })
        .collect();
    let columns: Vec<_> = (0..width).map(|x| taps(x, width, small.width)).collect();
    let pixel = |pixel: usize| {
        let column = columns[pixel % width as usize];
        let row = taps((pixel / width as usize) as u32, height, small.height);
        let guide = seen[pixel].as_ref();
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (y, weight_y) in row {
            for (x, weight_x) in column {
                let from = y * small.width as usize + x;
                let alike = match (guide, &seen_small[from]) {
                    (None, None) => 1.0,
                    (guide, other) => similarity(guide, other.as_ref()),
                };
                let weight = weight_x * weight_y * (alike + OTHER_SURFACE);
                if light[from].is_finite() {
                    sum += light[from] * weight;
                    weights += weight;
                }
            }
        }
        let light = sum / weights.max(f32::MIN_POSITIVE);
        guide.map_or(light, |guide| guide.modulated(light))
    };
    let pixels = (0..width as usize * height as usize).into_par_iter();
    Picture {
        width,
        height,
        pixels: pixels.map(pixel).collect(),
    }
}

/// The pixels of a row or column of `small` pixels that pixel `i` of `count` is interpolated from, with their weights. Those beyond
/// the edge repeat the last one.
fn taps(i: u32, count: u32, small: u32) -> [(usize, f32); 3] {
    let at = (f64::from(i) + 0.5) * f64::from(small) / f64::from(count.max(1)) - 0.5;
    let middle = at.round();
    let off = (at - middle) as f32;
    let last = i64::from(small.max(1)) - 1;
    let pixel = |by: i64| (middle as i64 + by).clamp(0, last) as usize;
    [
        (pixel(-1), 0.5 * (0.5 - off).powi(2)),
        (pixel(0), 0.75 - off * off),
        (pixel(1), 0.5 * (0.5 + off).powi(2)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A floor in stripes of two colours, with a lamp on it and a wall of another object above; light that falls to the right.
    fn view(width: u32, height: u32) -> (Picture, Vec<Option<Guide>>) {
        let across = |x: u32| (x as f32 + 0.5) / width as f32;
        let guide = |x: u32, y: u32| {
            let (u, v) = (across(x), (y as f32 + 0.5) / height as f32);
            let wall = v < 0.5;
            let lamp = !wall && u > 0.7 && v > 0.7;
            (v > 0.1).then(|| Guide {
                point: Vec3::new(u, if wall { 0.5 - v } else { 0.0 }, 1.0),
                normal: if wall { Vec3::Z } else { Vec3::Y },
                depth: 1.0,
                albedo: Vec3::splat(if x % 4 < 2 { 0.2 } else { 0.6 }),
                emission: Vec3::splat(if lamp { 5.0 } else { 0.0 }),
                object: u32::from(wall) + 2 * u32::from(lamp),
            })
        };
        let guides: Vec<_> = (0..width * height)
            .map(|i| guide(i % width, i / width))
            .collect();
        let picture = Picture::from_fn(width, height, |x, y| {
            let light = if y < height / 2 {
                3.0
            } else {
                1.0 - 0.8 * across(x)
            };
            match &guides[(y * width + x) as usize] {
                Some(guide) => guide.albedo * light + guide.emission,
                None => Vec3::splat(7.0),
            }
        });
        (picture, guides)
    }

    #[test]
    fn colours_and_edges_are_as_sharp_as_the_view_and_light_is_smooth() {
        let (small, seen_small) = view(20, 20);
        let (truth, seen) = view(160, 160);
        let worst = |found: Picture| {
            let pixels = found.pixels.iter().zip(&truth.pixels);
            let off = pixels.map(|(a, b)| ((*a - *b) / *b).abs().max_element());
            off.fold(0.0, f32::max)
        };
        let from_small = worst(upsample(&small, &seen_small, [160, 160], &seen));
        // Half a pixel of the small render at the picture's edges, where light cannot be interpolated: 0.8 / 40 of light 0.2.
        assert!(from_small < 0.1, "{from_small}");
        // A render of the same size changes by its interpolation alone.
        let same = worst(upsample(&truth, &seen, [160, 160], &seen));
        assert!(same < 0.01, "{same}");
    }
}
