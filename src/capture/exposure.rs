//! The imaging model from radiance to pixel values: exposure, white balance, vignetting and the camera response.

use crate::capture::camera::Intrinsics;
use crate::capture::response::Response;
use crate::math::picture::Picture;
use glam::{DVec2, Vec3};
use rayon::prelude::*;

/// Vignetting: a factor cosᵖ θ for the angle θ from the optical axis.
///
/// An ideal lens has p = 4 (the cos⁴ law); sensors and in-camera corrections change the power.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vignetting {
    /// The power p, per channel.
    pub power: Vec3,
}

impl Vignetting {
    /// ln cos θ for a point of the image plane, in pixels from the top-left corner. Ignores lens distortion.
    pub fn off_axis(lens: &Intrinsics, point: DVec2) -> f64 {
        -0.5 * lens.normalized(point).length_squared().ln_1p()
    }

    /// The factor at a point of the image plane, in pixels from the top-left corner.
    pub fn factor(&self, lens: &Intrinsics, point: DVec2) -> Vec3 {
        let off_axis = Self::off_axis(lens, point);
        (self.power.as_dvec3() * off_axis).map(f64::exp).as_vec3()
    }
}

/// Exposure, vignetting and response of one photograph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Exposure and white balance: the factor on the optical axis, per channel.
    pub factor: Vec3,
    /// Vignetting, where there is any.
    pub vignetting: Option<Vignetting>,
    /// Camera response; `None` where values are linear in light.
    pub response: Option<Response>,
}

impl Default for Exposure {
    /// Values are radiance.
    fn default() -> Self {
        Self {
            factor: Vec3::ONE,
            vignetting: None,
            response: None,
        }
    }
}

impl Exposure {
    /// The factor from radiance to light on the sensor at a pixel's centre. `pixel` counts row by row from the top left of a
    /// picture of the given size, which may differ from the lens's.
    pub fn at(&self, lens: &Intrinsics, [width, height]: [u32; 2], pixel: usize) -> Vec3 {
        let Some(vignetting) = &self.vignetting else {
            return self.factor;
        };
        let columns = width.max(1) as usize;
        let middle = DVec2::new((pixel % columns) as f64, (pixel / columns) as f64) + 0.5;
        let [across, down] = [(lens.width, width), (lens.height, height)]
            .map(|(lens, picture)| f64::from(lens) / f64::from(picture.max(1)));
        self.factor * vignetting.factor(lens, middle * DVec2::new(across, down))
    }

    /// The light on the sensor of a pixel value, both in units of the photograph, whose values saturate at `saturation`.
    pub fn light(&self, value: Vec3, saturation: Vec3) -> Vec3 {
        match &self.response {
            Some(response) => response.light(value, saturation),
            None => value,
        }
    }

    /// The pixel value of light on the sensor: the inverse of [`Exposure::light`].
    pub fn value(&self, light: Vec3, saturation: Vec3) -> Vec3 {
        match &self.response {
            Some(response) => response.value(light, saturation),
            None => light,
        }
    }

    /// Converts radiance to pixel values that saturate at `saturation`, in place.
    pub fn apply(&self, lens: &Intrinsics, saturation: Vec3, picture: &mut Picture) {
        let size = [picture.width, picture.height];
        picture
            .pixels
            .par_iter_mut()
            .enumerate()
            .for_each(|(pixel, value)| {
                *value = self.value(*value * self.at(lens, size, pixel), saturation);
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: Intrinsics = Intrinsics::plain([80, 60], [50.0; 2], [40.0, 30.0]);

    #[test]
    fn the_lens_dims_by_the_angle_from_its_axis_alone() {
        let vignetting = Vignetting {
            power: Vec3::new(0.0, 1.0, 4.0),
        };
        let at = |x, y| vignetting.factor(&LENS, DVec2::new(x, y));
        assert_eq!(at(40.0, 30.0), Vec3::ONE);
        // The corners lie 45° off the axis.
        for (x, y) in [(0.0, 0.0), (80.0, 60.0), (0.0, 60.0)] {
            let off = at(x, y) - Vec3::new(1.0, 0.5f32.sqrt(), 0.25);
            assert!(off.abs().max_element() < 1e-6);
        }
    }

    #[test]
    fn a_smaller_picture_through_the_lens_is_dimmed_alike() {
        let exposure = Exposure {
            factor: Vec3::new(2.0, 1.0, 0.5),
            vignetting: Some(Vignetting {
                power: Vec3::splat(4.0),
            }),
            response: None,
        };
        // Four pixels of the large picture around the middle of one of the small.
        let large = |x: usize, y: usize| exposure.at(&LENS, [80, 60], y * 80 + x);
        let around = (large(8, 4) + large(9, 4) + large(8, 5) + large(9, 5)) / 4.0;
        let small = exposure.at(&LENS, [40, 30], 2 * 40 + 4);
        assert!((small - around).abs().max_element() < 1e-3);
        assert_eq!(Exposure::default().at(&LENS, [40, 30], 7), Vec3::ONE);
    }
}
