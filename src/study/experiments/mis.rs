//! What multiple importance sampling buys.

use crate::error::Result;
use crate::export::plot::Plot;
use crate::export::table::Table;
use crate::inverse::settings::{LightSampling, Settings};
use crate::room::Room;
use crate::study::experiments::course::{
    Errors, Gauge, Mark, cache_settings, cached, descend, paper_settings,
};
use crate::study::experiments::courses::{self, Kind, Spread, common_mark, plot, table, words};
use crate::study::experiments::findings::brief;
use crate::study::experiments::gradient::{Noise, noise};
use crate::study::experiments::{Bench, Findings, Study, Summary, box_room};
use crate::transport::material::Lobe;
use glam::Vec3;

/// The study.
pub const STUDY: Study = Study {
    name: "mis",
    question: "The paper: multiple importance sampling speeds convergence markedly. Against light sampling alone and BSDF \
        sampling alone, under a small lamp and a large one, and with a rough surface near a lamp.",
    takes_capture: false,
    seeds: 5,
    run,
};

/// The rooms.
const ROOMS: [Lighting; 3] = [
    Lighting {
        name: "small lamp",
        files: ["", "-seconds"],
        lamp: 0.1,
        board: None,
    },
    Lighting {
        name: "large lamp",
        files: ["-large", "-large-seconds"],
        lamp: 0.85,
        board: None,
    },
    Lighting {
        name: "rough board near a lamp",
        files: ["-rough", "-rough-seconds"],
        lamp: 0.4,
        board: Some(Lobe {
            roughness: 0.1,
            specular: Vec3::splat(0.3),
        }),
    },
];
/// Mean albedo of the rooms.
const ALBEDO: f64 = 0.5;
const SAMPLINGS: [LightSampling; 3] = [
    LightSampling::Mis,
    LightSampling::Emitter,
    LightSampling::Bsdf,
];
/// A mean apart from another by less than this factor is as good.
const AS_GOOD: f64 = 1.05;

/// How one of the rooms is lit.
struct Lighting {
    name: &'static str,
    /// What the names of its plots over rays and over seconds end with.
    files: [&'static str; 2],
    /// Half side of the lamp in metres.
    lamp: f64,
    /// Lobe of a board below the lamp; `None` where all is diffuse.
    board: Option<Lobe>,
}

impl Lighting {
    fn room(&self) -> Room {
        match self.board {
            Some(lobe) => box_room::board_room(self.name, ALBEDO, self.lamp, lobe),
            None => box_room::box_room(self.name, ALBEDO, self.lamp),
        }
    }
}

/// What was measured in one room.
struct Scene {
    name: &'static str,
    files: [&'static str; 2],
    kinds: Vec<Kind>,
    noises: Vec<Noise>,
    cache: Vec<Mark>,
}

fn run(bench: &Bench) -> Result<Findings> {
    let limits = bench.limits(ROOMS.len() * SAMPLINGS.len() * bench.seeds as usize);
    let (pixels, paths) = if bench.quick { (300, 128) } else { (1000, 512) };
    let mut scenes = Vec::new();
    for lighting in &ROOMS {
        let name = lighting.name;
        bench.begin(name)?;
        let room = lighting.room();
        let subject = box_room::photograph(&room, bench.quick)?;
        let truth = box_room::truth(&room);
        let lobes: Vec<Option<Lobe>> = room.materials.iter().map(|m| m.lobe).collect();
        let bounces = paper_settings(1).max_bounces();
        let gauge = Gauge::new(&subject, bounces).knowing(lobes.clone());
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
        let of = |sampling: &LightSampling| {
            noise(&subject.problem, &truth, &lobes, *sampling, pixels, paths)
        };
        let cache = |seed| Settings {
            lobes: lighting.board.is_some(),
            ..cache_settings(seed, bench.quick)
        };
        scenes.push(Scene {
            name,
            files: lighting.files,
            kinds,
            noises: SAMPLINGS.iter().map(of).collect(),
            cache: (bench.seeds())
                .map(|seed| cached(bench, &deep, &cache(seed)))
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
    for scene in &scenes {
        let draw = |label, x| drawn(scene.name, label, x, &scene.kinds, &scene.cache);
        let [over_rays, over_seconds] = scene.files;
        plots.push((over_rays, draw("rays", |mark| mark.rays as f64)));
        plots.push((over_seconds, draw("seconds", |mark| mark.seconds)));
    }
    Ok(Findings {
        how: format!(
            "The paper's descent (batches of 8, two bounces, nothing annealed) in a box room of mean albedo {ALBEDO} under \
             a lamp of half side {} m and one of {} m with the same power, and in one whose lamp of {} m hangs above a rough \
             board (GGX, {}) whose lobe the descent knows and the transport cache has to find, {} seeds. The variance is \
             that of one path's derivative of a pixel's radiance at the true values, summed over unknowns, lobes held. \
             Seconds are those of this machine and whatever else ran on it; rays are the fairer axis.",
            ROOMS[0].lamp,
            ROOMS[1].lamp,
            ROOMS[2].lamp,
            ROOMS[2].board.map_or_else(String::new, |lobe| {
                format!(
                    "roughness {}, specular reflectance {}",
                    lobe.roughness, lobe.specular.x
                )
            }),
            bench.seeds,
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
