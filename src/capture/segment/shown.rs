//! Colour and saturation of faces from photographs, filled in where few pixels see a face.

use crate::capture::mesh::Mesh;
use crate::capture::segment::sets::Sets;
use glam::{DVec3, DVec4, Vec3};

/// Weight, in pixels, of the neighbours' colour: faces seen by many more pixels are hardly smoothed.
const SMOOTHING_PIXELS: f64 = 4.0;
/// A face or a segment is saturated if more than this fraction of its pixels is: more than half.
pub const MOSTLY: f64 = 0.5;
/// Patches seen by a smaller fraction of all pixels are neither lamps nor holes in lamps.
const MIN_FRACTION: f64 = 1e-4;
/// A saturated patch whose surroundings exceed this fraction of its level (square root of the brightest channel) has no edge: it
/// is brightly lit and no lamp.
const MAX_SURROUND_RATIO: f64 = 0.8;

/// What photographs show of one face, at a common exposure.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ShownFace {
    /// Mean radiance over its pixels; saturated pixels enter with their lower bounds.
    pub radiance: Vec3,
    /// Fraction of its pixels that are saturated in all channels, 0 to 1.
    pub saturated: f32,
    /// Number of pixels; zero for unseen faces.
    pub pixels: u32,
}

/// For each face, the square root of its colour at an arbitrary scale, and whether it belongs to a patch that is mostly
/// saturated: a lamp or a window.
///
/// Faces with few pixels are smoothed by their neighbours. Unseen faces take the vertex colours if there are any, else their
/// neighbours' colours; and whether they are saturated, which vertex colours do not tell, from their neighbours. `own` is the square
/// root of vertex colour per face.
pub fn filled(
    mesh: &Mesh,
    shown: &[ShownFace],
    own: &[DVec3],
    edges: &[[u32; 2]],
) -> (Vec<DVec3>, Vec<bool>) {
    let known: Vec<Known> = shown.iter().map(Known::of).collect();
    let seen = spread(known.clone(), edges);
    let colors = |faces: &[Known]| faces.iter().map(|k| k.features.truncate()).collect();
    let colors = match mesh.vertex_colors.is_empty() {
        true => colors(&seen),
        false => colors(&spread(with_own(known, own), edges)),
    };
    let saturated: Vec<bool> = seen.iter().map(|k| k.features.w > MOSTLY).collect();
    let pixels: Vec<f64> = shown.iter().map(|face| f64::from(face.pixels)).collect();
    let saturated = without_specks(saturated, &pixels, edges, true);
    let saturated = without_specks(saturated, &pixels, edges, false);
    let saturated = without_highlights(saturated, &seen, edges);
    (colors, saturated)
}

/// The features of a face, measured or filled in.
#[derive(Debug, Clone, Copy, Default)]
struct Known {
    /// Square root of colour; w is the fraction of saturated pixels.
    features: DVec4,
    /// Number of pixels; zero where unknown.
    weight: f64,
}

impl Known {
    fn of(face: &ShownFace) -> Self {
        let color = face.radiance.as_dvec3().max(DVec3::ZERO).map(f64::sqrt);
        Self {
            features: color.extend(f64::from(face.saturated)),
            weight: f64::from(face.pixels),
        }
    }
}

/// Fills unseen faces with vertex colours, scaled per channel to the photographs.
fn with_own(mut known: Vec<Known>, own: &[DVec3]) -> Vec<Known> {
    let mut sums = [DVec3::ZERO; 2];
    for (known, own) in known.iter().zip(own) {
        sums[0] += known.features.truncate() * known.weight;
        sums[1] += *own * known.weight;
    }
    let scale = sums[0] / sums[1];
    let scale = DVec3::select(scale.is_finite_mask(), scale, DVec3::ONE);
    for (known, own) in known.iter_mut().zip(own) {
        if known.weight == 0.0 {
            *known = Known {
                features: (*own * scale).extend(0.0),
                weight: 1.0,
            };
        }
    }
    known
}

/// Smooths the known faces and fills the unknown ones.
fn spread(mut known: Vec<Known>, edges: &[[u32; 2]]) -> Vec<Known> {
    smooth(&mut known, edges);
    while fill_from_neighbors(&mut known, edges) {}
    known
}

