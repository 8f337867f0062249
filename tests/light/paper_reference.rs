//! The Cornell box, photographed by another renderer, against our own rendering of its truth.

use crate::beside::beside;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relit::capture::read::{ReadOptions, read};
use relit::capture::truth::Truth;
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::scene::Scene;
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::{PathOptions, radiance};
use std::sync::Arc;

/// Side of a block in pixels.
const BLOCK: u32 = 16;
/// Paths a pixel of ours; the photographs have 2048, whose noise is taken to be that of as many of ours.
const SAMPLES: u64 = 24;
const PHOTOGRAPH_SAMPLES: u64 = 2048;

/// Mean difference of a set of pixels to the photograph, with its variance.
#[derive(Default, Clone, Copy)]
struct Difference {
    sum: f64,
    variance: f64,
}

impl Difference {
    fn add(&mut self, rendered: &Moments, photographed: f32) {
        let samples = 1.0 / SAMPLES as f64 + 1.0 / PHOTOGRAPH_SAMPLES as f64;
        self.sum += rendered.mean - f64::from(photographed);
        self.variance += rendered.variance() * samples;
    }

    /// In standard errors, which are never taken to be below a thousandth of what is photographed (a block within the
    /// lamp has no noise but rounding) nor a millionth of the whole photograph (none of our few paths may meet what one
    /// of the photograph's thousands met at the box's rim).
    fn z(&self, photographed: f64, whole: f64) -> f64 {
        let least = (1e-3 * photographed).max(1e-6 * whole);
        self.sum / self.variance.sqrt().max(least)
    }
}

/// 960 blocks and channels at 5 standard errors, a false alarm in 1,800 seeds, and 15 whole photographs at 4: in 1,000.
#[test]
fn the_cornell_box_is_reproduced_from_its_truth_within_its_noise() {
    let Some(folder) = beside("captures/cornell") else {
        return;
    };
    let capture = read(&folder, &ReadOptions::default()).expect("the capture is sound");
    let truth = Truth::read(&folder).expect("the truth is sound");
    let scene = Arc::new(Scene::new(&capture).expect("the mesh is sound"));
    let materials = scene.objects.iter().map(|object| {
        let truth = &truth.objects[&object.name];
        Material::diffuse(
            truth.albedo.expect("known").as_vec3(),
            truth.emission.as_vec3(),
        )
    });
    let lit = LitScene::new(scene.clone(), materials.collect(), None);
    for (frame, camera) in scene.cameras.iter().enumerate() {
        let photograph = capture.frames[frame]
            .load()
            .expect("the photograph is sound");
        let (width, pixels) = (photograph.width, photograph.pixels.len() as u32);
        let render = |pixel: u32| {
            let mut moments = [Moments::default(); 3];
            for sample in 0..SAMPLES {
                let mut stream = Stream::new(71, frame as u64, u64::from(pixel), sample);
                let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
                let ray = camera.ray(corner + Vec2::from(stream.uniform2()));
                let path = radiance(&lit, &ray, &mut stream, &PathOptions::default());
                let values: Vec3 = path.radiance;
                moments
                    .iter_mut()
                    .zip(values.to_array())
                    .for_each(|(m, v)| m.push(f64::from(v)));
            }
            moments
        };
        let rendered: Vec<[Moments; 3]> = (0..pixels).into_par_iter().map(render).collect();
        for channel in 0..3 {
            let columns = width.div_ceil(BLOCK);
            let mut blocks = vec![(Difference::default(), 0.0); (columns * columns) as usize];
            let mut whole = (Difference::default(), 0.0);
            for (pixel, rendered) in (0..pixels).zip(&rendered) {
                let block = pixel / width / BLOCK * columns + pixel % width / BLOCK;
                let photographed = photograph.pixels[pixel as usize][channel];
                for set in [&mut blocks[block as usize], &mut whole] {
                    set.0.add(&rendered[channel], photographed);
                    set.1 += f64::from(photographed);
                }
            }
            let z = whole.0.z(0.0, whole.1);
            println!(
                "frame {frame} channel {channel}: {:.4} relative, z {z:.2}",
                whole.0.sum / whole.1
            );
            assert!(z.abs() < 4.0, "frame {frame}, channel {channel}: z {z}");
            assert!(
                whole.0.variance.sqrt() < 0.01 * whole.1,
                "too noisy to tell"
            );
            for (index, (difference, photographed)) in blocks.iter().enumerate() {
                let z = difference.z(*photographed, whole.1);
                assert!(
                    z.abs() < 5.0,
                    "frame {frame}, channel {channel}, block {index}: z {z}"
                );
            }
        }
    }
}
