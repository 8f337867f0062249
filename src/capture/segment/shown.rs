//! What photographs show of the faces of a mesh, made good where they show little of it.

use crate::capture::mesh::Mesh;
use crate::capture::segment::sets::Sets;
use glam::{DVec3, DVec4, Vec3};

/// A face that more pixels see is hardly smoothed by its neighbours.
const ENOUGH_PIXELS: f64 = 4.0;
/// Patches that a smaller fraction of all pixels see are no lamps, and no holes in lamps.
const MIN_FRACTION: f64 = 1e-4;
/// A patch around which the brightest channel, compressed, is a larger fraction of its own has no edge: it is lit brightly and gives
/// no light.
const NO_EDGE: f64 = 0.8;

/// What photographs show of one face, all brought to one exposure.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ShownFace {
    /// Mean radiance over its pixels; what saturated ones show is a lower bound.
    pub radiance: Vec3,
    /// Fraction of its pixels in which the photograph is saturated in all channels, 0 to 1.
    pub saturated: f32,
    /// Pixels of which it is the mean; zero where no photograph shows it.
    pub pixels: u32,
}

/// For each face its colour, compressed by the square root, in any scale; and whether it belongs to a patch that most
/// photographs of it show saturated: a lamp, or a window.
///
/// Faces that few pixels see take part of their neighbours', those that none sees all of it, or the mesh's own colours where it has any.
pub fn filled(
    mesh: &Mesh,
    shown: &[ShownFace],
    own: &[DVec3],
    edges: &[[u32; 2]],
) -> (Vec<DVec3>, Vec<bool>) {
    let mut known: Vec<Known> = shown.iter().map(Known::of).collect();
    if !mesh.vertex_colors.is_empty() {
        take_own(&mut known, own);
    }
    smooth(&mut known, edges);
    while fill(&mut known, edges) {}
    let bright: Vec<bool> = known.iter().map(|k| k.look.w > 0.5).collect();
    let pixels: Vec<f64> = shown.iter().map(|face| f64::from(face.pixels)).collect();
    let bright = without_specks(bright, &pixels, edges, true);
    let bright = without_specks(bright, &pixels, edges, false);
    let bright = without_highlights(bright, &known, edges);
    (known.iter().map(|k| k.look.truncate()).collect(), bright)
}

/// What is known of a face.
#[derive(Debug, Clone, Copy, Default)]
struct Known {
    /// Compressed colour, and the fraction of saturated pixels.
    look: DVec4,
    /// Pixels that tell it; zero where it is not known.
    weight: f64,
}

impl Known {
    fn of(face: &ShownFace) -> Self {
        let color = face.radiance.as_dvec3().max(DVec3::ZERO).map(f64::sqrt);
        Self {
            look: color.extend(f64::from(face.saturated)),
            weight: f64::from(face.pixels),
        }
    }
}

/// Gives faces that no photograph shows the mesh's own colours, brought to the scale of what photographs show.
fn take_own(known: &mut [Known], own: &[DVec3]) {
    let mut sums = [DVec3::ZERO; 2];
    for (known, own) in known.iter().zip(own) {
        sums[0] += known.look.truncate() * known.weight;
        sums[1] += *own * known.weight;
    }
    let scale = sums[0] / sums[1];
    let scale = DVec3::select(scale.is_finite_mask(), scale, DVec3::ONE);
    for (known, own) in known.iter_mut().zip(own) {
        if known.weight == 0.0 {
            *known = Known {
                look: (*own * scale).extend(0.0),
                weight: 1.0,
            };
        }
    }
}

/// Adds to each known face part of what is known of its neighbours, the less the more pixels see it.
fn smooth(known: &mut [Known], edges: &[[u32; 2]]) {
    let before = known.to_vec();
    let mut sums: Vec<(DVec4, f64)> = (before.iter())
        .map(|k| (k.look * k.weight, k.weight))
        .collect();
    for &[a, b] in edges {
        for (own, other) in [(a, b), (b, a)] {
            let (own, other) = (own as usize, &before[other as usize]);
            let fraction = ENOUGH_PIXELS / (ENOUGH_PIXELS + before[own].weight);
            let weight = other.weight.min(ENOUGH_PIXELS) * fraction;
            sums[own].0 += other.look * weight;
            sums[own].1 += weight;
        }
    }
    for (known, (sum, weight)) in known.iter_mut().zip(sums) {
        if known.weight > 0.0 {
            known.look = sum / weight;
        }
    }
}

