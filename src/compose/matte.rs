//! Soft edges of recoloured surfaces. The edges of a scanned mesh are ragged and a little off; those of the photograph are not.

use crate::math::box_mean::box_mean;
use crate::math::color::linear_to_srgb;
use crate::transport::guide::Guide;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Radius of the filter's windows as a fraction of a photograph's longer side. Edges of a scan that are 2 cm off, 2.5 m away, are off
/// by 0.7 % of that side; the windows reach three times as far.
const RADIUS: f32 = 0.02;
/// Variance of the photograph's sRGB values, from 0 to 1, below which differences tell nothing: that of noise of 3 %.
const NOISE: f32 = 1e-3;
/// The filter softens a sharp edge over its windows. Mattes between these values are stretched to 0 to 1.
const SOFT: [f32; 2] = [0.2, 0.8];
/// Fraction of the variance of a mask that the photograph's colours have to explain: below the first value the edge stays as it is in
/// the mesh, above the second it is taken from the photograph.
const EXPLAINED: [f32; 2] = [0.1, 0.3];

/// Ratio of new to old albedo below which a surface is black.
const MIN_CHANGE: f32 = 1e-3;

/// The change of albedo at each pixel of a photograph, with the edges of the photograph.
#[derive(Debug)]
pub struct Matte {
    /// New over old albedo of what the pixel's centre sees in the mesh.
    in_mesh: Vec<Vec3>,
    /// The same with the edges of the photograph.
    in_photograph: Vec<Vec3>,
    /// Whether the pixel lies at an edge of the mesh, so that its render mixes both sides, and the photograph's edge counts.
    is_mixed: Vec<bool>,
    shape: [usize; 2],
}

impl Matte {
    /// The matte of a photograph of `shape` (width, height), whose pixels see `before`, and `after` a change of albedos. `shown` has
    /// its linear values, where 1 is white. `None` if no albedo changes.
    ///
    /// For each changed object, its mask is filtered with the photograph as the guide (He, Sun and Tang, "Guided image filtering",
    /// 2010): in each window the mask is fitted by a linear function of the photograph's colour.
    pub fn new(
        shown: &[Vec3],
        shape: [usize; 2],
        before: &[Option<Guide>],
        after: &[Option<Guide>],
    ) -> Option<Self> {
        let in_mesh: Vec<Vec3> = before.iter().zip(after).map(changed_albedo).collect();
        let mut masks: BTreeMap<u32, Vec<f32>> = BTreeMap::new();
        for (pixel, seen) in before.iter().enumerate() {
            if let Some(guide) = seen.filter(|_| in_mesh[pixel] != Vec3::ONE) {
                let mask = masks.entry(guide.object);
                mask.or_insert_with(|| vec![0.0; in_mesh.len()])[pixel] = 1.0;
            }
        }
        if masks.is_empty() {
            return None;
        }
        let filter = GuidedFilter::new(shown, shape);
        let window = 2 * radius(shape) + 1;
        let one_pixel = 1.0 / (window * window) as f32;
        let mut in_photograph = vec![Vec3::ONE; in_mesh.len()];
        let mut is_mixed = vec![false; in_mesh.len()];
        for mask in masks.values() {
            let (matte, trust) = filter.matte(mask);
            let covered = filter.mean(mask);
            let change = filter.means(|pixel| in_mesh[pixel] * mask[pixel]);
            let neighbours = box_mean(mask, shape, 1);
            for pixel in 0..mask.len() {
                // Beside the mask its mean change counts, as far as the windows reach.
                let change = match mask[pixel] > 0.0 {
                    true => in_mesh[pixel],
                    false if covered[pixel] > 0.5 * one_pixel => change[pixel] / covered[pixel],
                    false => Vec3::ONE,
                };
                in_photograph[pixel] += (change - Vec3::ONE) * matte[pixel];
                let at_edge = neighbours[pixel] > 0.0 && neighbours[pixel] < 1.0;
                is_mixed[pixel] |= at_edge && trust[pixel] > 0.0;
            }
        }
        Some(Self {
            in_mesh,
            in_photograph: in_photograph.iter().map(|c| c.max(Vec3::ZERO)).collect(),
            is_mixed,
            shape,
        })
    }

