//! Study: multiple importance sampling.

use crate::error::Result;
use crate::export::table::Table;
use crate::inverse::settings::{LightSampling, Settings};
use crate::room::Room;
use crate::room::photographs::Rendering;
use crate::study::experiments::box_room::{self, ALBEDO};
use crate::study::experiments::course::{
    CACHE_WITHOUT, Errors, Evaluator, Mark, cache_settings, cached, descend, paper_settings,
};
use crate::study::experiments::courses::{
    self, Kind, LOSS, RAYS, SECONDS, Spread, common_mark, comparison, plot, table, words,
};
use crate::study::experiments::gradient::{Noise, noise};
use crate::study::experiments::study::{Bench, Findings, Study, Summary, brief};
use crate::study::experiments::twin::twin;
use crate::study::subject::Subject;
use crate::transport::material::Lobe;
use glam::Vec3;

pub const STUDY: Study = Study {
    name: "mis",
    question: "The paper: multiple importance sampling speeds convergence markedly. Against light sampling alone and BSDF \
        sampling alone, under a small lamp and a large one, and with a rough surface near a lamp.",
    seeds: 5,
    run,
};

const ROOMS: [Lamp; 3] = [
    Lamp {
        name: "small lamp",
        files: ["", "-seconds"],
        half_side: 0.1,
        board: None,
    },
    Lamp {
        name: "large lamp",
        files: ["-large", "-large-seconds"],
        half_side: 0.85,
        board: None,
    },
    Lamp {
        name: "rough board near a lamp",
        files: ["-rough", "-rough-seconds"],
        half_side: 0.4,
        board: Some(Lobe {
            roughness: 0.1,
            specular: Vec3::splat(0.3),
        }),
    },
];
/// The samplings that are compared, in words too.
const SAMPLINGS: [(LightSampling, &str); 3] = [
    (LightSampling::Mis, "both (MIS)"),
    (LightSampling::Emitter, "light sampling"),
    (LightSampling::Bsdf, "BSDF sampling"),
];
/// Means within this factor of each other count as equal.
const AS_GOOD: f64 = 1.05;

