//! Study: the number of bounces of the fit.

use crate::error::Result;
use crate::export::plot::{Axis, Plot};
use crate::inverse::settings::Settings;
use crate::room::Room;
use crate::room::photographs::Rendering;
use crate::study::experiments::box_room;
use crate::study::experiments::course::{
    CACHE_WITHOUT, Evaluator, cache_settings, cached, descend, paper_settings, rays_at,
};
use crate::study::experiments::courses::{
    ALBEDO, Kind, Quantity, RAYS, Shown, Spread, common_mark, comparison, curve, plot, table, words,
};
use crate::study::experiments::study::{Bench, Findings, Study, Summary};
use crate::study::experiments::twin::twin;
use crate::study::subject::Subject;

pub const STUDY: Study = Study {
    name: "bounces",
    question: "The paper, fitting photographs of many bounces: one bounce is fast but stays wrong, two are the balance, \
        three are noisy and slow. Where do two stop being enough?",
    seeds: 5,
    run,
};

/// Mean albedos of the rooms, and the suffixes of their plots.
const ALBEDOS: &[(f64, &str)] = &[
    (0.3, "-paper-30"),
    (0.5, "-paper-50"),
    (0.8, "-paper-80"),
    (0.95, "-paper-95"),
];
/// Largest number of bounces of the fit; 0 lets the transport cache choose it by the albedo found. The descent cannot.
const DEPTHS: &[u64] = &[1, 2, 3, 5, 10, 0];
const QUICK_ALBEDOS: &[(f64, &str)] = &[(0.8, "-paper-80")];
const QUICK_DEPTHS: &[u64] = &[1, 2, 0];
/// Where the adaptive depth is plotted.
const CHOSEN_AT: f64 = 20.0;
/// An albedo error is too large if it exceeds this, ...
const TOLERABLE: f64 = 0.01;
/// ... and this factor times the error with adaptive depth.
const FACTOR: f64 = 2.0;

/// One room, solved with each depth.
struct TestRoom {
    /// "mean albedo 0.5", or the twin of a capture.
    name: String,
    /// Suffix of the descent's plot.
    file: &'static str,
    /// By depth: where the transport cache ended.
    cache: Vec<(u64, Kind)>,
    /// By depth: courses of the descent.
    paper: Vec<(u64, Kind)>,
}

impl TestRoom {
    /// The last mark that all courses of the descent passed.
    fn common_mark(&self) -> Option<u32> {
        common_mark(self.paper.iter().map(|(_, kind)| kind))
    }
}

