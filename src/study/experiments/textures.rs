//! Study: textures, from coarse to fine.

use crate::calibrate::problem::Problem;
use crate::error::Result;
use crate::export::plot::{Axis, Plot, Series};
use crate::export::table::Table;
use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::inverse::loss::LossProbe;
use crate::inverse::settings::{Preset, Settings};
use crate::inverse::solve;
use crate::inverse::solver::{Control, Observer, Progress, Termination};
use crate::math::picture::Picture;
use crate::room::truth::albedo_picture;
use crate::study::experiments::course::{cache_settings, paper_settings, solved};
use crate::study::experiments::furnished::built_in;
use crate::study::experiments::study::{Bench, Findings, Grid, Study, Summary, brief};
use crate::study::subject::Subject;
use crate::transport::lit::LitScene;
use glam::Vec3;
use std::sync::Arc;

pub const STUDY: Study = Study {
    name: "textures",
    question: "The paper: once lights are in place, albedos per triangle and then of ever finer triangles recover textures. At \
        what cost, beside the transport cache's cells of the size of pixels?",
    seeds: 1,
    run,
};

/// Bounces of the descent here: the photographs have all bounces, and light cut off by two would bias the albedos.
const BOUNCES: u64 = 8;
/// Paths of a round of the transport cache in a quick study.
const QUICK_PATHS: u64 = 300_000;
/// The photograph whose albedo is shown.
const SHOWN: usize = 0;

/// Measurements at one state of the textures.
struct State {
    name: String,
    unknowns: usize,
    /// Peak signal-to-noise ratio of the albedo pictures in dB, if the truth is known.
    psnr: Option<f64>,
    loss: Option<f64>,
    seconds: f64,
    rays: u64,
    picture: Picture,
}

struct Measure {
    /// The true albedo seen by each camera.
    truth: Option<Vec<Picture>>,
    /// For each camera and pixel, whether it is compared: it sees a surface that is no lamp.
    counts: Vec<Vec<bool>>,
    probe: LossProbe,
}

fn run(bench: &Bench) -> Result<Findings> {
    let (room, own);
    let (subject, truth) = match bench.subject {
        Some(subject) => (subject, None),
        None => {
            room = built_in(true, bench.quick)?;
            own = room.subject.at_working_resolution()?;
            (&own, Some(&room.lit))
        }
    };
    let measure = Measure::new(subject, truth);

    // The transport cache, with one colour an object and with textures.
    let own_light = truth.is_some();
    let of_objects = Settings {
        exposures: !own_light,
        outside_light: !own_light,
        ..cache_settings(1, bench.quick)
    };
    let with_textures = Settings {
        preset: Preset::Balanced,
        textures: true,
        paths: if bench.quick { QUICK_PATHS } else { 0 },
        ..of_objects.clone()
    };
    let mut states = Vec::new();
    for (name, settings) in [
        ("cache, one colour an object", &of_objects),
        ("cache, textures", &with_textures),
    ] {
        bench.begin(name)?;
        let solution = solved(bench, subject, settings)?;
        let (progress, estimate) = (&solution.progress, &solution.estimate);
        states.push(measure.state(name, &subject.problem, progress, estimate));
        (bench.show)(plot(&states, measure.truth.is_some()));
    }

    // The paper's descent, stage by stage.
    bench.begin("the paper's descent")?;
    let settings = descent_settings(bench);
    let mut stages = Stages {
        bench,
        ended: Vec::new(),
    };
    let solution = solve(&subject.problem, &settings, None, &mut stages)?;
    bench.go_on()?;
    if solution.progress.stages.len() > stages.ended.len() {
        let end = (solution.progress.clone(), solution.estimate.clone());
        stages.ended.push(end);
    }
    for (progress, estimate) in &stages.ended {
        let stage = progress.stages.last().map_or("", |stage| &stage.name);
        let name = format!("paper, {stage}");
        states.push(measure.state(&name, &subject.problem, progress, estimate));
    }
    let compared = match measure.truth {
        Some(_) => {
            "albedo pictures of all photographs against the true ones (peak 1, lamps left out), and held-out loss"
        }
        None => "held-out loss, as no truth is known",
    };
    let how = format!(
        "{}: {compared}, rendered with all bounces. The transport cache is run without lobes and without the test for \
         photographs that disagree, and with exposures and light from outside on captures alone. The paper's descent is preset \
         `paper` with {BOUNCES} bounces (the paper's two cut off light that these photographs hold), from zero, one stage after \
         the other: {}. It {}. Seconds are those of this machine and whatever else ran on it.",
        subject.name,
        (solution.progress.stages.iter())
            .map(|stage| format!("{} ({})", stage.name, stage.why))
            .collect::<Vec<_>>()
            .join("; "),
        match solution.termination {
            Termination::Converged => "ended by itself".to_owned(),
            _ => format!("was ended after {:.0} s", solution.progress.seconds),
        },
    );
    Ok(findings(how, states, measure.truth))
}