/// The lighting of one of the study's own rooms.
struct Lamp {
    name: &'static str,
    /// Suffixes of its plots over rays and over seconds.
    files: [&'static str; 2],
    /// Half side of the lamp in metres.
    half_side: f64,
    /// Lobe of a board below the lamp; `None` if all is diffuse.
    board: Option<Lobe>,
}

impl Lamp {
    fn room(&self) -> Room {
        match self.board {
            Some(lobe) => box_room::board_room(self.name, ALBEDO, self.half_side, lobe),
            None => box_room::box_room(self.name, ALBEDO, self.half_side),
        }
    }
}

/// Results in one room.
struct LitRoom {
    name: String,
    files: [&'static str; 2],
    kinds: Vec<Kind>,
    noises: Vec<Noise>,
    cache: Vec<Mark>,
}

fn own_rooms() -> String {
    let [small, large, rough] = &ROOMS;
    let lobe = rough.board.map_or_else(String::new, |lobe| {
        format!(
            "roughness {}, specular reflectance {}",
            lobe.roughness, lobe.specular.x
        )
    });
    format!(
        "A box room of mean albedo {ALBEDO} under a lamp of half side {} m and under one of {} m with the same power, and \
         one whose lamp of {} m hangs above a rough board (GGX, {lobe}) whose lobe the descent knows and the transport \
         cache has to find",
        small.half_side, large.half_side, rough.half_side,
    )
}

fn run(bench: &Bench) -> Result<Findings> {
    let twin = twin(bench)?;
    let how = twin
        .as_ref()
        .map_or_else(own_rooms, |twin| twin.words.clone());
    let rooms: Vec<([&str; 2], Room, Rendering)> = match twin {
        Some(twin) => vec![(ROOMS[0].files, twin.room, twin.rendering)],
        None => (ROOMS.iter())
            .map(|lamp| (lamp.files, lamp.room(), box_room::rendering(bench.quick)))
            .collect(),
    };
    let limits = bench.limits(rooms.len() * SAMPLINGS.len() * bench.seeds as usize);
    let (pixels, paths) = if bench.quick { (300, 128) } else { (1000, 512) };
    let mut scenes = Vec::new();
    for (files, room, rendering) in &rooms {
        let name = room.name.as_str();
        bench.begin(name)?;
        let subject = Subject::of_room(room, rendering)?;
        let truth = box_room::truth(room);
        let lobes: Vec<Option<Lobe>> = room.materials.iter().map(|m| m.lobe).collect();
        let bounces = paper_settings(1).max_bounces();
        let gauge = Evaluator {
            lobes: lobes.clone(),
            ..Evaluator::new(&subject, bounces)
        };
        let all_bounces = Evaluator::new(&subject, u32::MAX);
        let course = |index: usize, seed| {
            let settings = Settings {
                light_sampling: SAMPLINGS[index].0,
                ..paper_settings(seed)
            };
            descend(bench, &gauge, &settings, limits)
        };
        let names = SAMPLINGS.map(|(_, word)| format!("{name}, {word}"));
        let so_far = |kinds: &[Kind]| plot(name, RAYS, LOSS, kinds, &[]);
        let kinds = courses::run(bench, names, course, so_far)?;
        bench.begin(&format!("{name}, variance of gradients"))?;
        let measure =
            |(sampling, _)| noise(&subject.problem, &truth, &lobes, sampling, pixels, paths);
        let cache = |seed| Settings {
            lobes: lobes.iter().any(Option::is_some),
            ..cache_settings(seed, bench.quick)
        };
        scenes.push(LitRoom {
            name: name.to_owned(),
            files: *files,
            kinds,
            noises: SAMPLINGS.map(measure).to_vec(),
            cache: (bench.seeds())
                .map(|seed| cached(bench, &all_bounces, &cache(seed)))
                .collect::<Result<_>>()?,
        });
    }
    let kinds: Vec<Kind> = scenes.iter().flat_map(|s| s.kinds.clone()).collect();
    let cache: Vec<Mark> = scenes.iter().flat_map(|s| s.cache.clone()).collect();
    let mut plots = Vec::new();
    for scene in &scenes {
        let draw = |over| plot(&scene.name, over, LOSS, &scene.kinds, &scene.cache);
        plots.extend(scene.files.into_iter().zip([RAYS, SECONDS].map(draw)));
    }
    Ok(Findings {
        how: format!(
            "{how}. The paper's descent there (batches of 8, two bounces, nothing annealed), {} seeds, each for {}; the \
             transport cache goes to its own end, with {CACHE_WITHOUT} (but for lobes where the room has one). {}The \
             variance is that \
             of one path's derivative of a pixel's radiance at the true values, summed over unknowns, lobes held. \
             Seconds are those of this machine and whatever else ran on it; rays are the fairer axis.",
            bench.seeds,
            limits.words(),
            comparison(bench.seeds),
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

fn variances(scenes: &[LitRoom]) -> Table {
    let mut table = Table::new("scene,sampling,variance,standard_error,rays_per_path");
    for scene in scenes {
        for ((sampling, _), noise) in SAMPLINGS.iter().zip(&scene.noises) {
            table.row((
                scene.name.as_str(),
                sampling.word(),
                noise.variance,
                noise.error,
                noise.rays,
            ));
        }
    }
    table
}

/// An error at the last mark that all of a room's courses passed.
fn at_equal_rays(scene: &LitRoom, quantity: fn(&Errors) -> Option<f64>) -> Vec<Option<Spread>> {
    let mark = common_mark(&scene.kinds);
    let at = |kind: &Kind| kind.at_mark(mark, quantity);
    scene.kinds.iter().map(at).collect()
}

fn summary(scenes: &[LitRoom]) -> Summary {
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
        columns: "scene, sampling | loss at equal rays | albedo error at equal rays | loss at the end | \
                  gradient variance a path | rays a path | variance × rays",
        rows,
    }
}

fn seen(scene: &LitRoom) -> Vec<String> {
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
        let ratio = brief(single.mean / mis.mean);
        let conclusion = if mis.differs(&single) && mis.mean * AS_GOOD < single.mean {
            "beyond the noise, as the paper says"
        } else if mis.differs(&single) && mis.mean > single.mean * AS_GOOD {
            "beyond the noise, against what the paper says"
        } else {
            "no difference beyond the noise and 5 %"
        };
        seen.push(format!(
            "{}, loss at equal rays: {} with MIS, {} with light sampling, {} with BSDF sampling; the better of the two alone \
             has {ratio} times that of MIS, {conclusion}.",
            scene.name,
            mis.words(),
            light.words(),
            bsdf.words(),
        ));
    }
    seen
}
