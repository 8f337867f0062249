//! Converts the state of a descent to an estimate.

use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::problem::Problem;
use crate::inverse::estimate::{Estimate, ObjectEstimate, TexelEstimate};
use crate::inverse::paper::descent::Descent;
use crate::scene::Scene;
use crate::transport::material::TexelColors;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// For each object, why the photographs do not determine it; empty if they do.
pub fn undetermined(problem: &Problem, gbuffer: &GBuffer) -> Vec<&'static str> {
    let mut lit = false;
    let mut measured = vec![false; problem.scene.objects.len()];
    for pixel in gbuffer.pixels.iter().filter(|p| !p.held_out) {
        let photograph = &problem.photographs[pixel.frame as usize];
        let radiance = photograph.pixels[pixel.pixel as usize];
        lit |= radiance.max_element() > 0.0;
        if let Some(measured) = measured.get_mut(pixel.object as usize) {
            *measured |= !photograph.is_saturated(pixel.pixel as usize);
        }
    }
    (gbuffer.seen.iter().zip(measured))
        .map(|(&seen, measured)| match (seen, measured) {
            (0, _) => "no photograph sees it",
            (_, false) => "all of its pixels are saturated or held out",
            _ if !lit => "the photographs show no light",
            _ => "",
        })
        .collect()
}

/// The estimate of the averaged parameters; `covered` is the number of pixels of each patch. The paper's descent has no standard
/// errors: the width of the range is reported instead. Objects with a note in `notes` are reported as not identifiable.
pub fn describe(
    problem: &Problem,
    gbuffer: &GBuffer,
    notes: &[&str],
    descent: &Descent,
    covered: &[u64],
) -> Estimate {
    let scene = &problem.scene;
    let (albedos, emissions) = descent.averaged();
    let own = &albedos[scene.objects.len()..];
    let texels = descent.patches.as_ref().map(|patches| TexelEstimate {
        colors: Arc::new(TexelColors {
            layout: patches.layout.clone(),
            colors: patches.spread(own),
        }),
        stderr: vec![Vec3::ONE; patches.layout.len()],
        seen: (patches.spread(covered).into_iter())
            .map(|pixels| u32::try_from(pixels).unwrap_or(u32::MAX))
            .collect(),
        textured: vec![true; scene.objects.len()],
    });
    let objects = (0..scene.objects.len())
        .map(|k| {
            let albedo = match &texels {
                None => albedos[k],
                Some(texels) => mean_albedo(scene, k, &texels.colors),
            };
            let emission = emissions[k];
            ObjectEstimate {
                albedo,
                albedo_stderr: Vec3::ONE,
                emission,
                emission_stderr: emission.max(Vec3::splat(emission.max_element())),
                seen_pixels: gbuffer.seen[k],
                identifiable: notes[k].is_empty(),
                albedo_identifiable: notes[k].is_empty(),
                note: notes[k].to_owned(),
                ..Default::default()
            }
        })
        .collect();
    Estimate {
        objects,
        texels: texels.map(Arc::new),
        ..Default::default()
    }
}

fn mean_albedo(scene: &Scene, object: usize, texels: &TexelColors) -> Vec3 {
    let object = &scene.objects[object];
    let mut sum = DVec3::ZERO;
    for &triangle in &object.triangles {
        let triangle = triangle as usize;
        let [first, end] = [0, 1].map(|i| texels.layout.first[triangle + i] as usize);
        let colors: DVec3 = (texels.colors[first..end].iter())
            .map(|color| color.as_dvec3())
            .sum();
        sum += colors / (end - first) as f64 * f64::from(scene.areas[triangle]);
    }
    if object.area > 0.0 {
        (sum / object.area).as_vec3()
    } else {
        Vec3::ZERO
    }
}