fn run(bench: &Bench) -> Result<Findings> {
    let (albedos, depths) = match bench.quick {
        true => (QUICK_ALBEDOS, QUICK_DEPTHS),
        false => (ALBEDOS, DEPTHS),
    };
    let twin = twin(bench)?;
    let how = match &twin {
        Some(twin) => twin.words.clone(),
        None => "A box room of 2 m with seven reflectors of the mean albedo named, photographed with all bounces".to_owned(),
    };
    let rooms: Vec<(&str, Room, Rendering)> = match twin {
        Some(twin) => vec![("-paper", twin.room, twin.rendering)],
        None => (albedos.iter())
            .map(|&(albedo, file)| {
                let room =
                    box_room::box_room(&format!("mean albedo {albedo}"), albedo, box_room::LAMP);
                (file, room, box_room::rendering(bench.quick))
            })
            .collect(),
    };
    let limits = bench.limits(2 * rooms.len() * depths.len() * bench.seeds as usize);
    let mut scenes: Vec<TestRoom> = Vec::new();
    for (index, (file, room, rendering)) in rooms.iter().enumerate() {
        let subject = Subject::of_room(room, rendering)?;
        // The loss is measured with all bounces, whatever the fit has.
        let gauge = Evaluator::new(&subject, u32::MAX);
        scenes.push(TestRoom {
            name: room.name.clone(),
            file,
            cache: Vec::new(),
            paper: Vec::new(),
        });
        for &bounces in depths {
            bench.begin(&format!("{}, {} bounces", subject.name, word(bounces)))?;
            let with = |base: Settings| Settings { bounces, ..base };
            let end = |seed| {
                let settings = with(cache_settings(seed, bench.quick));
                cached(bench, &gauge, &settings).map(|end| vec![end])
            };
            let course = |seed| descend(bench, &gauge, &with(paper_settings(seed)), limits);
            let kind = |solver: &str, courses| Kind {
                name: format!("{}, {solver}, {}", room.name, word(bounces)),
                courses,
            };
            let ends = bench.seeds().map(end).collect::<Result<_>>()?;
            let cache = (bounces, kind("transport cache", ends));
            scenes[index].cache.push(cache);
            (bench.show)(over_depth(&scenes, ALBEDO));
            if bounces > 0 {
                let courses = bench.seeds().map(course).collect();
                scenes[index].paper.push((bounces, kind("paper", courses)));
            }
        }
    }
    bench.go_on()?;

    let kinds: Vec<Kind> = (scenes.iter())
        .flat_map(|scene| scene.cache.iter().chain(&scene.paper))
        .map(|(_, kind)| kind.clone())
        .collect();
    let mut plots = vec![
        ("", over_depth(&scenes, ALBEDO)),
        (
            "-emission",
            over_depth(&scenes, ("relative error of emission", |e| e.emission)),
        ),
    ];
    for scene in &scenes {
        let title = format!("Bounces of the paper's descent, {}", scene.name);
        let drawn: Vec<Kind> = scene.paper.iter().map(|(_, kind)| kind.clone()).collect();
        plots.push((scene.file, plot(&title, RAYS, ALBEDO, &drawn, &[])));
    }
    Ok(Findings {
        how: format!(
            "{how}; {} seeds. The paper's descent ({} each) is compared at equal rays, where its errors are the same on every machine; the \
             transport cache goes to where it ends by itself, with {CACHE_WITHOUT}. The loss is measured with all bounces. {}Two \
             bounces are called enough where albedo is off by no more than {TOLERABLE}, or by no more than {FACTOR} times what \
             adaptive depth comes to.",
            bench.seeds,
            limits.words(),
            comparison(bench.seeds),
        ),
        tables: vec![("", table("\"room, solver, bounces\"", &kinds, &[]))],
        plots,
        summary: summary(&scenes),
        seen: seen(&scenes),
        ..Findings::default()
    })
}

fn word(bounces: u64) -> String {
    match bounces {
        0 => "adaptive".to_owned(),
        bounces => bounces.to_string(),
    }
}

/// Error at the transport cache's end over the depth of its fit, one curve a room.
fn over_depth(scenes: &[TestRoom], (label, quantity): Shown) -> Plot {
    let of_room = |scene: &TestRoom| {
        let means = scene.cache.iter().filter_map(|(depth, kind)| {
            let x = match depth {
                0 => CHOSEN_AT,
                depth => *depth as f64,
            };
            Some((x, kind.at_end(quantity)?))
        });
        curve(&scene.name, means)
    };
    Plot {
        title: "Bounces of the fit, transport cache".to_owned(),
        x: Axis::logarithmic("bounces of the fit"),
        y: Axis::logarithmic(label),
        series: scenes.iter().map(of_room).collect(),
        marks: vec![(CHOSEN_AT, "adaptive".to_owned())],
        ..Plot::default()
    }
}

fn summary(scenes: &[TestRoom]) -> Summary {
    let mut rows = Vec::new();
    for scene in scenes {
        let mark = scene.common_mark();
        for (depth, kind) in &scene.cache {
            let paper = scene.paper.iter().find(|(other, _)| other == depth);
            let equal = |quantity: Quantity| {
                words(paper.and_then(|(_, kind)| kind.at_mark(mark, quantity)))
            };
            rows.push(vec![
                scene.name.clone(),
                word(*depth),
                words(kind.at_end(|e| e.albedo)),
                words(kind.at_end(|e| e.emission)),
                words(kind.at_end(|e| e.loss)),
                format!("{:.1}", kind.mean_end(|mark| mark.rays as f64) * 1e-6),
                equal(|e| e.albedo),
                equal(|e| e.emission),
                equal(|e| e.loss),
                mark.map_or("-".to_owned(), |mark| {
                    format!("{:.2}", rays_at(mark) as f64 * 1e-6)
                }),
            ]);
        }
    }
    Summary {
        columns: "room | bounces | cache: albedo error | emission error | loss | M rays | \
                  paper, equal rays: albedo error | emission error | loss | M rays",
        rows,
    }
}

