//! Study: composites with inserted objects against true renderings.

use crate::capture::exposure::Exposure;
use crate::compose::backdrop::Backdrop;
use crate::compose::denoise::denoised;
use crate::compose::insert::{Insertion, Layers};
use crate::compose::naive::{Pasted, harmonics_of_estimate, harmonics_of_photographs};
use crate::compose::placement::{PlacedObject, Placement};
use crate::error::Result;
use crate::export::picture::percentile_exposure;
use crate::export::plot::{Axis, Plot, Series};
use crate::export::table::Table;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::math::picture::Picture;
use crate::study::experiments::course::{CACHE_WITHOUT, cache_settings, paper_settings, solved};
use crate::study::experiments::furnished::{Furnished, built_in, of_twin};
use crate::study::experiments::likeness::Likeness;
use crate::study::experiments::study::{Bench, Findings, Grid, Study, Summary, brief};
use crate::study::experiments::twin::twin_of_size;
use crate::transport::denoise::Denoiser;
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use std::sync::Arc;

pub const STUDY: Study = Study {
    name: "insertion",
    question: "The paper: objects composited with the light found are consistent with the photograph, naive ones are not. By \
        how much, against a true rendering with the objects in the room?",
    seeds: 1,
    run,
};

const TRUTH_SEED: u64 = 0x7472_7574;
/// Shadow and bleed are the pixels beside the objects that change by more than this fraction.
const CHANGED: f32 = 0.05;
const WAYS: [&str; 5] = [
    "naive, light of the photographs",
    "naive, light of the estimate",
    "ours, transport cache",
    "ours, the paper's descent",
    "ours, true light",
];
const TITLES: [&str; 4] = ["truth", "naive, photographs", "naive, estimate", "ours"];
const PLACES: [&str; 2] = ["objects", "shadow and bleed"];

/// Results in one room: similarity by method and region.
struct Scene {
    name: String,
    /// Suffix of its pictures.
    file: &'static str,
    likeness: [[Likeness; 2]; 5],
    grid: Grid,
}

fn run(bench: &Bench) -> Result<Findings> {
    // Time of the paper's descent in each room, in seconds.
    let time = match bench.limits(4).seconds {
        seconds if seconds.is_finite() => seconds,
        _ => 2.0,
    };
    let (long_side, paths) = match bench.quick {
        true => (40, 1_000_000),
        false => (160, 20_000_000),
    };
    let rooms = match twin_of_size(bench, long_side, paths)? {
        Some(twin) => vec![(of_twin(twin)?, false, "-twin")],
        None => vec![
            (built_in(true, bench.quick)?, true, "-textured"),
            (built_in(false, bench.quick)?, false, "-plain"),
        ],
    };
    let (mut scenes, mut how) = (Vec::new(), String::new());
    for (room, textured, file) in rooms {
        bench.begin(&room.name)?;
        how += &format!("{} Photographs {:?}. ", room.how, room.frames);
        let cache = Settings {
            textures: textured && !bench.quick,
            ..cache_settings(1, bench.quick)
        };
        let paper = Settings {
            time,
            exposures: false,
            ..paper_settings(1)
        };
        let cache = solved(bench, &room.subject, &cache)?.estimate;
        let paper = solved(bench, &room.subject, &paper)?.estimate;
        bench.begin(&format!("{}, composites", room.name))?;
        scenes.push(scene(&room, file, &cache, &paper, bench.quick)?);
        (bench.show)(plot(&scenes));
    }
    Ok(Findings {
        how: format!(
            "{how}Each room is solved once by the transport cache, with {CACHE_WITHOUT}{}, and once by preset `paper`, which anneals, for {} s at most. \
             The chairs are put into these photographs by each way and compared with a path-traced rendering of the room \
             with the chairs in its mesh. Ours are denoised, with as many samples as `relit insert` takes by default. PSNR and SSIM are of the pictures as shown (the truth's 99th percentile at 1, \
             sRGB); shadow and bleed are the pixels beside the chairs that they change by more than {} %. The composites' \
             noise and the photographs' count as error, also where the true light is used.",
            match bench.subject.is_some() || bench.quick {
                true => "",
                false => " (but for textures in the textured room)",
            },
            brief(time),
            CHANGED * 100.0,
        ),
        tables: vec![("", table(&scenes))],
        plots: vec![("", plot(&scenes))],
        summary: summary(&scenes),
        seen: scenes.iter().flat_map(seen).collect(),
        pictures: scenes.into_iter().map(|s| (s.file, s.grid)).collect(),
    })
}

