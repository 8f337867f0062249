//! Mean photographed colour of each face of a mesh, at one common exposure, and the segmentation of meshes by it.

use crate::calibrate::exposure::{Exposures, Observations};
use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::capture::photograph::BELOW_SATURATION;
use crate::capture::segment::{ShownFace, segment};
use crate::capture::working::Working;
use crate::capture::{Capture, Segmentation};
use crate::error::Result;
use crate::scene::prepare::prepare;
use glam::DVec3;
use std::sync::Arc;

/// Pixels of the g-buffer that the exposures are estimated from.
const GBUFFER_PIXELS: usize = 100_000;
/// Seed of the rays inside pixels. It is fixed: the segments of a capture do not depend on the seed of a solve.
const SEED: u64 = 1;

/// For each face, the mean over the pixels whose centre sees it, without held-out pixels.
pub fn shown(problem: &Problem, hold_out: HoldOut) -> Vec<ShownFace> {
    let gbuffer = GBuffer::new(problem, hold_out, SEED, GBUFFER_PIXELS);
    let exposures = Exposures::new(problem, &Observations::new(problem, &gbuffer));
    let corrected = (exposures.filter(Exposures::needed)).map(|found| found.corrected(problem));
    let corrected = corrected.as_ref().unwrap_or(problem);

    let scene = &problem.scene;
    let mut sums = vec![Sum::default(); scene.triangles.len()];
    let photographs = problem.photographs.iter().zip(&corrected.photographs);
    let photographs = photographs.zip(&scene.ids().triangles).enumerate();
    for (frame, ((original, corrected), triangles)) in photographs {
        let saturation = original.saturation * BELOW_SATURATION;
        for (pixel, &triangle) in triangles.iter().enumerate() {
            let Some(sum) = sums.get_mut(triangle as usize) else {
                continue;
            };
            if !original.is_usable(pixel) || hold_out.contains(frame as u32, pixel as u32) {
                continue;
            }
            let is_white = original.pixels[pixel].cmpge(saturation).all();
            // Pixels that are saturated in some channels only are mixtures with clipped light.
            if is_white || !original.is_saturated(pixel) {
                sum.radiance += corrected.pixels[pixel].as_dvec3();
                sum.saturated += u32::from(is_white);
                sum.pixels += 1;
            }
        }
    }
    sums.iter().map(Sum::mean).collect()
}

/// Cuts the mesh of a capture into segments by its normals and its photographed colours.
///
/// # Errors
/// The mesh has no triangle with an area, or no photograph sees the mesh.
pub fn segment_mesh(
    capture: &mut Capture,
    cut: &Segmentation,
    working: &Working,
    hold_out: HoldOut,
) -> Result<()> {
    let prepared = prepare(capture, working)?;
    let problem = Problem {
        scene: Arc::new(prepared.scene),
        photographs: prepared.photographs,
    };
    let lamps = segment(&mut capture.mesh, &shown(&problem, hold_out), cut.wanted);
    let saturated = match lamps {
        0 => String::new(),
        1 => "; one is what photographs show saturated".to_owned(),
        _ => format!("; {lamps} are what photographs show saturated"),
    };
    capture.warnings.push(format!(
        "{}: the mesh has no objects; it was cut into {} segments by normal and by what photographs show (--segments changes the number){saturated}",
        cut.file.display(),
        capture.mesh.objects.len()
    ));
    Ok(())
}

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
