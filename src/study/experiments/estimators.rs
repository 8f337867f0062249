//! Study: bias of a fit from noise in its renders, by loss and by the samples of the derivative.

use crate::error::Result;
use crate::export::plot::{Axis, Plot, Series};
use crate::export::table::Table;
use crate::math::color::luminance_f64;
use crate::math::rng::Stream;
use crate::math::stats::{Moments, weighted_median};
use crate::room::photographs::Rendering;
use crate::scene::visibility::NOTHING;
use crate::study::experiments::box_room;
use crate::study::experiments::study::{Bench, Findings, Study, Summary, brief};
use crate::study::experiments::twin::studied;
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, radiance};
use glam::DVec3;
use rayon::prelude::*;

pub const STUDY: Study = Study {
    name: "estimators",
    question: "The paper takes colour and derivative of an l1 loss from independent samples. Is the fit then free of bias, \
        and what do an l2 loss with the same samples and one with two independent sets give?",
    seeds: 5,
    run,
};

/// Samples per pixel.
const SAMPLES: &[u32] = &[1, 2, 4, 8, 16, 32, 64];
const QUICK_SAMPLES: &[u32] = &[1, 4, 16];
/// First key of the samples, for the photographs and the fits.
const KEY: u64 = 0x6573_7469;
/// Most pixels that are rendered; the box room's photographs have fewer.
const MAX_PIXELS: usize = 12_000;
/// Largest bias that counts as none.
const SMALL: f64 = 0.01;

/// Fits the light's scale to pixels.
type Estimator = fn(&[Pixel]) -> f64;

const ESTIMATORS: [(&str, Estimator); 4] = [
    ("l1, same samples", |pixels| l1(pixels, |p| p.render[0])),
    ("l1, independent samples", |pixels| {
        l1(pixels, |p| p.render[1])
    }),
    ("l2, same samples", |pixels| {
        let over = |p: &Pixel| p.render[0] * p.photograph;
        ratio(pixels, over, |p| p.render[0] * p.render[0])
    }),
    ("l2, two sets", |pixels| {
        let both = |p: &Pixel| 0.5 * (p.render[0] + p.render[1]) * p.photograph;
        ratio(pixels, both, |p| p.render[0] * p.render[1])
    }),
];

/// Luminances of a pixel: the photograph, and two independent renders at the true values.
struct Pixel {
    photograph: f64,
    render: [f64; 2],
}

/// Fits of the light's scale to renders of one number of samples; the true value is 1.
struct Fits {
    samples: u32,
    /// For each seed, from 1: the scale by each estimator.
    scales: Vec<[f64; ESTIMATORS.len()]>,
    /// Mean of the expected l2 fits with the same samples.
    predicted: f64,
}

impl Fits {
    /// Mean and spread over seeds, without fits that have no finite root.
    fn mean(&self, estimator: usize) -> Moments {
        let scales = self.scales.iter().map(|scales| scales[estimator]);
        scales.filter(|scale| scale.is_finite()).collect()
    }

    fn value(&self, estimator: usize) -> String {
        let (fits, seeds) = (self.mean(estimator), self.scales.len() as u64);
        match fits.count {
            0 => "no finite root".to_owned(),
            all if all == seeds => format!("{:.4}", fits.mean),
            some => format!(
                "{:.4} ({some} of {seeds} seeds have a finite root)",
                fits.mean
            ),
        }
    }
}

