//! Study: the batch size of the paper's descent.

use crate::error::Result;
use crate::export::plot::Plot;
use crate::inverse::settings::Settings;
use crate::study::experiments::box_room;
use crate::study::experiments::course::{
    CACHE_WITHOUT, Errors, Evaluator, Mark, cache_settings, cached, descend, paper_settings,
};
use crate::study::experiments::courses::{
    self, Kind, LOSS, Over, RAYS, SECONDS, Spread, common_mark, comparison, plot, table, words,
};
use crate::study::experiments::study::{Bench, Findings, Study, Summary};
use std::borrow::Cow;

pub const STUDY: Study = Study {
    name: "batch",
    question: "The paper: at equal time too small a batch is noisy, too large a one wastes rays; 8 pixels are a good start.",
    seeds: 5,
    run,
};

/// Pixels per step, and samples for each of a pixel's colour and derivative.
const BATCHES: &[(u64, u64)] = &[
    (1, 1),
    (2, 1),
    (4, 1),
    (8, 1),
    (16, 1),
    (64, 1),
    (256, 1),
    (1024, 1),
    (8, 4),
    (8, 16),
];
const QUICK: &[(u64, u64)] = &[(1, 1), (8, 1), (64, 1)];
/// The paper's default.
const PAPER: (u64, u64) = (8, 1);
/// A mean is worse than the best only beyond this factor, whatever the noise.
const WORSE: f64 = 1.05;

fn run(bench: &Bench) -> Result<Findings> {
    let subject = match bench.subject {
        Some(subject) => Cow::Borrowed(subject),
        None => Cow::Owned(box_room::photographed(bench.quick)?),
    };
    let batches = if bench.quick { QUICK } else { BATCHES };
    let limits = bench.limits(batches.len() * bench.seeds as usize);

    // The descents; the transport cache's end is measured below.
    let gauge = Evaluator::new(&subject, paper_settings(1).max_bounces());
    let course = |index: usize, seed| {
        let (batch, samples) = batches[index];
        let settings = Settings {
            batch,
            samples,
            ..paper_settings(seed)
        };
        descend(bench, &gauge, &settings, limits)
    };
    let names = batches.iter().map(|&batch| name(batch));
    let so_far = |kinds: &[Kind]| drawn(RAYS, (kinds, batches), &[]);
    let kinds = courses::run(bench, names, course, so_far)?;
    // The cache fits all bounces, so its estimate is rendered with all.
    bench.begin("transport cache")?;
    let gauge = Evaluator::new(&subject, u32::MAX);
    let cache: Vec<Mark> = (bench.seeds())
        .map(|seed| cached(bench, &gauge, &cache_settings(seed, bench.quick)))
        .collect::<Result<_>>()?;

    let draw = |over| drawn(over, (&kinds, batches), &cache);
    let mark = common_mark(&kinds);
    Ok(Findings {
        how: format!(
            "The paper's descent on {}, {} seeds each, ADAM as published with nothing annealed and albedos and emissions \
             per object, each for {}. The loss is the mean absolute difference on up to 400 pixels held out of the fit, \
             rendered with two bounces as in the descent's fit, and with all for the transport cache, which goes to its own \
             end with {CACHE_WITHOUT}. {}At a mark in rays \
             all values but the seconds are the same on every machine; seconds are those of this machine and whatever \
             else ran on it. Batches from 256 pixels on use all threads, smaller ones one.",
            subject.name,
            bench.seeds,
            limits.words(),
            comparison(bench.seeds),
        ),
        tables: vec![("", table("batch", &kinds, &cache))],
        plots: vec![("", draw(RAYS)), ("-seconds", draw(SECONDS))],
        summary: summary(&kinds, mark),
        seen: seen(&kinds, batches, &cache, mark, &limits.words()),
        ..Findings::default()
    })
}

/// Plot of the batches with one sample per pixel.
fn drawn(over: Over, (kinds, batches): (&[Kind], &[(u64, u64)]), cache: &[Mark]) -> Plot {
    // Only as many curves as have distinguishable colours.
    let drawn: Vec<Kind> = (kinds.iter().zip(batches))
        .filter(|(_, (batch, samples))| *samples == 1 && *batch != 2)
        .map(|(kind, _)| kind.clone())
        .collect();
    plot("Batches", over, LOSS, &drawn, cache)
}

fn name((batch, samples): (u64, u64)) -> String {
    match samples {
        1 => format!("{batch}"),
        _ => format!("{batch} with {samples} paths"),
    }
}

