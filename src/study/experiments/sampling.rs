//! Study: sampling strategies for pixels and paths.

use crate::error::Result;
use crate::export::plot::{Axis, Plot, Series};
use crate::export::table::Table;
use crate::inverse::paper::descent::Descent;
use crate::inverse::settings::Settings;
use crate::study::experiments::box_room;
use crate::study::experiments::course::{
    Evaluator, Mark, descend, descend_by, estimate, paper_settings, rays_at,
};
use crate::study::experiments::courses::{
    self, ALBEDO, Kind, LOSS, RAYS, Shown, common_mark, comparison, plot, table, words,
};
use crate::study::experiments::gradient::{Evenness, evenness};
use crate::study::experiments::selection::Groups;
use crate::study::experiments::study::{Bench, Findings, Limits, Study, Summary, brief};
use crate::study::experiments::twin::studied;
use crate::study::subject::Subject;
use crate::transport::path::PathOptions;

pub const STUDY: Study = Study {
    name: "sampling",
    question: "The paper sees \"high potential in investigating better sampling strategies\". What do pixels drawn by object or \
        by residual bring the descent, and points of a low-discrepancy sequence the transport cache?",
    seeds: 3,
    run,
};

/// Steps between updates of the residual.
const UPDATE_INTERVAL: u64 = 500;
const UNIFORM: &str = "uniform";

#[derive(Clone, Copy)]
enum Strategy {
    Uniform,
    Objects { weighted: bool },
    Residual { weighted: bool },
}

const STRATEGIES: [(&str, Strategy); 5] = [
    (UNIFORM, Strategy::Uniform),
    ("by object", Strategy::Objects { weighted: false }),
    (
        "by object, weighed back",
        Strategy::Objects { weighted: true },
    ),
    ("by residual", Strategy::Residual { weighted: false }),
    (
        "by residual, weighed back",
        Strategy::Residual { weighted: true },
    ),
];

fn run(bench: &Bench) -> Result<Findings> {
    let limits = bench.limits(STRATEGIES.len() * bench.seeds as usize);
    let studied = studied(bench, box_room::rendering(bench.quick))?;
    let subject = Subject::of_room(&studied.room, &studied.rendering)?;
    let gauge = Evaluator::new(&subject, paper_settings(1).max_bounces());
    let names = STRATEGIES.iter().map(|(name, _)| (*name).to_owned());
    let course = |index: usize, seed| {
        let strategy = STRATEGIES[index].1;
        descent(bench, &gauge, strategy, &paper_settings(seed), limits)
    };
    let kinds = courses::run(bench, names, course, |kinds| drawn(kinds, LOSS))?;
    bench.begin("paths")?;
    let truth = box_room::truth(&studied.room);
    let (pixels, max) = if bench.quick { (16, 256) } else { (64, 4096) };
    let evenness = evenness(&subject.problem, &truth, pixels, max);

    Ok(Findings {
        how: format!(
            "{}. The paper's descent there, {} seeds, each for {}, batches of 8, nothing annealed, with \
             pixels drawn uniformly, from each object alike, and from blocks of 8 × 8 pixels by their residual (looked at \
             every {UPDATE_INTERVAL} steps, whose rays count); each with gradients as they come and weighed back to what uniform \
             draws fit. Held-out loss is over uniform pixels. {}Paths: standard deviation of a pixel's mean radiance over 16 \
             repetitions, root mean square over {pixels} pixels, at the true values.",
            studied.words,
            bench.seeds,
            limits.words(),
            comparison(bench.seeds),
        ),
        tables: vec![
            ("", table("pixels", &kinds, &[])),
            ("-paths", of_paths(&evenness)),
        ],
        plots: vec![
            ("", drawn(&kinds, LOSS)),
            ("-albedo", drawn(&kinds, ALBEDO)),
            ("-paths", evenness_plot(&evenness)),
        ],
        summary: summary(&kinds, &evenness),
        seen: seen(&kinds, &evenness),
        ..Findings::default()
    })
}

fn drawn(kinds: &[Kind], shown: Shown) -> Plot {
    plot("Pixels of the paper's descent", RAYS, shown, kinds, &[])
}

