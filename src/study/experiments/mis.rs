//! What multiple importance sampling buys.

use crate::error::Result;
use crate::export::plot::Plot;
use crate::export::table::Table;
use crate::inverse::settings::{LightSampling, Settings};
use crate::study::experiments::course::{
    Errors, Gauge, Mark, cache_settings, cached, descend, paper_settings,
};
use crate::study::experiments::courses::{self, Kind, Spread, common_mark, plot, table, words};
use crate::study::experiments::findings::brief;
use crate::study::experiments::gradient::{Noise, noise};
use crate::study::experiments::{Bench, Findings, Study, Summary, box_room};

/// The study.
pub const STUDY: Study = Study {
    name: "mis",
    question: "The paper: multiple importance sampling speeds convergence markedly. Against light sampling alone and BSDF \
        sampling alone, under a small lamp and a large one.",
    takes_capture: false,
    seeds: 5,
    run,
};

/// Rooms by their lamp's half side in metres.
const LAMPS: [(&str, f64); 2] = [("small lamp", 0.1), ("large lamp", 0.85)];
/// Mean albedo of the rooms.
const ALBEDO: f64 = 0.5;
const SAMPLINGS: [LightSampling; 3] = [
    LightSampling::Mis,
    LightSampling::Emitter,
    LightSampling::Bsdf,
];
/// A mean apart from another by less than this factor is as good.
const AS_GOOD: f64 = 1.05;

/// One room under one lamp.
struct Scene {
    name: &'static str,
    kinds: Vec<Kind>,
    noises: Vec<Noise>,
    cache: Vec<Mark>,
}

fn run(bench: &Bench) -> Result<Findings> {
    let limits = bench.limits(LAMPS.len() * SAMPLINGS.len() * bench.seeds as usize);
    let (pixels, paths) = if bench.quick { (300, 128) } else { (1000, 512) };
    let mut scenes = Vec::new();
    for (name, lamp) in LAMPS {
        bench.begin(name)?;
        let subject = box_room::photographed(name, ALBEDO, lamp, bench.quick)?;
        let truth = box_room::truth(&box_room::box_room(name, ALBEDO, lamp));
        let gauge = Gauge::new(&subject, paper_settings(1).max_bounces());
        let deep = Gauge::new(&subject, u32::MAX);
        let course = |index: usize, seed| {
            let settings = Settings {
                light_sampling: SAMPLINGS[index],
                ..paper_settings(seed)
            };
            descend(bench, &gauge, &settings, limits)
        };
        let names = SAMPLINGS.map(|sampling| format!("{name}, {}", word(sampling)));
        let over_rays = |kinds: &[Kind]| drawn(name, "rays", |mark| mark.rays as f64, kinds, &[]);
        let kinds = courses::run(bench, names, course, over_rays)?;
        bench.begin(&format!("{name}, variance of gradients"))?;
        let of =
            |sampling: &LightSampling| noise(&subject.problem, &truth, *sampling, pixels, paths);
        scenes.push(Scene {
            name,
            kinds,
            noises: SAMPLINGS.iter().map(of).collect(),
            cache: (bench.seeds())
                .map(|seed| cached(bench, &deep, &cache_settings(seed, bench.quick)))
                .collect::<Result<_>>()?,
        });
    }
    let kinds: Vec<Kind> = scenes
        .iter()
        .flat_map(|scene| scene.kinds.clone())
        .collect();
    let cache: Vec<Mark> = scenes
        .iter()
        .flat_map(|scene| scene.cache.clone())
        .collect();
    let mut plots = Vec::new();
    for (scene, (over_rays, over_seconds)) in scenes
        .iter()
        .zip([("", "-seconds"), ("-large", "-large-seconds")])
    {
        let draw = |label, x| drawn(scene.name, label, x, &scene.kinds, &scene.cache);
        plots.push((over_rays, draw("rays", |mark| mark.rays as f64)));
        plots.push((over_seconds, draw("seconds", |mark| mark.seconds)));
    }
    Ok(Findings {
        how: format!(
            "The paper's descent (batches of 8, two bounces, nothing annealed) in a box room of mean albedo {ALBEDO} under \
             a lamp of half side {} m and one of {} m with the same power, {} seeds. The variance is that of one path's \
             derivative of a pixel's radiance at the true values, summed over unknowns. All surfaces are diffuse. \
             Seconds are those of this machine and whatever else ran on it; rays are the fairer axis.",
            LAMPS[0].1, LAMPS[1].1, bench.seeds,
        ),
        tables: vec![
            ("", table("sampling", &kinds, &cache)),
            ("-variance", variances(&scenes)),
        ],
        plots,
        summary: summary(&scenes),
        seen: scenes.iter().flat_map(seen).collect(),
        ..Findings::default()
    })
}

