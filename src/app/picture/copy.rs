//! A picture as it is seen, for the clipboard: the arithmetic of `picture.wgsl` on the processor.

use crate::app::picture::drawn::Drawn;
use crate::app::picture::look::{Look, ToneCurve};
use crate::app::picture::quantity::Shading;
use crate::app::picture::ramp;
use crate::math::color::to_srgb8;
use egui::{Color32, ColorImage};
use glam::Vec3;

/// All pixels of a picture in the colours that panes show.
pub fn as_seen(drawn: &Drawn, look: &Look) -> ColorImage {
    let picture = &drawn.picture;
    let shading = drawn.quantity.shading();
    let colors = picture.pixels.iter().map(|&value| {
        let [r, g, b] = color(value, shading, drawn.range, look);
        Color32::from_rgb(r, g, b)
    });
    let size = [picture.width as usize, picture.height as usize];
    ColorImage::new(size, colors.collect())
}

fn color(value: Vec3, shading: Shading, range: f32, look: &Look) -> [u8; 3] {
    if !value.is_finite() {
        return [255, 0, 255];
    }
    let mean = value.element_sum() / 3.0;
    let ramp = |t: f32| ramp::color(shading, t.clamp(0.0, 1.0)).map(|v| (v * 255.0).round() as u8);
    match shading {
        Shading::Reflectance => to_srgb8(value, 1.0),
        Shading::Signed => ramp(0.5 + 0.5 * mean / range),
        Shading::Positive if mean < 0.0 => [136; 3],
        Shading::Positive => ramp(mean / range),
        Shading::Radiance => {
            let x = value.max(Vec3::ZERO) * look.exposure.exp2();
            let toned = match look.tone {
                ToneCurve::None => x,
                ToneCurve::Reinhard => x / (1.0 + x),
                ToneCurve::Filmic => (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14),
            };
            to_srgb8(toned, 1.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::color::srgb_to_linear;

    #[test]
    fn radiance_is_exposed_reflectance_is_not_and_what_is_no_number_is_magenta() {
        let look = Look {
            exposure: 1.0,
            ..Look::default()
        };
        let grey = Vec3::splat(srgb_to_linear(128.0 / 255.0));
        for (value, shading, expected) in [
            (grey * 0.5, Shading::Radiance, [128; 3]),
            (grey, Shading::Reflectance, [128; 3]),
            (Vec3::NAN, Shading::Radiance, [255, 0, 255]),
        ] {
            assert_eq!(color(value, shading, 1.0, &look), expected);
        }
    }
}