    /// Renders `after` the change whose ratio to those `before` has the photograph's edges. Pixels where they agree with the mesh keep
    /// their radiance to the bit.
    pub fn applied(&self, before: &[Vec3], after: &[Vec3]) -> Vec<Vec3> {
        // Radiance by the change of the light alone; of mixed pixels it is known from others, and black surfaces do not tell it.
        let light = |pixel: usize| {
            let change = self.in_mesh[pixel];
            let tells = change.cmpgt(Vec3::splat(MIN_CHANGE));
            Vec3::select(tells, after[pixel] / change, before[pixel])
        };
        let is_known = |pixel: usize| !self.is_mixed[pixel] && light(pixel).is_finite();
        let known = |value: &dyn Fn(usize) -> Vec3| -> Vec<Vec3> {
            let value = |pixel: usize| match is_known(pixel) {
                true => value(pixel),
                false => Vec3::ZERO,
            };
            let values: Vec<Vec3> = (0..before.len()).map(value).collect();
            means(&values, self.shape)
        };
        let [dark, lit] = [known(&|pixel| before[pixel]), known(&light)];
        (0..before.len())
            .map(|pixel| {
                let light = match is_known(pixel) {
                    true if self.in_mesh[pixel] == self.in_photograph[pixel] => {
                        return after[pixel];
                    }
                    true => light(pixel),
                    false => {
                        let is_lit = dark[pixel].cmpgt(before[pixel] * 1e-6);
                        before[pixel] * Vec3::select(is_lit, lit[pixel] / dark[pixel], Vec3::ONE)
                    }
                };
                light * self.in_photograph[pixel]
            })
            .collect()
    }
}

/// New over old albedo of what a pixel sees. Where the old one is zero, nothing tells its change.
fn changed_albedo((before, after): (&Option<Guide>, &Option<Guide>)) -> Vec3 {
    match (before, after) {
        (Some(before), Some(after)) if before.albedo != after.albedo => {
            let is_lit = before.albedo.cmpgt(Vec3::ZERO);
            Vec3::select(is_lit, after.albedo / before.albedo, Vec3::ONE)
        }
        _ => Vec3::ONE,
    }
}

fn radius(shape: [usize; 2]) -> usize {
    let long_side = shape[0].max(shape[1]) as f32;
    (RADIUS * long_side).ceil() as usize
}

/// Means of colours over the filter's windows.
fn means(values: &[Vec3], shape: [usize; 2]) -> Vec<Vec3> {
    let channel = |c: usize| -> Vec<f32> {
        let values: Vec<f32> = values.iter().map(|v| v[c]).collect();
        box_mean(&values, shape, radius(shape))
    };
    let [r, g, b] = [0, 1, 2].map(channel);
    let colors = r.into_iter().zip(g).zip(b);
    colors.map(|((r, g), b)| Vec3::new(r, g, b)).collect()
}

/// A guided filter: the means and covariances of the photograph's colours in the window of each pixel.
struct GuidedFilter {
    shape: [usize; 2],
    colors: Vec<Vec3>,
    mean: Vec<Vec3>,
    /// Inverse of the covariance with [`NOISE`] added.
    inverse: Vec<Mat3>,
}

impl GuidedFilter {
    fn new(shown: &[Vec3], shape: [usize; 2]) -> Self {
        let encoded = |v: f32| linear_to_srgb(v.clamp(0.0, 1.0));
        let colors: Vec<Vec3> = shown.iter().map(|c| c.map(encoded)).collect();
        let mean = means(&colors, shape);
        let [squares, products] = [|c: Vec3| c * c, |c: Vec3| c * Vec3::new(c.y, c.z, c.x)]
            .map(|of| means(&colors.iter().map(|&c| of(c)).collect::<Vec<_>>(), shape));
        let inverse = (mean.par_iter().zip(&squares).zip(&products))
            .map(|((&m, &squares), &products)| {
                let variance = squares - m * m + Vec3::splat(NOISE);
                let Vec3 {
                    x: rg,
                    y: gb,
                    z: br,
                } = products - m * Vec3::new(m.y, m.z, m.x);
                Mat3::from_cols(
                    Vec3::new(variance.x, rg, br),
                    Vec3::new(rg, variance.y, gb),
                    Vec3::new(br, gb, variance.z),
                )
                .inverse()
            })
            .collect();
        Self {
            shape,
            colors,
            mean,
            inverse,
        }
    }

    fn mean(&self, values: &[f32]) -> Vec<f32> {
        box_mean(values, self.shape, radius(self.shape))
    }

    fn means(&self, value: impl Fn(usize) -> Vec3) -> Vec<Vec3> {
        means(
            &(0..self.colors.len()).map(value).collect::<Vec<_>>(),
            self.shape,
        )
    }