/// The paper's solver as in the program, except for the bounces; with `quick`, without annealing and with large steps.
fn descent_settings(bench: &Bench) -> Settings {
    let settings = Settings {
        bounces: BOUNCES,
        ..paper_settings(1)
    };
    match bench.quick {
        true => Settings {
            bounces: 3,
            learning_rate: 2e-2,
            anneal: false,
            steps: 400_000,
            ..settings
        },
        false => Settings {
            time: bench.time.as_secs_f64(),
            ..settings
        },
    }
}

/// Collects the state after each stage of a solve.
struct Stages<'a, 'b> {
    bench: &'a Bench<'b>,
    ended: Vec<(Progress, Estimate)>,
}

impl Observer for Stages<'_, '_> {
    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control {
        if progress.stages.len() > self.ended.len() {
            self.ended.push((progress.clone(), estimate.clone()));
            let why = progress.stages.last().map_or("", |stage| &stage.why);
            (self.bench.say)(why);
        }
        match (self.bench.stopped)() {
            true => Control::Stop,
            false => Control::Continue,
        }
    }
}

/// Number of unknown albedos: objects, or visible patches or texels.
fn unknowns(estimate: &Estimate) -> usize {
    let cells = |texels: &Arc<TexelEstimate>| {
        // Texels of a patch have the same colour.
        let layout = &texels.colors.layout;
        let mut count = 0;
        for triangle in layout.first.windows(2) {
            let range = triangle[0] as usize..triangle[1] as usize;
            let mut colors: Vec<[u32; 3]> = (range.filter(|&t| texels.seen[t] > 0))
                .map(|t| texels.colors.colors[t].to_array().map(f32::to_bits))
                .collect();
            colors.sort_unstable();
            colors.dedup();
            count += colors.len();
        }
        count
    };
    let texels = estimate.texels.as_ref();
    texels.map_or(estimate.objects.len(), cells)
}

impl Measure {
    fn new(subject: &Subject, truth: Option<&LitScene>) -> Self {
        let scene = &subject.problem.scene;
        let pictures = |lit: &LitScene| {
            let cameras = scene.cameras.iter();
            cameras.map(|camera| albedo_picture(lit, camera)).collect()
        };
        let counts = scene.ids().triangles.iter().map(|triangles| {
            let reflects = |&triangle: &u32| {
                let object = scene.object_of.get(triangle as usize);
                let material = object
                    .zip(truth)
                    .map(|(&k, lit)| &lit.materials[k as usize]);
                material.is_some_and(|material| material.emission == Vec3::ZERO)
            };
            triangles.iter().map(reflects).collect()
        });
        Self {
            truth: truth.map(pictures),
            counts: counts.collect(),
            probe: LossProbe::new(&subject.problem, &Settings::default(), 400, 64, u32::MAX),
        }
    }

    fn state(
        &self,
        name: &str,
        problem: &Problem,
        progress: &Progress,
        estimate: &Estimate,
    ) -> State {
        let lit = estimate.lit(&problem.scene);
        let cameras = &problem.scene.cameras;
        let psnr = self.truth.as_ref().map(|truth| {
            let (mut squares, mut values) = (0.0, 0.0);
            for ((camera, truth), counts) in cameras.iter().zip(truth).zip(&self.counts) {
                let found = albedo_picture(&lit, camera);
                let pixels = found.pixels.iter().zip(&truth.pixels).zip(counts);
                for ((found, truth), _) in pixels.filter(|(_, counts)| **counts) {
                    squares += f64::from((*found - *truth).length_squared());
                    values += 3.0;
                }
            }
            -10.0 * (squares / f64::max(values, 1.0)).log10()
        });
        State {
            name: name.to_owned(),
            unknowns: unknowns(estimate),
            psnr,
            loss: self.probe.held_out(problem, estimate).0,
            seconds: progress.seconds,
            rays: progress.rays,
            picture: albedo_picture(&lit, &cameras[SHOWN]),
        }
    }
}