fn descent(
    bench: &Bench,
    gauge: &Evaluator,
    strategy: Strategy,
    settings: &Settings,
    limits: Limits,
) -> Vec<Mark> {
    let problem = &gauge.subject.problem;
    let bounces = settings.max_bounces();
    let mut groups = match strategy {
        Strategy::Uniform => return descend(bench, gauge, settings, limits),
        Strategy::Objects { weighted } => Groups::by_object(problem, settings, weighted),
        Strategy::Residual { weighted } => Groups::by_block(problem, settings, weighted),
    };
    let options = PathOptions {
        max_bounces: bounces,
        ..PathOptions::default()
    };
    let mut steps = 0;
    let mut step = |descent: &mut Descent| {
        let mut rays = 0;
        if matches!(strategy, Strategy::Residual { .. }) && steps % UPDATE_INTERVAL == 0 {
            let lit = estimate(descent).lit(&problem.scene);
            rays = groups.update(problem, &lit, &options, settings.seed + steps);
        }
        steps += 1;
        let mut outcome =
            descent.step_on(problem, settings, bounces, &|stream| groups.draw(stream));
        outcome.cast.rays += rays;
        outcome
    };
    let start = Descent::new(problem);
    descend_by(bench, gauge, start, limits, &mut step)
}

fn of_paths(evenness: &[Evenness]) -> Table {
    let mut table = Table::new("paths,random,low_discrepancy");
    for at in evenness {
        table.row((at.paths, at.random, at.sequence));
    }
    table
}

fn evenness_plot(evenness: &[Evenness]) -> Plot {
    let series = |name: &str, noise: fn(&Evenness) -> f64| {
        Series::line(name, evenness.iter().map(|at| [at.paths as f64, noise(at)]))
    };
    Plot {
        title: "Noise of a pixel's mean".to_owned(),
        x: Axis::logarithmic("paths"),
        y: Axis::logarithmic("relative standard deviation"),
        series: vec![
            series("random numbers", |at| at.random),
            series("low-discrepancy points", |at| at.sequence),
        ],
        ..Plot::default()
    }
}

fn summary(kinds: &[Kind], evenness: &[Evenness]) -> Summary {
    let mark = common_mark(kinds);
    let mut rows: Vec<Vec<String>> = (kinds.iter())
        .map(|kind| {
            vec![
                format!("pixels {}", kind.name),
                words(kind.at_mark(mark, |e| e.loss)),
                words(kind.at_mark(mark, |e| e.albedo)),
                words(kind.at_end(|e| e.loss)),
                words(kind.at_end(|e| e.albedo)),
            ]
        })
        .collect();
    rows.extend(evenness.iter().map(|at| {
        vec![
            format!("{} paths a pixel", at.paths),
            format!("random: {}", brief(at.random)),
            format!("low-discrepancy: {}", brief(at.sequence)),
            format!("variance / {}", brief((at.random / at.sequence).powi(2))),
            String::new(),
        ]
    }));
    Summary {
        columns: "what | loss at equal rays | albedo error at equal rays | loss at the end | albedo error at the end",
        rows,
    }
}

fn seen(kinds: &[Kind], evenness: &[Evenness]) -> Vec<String> {
    let mut seen = Vec::new();
    if let Some(mark) = common_mark(kinds) {
        let at = |kind: &Kind| kind.at_mark(Some(mark), |e| e.albedo);
        let uniform = kinds.iter().find(|kind| kind.name == UNIFORM).and_then(at);
        for kind in kinds.iter().filter(|kind| kind.name != UNIFORM) {
            let (Some(uniform), Some(other)) = (uniform, at(kind)) else {
                continue;
            };
            let conclusion = match (other.differs(&uniform), other.mean < uniform.mean) {
                (false, _) => "no difference beyond what seeds tell of the noise",
                (true, true) => "better",
                (true, false) => "worse",
            };
            seen.push(format!(
                "Pixels {}, at {:.2} million rays: albedo off by {}, uniformly {}: {conclusion}.",
                kind.name,
                rays_at(mark) as f64 * 1e-6,
                other.words(),
                uniform.words(),
            ));
        }
    }
    if let (Some(few), Some(many)) = (evenness.first(), evenness.last()) {
        let gain = |at: &Evenness| brief((at.random / at.sequence).powi(2));
        seen.push(format!(
            "Random numbers have {} times the variance of low-discrepancy points with {} paths a pixel and {} times with {}; the \
             transport cache uses the latter.",
            gain(few),
            few.paths,
            gain(many),
            many.paths,
        ));
    }
    seen
}