fn seen(scenes: &[TestRoom]) -> Vec<String> {
    let mut seen = Vec::new();
    let (mut tried, mut insufficient) = (0, Vec::new());
    for scene in scenes {
        let at = |depth: u64| {
            let found = scene.cache.iter().find(|(d, _)| *d == depth);
            found.and_then(|(_, kind)| kind.at_end(|e| e.albedo))
        };
        if let (Some(one), Some(two), Some(deep)) = (at(1), at(2), at(0)) {
            let enough = two.mean <= TOLERABLE.max(FACTOR * deep.mean);
            tried += 1;
            insufficient.extend((!enough).then_some(scene.name.as_str()));
            seen.push(format!(
                "{}, transport cache: albedo is off by {} with one bounce, {} with two, {} with adaptive \
                 depth. Two are {}.",
                scene.name,
                one.words(),
                two.words(),
                deep.words(),
                if enough { "enough" } else { "not enough" },
            ));
        }
        seen.extend(balance(scene));
    }
    if tried > 0 {
        let but = match insufficient.is_empty() {
            true => String::new(),
            false => format!("; not in {}", insufficient.join(", ")),
        };
        seen.push(format!(
            "Two bounces are enough for the transport cache in {} of {tried} rooms tried{but}.",
            tried - insufficient.len(),
        ));
    }
    seen
}

/// Which depth is best for the descent, and which others do not differ beyond the noise.
fn balance(scene: &TestRoom) -> Option<String> {
    let mark = scene.common_mark();
    let known: Vec<(u64, Spread)> = (scene.paper.iter())
        .filter_map(|(depth, kind)| Some((*depth, kind.at_mark(mark, |e| e.albedo)?)))
        .collect();
    let (best, lowest) = *known.iter().min_by(|a, b| a.1.mean.total_cmp(&b.1.mean))?;
    let (_, two) = known.iter().find(|(depth, _)| *depth == 2)?;
    let bounces = |depth: u64| format!("{depth} bounce{}", if depth == 1 { "" } else { "s" });
    let within: Vec<String> = (known.iter())
        .filter(|(depth, error)| *depth != best && !error.differs(&lowest))
        .map(|(depth, _)| bounces(*depth))
        .collect();
    let within = match (lowest.count, within.as_slice()) {
        (0 | 1, _) => "one seed tells no noise".to_owned(),
        (_, []) => "all others are worse beyond the noise".to_owned(),
        (_, within) => format!("no different within the noise: {}", within.join(", ")),
    };
    Some(format!(
        "{}, the paper's descent at {:.2} million rays: least error of albedo with {}, {}; two give {}; {within}. The \
         paper takes two.",
        scene.name,
        rays_at(mark?) as f64 * 1e-6,
        bounces(best),
        lowest.words(),
        two.words(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::experiments::course::{Errors, Mark};

    /// A room in which the cache ends with these errors at one bounce, two bounces, and adaptive depth.
    fn room(errors: [f64; 3]) -> TestRoom {
        let kind = |error: f64| Kind {
            name: String::new(),
            courses: vec![vec![Mark {
                index: None,
                rays: 1,
                seconds: 1.0,
                steps: 1,
                errors: Errors {
                    albedo: Some(error),
                    ..Errors::default()
                },
            }]],
        };
        TestRoom {
            name: "a room".to_owned(),
            file: "",
            cache: [1, 2, 0].into_iter().zip(errors.map(kind)).collect(),
            paper: Vec::new(),
        }
    }

    #[test]
    fn two_bounces_are_enough_by_the_errors_and_nothing_is_said_of_no_room() {
        assert!(seen(&[]).is_empty());
        let text = seen(&[room([0.1, 0.009, 0.001]), room([0.1, 0.05, 0.001])]).join(" ");
        assert!(text.contains("Two are enough.") && text.contains("Two are not enough."));
        assert!(
            text.contains("enough for the transport cache in 1 of 2 rooms tried; not in a room.")
        );
    }
}