fn run(bench: &Bench) -> Result<Findings> {
    let (size, reference, samples) = match bench.quick {
        true => ([24, 18], 256, QUICK_SAMPLES),
        false => ([48, 36], 1024, SAMPLES),
    };
    let rendering = Rendering {
        size,
        ..box_room::rendering(bench.quick)
    };
    let studied = studied(bench, rendering)?;
    let lit = studied.room.lit(studied.rendering.size)?;

    let options = |sample_emitters| PathOptions {
        sample_emitters,
        ..PathOptions::default()
    };
    bench.begin("photographs")?;
    let photographs = render(&lit, &options(true), [KEY, 0], reference);
    let mut table = Table::new("sampling,estimator,samples,seed,scale,predicted");
    let mut plots = Vec::new();
    let mut summary = Summary {
        columns: "sampling | samples a pixel | l1, same samples | l1, independent samples | l2, same samples | \
                  l2 same, predicted | l2, two sets",
        rows: Vec::new(),
    };
    let mut seen = Vec::new();
    // BSDF sampling alone is noisy, like light through a door; MIS is not.
    for (name, suffix, options) in [
        ("BSDF sampling", "", options(false)),
        ("both (MIS)", "-mis", options(true)),
    ] {
        let mut fits: Vec<Fits> = Vec::new();
        for &count in samples {
            bench.begin(&format!("{name}, {count} samples a pixel"))?;
            let (mut scales, mut predicted) = (Vec::new(), Moments::default());
            for seed in bench.seeds() {
                let sets = [1, 2].map(|set| render(&lit, &options, [KEY + seed, set], count));
                let pixels = pixels(&photographs, &sets);
                predicted.push(same_samples_predicted(&pixels));
                scales.push(ESTIMATORS.map(|(_, fit)| fit(&pixels)));
            }
            fits.push(Fits {
                samples: count,
                scales,
                predicted: predicted.mean,
            });
            (bench.show)(plot(name, &fits));
        }
        for at in &fits {
            for (seed, scales) in (1u64..).zip(&at.scales) {
                for (index, (estimator, _)) in ESTIMATORS.iter().enumerate() {
                    table.row((
                        name,
                        (*estimator),
                        u64::from(at.samples),
                        seed,
                        scales[index],
                        (index == 2).then_some(at.predicted),
                    ));
                }
            }
            let [a, b, c, d] = [0, 1, 2, 3].map(|estimator| at.value(estimator));
            let predicted = format!("{:.4}", at.predicted);
            let name = name.to_owned();
            (summary.rows).push(vec![name, at.samples.to_string(), a, b, c, predicted, d]);
        }
        plots.push((suffix, plot(name, &fits)));
        seen.extend(sentences(name, &fits));
    }
    Ok(Findings {
        how: format!(
            "{}. One unknown, the brightness of all lamps, fitted exactly (no descent) to \
             photographs of {reference} paths a pixel at renders of few paths, {} seeds; 1 is right. Pixels that see the \
             lamps themselves are left out, since their renders carry no noise. \
             Both losses are minimised, or their derivative brought to zero where it uses other samples than the colour.",
            studied.words, bench.seeds,
        ),
        tables: vec![("", table)],
        plots,
        summary,
        seen,
        ..Findings::default()
    })
}

/// Luminance of the pixels of all cameras that see no lamp, in order; of an evenly spread subset of too many. Keyed by seed and
/// set.
fn render(lit: &LitScene, options: &PathOptions, [seed, set]: [u64; 2], samples: u32) -> Vec<f64> {
    let scene = &lit.scene;
    let is_lamp = |object: u32| lit.materials[object as usize].emission.max_element() > 0.0;
    let seen = &scene.ids().triangles;
    let frames = scene.cameras.iter().enumerate();
    let pixels: Vec<(usize, usize)> = frames
        .flat_map(|(frame, _)| (0..seen[frame].len()).map(move |pixel| (frame, pixel)))
        .filter(|&(frame, pixel)| {
            let triangle = seen[frame][pixel];
            triangle != NOTHING && !is_lamp(scene.object_of[triangle as usize])
        })
        .collect();
    let count = pixels.len().min(MAX_PIXELS);
    (0..count)
        .into_par_iter()
        .map(|index| {
            let (frame, pixel) = pixels[index * pixels.len() / count];
            let camera = &scene.cameras[frame];
            // Through the pixel's centre, so that only the light is noisy.
            let ray = camera.ray(camera.corner(pixel) + 0.5);
            let mut sum = DVec3::ZERO;
            for sample in 0..samples {
                let key = (set << 32) + u64::from(sample);
                let mut stream = Stream::new(seed, frame as u64, pixel as u64, key);
                sum += radiance(lit, &ray, &mut stream, options)
                    .radiance
                    .as_dvec3();
            }
            luminance_f64(sum / f64::from(samples))
        })
        .collect()
}

fn pixels(photographs: &[f64], sets: &[Vec<f64>; 2]) -> Vec<Pixel> {
    let renders = sets[0].iter().zip(&sets[1]);
    (photographs.iter().zip(renders))
        .map(|(&photograph, (&a, &b))| Pixel {
            photograph,
            render: [a, b],
        })
        .collect()
}

fn ratio(pixels: &[Pixel], over: impl Fn(&Pixel) -> f64, under: impl Fn(&Pixel) -> f64) -> f64 {
    pixels.iter().map(over).sum::<f64>() / pixels.iter().map(under).sum::<f64>()
}

/// The root θ of Σ sign(θ·x − y)·w, with a pixel's first render x, photograph y and derivative w: the median of y / x
/// weighted by w. Where x = 0 the sign is negative for every θ.
fn l1(pixels: &[Pixel], weight: impl Fn(&Pixel) -> f64) -> f64 {
    let roots = pixels
        .iter()
        .map(|p| (p.photograph / p.render[0].max(0.0), weight(p)))
        .filter(|(root, weight)| !root.is_nan() && *weight > 0.0)
        .collect();
    weighted_median(roots).unwrap_or(f64::NAN)
}

