//! How textures come out, coarse to fine.

use crate::error::Result;
use crate::export::plot::{Axis, Plot, Series};
use crate::export::table::Table;
use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::inverse::loss::LossProbe;
use crate::inverse::paper::descent::{Descent, Grain};
use crate::inverse::settings::{Preset, Settings};
use crate::inverse::solver::Problem;
use crate::math::picture::Picture;
use crate::room::truth::albedo_picture;
use crate::scene::texels::TexelLayout;
use crate::study::experiments::course::{cache_settings, paper_settings, solved};
use crate::study::experiments::findings::{Grid, brief};
use crate::study::experiments::furnished::built_in;
use crate::study::experiments::{Bench, Findings, Limits, Study, Subject, Summary, finer};
use crate::transport::lit::Lit;
use crate::transport::material::TexelColors;
use glam::Vec3;
use std::sync::Arc;
use std::time::Instant;

/// The study.
pub const STUDY: Study = Study {
    name: "textures",
    question: "The paper: once lights are in place, albedos per triangle and then of ever finer triangles recover textures. At \
        what cost, beside the transport cache's cells of the size of pixels?",
    seeds: 1,
    run,
};

/// Subdivisions after the mesh's own triangles.
const CUTS: usize = 2;
/// Triangles seen by so many pixels are cut.
const PIXELS: u64 = 16;
/// The photograph whose albedo is shown.
const SHOWN: usize = 0;

/// Where textures stood.
struct State {
    name: String,
    unknowns: usize,
    /// Peak signal-to-noise ratio of the albedo pictures in dB, where the truth is known.
    psnr: Option<f64>,
    loss: Option<f64>,
    seconds: f64,
    rays: u64,
    picture: Picture,
}

/// Measures states.
struct Measure {
    /// The true albedo seen by each camera.
    truth: Option<Vec<Picture>>,
    /// For each camera and pixel, whether it counts: no lamp, no edge of the mesh.
    counts: Vec<Vec<bool>>,
    probe: LossProbe,
}

fn run(bench: &Bench) -> Result<Findings> {
    let room = match bench.subject {
        Some(_) => None,
        None => Some(built_in(true, bench.quick)?),
    };
    let subject = match (&room, bench.subject) {
        (Some(room), _) => &room.subject,
        (None, Some(subject)) => subject,
        (None, None) => return Ok(Findings::default()),
    };
    let measure = Measure::new(subject, room.as_ref().map(|room| &room.lit));
    let limits = bench.limits(1 + CUTS);

    // The transport cache, with one colour an object and with textures.
    bench.begin("transport cache")?;
    let own_light = room.is_some();
    let of_objects = Settings {
        exposures: !own_light,
        outside_light: !own_light,
        ..cache_settings(1, bench.quick)
    };
    let with_textures = Settings {
        preset: Preset::Balanced,
        textures: true,
        ..of_objects.clone()
    };
    let mut states = Vec::new();
    let mut objects = Estimate::default();
    for (name, settings) in [
        ("cache, one colour an object", &of_objects),
        ("cache, textures", &with_textures),
    ] {
        bench.begin(name)?;
        let solution = solved(bench, subject, settings)?;
        let (seconds, rays) = (solution.progress.seconds, solution.progress.rays);
        let estimate = solution.estimate;
        let cells = |t: &Arc<TexelEstimate>| t.seen.iter().filter(|&&n| n > 0).count();
        let unknowns = estimate
            .texels
            .as_ref()
            .map_or(estimate.objects.len(), cells);
        states.push(measure.state(name, &subject.problem, &estimate, unknowns, seconds, rays));
        (bench.show)(plot(&states, measure.truth.is_some()));
        if objects.objects.is_empty() {
            objects = estimate;
        }
    }
    let problem = &subject.problem;
    descents(bench, &measure, problem, &objects, limits, &mut states)?;
    let judged = match measure.truth {
        Some(_) => {
            "albedo pictures of all photographs against the true ones (peak 1, lamps left out), and held-out loss"
        }
        None => "held-out loss, as no truth is known",
    };
    let how = format!(
        "{}: {judged}, rendered with all bounces. The transport cache is run without lobes and without the test for \
         photographs that disagree, and with exposures and light from outside on captures alone. The paper's descent does not \
         start from zero but from the transport cache's lamps and one colour an object; it keeps the lamps and fits, with two \
         bounces and batches of {} as published and nothing annealed, for {} on the \
         mesh's own triangles and as long after each of {CUTS} subdivisions, where every triangle is cut into four that {PIXELS} \
         pixels or more see (the paper cuts by error). Its seconds and rays are counted from there.",
        subject.name,
        paper_settings(1).batch,
        limits.words(),
    );
    Ok(findings(how, states, measure.truth))
}

