//! Linear RGB and sRGB. RGB always means linear light with the Rec. 709 primaries.

use glam::{DVec3, Vec3};

/// Rec. 709 luminance of a linear colour.
#[inline]
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Rec. 709 luminance of a linear colour, in f64.
#[inline]
pub fn luminance_f64(rgb: DVec3) -> f64 {
    rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Linear value of an sRGB-encoded value in [0, 1] (IEC 61966-2-1).
#[inline]
pub fn srgb_to_linear(v: f32) -> f32 {
    if v <= 0.04045 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }
}

/// sRGB-encoded value of a linear value; values outside [0, 1] are clamped.
#[inline]
pub fn linear_to_srgb(v: f32) -> f32 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.003_130_8 {
        v * 12.92
    } else {
        1.055 * v.powf(1.0 / 2.4) - 0.055
    }
}

/// 8-bit sRGB of a linear colour times an exposure; non-finite colours become magenta, to be noticed.
#[inline]
pub fn to_srgb8(rgb: Vec3, exposure: f32) -> [u8; 3] {
    if !rgb.is_finite() {
        return [255, 0, 255];
    }
    (rgb * exposure)
        .to_array()
        .map(|v| (linear_to_srgb(v) * 255.0 + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_curve_round_trips_and_meets_its_published_points() {
        for i in 0..=255u8 {
            let v = f32::from(i) / 255.0;
            assert!((linear_to_srgb(srgb_to_linear(v)) - v).abs() < 1e-6);
            assert_eq!(to_srgb8(Vec3::splat(srgb_to_linear(v)), 1.0), [i; 3]);
        }
        assert!((srgb_to_linear(0.5) - 0.214_041_14).abs() < 1e-6);
        assert_eq!(to_srgb8(Vec3::new(f32::NAN, 0.0, 0.0), 1.0), [255, 0, 255]);
    }
}
