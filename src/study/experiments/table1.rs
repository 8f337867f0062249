//! Study: accuracy of a single object's albedo.

use crate::error::Result;
use crate::export::plot::{Axis, Draw, Plot, Series};
use crate::export::table::Table;
use crate::inverse::settings::{Preset, Settings};
use crate::study::experiments::course::{Evaluator, Mark, cached, descend, paper_settings};
use crate::study::experiments::objects::{self, Posed};
use crate::study::experiments::study::{Bench, Findings, Limits, Study, Summary, brief};
use crate::study::experiments::twin::twin;

pub const STUDY: Study = Study {
    name: "table1",
    question: "The paper, relative error of the diffuse albedo of single objects: 0.00037 % and 0.14 %, where LIME has 0.45 % \
        and 1.37 %. Does a convex object under a lamp, and one that shadows itself in a room, come out as exactly?",
    seeds: 10,
    run,
};

/// Seeds of the paper's descent, which always takes its full time.
const PAPER_SEEDS: u64 = 2;
/// Time of one solve of the descent, relative to one of the transport cache.
const PAPER_FRACTION: f64 = 2.0;

/// One object, solved with several seeds.
struct Solved {
    posed: Posed,
    cache: Vec<Mark>,
    paper: Vec<Mark>,
}

impl Solved {
    /// The ends by each solver, with its name.
    fn by_solver(&self) -> [(&'static str, &[Mark]); 2] {
        [("transport cache", &self.cache), ("paper", &self.paper)]
    }
}

fn run(bench: &Bench) -> Result<Findings> {
    let objects = match twin(bench)? {
        Some(twin) => vec![objects::of_twin(&twin)?],
        None => vec![
            objects::convex(bench.quick)?,
            objects::shadowed(bench.quick)?,
        ],
    };
    let each = bench.seeds as f64 + PAPER_SEEDS as f64 * PAPER_FRACTION;
    let limits = bench.limits((objects.len() as f64 * each) as usize);
    let how: String = (objects.iter())
        .map(|posed| format!("{} ", posed.how))
        .collect();
    let longer = Limits {
        seconds: limits.seconds * PAPER_FRACTION,
        ..limits
    };
    let mut all: Vec<Solved> = (objects.into_iter())
        .map(|posed| Solved {
            posed,
            cache: Vec::new(),
            paper: Vec::new(),
        })
        .collect();
    for index in 0..all.len() {
        let by_cache = bench.seeds().map(|seed| (seed, true));
        let by_paper = (1..=PAPER_SEEDS.min(bench.seeds)).map(|seed| (seed, false));
        for (seed, by_cache) in by_cache.chain(by_paper) {
            let Solved {
                posed,
                cache,
                paper,
            } = &mut all[index];
            let solver = if by_cache { "transport cache" } else { "paper" };
            bench.begin(&format!("{}, {solver}, seed {seed}", posed.name))?;
            let gauge = Evaluator {
                watched: Some(&posed.object),
                ..Evaluator::new(&posed.subject, u32::MAX)
            };
            if by_cache {
                let settings = settings(seed, bench.quick, limits.seconds);
                cache.push(cached(bench, &gauge, &settings)?);
            } else {
                paper.extend(descend(bench, &gauge, &paper_settings(seed), longer).pop());
            }
            (bench.show)(plot(&all[..=index]));
        }
    }
    bench.go_on()?;
    Ok(Findings {
        how: format!(
            "{how}Solved by the transport cache with preset `{}` as the program runs it: all stages on, ended by its own \
             rule{}. Errors are ‖ρ̂ − ρ‖₂ / ‖ρ‖₂ over RGB, seeds 1 to {}. The paper's objects are others than these, \
             so that its numbers are not the same measurement. The paper's descent runs per object with nothing annealed, \
             for {} at {} seeds. Seconds are those of this machine and whatever else ran on it.",
            preset(bench.quick).word(),
            match bench.quick {
                true => String::new(),
                false => format!(" (for {} at most)", limits.words()),
            },
            bench.seeds,
            longer.words(),
            PAPER_SEEDS.min(bench.seeds),
        ),
        tables: vec![("", table(&all))],
        plots: vec![("", plot(&all))],
        summary: Summary {
            columns: "object | solver | relative error of albedo in %, root mean square | each seed | \
                      floor in % (noise of the photographs) | the paper's | lamp's error in % | seconds | M rays",
            rows: (all.iter())
                .flat_map(|s| s.by_solver().map(|(solver, marks)| row(s, solver, marks)))
                .collect(),
        },
        seen: all.iter().flat_map(seen).collect(),
        ..Findings::default()
    })
}

fn preset(quick: bool) -> Preset {
    match quick {
        true => Preset::Preview,
        false => Preset::Balanced,
    }
}

/// The program's defaults: nothing is switched off, and no error is asked for.
fn settings(seed: u64, quick: bool, seconds: f64) -> Settings {
    Settings {
        preset: preset(quick),
        seed,
        time: if seconds.is_finite() { seconds } else { 0.0 },
        ..Settings::default()
    }
}

/// Errors in percent, in order of seeds.
fn percents(marks: &[Mark]) -> Vec<f64> {
    let errors = marks.iter().filter_map(|mark| mark.errors.object);
    errors.map(|error| error * 100.0).collect()
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn mean(marks: &[Mark], value: impl Fn(&Mark) -> f64) -> f64 {
    marks.iter().map(value).sum::<f64>() / marks.len().max(1) as f64
}

fn table(all: &[Solved]) -> Table {
    let mut table = Table::new(
        "object,solver,seed,relative_error,albedo_error_all,emission_error,loss,rays,seconds,floor",
    );
    for solved in all {
        for (solver, marks) in solved.by_solver() {
            for (seed, mark) in (1u64..).zip(marks) {
                table.row((
                    solved.posed.object.as_str(),
                    solver,
                    seed,
                    mark.errors.object,
                    mark.errors.albedo,
                    mark.errors.emission,
                    mark.errors.loss,
                    mark.rays,
                    mark.seconds,
                    solved.posed.floor,
                ));
            }
        }
    }
    table
}

fn plot(all: &[Solved]) -> Plot {
    let mut series = Vec::new();
    for solved in all {
        let object = &solved.posed.object;
        for (solver, marks) in solved.by_solver() {
            let points = (1..).zip(percents(marks));
            let points = points.map(|(seed, error)| [f64::from(seed), error]);
            series.push(Series::line(format!("{object}, {solver}"), points));
        }
        let target = [1.0, solved.cache.len() as f64].map(|seed| [seed, solved.posed.target]);
        series.push(Series {
            draw: Draw::Steps,
            ..Series::line(format!("{object}, the paper's number"), target)
        });
    }
    Plot {
        title: "Relative error of a single object's albedo".to_owned(),
        x: Axis::linear("seed"),
        y: Axis::logarithmic("relative error, %"),
        series,
        ..Plot::default()
    }
}

fn row(solved: &Solved, solver: &str, marks: &[Mark]) -> Vec<String> {
    let errors = percents(marks);
    let each: Vec<String> = errors.iter().map(|&error| brief(error)).collect();
    let lamp = mean(marks, |mark| {
        mark.errors.emission.unwrap_or(f64::NAN) * 100.0
    });
    vec![
        solved.posed.name.clone(),
        solver.to_owned(),
        brief(root_mean_square(&errors)),
        each.join(", "),
        brief(solved.posed.floor * 100.0),
        brief(solved.posed.target),
        brief(lamp),
        format!("{:.0}", mean(marks, |mark| mark.seconds)),
        format!("{:.1}", mean(marks, |mark| mark.rays as f64) * 1e-6),
    ]
}

fn seen(solved: &Solved) -> Vec<String> {
    let posed = &solved.posed;
    let errors = percents(&solved.cache);
    let (rms, worst) = (
        root_mean_square(&errors),
        errors.iter().copied().fold(0.0, f64::max),
    );
    let below = errors.iter().filter(|&&e| e < posed.target).count();
    let paper = percents(&solved.paper);
    vec![
        format!(
            "{}: {} % (root mean square over {} seeds; worst {} %), which is {} the paper's {} % for an object of its own; {below} \
             of {} seeds are below it. Noise of the photographs alone makes {} %.",
            posed.name,
            brief(rms),
            errors.len(),
            brief(worst),
            if rms < posed.target {
                "below"
            } else {
                "not below"
            },
            posed.target,
            errors.len(),
            brief(posed.floor * 100.0),
        ),
        format!(
            "{}: the paper's descent per object, nothing annealed, stands at {} % after {:.2} million rays ({} seeds).",
            posed.name,
            brief(root_mean_square(&paper)),
            mean(&solved.paper, |mark| mark.rays as f64) * 1e-6,
            paper.len(),
        ),
    ]
}