/// Averages each known face with its neighbours, the less the more pixels see it.
fn smooth(known: &mut [Known], edges: &[[u32; 2]]) {
    let before = known.to_vec();
    let mut sums: Vec<(DVec4, f64)> = (before.iter())
        .map(|k| (k.features * k.weight, k.weight))
        .collect();
    for &[a, b] in edges {
        for (own, other) in [(a, b), (b, a)] {
            let (own, other) = (own as usize, &before[other as usize]);
            let fraction = SMOOTHING_PIXELS / (SMOOTHING_PIXELS + before[own].weight);
            let weight = other.weight.min(SMOOTHING_PIXELS) * fraction;
            sums[own].0 += other.features * weight;
            sums[own].1 += weight;
        }
    }
    for (known, (sum, weight)) in known.iter_mut().zip(sums) {
        if known.weight > 0.0 {
            known.features = sum / weight;
        }
    }
}

/// Fills unknown faces with the mean of their known neighbours; returns whether any was filled.
fn fill_from_neighbors(known: &mut [Known], edges: &[[u32; 2]]) -> bool {
    let mut sums = vec![(DVec4::ZERO, 0.0); known.len()];
    for &[a, b] in edges {
        for (own, other) in [(a, b), (b, a)] {
            let other = known[other as usize];
            if known[own as usize].weight == 0.0 && other.weight > 0.0 {
                sums[own as usize].0 += other.features;
                sums[own as usize].1 += 1.0;
            }
        }
    }
    let mut filled = false;
    for (known, (sum, count)) in known.iter_mut().zip(sums) {
        if count > 0.0 {
            *known = Known {
                features: sum / count,
                weight: 1.0,
            };
            filled = true;
        }
    }
    filled
}

/// Connected patches of faces with equal flags.
fn patches(saturated: &[bool], edges: &[[u32; 2]]) -> Sets {
    let mut sets = Sets::new(saturated.len());
    for &[a, b] in edges {
        if saturated[a as usize] == saturated[b as usize] {
            sets.unite(a, b);
        }
    }
    sets
}

/// Clears saturated patches whose border has no edge in brightness, such as a pool of light on a floor.
fn without_highlights(mut saturated: Vec<bool>, known: &[Known], edges: &[[u32; 2]]) -> Vec<bool> {
    let mut sets = patches(&saturated, edges);
    // (Sum, count) of the brightest channel inside and around each patch.
    let level = |face: u32| known[face as usize].features.truncate().max_element();
    let mut inside = vec![(0.0, 0.0); saturated.len()];
    let mut around = inside.clone();
    for (face, known) in (0..).zip(known) {
        let sum = &mut inside[sets.find(face) as usize];
        sum.0 += level(face) * known.weight;
        sum.1 += known.weight;
    }
    for &[a, b] in edges {
        let (lamp, other) = match [a, b].map(|face| saturated[face as usize]) {
            [true, false] => (a, b),
            [false, true] => (b, a),
            _ => continue,
        };
        let sum = &mut around[sets.find(lamp) as usize];
        sum.0 += level(other);
        sum.1 += 1.0;
    }
    for (face, saturated) in (0..).zip(&mut saturated) {
        let patch = sets.find(face) as usize;
        let (inside, around) = (inside[patch], around[patch]);
        *saturated &= around.0 * inside.1 <= MAX_SURROUND_RATIO * inside.0 * around.1;
    }
    saturated
}