    /// The matte of a mask with values 0 and 1: the fraction of each pixel that belongs to it by the photograph's colours, and the
    /// mask itself where these tell nothing. Also returns how much the colours count, 0 to 1.
    fn matte(&self, mask: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let share = self.mean(mask);
        let covariance = self.means(|pixel| self.colors[pixel] * mask[pixel]);
        let covariance: Vec<Vec3> = (0..mask.len())
            .map(|pixel| covariance[pixel] - self.mean[pixel] * share[pixel])
            .collect();
        let slope: Vec<Vec3> = (0..mask.len())
            .map(|pixel| self.inverse[pixel] * covariance[pixel])
            .collect();
        let offset: Vec<f32> = (0..mask.len())
            .map(|pixel| share[pixel] - slope[pixel].dot(self.mean[pixel]))
            .collect();
        let explained: Vec<f32> = (0..mask.len())
            .map(|pixel| slope[pixel].dot(covariance[pixel]))
            .collect();
        let variance: Vec<f32> = share.iter().map(|share| share * (1.0 - share)).collect();
        let slope = self.means(|pixel| slope[pixel]);
        let [offset, explained, variance] = [offset, explained, variance].map(|v| self.mean(&v));
        (0..mask.len())
            .map(|pixel| {
                let fitted = slope[pixel].dot(self.colors[pixel]) + offset[pixel];
                let explained = explained[pixel] / variance[pixel].max(f32::MIN_POSITIVE);
                let trust = ramp(explained, EXPLAINED);
                (
                    mask[pixel] + (ramp(fitted, SOFT) - mask[pixel]) * trust,
                    trust,
                )
            })
            .unzip()
    }
}

/// 0 below the first limit, 1 above the second, linear between.
fn ramp(value: f32, [low, high]: [f32; 2]) -> f32 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: [usize; 2] = [400, 60];
    const RED: Vec3 = Vec3::new(2.0, 0.5, 0.25);

    /// A carpet left of column 200 in the photograph, and of a ragged edge in the mesh. The carpet is recoloured. Returns the pixels
    /// of `applied` where the light of all surfaces is one.
    fn recoloured(carpet: Vec3, floor: Vec3) -> Vec<Vec3> {
        let [width, height] = SHAPE;
        let on_carpet = |pixel: usize| pixel % width < 200;
        let in_mesh = |pixel: usize| pixel % width < 197 + (pixel / width * 5) % 7;
        let pixels = 0..width * height;
        let noise = |pixel: usize| 0.02 * ((pixel * 7919 % 101) as f32 / 50.0 - 1.0);
        let shown: Vec<Vec3> = (pixels.clone())
            .map(|pixel| if on_carpet(pixel) { carpet } else { floor } + noise(pixel))
            .collect();
        let guide = |pixel: usize, change: Vec3| {
            let (object, albedo) = match in_mesh(pixel) {
                true => (4, Vec3::splat(0.4) * change),
                false => (7, Vec3::splat(0.3)),
            };
            Some(Guide {
                point: Vec3::ZERO,
                normal: Vec3::Y,
                depth: 1.0,
                albedo,
                emission: Vec3::ZERO,
                object,
            })
        };
        let [before, after] = [Vec3::ONE, RED]
            .map(|change| pixels.clone().map(|p| guide(p, change)).collect::<Vec<_>>());
        assert!(Matte::new(&shown, SHAPE, &before, &before).is_none());
        let matte = Matte::new(&shown, SHAPE, &before, &after).expect("the carpet has changed");
        let [dark, lit] = [&before, &after].map(|seen| {
            seen.iter()
                .flatten()
                .map(|guide| guide.albedo)
                .collect::<Vec<_>>()
        });
        let applied = matte.applied(&dark, &lit);
        applied.iter().zip(&dark).map(|(a, b)| *a / *b).collect()
    }

    #[test]
    fn a_recoloured_carpet_ends_where_the_photograph_shows_its_edge() {
        let ratios = recoloured(Vec3::new(0.05, 0.1, 0.4), Vec3::new(0.5, 0.3, 0.1));
        let [width, height] = SHAPE;
        let off = |edge: &dyn Fn(usize) -> usize| -> f32 {
            let pixels = (0..width * height).map(|pixel| {
                let is_red = pixel % width < edge(pixel / width);
                (ratios[pixel].x - if is_red { RED.x } else { 1.0 }).abs()
            });
            pixels.sum()
        };
        let [from_photograph, from_mesh] = [off(&|_| 200), off(&|row| 197 + (row * 5) % 7)];
        assert!(
            from_photograph < 0.05 * from_mesh,
            "{from_photograph}, {from_mesh}"
        );
        // Far from the edge nothing changes, to the bit.
        assert!(ratios[40].abs_diff_eq(RED, 1e-6) && ratios[390] == Vec3::ONE);
    }

    #[test]
    fn an_edge_that_the_photograph_does_not_show_stays_as_it_is_in_the_mesh() {
        let ratios = recoloured(Vec3::splat(0.4), Vec3::splat(0.4));
        for (pixel, ratio) in ratios.iter().enumerate() {
            let row = pixel / SHAPE[0];
            let truth = if pixel % SHAPE[0] < 197 + (row * 5) % 7 {
                RED
            } else {
                Vec3::ONE
            };
            assert!(ratio.abs_diff_eq(truth, 1e-6), "{pixel}: {ratio}");
        }
    }
}
