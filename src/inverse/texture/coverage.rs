//! Which cells of an object its pixels see, and where.

use crate::inverse::texture::cells::Cells;
use crate::inverse::texture::look::{RAYS, SeenPixel};
use crate::inverse::texture::observations::{Observations, row_range};
use crate::scene::geometry::Hit;
use rayon::prelude::*;

/// What the pixels see of the cells.
#[derive(Debug, Clone)]
pub struct Coverage {
    /// Pixels that see the side of the cells whose irradiance is traced.
    pub pixels: Vec<SeenPixel>,
    /// For each pixel in the fit, the cells that it sees and the fraction of its rays on each.
    pub observations: Observations,
    /// Area of each cell below the rays of the pixels in the fit, at most all of it, in square metres.
    pub areas: Vec<f32>,
    /// End of each cell's hits in `hits`.
    ends: Vec<u32>,
    /// Indices of hits, all rays of one pixel after another, by cell.
    hits: Vec<u32>,
}

impl Coverage {
    /// Locates the hits of all pixels. Cells have one side, whose irradiance is traced: pixels that see the other side are removed.
    pub fn new(cells: &Cells, mut pixels: Vec<SeenPixel>) -> Self {
        let located: Vec<Option<Vec<u32>>> = (pixels.par_iter())
            .map(|pixel| pixel.hits.iter().map(|hit| cells.facing(hit)).collect())
            .collect();
        let mut known = located.iter();
        pixels.retain(|_| known.next().is_some_and(Option::is_some));
        let located: Vec<Vec<u32>> = located.into_iter().flatten().collect();
        let fitted = || (pixels.iter().zip(&located)).filter(|(pixel, _)| !pixel.held_out);

        let mut areas = vec![0.0; cells.count()];
        for (pixel, located) in fitted() {
            for (hit, &cell) in pixel.hits.iter().zip(located) {
                areas[cell as usize] += hit.footprint * hit.footprint / RAYS as f32;
            }
        }
        for (area, cell) in areas.iter_mut().zip(&cells.cells) {
            *area = area.min(cell.size * cell.size);
        }
        let rows: Vec<Vec<(u32, f32)>> = fitted().map(|(_, located)| row(located)).collect();
        let (ends, hits) = by_cell(&located, cells.count());
        Self {
            pixels,
            observations: Observations::new(&rows, cells.count()),
            areas,
            ends,
            hits,
        }
    }

    /// Number of hits on a cell, those of held-out pixels included.
    pub fn count(&self, cell: usize) -> usize {
        row_range(&self.ends, cell).len()
    }

    /// A hit on a cell.
    pub fn hit(&self, cell: usize, index: usize) -> Hit {
        let hit = self.hits[row_range(&self.ends, cell)][index];
        self.pixels[(hit / RAYS) as usize].hits[(hit % RAYS) as usize].hit
    }
}

/// The cells of a pixel's rays, and the fraction of rays on each.
fn row(located: &[u32]) -> Vec<(u32, f32)> {
    let mut cells = located.to_vec();
    cells.sort_unstable();
    let fraction = 1.0 / cells.len() as f32;
    (cells.chunk_by(|a, b| a == b))
        .map(|same| (same[0], same.len() as f32 * fraction))
        .collect()
}

/// The hits of each cell in their order, and the end of each cell's.
fn by_cell(located: &[Vec<u32>], count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut next = vec![0; count];
    for &cell in located.iter().flatten() {
        next[cell as usize] += 1;
    }
    let mut sum = 0;
    for next in &mut next {
        sum += std::mem::replace(next, sum);
    }
    let mut hits = vec![0; sum as usize];
    for (pixel, cells) in located.iter().enumerate() {
        for (ray, &cell) in cells.iter().enumerate() {
            let next = &mut next[cell as usize];
            hits[*next as usize] = pixel as u32 * RAYS + ray as u32;
            *next += 1;
        }
    }
    (next, hits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_are_sorted_by_cell_and_rays_counted() {
        let rays = RAYS as usize;
        let located = [
            vec![2; rays],
            [vec![0; rays / 2], vec![2; rays / 2]].concat(),
        ];
        let (ends, hits) = by_cell(&located, 4);
        let half = RAYS / 2;
        assert_eq!(ends, [half, half, 2 * RAYS, 2 * RAYS]);
        assert!(
            hits[..half as usize]
                .iter()
                .all(|hit| (RAYS..RAYS + half).contains(hit))
        );
        assert_eq!(row(&located[1]), [(0, 0.5), (2, 0.5)]);
    }
}