/// Flips patches with flag `kind` that few pixels see; patches with a false flag only if they border on another patch.
fn without_specks(
    mut saturated: Vec<bool>,
    pixels: &[f64],
    edges: &[[u32; 2]],
    kind: bool,
) -> Vec<bool> {
    let mut sets = patches(&saturated, edges);
    let min_pixels = MIN_FRACTION * pixels.iter().sum::<f64>();
    let mut seen = vec![0.0; saturated.len()];
    for (face, pixels) in (0..).zip(pixels) {
        seen[sets.find(face) as usize] += pixels;
    }
    let mut at_border = vec![false; saturated.len()];
    for &[a, b] in edges {
        if saturated[a as usize] != saturated[b as usize] {
            for face in [a, b] {
                at_border[sets.find(face) as usize] = true;
            }
        }
    }
    for (face, saturated) in (0..).zip(&mut saturated) {
        let patch = sets.find(face) as usize;
        if *saturated == kind && seen[patch] < min_pixels && (at_border[patch] || kind) {
            *saturated = !kind;
        }
    }
    saturated
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(radiance: f32, saturated: f32, pixels: u32) -> ShownFace {
        ShownFace {
            radiance: Vec3::splat(radiance),
            saturated,
            pixels,
        }
    }

    /// A strip of faces, each next to the one before.
    fn strip(faces: &[ShownFace]) -> (Vec<DVec3>, Vec<bool>) {
        let edges: Vec<[u32; 2]> = (1..faces.len() as u32).map(|i| [i - 1, i]).collect();
        let own = vec![DVec3::ZERO; faces.len()];
        filled(&Mesh::default(), faces, &own, &edges)
    }

    #[test]
    fn what_no_pixel_sees_is_as_what_is_around_it_and_much_seen_faces_stay() {
        let unseen = ShownFace::default();
        let (colors, _) = strip(&[face(4.0, 0.0, 4000), unseen, unseen, face(1.0, 0.0, 4000)]);
        let found: Vec<f64> = colors.iter().map(|c| c.x).collect();
        let expected = [2.0, 2.0, 1.0, 1.0];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 0.01, "{found} {expected}");
        }
        // One pixel alone is not believed.
        let (colors, _) = strip(&[face(4.0, 0.0, 9), face(0.0, 0.0, 1), face(4.0, 0.0, 9)]);
        assert!(colors[1].x > 1.5, "{}", colors[1]);
    }

    #[test]
    fn a_mesh_fills_what_is_not_seen_with_its_own_colours_in_the_scale_of_photographs() {
        let mesh = Mesh {
            vertex_colors: vec![Vec3::ONE],
            ..Mesh::default()
        };
        let faces = [face(4.0, 0.0, 100), ShownFace::default()];
        let own = [DVec3::splat(0.5), DVec3::splat(0.25)];
        let (colors, _) = filled(&mesh, &faces, &own, &[]);
        assert!((colors[1] - DVec3::ONE).length() < 1e-12, "{}", colors[1]);
    }

    /// Faces of a lamp are smaller than pixels, so that one of three is seen.
    #[test]
    fn a_lamp_is_whole_in_a_mesh_with_vertex_colours() {
        let (wall, lamp) = (face(0.5, 0.0, 1000), face(1.0, 1.0, 1));
        let (before, after) = (vec![wall; 10], vec![wall; 10]);
        let between = (0..90).map(|i| {
            if i % 3 == 0 {
                lamp
            } else {
                ShownFace::default()
            }
        });
        let faces: Vec<ShownFace> = before.into_iter().chain(between).chain(after).collect();
        let colored = Mesh {
            vertex_colors: vec![Vec3::ONE],
            ..Mesh::default()
        };
        let edges: Vec<[u32; 2]> = (1..110).map(|i| [i - 1, i]).collect();
        for mesh in [Mesh::default(), colored] {
            let (_, saturated) = filled(&mesh, &faces, &[DVec3::ONE; 110], &edges);
            // Two faces at each end are between lamp and wall.
            assert!(saturated[12..98].iter().all(|lamp| *lamp));
            assert!(
                !saturated[..10]
                    .iter()
                    .chain(&saturated[100..])
                    .any(|lamp| *lamp)
            );
        }
    }

    #[test]
    fn lamps_are_patches_that_most_pixels_show_saturated_and_specks_are_none() {
        let wall = face(0.5, 0.1, 100_000);
        let lamp = face(1.0, 0.9, 100);
        let hole = face(1.0, 0.2, 2);
        let (_, saturated) = strip(&[wall, wall, lamp, lamp, hole, lamp, lamp, wall, wall]);
        let expected = [false, false, true, true, true, true, true, false, false];
        assert_eq!(saturated, expected);
        let speck = face(1.0, 1.0, 12);
        let (_, saturated) = strip(&[wall, wall, speck, wall, wall]);
        assert_eq!(saturated, [false; 5]);
    }

    #[test]
    fn a_pool_of_light_that_saturates_is_no_lamp_and_a_pane_of_the_same_radiance_is() {
        let lit = [0.2, 0.5, 0.9, 1.0, 1.0, 1.0, 0.9, 0.5, 0.2];
        // An orange floor, white only where all channels are saturated.
        let shown = |radiance: &f32| match *radiance {
            1.0 => face(1.0, 1.0, 100),
            level => ShownFace {
                radiance: Vec3::new(level, 0.5 * level, 0.2 * level),
                saturated: 0.0,
                pixels: 100,
            },
        };
        let (_, saturated) = strip(&lit.each_ref().map(shown));
        assert_eq!(saturated, [false; 9]);
        let pane = [0.2, 0.2, 0.2, 1.0, 1.0, 1.0, 0.2, 0.2, 0.2];
        let (_, saturated) = strip(&pane.each_ref().map(shown));
        assert_eq!(saturated, pane.map(|radiance| radiance == 1.0));
    }
}