/// Expected l2 fit with the same samples: Σ x² / Σ (x² + σ²), the variance σ² of a render from the difference of the two.
fn same_samples_predicted(pixels: &[Pixel]) -> f64 {
    let noise = |p: &Pixel| 0.5 * (p.render[0] - p.render[1]).powi(2);
    let square = |p: &Pixel| p.photograph.powi(2);
    ratio(pixels, square, |p| square(p) + noise(p))
}

fn plot(name: &str, fits: &[Fits]) -> Plot {
    let mut series: Vec<Series> = Vec::new();
    for (estimator, (name, _)) in ESTIMATORS.iter().enumerate() {
        let known: Vec<(f64, Moments)> = (fits.iter())
            .map(|at| (f64::from(at.samples), at.mean(estimator)))
            .filter(|(_, moments)| moments.count > 0)
            .collect();
        let deviation = |m: &Moments| m.variance().sqrt();
        series.push(Series {
            band: (known.iter())
                .map(|(_, m)| [m.mean - deviation(m), m.mean + deviation(m)])
                .collect(),
            ..Series::line(*name, known.iter().map(|(n, m)| [*n, m.mean]))
        });
    }
    let predicted = fits.iter().map(|at| [f64::from(at.samples), at.predicted]);
    series.push(Series::line("l2, same samples: predicted", predicted));
    Plot {
        title: format!("Fitted brightness of a lamp, paths by {name}"),
        x: Axis::logarithmic("samples a pixel"),
        y: Axis::linear("fitted / true"),
        series,
        ..Plot::default()
    }
}

fn sentences(name: &str, fits: &[Fits]) -> Vec<String> {
    let (Some(few), Some(many)) = (fits.first(), fits.last()) else {
        return Vec::new();
    };
    let mut seen = vec![format!(
        "{name}, {} sample(s) a pixel: l1 with the same samples fits {}, l1 with independent samples {}, l2 with the \
         same samples {}, l2 with two sets {}; with {}: {}, {}, {}, {}.",
        few.samples,
        few.value(0),
        few.value(1),
        few.value(2),
        few.value(3),
        many.samples,
        many.value(0),
        many.value(1),
        many.value(2),
        many.value(3),
    )];
    let seeds = few.scales.len() as u64;
    // The noise of a single seed is unknown.
    if seeds < 2 {
        return seen;
    }
    let listed = |tried: &mut dyn Iterator<Item = &Fits>| -> String {
        let tried: Vec<String> = tried.map(|at| at.samples.to_string()).collect();
        tried.join(", ")
    };
    let biased = |estimator: usize| {
        let found = listed(&mut fits.iter().filter(|at| {
            let moments = at.mean(estimator);
            let bias = (moments.mean - 1.0).abs();
            moments.count < seeds || bias > SMALL.max(3.0 * moments.standard_error())
        }));
        match found.is_empty() {
            true => "none".to_owned(),
            false => found,
        }
    };
    seen.push(format!(
        "{name}: numbers of samples, of {}, at which the fit is off by more than {} % and three standard errors, or a seed has \
         no finite root: l1 with independent samples, the paper's way, {}; l2 with two sets {}.",
        listed(&mut fits.iter()),
        brief(SMALL * 100.0),
        biased(1),
        biased(3),
    ));
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_noise_every_estimator_is_exact_and_noise_darkens_the_fit_of_the_same_samples() {
        let clean: Vec<Pixel> = (1..50)
            .map(|i| Pixel {
                photograph: 3.0 * f64::from(i),
                render: [f64::from(i); 2],
            })
            .collect();
        for (name, fit) in ESTIMATORS {
            assert!((fit(&clean) - 3.0).abs() < 1e-12, "{name}");
        }
        // Renders of 0 or 2 with mean 1: a relative variance of 1 halves the fit.
        let noisy: Vec<Pixel> = (0..4)
            .map(|i| Pixel {
                photograph: 1.0,
                render: [2.0 * f64::from(i / 2), 2.0 * f64::from(i % 2)],
            })
            .collect();
        let fits = ESTIMATORS.map(|(_, fit)| fit(&noisy));
        assert!((fits[2] - 0.5).abs() < 1e-12, "{fits:?}");
        assert!((fits[3] - 1.0).abs() < 1e-12, "{fits:?}");
        assert!((same_samples_predicted(&noisy) - 0.5).abs() < 1e-12);
    }
}
