//! False colours: the stops that the shader and the legends share, and the range that a picture needs.

use crate::app::picture::quantity::{Quantity, Shading};
use crate::session::snapshot::Picture;
use glam::Vec3;
use std::collections::HashMap;

/// Number of evenly spaced stops of a ramp.
pub const STOPS: usize = 7;

/// Blue over grey to red, sRGB values: below, at and above zero.
const SIGNED: [[f32; 3]; STOPS] = [
    [0.42, 0.78, 1.00],
    [0.16, 0.47, 0.90],
    [0.10, 0.20, 0.48],
    [0.12, 0.12, 0.13],
    [0.48, 0.13, 0.10],
    [0.90, 0.32, 0.16],
    [1.00, 0.74, 0.40],
];

/// Black over violet and orange to pale yellow, sRGB values, of rising lightness.
const POSITIVE: [[f32; 3]; STOPS] = [
    [0.02, 0.02, 0.06],
    [0.20, 0.06, 0.36],
    [0.45, 0.11, 0.43],
    [0.70, 0.19, 0.34],
    [0.90, 0.38, 0.19],
    [0.98, 0.66, 0.16],
    [0.99, 0.96, 0.68],
];

/// The stops of a shading, from its lowest value to its highest.
pub fn stops(shading: Shading) -> &'static [[f32; 3]; STOPS] {
    match shading {
        Shading::Signed => &SIGNED,
        _ => &POSITIVE,
    }
}

/// The sRGB colour at `t` in [0, 1].
pub fn color(shading: Shading, t: f32) -> [f32; 3] {
    let stops = stops(shading);
    let x = t.clamp(0.0, 1.0) * (STOPS - 1) as f32;
    let below = (x as usize).min(STOPS - 2);
    let mix = x - below as f32;
    std::array::from_fn(|c| stops[below][c] * (1.0 - mix) + stops[below + 1][c] * mix)
}

/// The 98th percentile of the magnitude, rounded up to 1, 2 or 5 times a power of ten. Negative pixels of a picture of
/// positive values are unknown and left out.
///
/// Looks at no more than about 4096 pixels. At least the smallest positive step, so that it may be divided by.
pub fn range(picture: &Picture, shading: Shading) -> f32 {
    let magnitude = |p: &Vec3| {
        let mean = p.element_sum() / 3.0;
        let known = shading == Shading::Signed || mean >= 0.0;
        known.then(|| mean.abs())
    };
    round_up(percentile(&picture.pixels, 4096, 0.98, magnitude))
}

/// The ends of scales, which stay while pictures fit them about.
#[derive(Debug, Default)]
pub struct Scales(HashMap<Quantity, f32>);

impl Scales {
    /// The end of a quantity's scale, whose newest picture needs `range`: it grows at once, and shrinks by four at least.
    pub fn follow(&mut self, quantity: Quantity, range: f32) -> f32 {
        let end = self.0.entry(quantity).or_insert(range);
        if range > *end || range * 4.0 <= *end {
            *end = range;
        }
        *end
    }
}

/// Stops of exposure that put the 99th percentile of a picture's brightest channel at 1.
pub fn automatic_exposure(pixels: &[Vec3]) -> f32 {
    let high = percentile(pixels, 16384, 0.99, |p| Some(p.max_element()));
    if high > 0.0 { -high.log2() } else { 0.0 }
}

/// The percentile of the finite values of about so many pixels; zero where there are none.
fn percentile(
    pixels: &[Vec3],
    looked_at: usize,
    fraction: f32,
    value: impl Fn(&Vec3) -> Option<f32>,
) -> f32 {
    let stride = (pixels.len() / looked_at).max(1);
    let values = pixels.iter().step_by(stride).filter_map(value);
    let mut values: Vec<f32> = values.filter(|v| v.is_finite()).collect();
    if values.is_empty() {
        return 0.0;
    }
    let index = ((values.len() - 1) as f32 * fraction) as usize;
    *values.select_nth_unstable_by(index, f32::total_cmp).1
}

fn round_up(value: f32) -> f32 {
    if value.is_nan() || value <= 0.0 {
        return 1e-3;
    }
    let power = 10f32.powf(value.log10().floor());
    let mut steps = [1.0, 2.0, 5.0, 10.0].into_iter().map(|step| step * power);
    steps.find(|&step| step >= value).unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_round_and_hold_nearly_all_pixels() {
        for (value, range) in [(0.013, 0.02), (0.5, 0.5), (7.0, 10.0), (0.0, 1e-3)] {
            assert!((round_up(value) - range).abs() < 1e-6 * range, "{value}");
        }
        let picture = Picture::from_fn(1000, 1, |x, _| Vec3::splat(x as f32 / 1000.0));
        assert_eq!(range(&picture, Shading::Positive), 1.0);
    }

    #[test]
    fn a_scale_stays_until_it_is_four_times_too_long() {
        let mut scales = Scales::default();
        let ends = [0.2, 0.1, 0.05, 0.02, 0.5].map(|range| scales.follow(Quantity::Error, range));
        assert_eq!(ends, [0.2, 0.2, 0.05, 0.05, 0.5]);
    }

    #[test]
    fn automatic_exposure_puts_the_99th_percentile_at_one() {
        let pixels: Vec<Vec3> = (0..=1000)
            .map(|i| Vec3::new(0.0, i as f32 / 250.0, 0.0))
            .collect();
        let exposure = automatic_exposure(&pixels);
        assert!((exposure.exp2() * 3.96 - 1.0).abs() < 1e-3);
        assert_eq!(automatic_exposure(&[Vec3::ZERO; 4]), 0.0);
        assert_eq!(automatic_exposure(&[Vec3::NAN]), 0.0);
    }

    #[test]
    fn ramps_meet_their_ends_and_positive_ones_grow_lighter() {
        assert_eq!(color(Shading::Signed, -1.0), SIGNED[0]);
        assert_eq!(color(Shading::Positive, 2.0), POSITIVE[STOPS - 1]);
        let lightness = |t: f32| color(Shading::Positive, t).iter().sum::<f32>();
        assert!((1..=20).all(|i| lightness(i as f32 / 20.0) > lightness((i - 1) as f32 / 20.0)));
    }
}
