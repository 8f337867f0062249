//! Scores how well the gradients of a photograph coincide with the projected edges of the mesh.

use crate::calibrate::alignment::edges::{Edge, Edges};
use crate::capture::photograph::Photograph;
use crate::math::color::luminance;
use crate::math::stats::Moments;
use glam::{IVec2, Vec3};

/// Largest displacement of the edges, in pixels.
const REACH: i32 = 8;
/// Displacements of at least this many pixels sample the distribution of chance.
const FAR: f32 = 5.0;
/// Least number of edges of a kind.
const MIN_EDGES: usize = 30;
/// Limit of the score of one kind of edges, in standard deviations, so that no kind decides alone.
const MAX_SCORE: f64 = 8.0;
/// Radiance is clamped to at least this before the logarithm.
const DARK: f32 = 1e-8;

/// Gradient magnitudes of a photograph as ranks, which are invariant to exposure and contrast.
pub struct Contrast {
    size: IVec2,
    /// Rank in [0, 1) of the difference to the pixel on the right and below; NaN without that neighbour.
    ranks: [Vec<f32>; 2],
}

impl Contrast {
    /// From logarithmic luminance, row by row.
    pub fn new(levels: &[f32], width: u32, height: u32) -> Self {
        let (columns, rows) = (width as usize, height as usize);
        let mut changes = Vec::with_capacity(2 * levels.len());
        for pixel in 0..levels.len() {
            if pixel % columns + 1 < columns {
                changes.push(((levels[pixel] - levels[pixel + 1]).abs(), 0, pixel));
            }
            if pixel / columns + 1 < rows {
                changes.push(((levels[pixel] - levels[pixel + columns]).abs(), 1, pixel));
            }
        }
        changes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut ranks = [vec![f32::NAN; levels.len()], vec![f32::NAN; levels.len()]];
        for (rank, &(_, axis, pixel)) in changes.iter().enumerate() {
            ranks[axis][pixel] = rank as f32 / changes.len() as f32;
        }
        Self {
            size: IVec2::new(width as i32, height as i32),
            ranks,
        }
    }

    /// Mean rank of the gradients at edges displaced by `shift` pixels; `None` if too few of them are inside the image.
    fn at(&self, edges: &[Edge], shift: IVec2) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0u32);
        for edge in edges {
            let p = edge.pixel + shift;
            if p.cmplt(IVec2::ZERO).any() || p.cmpge(self.size).any() {
                continue;
            }
            let rank = self.ranks[edge.axis][(p.y * self.size.x + p.x) as usize];
            if rank.is_finite() {
                sum += f64::from(rank);
                count += 1;
            }
        }
        (count as usize >= MIN_EDGES / 2).then(|| sum / f64::from(count))
    }

    /// How well the photograph's gradients fit edges of the mesh, in standard deviations over displaced edges: near zero for
    /// unrelated edges, several for correct ones. Zero if there are too few edges.
    pub fn score(&self, edges: &Edges) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for kind in edges.iter().filter(|kind| kind.len() >= MIN_EDGES) {
            if let Some(score) = self.score_of(kind) {
                let count = kind.len() as f64;
                sum += count.sqrt() * score.clamp(-MAX_SCORE, MAX_SCORE);
                weights += count;
            }
        }
        if weights > 0.0 {
            sum / f64::sqrt(weights)
        } else {
            0.0
        }
    }

    fn score_of(&self, edges: &[Edge]) -> Option<f64> {
        let side = 2 * REACH + 1;
        let profile: Vec<Option<f64>> = (0..side * side)
            .map(|i| self.at(edges, IVec2::new(i % side, i / side) - REACH))
            .collect();
        // The maximum over 3 × 3 displacements, since poses are off by up to a pixel.
        let best = |dx: i32, dy: i32| -> Option<f64> {
            let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| (dx + x, dy + y)));
            let values =
                around.filter_map(|(x, y)| profile[((y + REACH) * side + x + REACH) as usize]);
            values.reduce(f64::max)
        };
        let mut far = Moments::default();
        for dy in 1 - REACH..REACH {
            for dx in 1 - REACH..REACH {
                if ((dx * dx + dy * dy) as f32).sqrt() >= FAR {
                    far.push(best(dx, dy)?);
                }
            }
        }
        let deviation = far.variance().sqrt();
        (deviation > 0.0).then(|| best(0, 0).map(|here| (here - far.mean) / deviation))?
    }
}

/// Logarithmic luminance of a photograph downscaled with a box filter.
pub fn levels(photograph: &Photograph, width: u32, height: u32) -> Vec<f32> {
    let span = |index: u32, count: u32, source: u32| {
        let from = (u64::from(index) * u64::from(source) / u64::from(count)) as u32;
        let to = (u64::from(index + 1) * u64::from(source) / u64::from(count)) as u32;
        from..to.max(from + 1)
    };
    let pixel = |x: u32, y: u32| {
        let mut sum = Vec3::ZERO;
        let mut count = 0.0;
        for row in span(y, height, photograph.height) {
            for column in span(x, width, photograph.width) {
                sum += photograph.pixels[(row * photograph.width + column) as usize];
                count += 1.0;
            }
        }
        let level = luminance(sum / count);
        match level.is_finite() {
            true => level.max(DARK).ln(),
            false => DARK.ln(),
        }
    };
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| pixel(x, y))
        .collect()
}