/// Adds the paper's descent per triangle, on finer and finer triangles.
fn descents(
    bench: &Bench,
    measure: &Measure,
    problem: &Problem,
    start: &Estimate,
    limits: Limits,
    states: &mut Vec<State>,
) -> Result<()> {
    let settings = paper_settings(1);
    let mut descent = Descent::new(problem, Grain::Objects);
    for (index, object) in start.objects.iter().enumerate() {
        descent.unknowns.albedo[index] = object.albedo;
        descent.unknowns.emission[index] = object.emission;
        descent.lights[index] = object.emission;
    }
    let mut problem = problem.clone();
    let mut descent = descent.refine(&problem);
    let (mut seconds, mut rays) = (0.0, 0);
    for cuts in 0..=CUTS {
        let name = match cuts {
            0 => "paper, triangles".to_owned(),
            cuts => format!("paper, cut {cuts} ×"),
        };
        bench.begin(&name)?;
        if cuts > 0 {
            let (finer, parents) = finer::cut(&problem, PIXELS)?;
            descent = descent.refine_by(&parents);
            problem = finer;
        }
        let (begun, goal) = (Instant::now(), rays + limits.rays.min(u64::MAX / 8));
        while rays < goal && begun.elapsed().as_secs_f64() < limits.seconds {
            let outcome = descent.step(&problem, &settings, settings.max_bounces());
            rays += outcome.cast.rays;
            if !outcome.finite || outcome.cast.rays == 0 || (bench.stopped)() {
                break;
            }
        }
        seconds += begun.elapsed().as_secs_f64();
        let estimate = of_triangles(&problem, start, &descent);
        let unknowns = problem.scene.triangles.len();
        states.push(measure.state(&name, &problem, &estimate, unknowns, seconds, rays));
        (bench.show)(plot(states, measure.truth.is_some()));
    }
    bench.go_on()
}

/// An estimate with the descent's albedo of each triangle.
fn of_triangles(problem: &Problem, start: &Estimate, descent: &Descent) -> Estimate {
    let count = problem.scene.triangles.len();
    Estimate {
        texels: Some(Arc::new(TexelEstimate {
            colors: Arc::new(TexelColors {
                layout: TexelLayout::new(vec![0; count]),
                colors: descent.unknowns.albedo.clone(),
            }),
            stderr: vec![Vec3::ONE; count],
            seen: vec![0; count],
            textured: vec![true; start.objects.len()],
        })),
        ..start.clone()
    }
}

impl Measure {
    fn new(subject: &Subject, truth: Option<&Lit>) -> Self {
        let scene = &subject.problem.scene;
        let pictures = |lit: &Lit| {
            scene
                .cameras
                .iter()
                .map(|c| albedo_picture(lit, c))
                .collect()
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
        estimate: &Estimate,
        unknowns: usize,
        seconds: f64,
        rays: u64,
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
            unknowns,
            psnr,
            loss: self.probe.held_out(problem, estimate).0,
            seconds,
            rays,
            picture: albedo_picture(&lit, &cameras[SHOWN]),
        }
    }
}