/// Losses in one room.
fn drawn(name: &str, label: &str, x: fn(&Mark) -> f64, kinds: &[Kind], cache: &[Mark]) -> Plot {
    let loss = |errors: &Errors| errors.loss;
    let held_out = "held-out l1 loss, radiance";
    plot(name, label, held_out, x, loss, kinds, cache)
}

fn word(sampling: LightSampling) -> &'static str {
    match sampling {
        LightSampling::Mis => "both (MIS)",
        LightSampling::Emitter => "light sampling",
        LightSampling::Bsdf => "BSDF sampling",
    }
}

fn variances(scenes: &[Scene]) -> Table {
    let mut table = Table::new(&[
        "scene",
        "sampling",
        "variance",
        "standard_error",
        "rays_per_path",
    ]);
    for scene in scenes {
        for (sampling, noise) in SAMPLINGS.iter().zip(&scene.noises) {
            table.row(&[
                scene.name.into(),
                sampling.word().into(),
                noise.variance.into(),
                noise.error.into(),
                noise.rays.into(),
            ]);
        }
    }
    table
}

/// Loss at the last mark in rays that all of a scene's courses passed.
fn at_equal_rays(scene: &Scene, quantity: fn(&Errors) -> Option<f64>) -> Vec<Option<Spread>> {
    let mark = common_mark(&scene.kinds);
    let loss = |kind: &Kind| mark.and_then(|mark| kind.at_mark(mark, quantity));
    scene.kinds.iter().map(loss).collect()
}

fn summary(scenes: &[Scene]) -> Summary {
    let mut rows = Vec::new();
    for scene in scenes {
        let losses = at_equal_rays(scene, |e| e.loss);
        let albedos = at_equal_rays(scene, |e| e.albedo);
        for (index, (kind, noise)) in scene.kinds.iter().zip(&scene.noises).enumerate() {
            rows.push(vec![
                kind.name.clone(),
                words(losses[index]),
                words(albedos[index]),
                words(kind.at_end(|e| e.loss)),
                format!("{} ± {}", brief(noise.variance), brief(noise.error)),
                format!("{:.2}", noise.rays),
                brief(noise.variance * noise.rays),
            ]);
        }
    }
    Summary {
        columns: vec![
            "scene, sampling",
            "loss at equal rays",
            "albedo error at equal rays",
            "loss at equal time",
            "gradient variance a path",
            "rays a path",
            "variance × rays",
        ],
        rows,
    }
}

fn seen(scene: &Scene) -> Vec<String> {
    let [mis, light, bsdf] = [0, 1, 2].map(|i| scene.noises[i].variance);
    let mut seen = vec![format!(
        "{}: the gradient of one path has {} times the variance with light sampling alone and {} times with BSDF sampling \
         alone, against both together.",
        scene.name,
        brief(light / mis),
        brief(bsdf / mis),
    )];
    if let [Some(mis), Some(light), Some(bsdf)] = at_equal_rays(scene, |e| e.loss)[..] {
        let single = if light.mean < bsdf.mean { light } else { bsdf };
        let verdict = if mis.differs(&single) && mis.mean * AS_GOOD < single.mean {
            "MIS is better than either alone, as the paper says"
        } else if mis.differs(&single) && mis.mean > single.mean * AS_GOOD {
            "the paper is not confirmed: MIS is worse than the better of the two alone"
        } else {
            "the paper is not confirmed: MIS is no better than the better of the two alone"
        };
        seen.push(format!(
            "{}, loss at equal rays: {} with MIS, {} with light sampling, {} with BSDF sampling; {verdict}.",
            scene.name,
            mis.words(),
            light.words(),
            bsdf.words(),
        ));
    }
    seen
}