/// Composites by every method in all frames, compared with the truth.
fn scene(
    room: &Furnished,
    file: &'static str,
    cache: &Estimate,
    paper: &Estimate,
    quick: bool,
) -> Result<Scene> {
    // As many samples as `relit insert` takes by default.
    let (truth_samples, samples) = if quick { (128, 32) } else { (512, 64) };
    let problem = &room.subject.problem;
    let scene = &problem.scene;
    let as_modelled = Placement::new("chairs", None);
    let objects = (room.models.iter())
        .map(|model| PlacedObject::new(model.clone(), &as_modelled, scene).map(Arc::new))
        .collect::<Result<Vec<_>>>()?;
    let pictures: Vec<Picture> = (problem.photographs.iter()).map(|p| p.picture()).collect();
    let photographed = harmonics_of_photographs(scene.cameras.iter().zip(&pictures));
    let mut found = Scene {
        name: room.name.clone(),
        file,
        likeness: [[Likeness::default(); 2]; 5],
        grid: Grid {
            columns: WAYS.len() - 1,
            exposure: 1.0,
            pictures: Vec::new(),
        },
    };
    for &frame in &room.frames {
        let camera = &scene.cameras[frame];
        let photograph = &problem.photographs[frame];
        let backdrop = Backdrop::new(frame, camera, photograph, Exposure::default())?;
        let composite = |lit: &Arc<LitScene>, options: PathOptions| {
            insert(lit, &backdrop, &objects, options, [1, 2], samples)
        };
        let full = PathOptions::default();
        let lit = Arc::new(cache.lit(scene));
        let estimated: Vec<_> = (objects.iter())
            .map(|object| harmonics_of_estimate(&lit, object.center, &full, 1))
            .collect();
        let of_photographs = vec![photographed; objects.len()];
        // The descent's estimate is only right with the bounces that it was fitted with.
        let two_bounces = PathOptions {
            max_bounces: paper_settings(1).max_bounces(),
            ..full
        };
        let pasted = |harmonics: &[_]| {
            let pasted = Pasted::new(&backdrop, &lit, &objects, harmonics, Exposure::default());
            pasted.over(&backdrop.photograph)
        };
        let (with_truth, layers) = composite(&Arc::new(room.lit.clone()), full);
        let ways = [
            pasted(&of_photographs),
            pasted(&estimated),
            composite(&lit, full).0,
            composite(&Arc::new(paper.lit(scene)), two_bounces).0,
            with_truth,
        ];

        // The truth, and where it differs from the empty room.
        let mut film = Film::new(camera);
        let (world, key) = (&room.furnished, frame as u64);
        film.add(world, camera, &full, TRUTH_SEED, key, truth_samples);
        let truth = film.picture();
        let changes = layers.delta.pixels.iter().zip(&layers.without.pixels);
        let masks = [
            layers.alpha.iter().map(|&alpha| alpha > 0.5).collect(),
            (changes.zip(&layers.alpha))
                .map(|((d, w), &a)| a == 0.0 && d.abs().element_sum() > CHANGED * w.element_sum())
                .collect::<Vec<bool>>(),
        ];
        let exposure = percentile_exposure(&truth.pixels);
        for (likeness, picture) in found.likeness.iter_mut().zip(&ways) {
            for (likeness, mask) in likeness.iter_mut().zip(&masks) {
                likeness.add(picture, &truth, exposure, mask);
            }
        }
        found.grid.exposure = exposure;
        let shown = std::iter::once(truth).chain(ways);
        let titles = TITLES.iter().map(|title| (*title).to_owned());
        found.grid.pictures.extend(titles.zip(shown));
    }
    Ok(found)
}

