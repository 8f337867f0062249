//! Bakes the texels of all textured objects into one picture, with a chart for each triangle.

use crate::inverse::estimate::TexelEstimate;
use crate::math::picture::Picture;
use crate::scene::Scene;
use crate::scene::geometry::Hit;
use glam::{Vec2, Vec3};

/// Pixels along a texel's edge; two are needed to resolve both triangular texels of a square.
const PIXELS_A_TEXEL: u32 = 2;
/// Border pixels around each chart that repeat its edge, so that bilinear filtering does not mix charts.
const MARGIN: u32 = 1;
/// Largest width and height; nearly all graphics hardware supports it.
const MAX_SIDE: u32 = 8192;

/// The albedo of all textured objects in one picture, and the texture coordinates of their triangles.
#[derive(Debug, Clone)]
pub struct Atlas {
    /// Linear albedo.
    pub picture: Picture,
    /// For each triangle, the texture coordinates of its corners as in glTF (v down, both from 0 to 1); `None` without texture.
    pub corners: Vec<Option<[Vec2; 3]>>,
}

/// Position of a triangle's chart: upper-left corner without the border, and side.
#[derive(Debug, Clone, Copy)]
struct Chart {
    triangle: u32,
    x: u32,
    y: u32,
    side: u32,
}

impl Atlas {
    /// Bakes the textured objects; `None` where there are none. Coarsens texels if the picture would exceed the largest size.
    pub fn new(scene: &Scene, texels: &TexelEstimate) -> Option<Self> {
        let textured = |&t: &u32| {
            let object = scene.object_of[t as usize] as usize;
            texels.textured.get(object) == Some(&true)
        };
        let mut triangles: Vec<u32> = (0..scene.triangles.len() as u32).filter(textured).collect();
        let levels = &texels.colors.layout.levels;
        triangles.sort_by_key(|&t| std::cmp::Reverse(levels[t as usize]));
        if triangles.is_empty() {
            return None;
        }
        let finest = levels[triangles[0] as usize];
        let (charts, size) = (0..=finest).find_map(|coarser| {
            let side = |t: u32| PIXELS_A_TEXEL << levels[t as usize].saturating_sub(coarser);
            pack(&triangles, side, coarser == finest)
        })?;
        let mut atlas = Self {
            picture: Picture {
                width: size[0],
                height: size[1],
                pixels: vec![Vec3::ZERO; size[0] as usize * size[1] as usize],
            },
            corners: vec![None; scene.triangles.len()],
        };
        for chart in charts {
            atlas.bake(&chart, texels);
        }
        Some(atlas)
    }

    fn bake(&mut self, chart: &Chart, texels: &TexelEstimate) {
        let layout = &texels.colors.layout;
        let side = chart.side as f32;
        // Near the diagonal of a square, sample half a texel to both sides, so that each sample lies in one texel.
        let half_texel = 0.1 / (1u32 << layout.levels[chart.triangle as usize]) as f32;
        for j in 0..chart.side + 2 * MARGIN {
            for i in 0..chart.side + 2 * MARGIN {
                let place = |k: u32| ((k as f32 + 0.5 - MARGIN as f32) / side).max(0.0);
                let (b1, b2) = (place(i), place(j));
                let color = |step: f32| {
                    let (b1, b2) = onto_triangle(b1 + step, b2 + step);
                    let hit = Hit {
                        t: 0.0,
                        triangle: chart.triangle,
                        b1,
                        b2,
                    };
                    texels.colors.colors[layout.texel(&hit) as usize]
                };
                let (x, y) = (chart.x + i - MARGIN, chart.y + j - MARGIN);
                let at = y as usize * self.picture.width as usize + x as usize;
                self.picture.pixels[at] = (color(half_texel) + color(-half_texel)) * 0.5;
            }
        }
        let size = Vec2::new(self.picture.width as f32, self.picture.height as f32);
        let corner = |x: u32, y: u32| Vec2::new(x as f32, y as f32) / size;
        let (x, y, side) = (chart.x, chart.y, chart.side);
        self.corners[chart.triangle as usize] =
            Some([corner(x, y), corner(x + side, y), corner(x, y + side)]);
    }
}

/// Clamps barycentric coordinates to the triangle.
fn onto_triangle(b1: f32, b2: f32) -> (f32, f32) {
    let (b1, b2) = (b1.clamp(0.0, 1.0), b2.clamp(0.0, 1.0));
    let beyond = ((b1 + b2 - 1.0) * 0.5).max(0.0);
    let (b1, b2) = ((b1 - beyond).max(0.0), (b2 - beyond).max(0.0));
    (b1, b2.min(1.0 - b1))
}

/// Packs squares of decreasing size into rows of a nearly square picture. `None` if it exceeds [`MAX_SIDE`], unless `any_size`.
fn pack(
    triangles: &[u32],
    side: impl Fn(u32) -> u32,
    any_size: bool,
) -> Option<(Vec<Chart>, [u32; 2])> {
    let padded = |t: u32| side(t) + 2 * MARGIN;
    let area: u64 = triangles.iter().map(|&t| u64::from(padded(t)).pow(2)).sum();
    let widest = triangles.iter().map(|&t| padded(t)).max()?;
    let side_of_all = (area as f64).sqrt().ceil() as u32;
    let width = side_of_all.max(widest).next_multiple_of(4);
    let (mut x, mut y, mut row) = (0, 0, 0);
    let mut charts = Vec::with_capacity(triangles.len());
    for &triangle in triangles {
        let size = padded(triangle);
        if x + size > width {
            (x, y, row) = (0, y + row, 0);
        }
        charts.push(Chart {
            triangle,
            x: x + MARGIN,
            y: y + MARGIN,
            side: side(triangle),
        });
        x += size;
        row = row.max(size);
    }
    let height = (y + row).next_multiple_of(4);
    (any_size || width.max(height) <= MAX_SIDE).then_some((charts, [width, height]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_do_not_overlap_and_the_picture_is_mostly_charts() {
        let side = |t: u32| if t < 3 { 64 } else { 2 << (t % 4) };
        let mut triangles: Vec<u32> = (0..400).collect();
        triangles.sort_by_key(|&t| std::cmp::Reverse(side(t)));
        let (charts, [width, height]) = pack(&triangles, side, false).expect("it is small");
        let mut taken = vec![false; (width * height) as usize];
        let mut used = 0;
        for chart in charts {
            for y in chart.y - MARGIN..chart.y + chart.side + MARGIN {
                for x in chart.x - MARGIN..chart.x + chart.side + MARGIN {
                    let taken = &mut taken[(y * width + x) as usize];
                    assert!(!std::mem::replace(taken, true));
                    used += 1;
                }
            }
        }
        let all = width * height;
        assert!(used * 10 > 7 * all, "{used} of {all}");
        let packed = |any_size| pack(&triangles, |_| 512, any_size).is_some();
        assert!(!packed(false) && packed(true));
    }
}