/// Gives faces of which nothing is known the mean of what is known of their neighbours; whether there were such.
fn fill(known: &mut [Known], edges: &[[u32; 2]]) -> bool {
    let mut sums = vec![(DVec4::ZERO, 0.0); known.len()];
    for &[a, b] in edges {
        for (own, other) in [(a, b), (b, a)] {
            let other = known[other as usize];
            if known[own as usize].weight == 0.0 && other.weight > 0.0 {
                sums[own as usize].0 += other.look;
                sums[own as usize].1 += 1.0;
            }
        }
    }
    let mut filled = false;
    for (known, (sum, count)) in known.iter_mut().zip(sums) {
        if count > 0.0 {
            *known = Known {
                look: sum / count,
                weight: 1.0,
            };
            filled = true;
        }
    }
    filled
}

/// The patches of neighbours that are alike.
fn patches(bright: &[bool], edges: &[[u32; 2]]) -> Sets {
    let mut sets = Sets::new(bright.len());
    for &[a, b] in edges {
        if bright[a as usize] == bright[b as usize] {
            sets.unite(a, b);
        }
    }
    sets
}

/// Takes for no lamps the patches that rise from what is around them without an edge, as a pool of light on a floor does.
fn without_highlights(mut bright: Vec<bool>, known: &[Known], edges: &[[u32; 2]]) -> Vec<bool> {
    let mut sets = patches(&bright, edges);
    // Sums of the brightest channel inside each patch and around it, with their counts.
    let level = |face: u32| known[face as usize].look.truncate().max_element();
    let mut inside = vec![(0.0, 0.0); bright.len()];
    let mut around = inside.clone();
    for (face, known) in (0..).zip(known) {
        let sum = &mut inside[sets.find(face) as usize];
        sum.0 += level(face) * known.weight;
        sum.1 += known.weight;
    }
    for &[a, b] in edges {
        let (lamp, other) = match [a, b].map(|face| bright[face as usize]) {
            [true, false] => (a, b),
            [false, true] => (b, a),
            _ => continue,
        };
        let sum = &mut around[sets.find(lamp) as usize];
        sum.0 += level(other);
        sum.1 += 1.0;
    }
    for (face, bright) in (0..).zip(&mut bright) {
        let patch = sets.find(face) as usize;
        let (inside, around) = (inside[patch], around[patch]);
        *bright &= around.0 * inside.1 <= NO_EDGE * inside.0 * around.1;
    }
    bright
}

/// Turns patches of one kind that few pixels see, and that border on the other, into that.
fn without_specks(
    mut bright: Vec<bool>,
    pixels: &[f64],
    edges: &[[u32; 2]],
    kind: bool,
) -> Vec<bool> {
    let mut sets = patches(&bright, edges);
    let least = MIN_FRACTION * pixels.iter().sum::<f64>();
    let mut seen = vec![0.0; bright.len()];
    for (face, pixels) in (0..).zip(pixels) {
        seen[sets.find(face) as usize] += pixels;
    }
    let mut at_border = vec![false; bright.len()];
    for &[a, b] in edges {
        if bright[a as usize] != bright[b as usize] {
            for face in [a, b] {
                at_border[sets.find(face) as usize] = true;
            }
        }
    }
    for (face, bright) in (0..).zip(&mut bright) {
        let patch = sets.find(face) as usize;
        if *bright == kind && seen[patch] < least && (at_border[patch] || kind) {
            *bright = !kind;
        }
    }
    bright
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
        let told: Vec<f64> = colors.iter().map(|c| c.x).collect();
        let expected = [2.0, 2.0, 1.0, 1.0];
        for (told, expected) in told.iter().zip(expected) {
            assert!((told - expected).abs() < 0.01, "{told} {expected}");
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

    #[test]
    fn lamps_are_patches_that_most_pixels_show_saturated_and_specks_are_none() {
        let wall = face(0.5, 0.1, 100_000);
        let lamp = face(1.0, 0.9, 100);
        let hole = face(1.0, 0.2, 2);
        let (_, bright) = strip(&[wall, wall, lamp, lamp, hole, lamp, lamp, wall, wall]);
        let expected = [false, false, true, true, true, true, true, false, false];
        assert_eq!(bright, expected);
        let speck = face(1.0, 1.0, 12);
        let (_, bright) = strip(&[wall, wall, speck, wall, wall]);
        assert_eq!(bright, [false; 5]);
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
        let (_, bright) = strip(&lit.each_ref().map(shown));
        assert_eq!(bright, [false; 9]);
        let pane = [0.2, 0.2, 0.2, 1.0, 1.0, 1.0, 0.2, 0.2, 0.2];
        let (_, bright) = strip(&pane.each_ref().map(shown));
        assert_eq!(bright, pane.map(|radiance| radiance == 1.0));
    }
}