fn findings(how: String, states: Vec<State>, truth: Option<Vec<Picture>>) -> Findings {
    let mut table = Table::new(&["state", "unknowns", "psnr", "loss", "seconds", "rays"]);
    let mut rows = Vec::new();
    let number = |value: Option<f64>, unit: &str| {
        value.map_or("-".to_owned(), |value| format!("{}{unit}", brief(value)))
    };
    for state in &states {
        table.row(&[
            state.name.as_str().into(),
            (state.unknowns as u64).into(),
            state.psnr.into(),
            state.loss.into(),
            state.seconds.into(),
            state.rays.into(),
        ]);
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
    let mut grid = Grid::new(3);
    let shown = truth.and_then(|pictures| pictures.into_iter().nth(SHOWN));
    grid.pictures
        .extend(shown.map(|picture| ("truth".to_owned(), picture)));
    let pictures = states.into_iter().map(|state| (state.name, state.picture));
    grid.pictures.extend(pictures);
    Findings {
        how,
        tables: vec![("", table)],
        plots: vec![("", plot)],
        summary: Summary {
            columns: vec![
                "state",
                "unknowns",
                "albedo pictures, PSNR",
                "held-out loss",
                "seconds",
                "M rays",
            ],
            rows,
        },
        seen,
        pictures: vec![("-albedo", grid)],
    }
}

/// How right the albedo pictures are over rays; `known` says whether the truth is.
fn plot(states: &[State], known: bool) -> Plot {
    let point = |state: &State| Some([state.rays as f64, state.psnr.or(state.loss)?]);
    let series = |name: &str, solver: &str| Series {
        name: name.to_owned(),
        points: (states.iter().filter(|s| s.name.starts_with(solver)))
            .filter_map(point)
            .collect(),
        ..Series::default()
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
    let course: Vec<String> = states
        .iter()
        .map(|s| format!("{} {}", s.name, score(s)))
        .collect();
    // Higher is better for both.
    let value = |state: &State| {
        state
            .psnr
            .or(state.loss.map(|loss| -loss))
            .unwrap_or(f64::NAN)
    };
    let mut seen = vec![format!("{}.", course.join("; "))];
    if let [objects, textures, triangles @ ..] = states {
        let best = triangles
            .iter()
            .max_by(|a, b| value(a).total_cmp(&value(b)));
        if let Some(best) = best {
            let is_better = value(best) > value(objects);
            let gains = (triangles.windows(2)).all(|pair| value(&pair[1]) > value(&pair[0]));
            seen.push(format!(
                "The paper's coarse-to-fine descent is at best {} than one colour an object (\"{}\"), and {}: what the paper \
                 says of it was {}seen in this time.",
                if is_better { "better" } else { "no better" },
                best.name,
                if gains {
                    "each subdivision gains"
                } else {
                    "not every subdivision gains"
                },
                if is_better && gains { "" } else { "not " },
            ));
            seen.push(format!(
                "The transport cache's textures stand at {} after {:.1} million rays, the descent's best at {} after {:.1}.",
                score(textures),
                textures.rays as f64 * 1e-6,
                score(best),
                best.rays as f64 * 1e-6,
            ));
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(scores: [f64; 5]) -> String {
        let names = ["cache", "cache, textures", "paper", "cut 1 ×", "cut 2 ×"];
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
    fn the_paper_s_gain_is_seen_where_every_subdivision_gains_over_one_colour_alone() {
        let gains = said([24.0, 37.0, 25.0, 26.0, 27.0]);
        assert!(gains.contains("at best better") && gains.contains("of it was seen"));
        // The finest is best, but a cut before it lost.
        let lost = said([24.0, 37.0, 26.0, 25.0, 27.0]);
        assert!(lost.contains("not every subdivision") && lost.contains("was not seen"));
        let worse = said([24.0, 37.0, 12.0, 13.0, 14.0]);
        assert!(worse.contains("at best no better") && worse.contains("was not seen"));
    }
}