/// Rays of the course that passed a mark first.
fn rays_when(kinds: &[Kind], mark: u32) -> f64 {
    let courses = kinds.iter().flat_map(|kind| &kind.courses);
    let rays = courses.filter_map(|c| Some(c.iter().find(|m| m.index >= Some(mark))?.rays));
    rays.min().unwrap_or(0) as f64
}

fn summary(kinds: &[Kind], mark: Option<u32>) -> Summary {
    let row = |kind: &Kind| {
        vec![
            kind.name.clone(),
            words(kind.at_mark(mark, |e| e.loss)),
            words(kind.at_mark(mark, |e| e.albedo)),
            words(kind.at_end(|e| e.loss)),
            words(kind.at_end(|e| e.albedo)),
            format!("{:.2}", kind.mean_end(|m| m.rays as f64) * 1e-6),
            format!("{:.0}", kind.mean_end(|m| m.steps as f64)),
        ]
    };
    Summary {
        columns: "batch | loss at equal rays | albedo error at equal rays | loss at the end | albedo error at the end | \
                  M rays at the end | steps",
        rows: kinds.iter().map(row).collect(),
    }
}

fn seen(
    kinds: &[Kind],
    batches: &[(u64, u64)],
    cache: &[Mark],
    mark: Option<u32>,
    limit: &str,
) -> Vec<String> {
    let mut seen = Vec::new();
    let common = mark.map_or(0.0, |mark| rays_when(kinds, mark));
    let rays = format!("At equal rays ({:.2} million)", common * 1e-6);
    let at_rays: Vec<Option<Spread>> = (kinds.iter())
        .map(|kind| kind.at_mark(mark, |e| e.loss))
        .collect();
    let at_end: Vec<Option<Spread>> = kinds.iter().map(|kind| kind.at_end(|e| e.loss)).collect();
    let end = format!("At the end ({limit} each)");
    for (budget, losses) in [(&rays, at_rays), (&end, at_end)] {
        seen.extend(conclusion(budget, batches, &losses));
    }
    let albedo = |errors: &Errors| errors.albedo.or(errors.loss);
    let best = kinds.iter().filter_map(|kind| kind.at_end(albedo));
    let best = best.min_by(|a, b| a.mean.total_cmp(&b.mean));
    let ends = Spread::over(cache.iter().filter_map(|m| albedo(&m.errors)));
    if let Some((spread, best)) = ends.zip(best) {
        let rays = cache.iter().map(|m| m.rays as f64).sum::<f64>() / cache.len() as f64;
        seen.push(format!(
            "The transport cache ends at an error of {} after {:.2} million rays; the best end of a descent is at {} \
             (albedo where the truth is known, else held-out loss).",
            spread.words(),
            rays * 1e-6,
            best.words(),
        ));
    }
    seen
}

/// Which batch was best with one sample per pixel, and, if the seeds show the noise, whether that agrees with the paper.
fn conclusion(budget: &str, batches: &[(u64, u64)], losses: &[Option<Spread>]) -> Option<String> {
    let single: Vec<(u64, Spread)> = (batches.iter().zip(losses))
        .filter(|((_, samples), _)| *samples == 1)
        .filter_map(|(&(batch, _), spread)| Some((batch, (*spread)?)))
        .collect();
    let (best, lowest) = *single.iter().min_by(|a, b| a.1.mean.total_cmp(&b.1.mean))?;
    let worse = |spread: &Spread| spread.differs(&lowest) && spread.mean > WORSE * lowest.mean;
    let (first, last) = (single.first()?, single.last()?);
    let (_, paper) = single.iter().find(|(batch, _)| *batch == PAPER.0)?;
    let values = format!(
        "{budget} a batch of {best} has the least loss, {}; {} pixels have {}, {} {}, {} {}.",
        lowest.words(),
        PAPER.0,
        paper.words(),
        first.0,
        first.1.words(),
        last.0,
        last.1.words(),
    );
    if lowest.count < 2 {
        return Some(values);
    }
    let is_worse = |spread: &Spread| if worse(spread) { "yes" } else { "no" };
    Some(format!(
        "{values} Worse than the best by more than the noise and 5 %: {} {}, {} {}, {} {} (the paper: too small and too large \
         ones are, 8 is not).",
        first.0,
        is_worse(&first.1),
        PAPER.0,
        is_worse(paper),
        last.0,
        is_worse(&last.1),
    ))
}