/// The denoised composite and its layers, of two halves with their own seeds.
pub fn insert(
    lit: &Arc<LitScene>,
    backdrop: &Backdrop,
    objects: &[Arc<PlacedObject>],
    options: PathOptions,
    seeds: [u64; 2],
    samples: u32,
) -> (Picture, Layers) {
    let [a, b] = seeds.map(|seed| {
        let (lit, objects) = (lit.clone(), objects.to_vec());
        let mut half = Insertion::new(backdrop.clone(), lit, objects, options, seed);
        half.pass(samples / 2);
        half
    });
    denoised([&a, &b], Denoiser::Builtin)
}

fn table(scenes: &[Scene]) -> Table {
    let mut table = Table::new("room,way,place,pixels,relative_error,psnr,ssim");
    for scene in scenes {
        for (way, places) in WAYS.iter().zip(&scene.likeness) {
            for (place, likeness) in PLACES.iter().zip(places) {
                table.row((
                    scene.name.as_str(),
                    (*way),
                    (*place),
                    likeness.pixels(),
                    likeness.relative(),
                    likeness.psnr(),
                    likeness.ssim(),
                ));
            }
        }
    }
    table
}

fn plot(scenes: &[Scene]) -> Plot {
    let series = scenes.iter().flat_map(|scene| {
        (0..PLACES.len()).map(|place| {
            let ways = (1u32..).zip(&scene.likeness);
            let points = ways.map(|(way, likeness)| [f64::from(way), likeness[place].psnr()]);
            Series::line(format!("{}, {}", scene.name, PLACES[place]), points)
        })
    });
    Plot {
        title: "Composites against a true rendering".to_owned(),
        x: Axis::linear(
            "1, 2: naive by photographs, by estimate; 3, 4, 5: ours by cache, by descent, by truth",
        ),
        y: Axis::linear("PSNR, dB"),
        series: series.collect(),
        ..Plot::default()
    }
}

fn summary(scenes: &[Scene]) -> Summary {
    let words = |l: &Likeness| {
        let error = brief(l.relative());
        format!("{error} · {:.1} dB · {:.3}", l.psnr(), l.ssim())
    };
    let rows = scenes.iter().flat_map(|scene| {
        (WAYS.iter().zip(&scene.likeness)).map(move |(way, [objects, shadow])| {
            vec![
                scene.name.clone(),
                (*way).to_owned(),
                words(objects),
                words(shadow),
            ]
        })
    });
    Summary {
        columns: "room | way | objects: relative error · PSNR · SSIM | shadow and bleed: the same",
        rows: rows.collect(),
    }
}

fn seen(scene: &Scene) -> Vec<String> {
    let [photographs, estimate, ours, paper, truth] = &scene.likeness;
    let comparison = |place: usize| {
        let naive = f64::max(photographs[place].psnr(), estimate[place].psnr());
        let gain = ours[place].psnr() - naive;
        format!(
            "{}: ours {:.1} dB, the better naive one {naive:.1} dB, a difference of {gain:+.1} dB",
            PLACES[place],
            ours[place].psnr(),
        )
    };
    vec![
        format!("{}, {}. {}.", scene.name, comparison(0), comparison(1)),
        format!(
            "{}: the same composite with the true light and materials is at {:.1} dB and {:.1} dB, where \
             noise and compositing are all that is left; with what the paper's descent found in its time at {:.1} dB and {:.1} dB.",
            scene.name,
            truth[0].psnr(),
            truth[1].psnr(),
            paper[0].psnr(),
            paper[1].psnr(),
        ),
    ]
}
