//! Procedural textures of the built-in room.

use crate::math::picture::Picture;
use crate::math::rng::splitmix64;
use glam::{Vec2, Vec3};

/// Number of spines in the picture of [`books`].
pub const SPINES: u32 = 16;

/// A woven rug: a border and two rows of nested diamonds, (u, v) over its length and width.
pub fn rug() -> Picture {
    const CREAM: Vec3 = Vec3::new(0.66, 0.58, 0.44);
    const NAVY: Vec3 = Vec3::new(0.035, 0.055, 0.16);
    const BRICK: Vec3 = Vec3::new(0.36, 0.07, 0.045);
    const OCHRE: Vec3 = Vec3::new(0.55, 0.32, 0.08);
    let (width, height) = (192, 128);
    Picture::from_fn(width, height, |x, y| {
        let edge = x.min(width - 1 - x).min(y.min(height - 1 - y));
        let knot = |color: Vec3| color * (1.0 - 0.12 * hash(x, y));
        knot(match edge {
            0..=3 => NAVY,
            4..=7 => CREAM,
            8..=13 => BRICK,
            14..=15 => CREAM,
            _ => {
                let cell = Vec2::new(x as f32 - 16.0, y as f32 - 16.0) / Vec2::new(40.0, 48.0);
                let offset = (cell - cell.floor() - Vec2::splat(0.5)).abs();
                match ((offset.x + offset.y) * 10.0) as u32 {
                    0 => CREAM,
                    1 | 2 => BRICK,
                    3 => CREAM,
                    4 => OCHRE,
                    _ => NAVY,
                }
            }
        })
    })
}

/// A poster of a sun over three ranges of hills.
pub fn poster() -> Picture {
    const SKY: Vec3 = Vec3::new(0.78, 0.62, 0.40);
    const SUN: Vec3 = Vec3::new(0.72, 0.12, 0.05);
    const HILLS: [Vec3; 3] = [
        Vec3::new(0.34, 0.36, 0.30),
        Vec3::new(0.10, 0.22, 0.24),
        Vec3::new(0.03, 0.07, 0.11),
    ];
    const MARGIN: f32 = 0.06;
    Picture::from_fn(160, 112, |x, y| {
        let p = Vec2::new((x as f32 + 0.5) / 160.0, 1.0 - (y as f32 + 0.5) / 112.0);
        if (p - Vec2::splat(0.5)).abs().max_element() > 0.5 - MARGIN {
            return Vec3::splat(0.78);
        }
        let ridge = |range: usize| {
            let k = range as f32;
            0.52 - 0.15 * k
                + 0.07 * (p.x * (5.0 + 2.0 * k) + 1.7 * k).sin()
                + 0.03 * (p.x * 17.0 + 4.0 * k).sin()
        };
        if let Some(range) = (0..3).rev().find(|&range| p.y < ridge(range)) {
            return HILLS[range];
        }
        let to_sun = (p - Vec2::new(0.64, 0.66)) * Vec2::new(1.43, 1.0);
        if to_sun.length() < 0.15 { SUN } else { SKY }
    })
}

/// Book spines side by side: a column of colour for each book, with a pale title band.
pub fn books() -> Picture {
    const INKS: [Vec3; 8] = [
        Vec3::new(0.42, 0.05, 0.04),
        Vec3::new(0.05, 0.12, 0.30),
        Vec3::new(0.62, 0.55, 0.42),
        Vec3::new(0.06, 0.20, 0.11),
        Vec3::new(0.52, 0.30, 0.05),
        Vec3::new(0.72, 0.70, 0.66),
        Vec3::new(0.09, 0.09, 0.10),
        Vec3::new(0.30, 0.10, 0.22),
    ];
    Picture::from_fn(SPINES * 4, 32, |x, y| {
        let spine = x / 4;
        let band = 4 + (hash(spine, 1) * 8.0) as u32;
        if (band..band + 4).contains(&y) {
            Vec3::new(0.64, 0.56, 0.36)
        } else {
            INKS[(spine as usize * 5) % INKS.len()]
        }
    })
}

/// Hash of two integers to a number in [0, 1).
pub fn hash(x: u32, y: u32) -> f32 {
    (splitmix64(u64::from(x) << 32 | u64::from(y)) >> 40) as f32 / 16_777_216.0
}