fn findings(how: String, states: Vec<State>, truth: Option<Vec<Picture>>) -> Findings {
    let mut table = Table::new("state,unknowns,psnr,loss,seconds,rays");
    let mut rows = Vec::new();
    let number = |value: Option<f64>, unit: &str| {
        value.map_or("-".to_owned(), |value| format!("{}{unit}", brief(value)))
    };
    for state in &states {
        table.row((
            state.name.as_str(),
            (state.unknowns as u64),
            state.psnr,
            state.loss,
            state.seconds,
            state.rays,
        ));
        rows.push(vec![
            state.name.clone(),
            state.unknowns.to_string(),
            number(state.psnr, " dB"),
            number(state.loss, ""),
            format!("{:.0}", state.seconds),
            format!("{:.1}", state.rays as f64 * 1e-6),
        ]);
    }
    let plot = plot(&states, truth.is_some());
    let seen = seen(&states);
    let shown = truth.and_then(|pictures| pictures.into_iter().nth(SHOWN));
    let shown = shown.map(|picture| ("truth".to_owned(), picture));
    let pictures = states.into_iter().map(|state| (state.name, state.picture));
    let grid = Grid {
        columns: 3,
        exposure: 1.0,
        pictures: shown.into_iter().chain(pictures).collect(),
    };
    Findings {
        how,
        tables: vec![("", table)],
        plots: vec![("", plot)],
        summary: Summary {
            columns: "state | unknowns | albedo pictures, PSNR | held-out loss | seconds | M rays",
            rows,
        },
        seen,
        pictures: vec![("-albedo", grid)],
    }
}

/// Accuracy of the albedo pictures over rays, by PSNR if the truth is `known`, else by loss.
fn plot(states: &[State], known: bool) -> Plot {
    let point = |state: &State| Some([state.rays as f64, state.psnr.or(state.loss)?]);
    let series = |name: &str, solver: &str| {
        let states = states.iter().filter(|s| s.name.starts_with(solver));
        Series::line(name, states.filter_map(point))
    };
    Plot {
        title: "Textures".to_owned(),
        x: Axis::logarithmic("rays"),
        y: Axis::linear(if known {
            "PSNR of albedo pictures, dB"
        } else {
            "held-out l1 loss, radiance"
        }),
        series: vec![
            series("transport cache: objects, textures", "cache"),
            series("paper: triangles, subdivisions", "paper"),
        ],
        ..Plot::default()
    }
}

fn seen(states: &[State]) -> Vec<String> {
    let score = |state: &State| match (state.psnr, state.loss) {
        (Some(psnr), _) => format!("{psnr:.1} dB"),
        (None, Some(loss)) => format!("a loss of {}", brief(loss)),
        (None, None) => "nothing measured".to_owned(),
    };
    let words = |state: &State| format!("{} {}", state.name, score(state));
    let course: Vec<String> = states.iter().map(words).collect();
    // Larger is better for both.
    let value = |state: &State| {
        let value = state.psnr.or(state.loss.map(|loss| -loss));
        value.unwrap_or(f64::NAN)
    };
    let mut seen = vec![format!("{}.", course.join("; "))];
    let [objects, textures, start, ..] = states else {
        return seen;
    };
    let best = (states[2..].iter()).max_by(|a, b| value(a).total_cmp(&value(b)));
    let Some(best) = best else {
        return seen;
    };
    let gain = |from: &State| match (best.psnr, from.psnr) {
        (Some(best), Some(from)) => format!("{:+.1} dB", best - from),
        _ => format!("{} against {}", score(best), score(from)),
    };
    let is_better = value(best) > value(objects).max(value(start));
    seen.push(format!(
        "The paper's coarse-to-fine descent is at best at \"{}\": {} from its own one colour an object, {} from the transport \
         cache's. What the paper says of it was {}seen.",
        best.name,
        gain(start),
        gain(objects),
        if is_better { "" } else { "not " },
    ));
    seen.push(format!(
        "The transport cache's textures stand at {} after {:.1} million rays, the descent's best at {} after {:.1}.",
        score(textures),
        textures.rays as f64 * 1e-6,
        score(best),
        best.rays as f64 * 1e-6,
    ));
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(scores: [f64; 5]) -> String {
        let names = [
            "cache",
            "cache, textures",
            "paper, objects",
            "triangles",
            "cut 1",
        ];
        let states: Vec<State> = (names.iter().zip(scores))
            .map(|(name, psnr)| State {
                name: (*name).to_owned(),
                unknowns: 1,
                psnr: Some(psnr),
                loss: None,
                seconds: 1.0,
                rays: 1,
                picture: Picture::from_fn(1, 1, |_, _| Vec3::ZERO),
            })
            .collect();
        seen(&states).join(" ")
    }

    #[test]
    fn the_paper_s_gain_is_seen_where_patches_are_better_than_one_colour_of_both_solvers() {
        let gains = text([24.0, 37.0, 23.5, 26.0, 30.0]);
        assert!(
            gains.contains("\"cut 1\": +6.5 dB from its own") && gains.contains("of it was seen")
        );
        assert!(gains.contains("+6.0 dB from the transport"));
        let worse = text([24.0, 37.0, 20.0, 22.0, 23.0]);
        assert!(worse.contains("+3.0 dB from its own") && worse.contains("was not seen"));
    }
}
