//! Gaussian blur.

use glam::Vec3;
use rayon::prelude::*;
use std::iter::Sum;
use std::ops::{Div, Mul};

/// Below this standard deviation a sampled Gaussian has the wrong variance; a three-tap kernel of the exact variance is used.
const NARROW: f32 = 0.6;

/// A type that can be blurred.
pub trait Blend:
    Copy + Send + Sync + Sum + Mul<f32, Output = Self> + Div<f32, Output = Self>
{
}

impl Blend for f32 {}
impl Blend for Vec3 {}

/// Gaussian blur of a picture of `shape` (width, height) with a standard deviation in pixels along rows, or along columns if
/// `down`; the border pixel is repeated.
pub fn blurred<T: Blend>(values: &[T], shape: [usize; 2], deviation: f32, down: bool) -> Vec<T> {
    if deviation <= 0.0 || values.is_empty() {
        return values.to_vec();
    }
    let variance = deviation * deviation;
    let kernel: Vec<f32> = match deviation < NARROW {
        true => vec![0.5 * variance, 1.0 - variance, 0.5 * variance],
        false => {
            let reach = (3.0 * deviation).ceil() as i32;
            let weight = |i: i32| (-0.5 * (i * i) as f32 / variance).exp();
            (-reach..=reach).map(weight).collect()
        }
    };
    let reach = (kernel.len() / 2) as isize;
    let sum: f32 = kernel.iter().sum();
    let [width, height] = shape;
    (0..values.len())
        .into_par_iter()
        .map(|index| {
            let (x, y) = (index % width, index / width);
            let at = |i: isize| match down {
                false => y * width + (x as isize + i).clamp(0, width as isize - 1) as usize,
                true => (y as isize + i).clamp(0, height as isize - 1) as usize * width + x,
            };
            let terms = (-reach..=reach).zip(&kernel);
            terms.map(|(i, k)| values[at(i)] * *k).sum::<T>() / sum
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blur_keeps_the_sum_and_has_the_width_asked_for() {
        let [width, height] = [41, 31];
        let mut point = vec![Vec3::ZERO; width * height];
        point[15 * width + 20] = Vec3::ONE;
        let rows = blurred(&point, [width, height], 2.0, false);
        let soft = blurred(&rows, [width, height], 0.4, true);
        let moment = |power: i32, down: bool| -> f32 {
            let term = |(index, value): (usize, &Vec3)| {
                let away = match down {
                    false => (index % width) as f32 - 20.0,
                    true => (index / width) as f32 - 15.0,
                };
                value.x * away.powi(power)
            };
            soft.iter().enumerate().map(term).sum()
        };
        assert!((moment(0, false) - 1.0).abs() < 1e-5);
        for (down, wanted) in [(false, 4.0), (true, 0.16)] {
            let found = moment(2, down);
            assert!((found / wanted - 1.0).abs() < 0.05, "{found}");
        }
    }
}
