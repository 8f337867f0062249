//! Patches: triangles and recursively subdivided parts of triangles, with one albedo each.

use crate::scene::geometry::Hit;
use crate::scene::texels::TexelLayout;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Greatest depth of subdivision: each edge into 256 parts.
pub const MAX_DEPTH: u8 = 8;

/// The patches of the mesh.
///
/// A triangle has a grid of texels as fine as its finest patch; a coarser patch consists of several texels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Stored", into = "Stored")]
pub struct Patches {
    pub layout: TexelLayout,
    patch_of: Vec<u32>,
    /// Depth of subdivision of each patch.
    pub depth: Vec<u8>,
}

/// The form in a checkpoint.
#[derive(Clone, Serialize, Deserialize)]
struct Stored {
    levels: Vec<u8>,
    patch_of: Vec<u32>,
    depth: Vec<u8>,
}

impl From<Stored> for Patches {
    fn from(stored: Stored) -> Self {
        let deepest = |level: u8| level.min(MAX_DEPTH);
        Self {
            layout: TexelLayout::new(stored.levels.into_iter().map(deepest).collect()),
            patch_of: stored.patch_of,
            depth: stored.depth,
        }
    }
}

impl From<Patches> for Stored {
    fn from(patches: Patches) -> Self {
        Self {
            levels: patches.layout.levels,
            patch_of: patches.patch_of,
            depth: patches.depth,
        }
    }
}

impl Patches {
    pub fn triangles(count: usize) -> Self {
        Self {
            layout: TexelLayout::new(vec![0; count]),
            patch_of: (0..count as u32).collect(),
            depth: vec![0; count],
        }
    }

    pub fn len(&self) -> usize {
        self.depth.len()
    }

    /// The patch of a texel of the grid.
    #[inline]
    pub fn of_texel(&self, texel: u32) -> usize {
        self.patch_of[texel as usize] as usize
    }

    /// The patches of a triangle, one entry per texel.
    pub fn of_triangle(&self, triangle: usize) -> impl Iterator<Item = usize> + '_ {
        (self.layout.first[triangle]..self.layout.first[triangle + 1])
            .map(|texel| self.of_texel(texel))
    }

    /// Copies one value per patch to its texels.
    pub fn spread<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let value = |&patch: &u32| values[patch as usize];
        self.patch_of.iter().map(value).collect()
    }

    /// Whether the sizes fit this number of triangles.
    pub fn fit(&self, triangles: usize) -> bool {
        self.layout.levels.len() == triangles
            && self.patch_of.len() == self.layout.len()
            && (self.patch_of.iter()).all(|&patch| (patch as usize) < self.depth.len())
    }

    /// Subdivides the patches in `which` into four at the midpoints of their edges, unless they have [`MAX_DEPTH`]. Returns the new
    /// patches, and the old patch of each.
    pub fn cut(&self, which: &[bool]) -> (Self, Vec<u32>) {
        let is_cut = |patch: usize| which[patch] && self.depth[patch] < MAX_DEPTH;
        let mut levels = self.layout.levels.clone();
        for (level, first) in levels.iter_mut().zip(self.layout.first.windows(2)) {
            for texel in first[0]..first[1] {
                let patch = self.of_texel(texel);
                *level = (*level).max(self.depth[patch] + u8::from(is_cut(patch)));
            }
        }
        let layout = TexelLayout::new(levels);

        // Each new texel belongs to an old patch, or to one of its four parts if that is cut.
        let grids: Vec<TexelLayout> = (0..=MAX_DEPTH)
            .map(|level| TexelLayout::new(vec![level]))
            .collect();
        let mut cut = Self {
            patch_of: Vec::with_capacity(layout.len()),
            layout,
            depth: Vec::new(),
        };
        let mut parents = Vec::new();
        let mut known: HashMap<(usize, u32), u32> = HashMap::new();
        for triangle in 0..cut.layout.levels.len() {
            let count = 1u32 << (2 * u32::from(cut.layout.levels[triangle]));
            for texel in 0..count {
                let [b1, b2] = cut.layout.center(triangle, texel);
                let mut middle = Hit {
                    t: 0.0,
                    triangle: triangle as u32,
                    b1,
                    b2,
                };
                let parent = self.of_texel(self.layout.texel(&middle));
                let depth = self.depth[parent] + u8::from(is_cut(parent));
                middle.triangle = 0;
                let part = match is_cut(parent) {
                    true => grids[usize::from(depth)].texel(&middle),
                    false => 0,
                };
                let patch = *known.entry((parent, part)).or_insert_with(|| {
                    cut.depth.push(depth);
                    parents.push(parent as u32);
                    (parents.len() - 1) as u32
                });
                cut.patch_of.push(patch);
            }
        }
        (cut, parents)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fraction of its triangle's area that each patch covers.
    fn fractions(patches: &Patches) -> Vec<f64> {
        let mut fractions = vec![0.0; patches.len()];
        let first = &patches.layout.first;
        for (triangle, &level) in patches.layout.levels.iter().enumerate() {
            for texel in first[triangle]..first[triangle + 1] {
                fractions[patches.of_texel(texel)] += 0.25f64.powi(i32::from(level));
            }
        }
        fractions
    }

    #[test]
    fn a_patch_is_cut_into_four_of_a_quarter_and_what_is_not_cut_stays_whole() {
        let whole = Patches::triangles(3);
        let (once, parents) = whole.cut(&[false, true, false]);
        assert_eq!(parents, [0, 1, 1, 1, 1, 2]);
        assert_eq!(fractions(&once), [1.0, 0.25, 0.25, 0.25, 0.25, 1.0]);
        // One quarter again, next to its coarser neighbours.
        let which: Vec<bool> = (0..6).map(|patch| patch == 2).collect();
        let (twice, parents) = once.cut(&which);
        assert_eq!(twice.len(), 9);
        assert!(twice.fit(3) && !twice.fit(2));
        for (patch, fraction) in fractions(&twice).into_iter().enumerate() {
            assert_eq!(fraction, 0.25f64.powi(i32::from(twice.depth[patch])));
        }
        assert_eq!(parents.iter().filter(|&&parent| parent == 2).count(), 4);
        // Every point lies in a part of its old patch.
        for (b1, b2) in [(0.1, 0.1), (0.6, 0.3), (0.3, 0.6), (0.3, 0.3), (0.05, 0.9)] {
            let hit = Hit {
                t: 1.0,
                triangle: 1,
                b1,
                b2,
            };
            let [coarse, fine] = [&once, &twice].map(|p| p.of_texel(p.layout.texel(&hit)));
            assert_eq!(parents[fine] as usize, coarse);
        }
    }

    #[test]
    fn they_round_trip_and_are_not_cut_for_ever() {
        let mut patches = Patches::triangles(1);
        for _ in 0..=MAX_DEPTH {
            // One corner of the triangle over and over.
            let which: Vec<bool> = (0..patches.len()).map(|patch| patch == 0).collect();
            patches = patches.cut(&which).0;
        }
        assert_eq!(patches.len(), 1 + 3 * usize::from(MAX_DEPTH));
        let text = serde_json::to_string(&patches).expect("writes");
        let back: Patches = serde_json::from_str(&text).expect("reads back");
        assert_eq!(patches, back);
    }
}
