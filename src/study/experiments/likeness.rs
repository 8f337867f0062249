//! Similarity of two pictures over a mask.

use crate::math::color::linear_to_srgb;
use crate::math::picture::Picture;
use glam::Vec3;

/// Radius of the Gaussian window of SSIM in pixels (Wang et al. 2004).
const REACH: i64 = 5;
/// Standard deviation of the window in pixels.
const DEVIATION: f64 = 1.5;
/// Stabilising constants of SSIM for values from 0 to 1.
const C1: f64 = 1e-4;
const C2: f64 = 9e-4;

/// Differences summed over the pixels of one or more pairs of pictures.
#[derive(Debug, Clone, Copy, Default)]
pub struct Likeness {
    pixels: f64,
    linear: f64,
    level: f64,
    shown: f64,
    similar: f64,
}

impl Likeness {
    /// Adds the masked pixels of a pair, both displayed at the same exposure.
    pub fn add(&mut self, picture: &Picture, truth: &Picture, exposure: f32, mask: &[bool]) {
        let similarity = similarity(&shown(picture, exposure), &shown(truth, exposure), truth);
        let pixels = picture.pixels.iter().zip(&truth.pixels);
        for (index, (&a, &b)) in pixels.enumerate().filter(|(i, _)| mask[*i]) {
            let display = |v: Vec3| (v * exposure).map(linear_to_srgb);
            self.pixels += 1.0;
            self.linear += f64::from((a - b).length_squared()) / 3.0;
            self.level += f64::from(b.element_sum()) / 3.0;
            self.shown += f64::from((display(a) - display(b)).length_squared()) / 3.0;
            self.similar += similarity[index];
        }
    }

    /// Root mean square difference of radiance, relative to the mean of the true one.
    pub fn relative(&self) -> f64 {
        (self.linear / self.pixels).sqrt() / (self.level / self.pixels)
    }

    /// Peak signal-to-noise ratio of the displayed pictures in dB, peak 1.
    pub fn psnr(&self) -> f64 {
        -10.0 * (self.shown / self.pixels).log10()
    }

    /// Mean structural similarity of the displayed pictures in greyscale.
    pub fn ssim(&self) -> f64 {
        self.similar / self.pixels
    }

    pub fn pixels(&self) -> f64 {
        self.pixels
    }
}

/// Displayed greyscale values.
fn shown(picture: &Picture, exposure: f32) -> Vec<f64> {
    let grey = |v: &Vec3| (*v * exposure).map(linear_to_srgb).element_sum() / 3.0;
    picture.pixels.iter().map(|v| f64::from(grey(v))).collect()
}

/// SSIM at each pixel; the window is clipped at the border.
fn similarity(a: &[f64], b: &[f64], size: &Picture) -> Vec<f64> {
    let (width, height) = (i64::from(size.width), i64::from(size.height));
    let about = |x: i64, y: i64| {
        let (mut weight, mut sums) = (0.0, [0.0; 5]);
        for (u, v) in (-REACH..=REACH).flat_map(|v| (-REACH..=REACH).map(move |u| (x + u, y + v))) {
            if u < 0 || v < 0 || u >= width || v >= height {
                continue;
            }
            let squared = ((u - x).pow(2) + (v - y).pow(2)) as f64;
            let w = (-0.5 * squared / (DEVIATION * DEVIATION)).exp();
            let at = (v * width + u) as usize;
            let (p, q) = (a[at], b[at]);
            weight += w;
            for (sum, value) in sums.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                *sum += w * value;
            }
        }
        let [p, q, pp, qq, pq] = sums.map(|sum| sum / weight);
        let (spread, common) = (pp - p * p + qq - q * q, pq - p * q);
        (2.0 * p * q + C1) * (2.0 * common + C2) / ((p * p + q * q + C1) * (spread + C2))
    };
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    places.map(|(x, y)| about(x, y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_are_alike_and_a_known_difference_is_measured() {
        let truth = Picture::from_fn(16, 12, |x, y| {
            Vec3::splat(0.1 + 0.05 * ((x + y) % 7) as f32)
        });
        let mask = vec![true; truth.pixels.len()];
        let mut same = Likeness::default();
        same.add(&truth, &truth, 1.0, &mask);
        assert_eq!((same.relative(), same.psnr()), (0.0, f64::INFINITY));
        assert!((same.ssim() - 1.0).abs() < 1e-12);

        // Linear values 0 and 1 are displayed as 0 and 1: half of the pixels completely wrong is 3 dB.
        let [black, half] =
            [0, 1].map(|n| Picture::from_fn(16, 12, |x, _| Vec3::splat(((x % 2) * n) as f32)));
        let mut wrong = Likeness::default();
        wrong.add(&black, &half, 1.0, &mask);
        assert!((wrong.psnr() - 10.0 * 2f64.log10()).abs() < 1e-5);
        assert!((wrong.relative() - 2f64.sqrt()).abs() < 1e-6);
        assert!(wrong.ssim() < 0.1);
        // Pixels outside of the mask do not count.
        let mut masked = Likeness::default();
        let even: Vec<bool> = (0..16 * 12).map(|i| i % 2 == 0).collect();
        masked.add(&black, &half, 1.0, &even);
        assert_eq!((masked.pixels(), masked.psnr()), (96.0, f64::INFINITY));
    }
}
