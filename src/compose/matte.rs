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
/// Mattes between these values are stretched to 0 to 1. Where colours explain a fraction f of a mask's variance, the fit is on average
/// (1 - f) / 2 beside a straight edge and (1 + f) / 2 within: with 0.6 and more both sides come out whole.
const SOFT: [f32; 2] = [0.2, 0.8];
/// Fraction of a mask's variance that the photograph's colours have to explain. With less than the first value, both sides of an edge
/// differ by a tenth at most, and the matte would be a blur: the edge stays as it is in the mesh. Above the second it is taken from the
/// photograph.
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
    windows: Windows,
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
        let windows = Windows::of(shape);
        let filter = GuidedFilter::new(shown, windows);
        let one_pixel = windows.one_pixel();
        let mut in_photograph = vec![Vec3::ONE; in_mesh.len()];
        let mut is_mixed = vec![false; in_mesh.len()];
        for mask in masks.values() {
            let (matte, trust) = filter.matte(mask);
            let covered = windows.mean(mask);
            let change = windows.means(|pixel| in_mesh[pixel] * mask[pixel]);
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
            windows,
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
        let known = |value: &(dyn Fn(usize) -> Vec3 + Sync)| {
            self.windows.means(|pixel| match is_known(pixel) {
                true => value(pixel),
                false => Vec3::ZERO,
            })
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

/// The filter's windows around the pixels of a picture.
#[derive(Debug, Clone, Copy)]
struct Windows {
    shape: [usize; 2],
    radius: usize,
}

impl Windows {
    fn of(shape: [usize; 2]) -> Self {
        let long_side = shape[0].max(shape[1]) as f32;
        let radius = (RADIUS * long_side).ceil() as usize;
        Self { shape, radius }
    }

    /// The fraction of a window that one pixel is.
    fn one_pixel(self) -> f32 {
        let side = 2 * self.radius + 1;
        1.0 / (side * side) as f32
    }

    /// Means of numbers over the window of each pixel.
    fn mean(self, values: &[f32]) -> Vec<f32> {
        box_mean(values, self.shape, self.radius)
    }

    /// Means of colours over the window of each pixel.
    fn means(self, value: impl Fn(usize) -> Vec3 + Sync + Send) -> Vec<Vec3> {
        let values = each(self.shape[0] * self.shape[1], value);
        let [r, g, b] =
            [0, 1, 2].map(|channel| self.mean(&each(values.len(), |pixel| values[pixel][channel])));
        each(values.len(), |pixel| {
            Vec3::new(r[pixel], g[pixel], b[pixel])
        })
    }
}

/// A value for each of some pixels, in parallel.
fn each<T: Send>(pixels: usize, value: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    (0..pixels).into_par_iter().map(value).collect()
}

/// A guided filter: the means and covariances of the photograph's colours in the window of each pixel.
struct GuidedFilter {
    windows: Windows,
    colors: Vec<Vec3>,
    mean: Vec<Vec3>,
    /// Inverse of the covariance with [`NOISE`] added.
    inverse: Vec<Mat3>,
}

impl GuidedFilter {
    fn new(shown: &[Vec3], windows: Windows) -> Self {
        let encoded = |v: f32| linear_to_srgb(v.clamp(0.0, 1.0));
        let colors = each(shown.len(), |pixel| shown[pixel].map(encoded));
        let turned = |c: Vec3| Vec3::new(c.y, c.z, c.x);
        let mean = windows.means(|pixel| colors[pixel]);
        let squares = windows.means(|pixel| colors[pixel] * colors[pixel]);
        let products = windows.means(|pixel| colors[pixel] * turned(colors[pixel]));
        let inverse = each(colors.len(), |pixel| {
            let m = mean[pixel];
            let variance = squares[pixel] - m * m + Vec3::splat(NOISE);
            let [rg, gb, br] = (products[pixel] - m * turned(m)).to_array();
            Mat3::from_cols(
                Vec3::new(variance.x, rg, br),
                Vec3::new(rg, variance.y, gb),
                Vec3::new(br, gb, variance.z),
            )
            .inverse()
        });
        Self {
            windows,
            colors,
            mean,
            inverse,
        }
    }

    /// The matte of a mask with values 0 and 1: the fraction of each pixel that belongs to it by the photograph's colours, and the
    /// mask itself where these tell nothing. Also returns how much the colours count, 0 to 1.
    fn matte(&self, mask: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let pixels = mask.len();
        // In each window, the mask as a linear function of colour, and how much of its variance that explains.
        let share = self.windows.mean(mask);
        let products = self.windows.means(|pixel| self.colors[pixel] * mask[pixel]);
        let covariance = |pixel: usize| products[pixel] - self.mean[pixel] * share[pixel];
        let slope = each(pixels, |pixel| self.inverse[pixel] * covariance(pixel));
        let offset = each(pixels, |pixel| {
            share[pixel] - slope[pixel].dot(self.mean[pixel])
        });
        let explained = each(pixels, |pixel| slope[pixel].dot(covariance(pixel)));
        let variance = each(pixels, |pixel| share[pixel] * (1.0 - share[pixel]));

        // Each pixel takes the mean over the windows that it is in.
        let slope = self.windows.means(|pixel| slope[pixel]);
        let [offset, explained, variance] =
            [offset, explained, variance].map(|values| self.windows.mean(&values));
        (0..pixels)
            .map(|pixel| {
                let fitted = slope[pixel].dot(self.colors[pixel]) + offset[pixel];
                let explained = explained[pixel] / variance[pixel].max(f32::MIN_POSITIVE);
                let trust = ramp(explained, EXPLAINED);
                let mask = mask[pixel];
                (mask + (ramp(fitted, SOFT) - mask) * trust, trust)
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
        // Far from the edge nothing changes.
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
