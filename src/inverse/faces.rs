//! What photographs show of each face of a mesh, all brought to one exposure, for segments that follow it.

use crate::capture::photograph::BELOW_SATURATION;
use crate::capture::segment::ShownFace;
use crate::inverse::exposure::{Exposures, Sights};
use crate::inverse::held_out::{HoldOut, is_held_out};
use crate::inverse::solver::Problem;
use crate::inverse::survey::Survey;
use glam::DVec3;

/// Pixels that are looked at for the exposures.
const SURVEY_PIXELS: usize = 100_000;

/// For each face what the pixels show whose centres see it; those that are held out say nothing.
pub fn shown(problem: &Problem, hold_out: HoldOut) -> Vec<ShownFace> {
    let settings = hold_out.settings();
    let survey = Survey::new(problem, &settings, SURVEY_PIXELS);
    let exposures = Exposures::new(problem, &Sights::new(problem, &survey));
    let undone = (exposures.filter(Exposures::needed)).map(|found| found.undone(problem));
    let alike = undone.as_ref().unwrap_or(problem);

    let scene = &problem.scene;
    let mut sums = vec![Sum::default(); scene.triangles.len()];
    let photographs = problem.photographs.iter().zip(&alike.photographs);
    for (frame, ((taken, alike), triangles)) in photographs.zip(&scene.ids().triangles).enumerate()
    {
        let full = taken.saturation * BELOW_SATURATION;
        for (pixel, &triangle) in triangles.iter().enumerate() {
            let Some(sum) = sums.get_mut(triangle as usize) else {
                continue;
            };
            if !taken.is_usable(pixel) || is_held_out(&settings, frame as u32, pixel as u32) {
                continue;
            }
            let is_full = taken.pixels[pixel].cmpge(full).all();
            // What lies beside is a mixture with clipped light.
            if is_full || !taken.is_saturated(pixel) {
                sum.radiance += alike.pixels[pixel].as_dvec3();
                sum.saturated += u32::from(is_full);
                sum.pixels += 1;
            }
        }
    }
    sums.iter().map(Sum::mean).collect()
}

/// Sums over the pixels of a face.
#[derive(Clone, Copy, Default)]
struct Sum {
    radiance: DVec3,
    saturated: u32,
    pixels: u32,
}

impl Sum {
    fn mean(&self) -> ShownFace {
        let pixels = f64::from(self.pixels.max(1));
        ShownFace {
            radiance: (self.radiance / pixels).as_vec3(),
            saturated: (f64::from(self.saturated) / pixels) as f32,
            pixels: self.pixels,
        }
    }
}
