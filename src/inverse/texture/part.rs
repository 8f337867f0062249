//! A part of an object that stands for all of it: blocks drawn at random, with all pixels that see them.

use crate::calibrate::gbuffer::GBufferPixel;
use crate::math::rng::splitmix64;
use glam::Vec3;

/// Blocks along the longest side of the object's bounding box.
const BLOCKS: f32 = 32.0;
/// Key of the draw.
const KEY: u64 = 0xb10c_5eed;

/// About `count` of the pixels, or all if they are no more: those that see blocks drawn at random. Unlike pixels drawn one by one,
/// they show as fine a texture as all do, in a part of the surface.
pub fn part_of<'a>(pixels: &[&'a GBufferPixel], count: usize) -> Vec<&'a GBufferPixel> {
    if pixels.len() <= count {
        return pixels.to_vec();
    }
    let centers: Vec<Vec3> = pixels.iter().map(|pixel| center(pixel)).collect();
    let min = centers.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let max = centers.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    let size = (max - min).max_element() / BLOCKS;
    let limit = (count as f64 / pixels.len() as f64 * u64::MAX as f64) as u64;
    let drawn = |center: Vec3| {
        let block = ((center - min) / size).floor().as_u64vec3();
        let mixed = [block.x, block.y, block.z].into_iter();
        mixed.fold(KEY, |key, index| splitmix64(key ^ index)) < limit
    };
    (pixels.iter().zip(centers))
        .filter(|(_, center)| drawn(*center))
        .map(|(pixel, _)| *pixel)
        .collect()
}

/// Mean of a pixel's hit points.
fn center(pixel: &GBufferPixel) -> Vec3 {
    let points = pixel.points.iter().flatten();
    let count = points.clone().count().max(1) as f32;
    points.map(|p| p.point).sum::<Vec3>() / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::gbuffer::SurfacePoint;

    #[test]
    fn a_part_is_as_dense_as_the_whole() {
        let at = |index: u32| {
            let point = Vec3::new((index % 500) as f32, (index / 500) as f32, 0.0) * 0.01;
            let point = SurfacePoint {
                point,
                normal: Vec3::Z,
                object: 0,
            };
            GBufferPixel {
                frame: 0,
                pixel: index,
                object: 0,
                pure: true,
                inside: true,
                held_out: false,
                points: [Some(point); 4],
            }
        };
        let pixels: Vec<GBufferPixel> = (0..250_000).map(at).collect();
        let all: Vec<&GBufferPixel> = pixels.iter().collect();
        let part = part_of(&all, 50_000);
        // About 200 of 1000 blocks: three standard deviations are 19 % of them.
        assert!((40_000..60_000).contains(&part.len()), "{}", part.len());
        let next = (part.windows(2)).filter(|two| two[0].pixel + 1 == two[1].pixel);
        assert!(next.count() * 10 > part.len() * 9, "whole blocks");
        assert_eq!(part_of(&part, part.len()).len(), part.len());
    }
}
