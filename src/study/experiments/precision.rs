//! Study: limits of single precision.

use crate::error::Result;
use crate::export::plot::{Axis, Plot, Series};
use crate::export::table::Table;
use crate::inverse::settings::{Preset, Settings};
use crate::math::stats::quantile;
use crate::room::Room;
use crate::room::cameras::cameras;
use crate::scene::Scene;
use crate::scene::visibility::NOTHING;
use crate::study::experiments::box_room;
use crate::study::experiments::course::{cache_settings, solved};
use crate::study::experiments::study::{Bench, Findings, Study, Summary, brief};
use crate::study::experiments::summed::Paths;
use crate::study::experiments::twin::studied;
use crate::study::subject::Subject;
use crate::transport::material::Material;
use glam::{DVec3, Vec2, Vec3};

pub const STUDY: Study = Study {
    name: "precision",
    question: "Rays and path weights are kept in 32 bits, sums in 64. Over sizes, distances from the origin, numbers of paths \
        and ratios of lamps: where is that no longer enough?",
    seeds: 1,
    run,
};

/// Quantile of the reported error over rays.
const QUANTILE: f64 = 0.99;

/// Largest tolerable relative error. For a fit it is twice the difference between two seeds.
const TOLERABLE: f64 = 1e-3;

/// Changes a room by a parameter. Returns the room, and the size that errors are relative to.
type Change = fn(&Room, f64) -> (Room, f64);

/// Errors over one parameter.
struct Line {
    axis: &'static str,
    quantity: &'static str,
    tolerable: f64,
    /// Parameter value and error.
    points: Vec<(f64, f64)>,
}

fn run(bench: &Bench) -> Result<Findings> {
    let step = if bench.quick { 4 } else { 1 };
    let powers = |low: i32, high: i32| -> Vec<f64> {
        (low..=high).step_by(step).map(|k| 10f64.powi(k)).collect()
    };
    let studied = studied(bench, box_room::rendering(true))?;
    let subject = Subject::of_room(&studied.room, &studied.rendering)?;
    let (words, room) = (studied.words, studied.room);
    let reflects: Vec<bool> = (room.materials.iter())
        .map(|material| material.emission == Vec3::ZERO)
        .collect();
    let albedos = |subject: &Subject, seed| fitted(bench, subject, &reflects, seed);
    let met = meets(&subject.problem.scene);
    let noise = difference(&albedos(&subject, 2)?, &albedos(&subject, 1)?);

    // The room scaled, and with an ever farther outlier; fits are compared with the first value of each.
    let mut lines = Vec::new();
    let sizes: Vec<f64> = std::iter::once(1.0).chain(powers(-6, 6)).collect();
    let far: Vec<f64> = std::iter::once(1.0).chain(powers(1, 6)).collect();
    let changed: [(&str, Vec<f64>, Change); 2] = [
        ("size of the room", sizes, scaled),
        ("distance of an outlier, in rooms", far, with_outlier),
    ];
    for (axis, values, change) in changed {
        bench.begin(axis)?;
        let (mut hits, mut off) = (Vec::new(), Vec::new());
        let mut wanted = Vec::new();
        for value in values {
            let (room, size) = change(&room, value);
            let photographs = subject.problem.photographs.iter().map(|p| (**p).clone());
            let other = Subject::of_photographs(&room, photographs.collect())?;
            let found = albedos(&other, 1)?;
            if wanted.is_empty() {
                wanted = found;
                continue;
            }
            hits.push((value, hit_error(&room, &other.problem.scene, &met, size)));
            off.push((value, difference(&found, &wanted)));
        }
        lines.push(Line {
            axis,
            quantity: "hit points, in rooms (99 % below)",
            tolerable: TOLERABLE,
            points: hits,
        });
        lines.push(Line {
            axis,
            quantity: "albedos of a fit, against the same at 1",
            tolerable: 2.0 * noise,
            points: off,
        });
        (bench.show)(plot(&lines));
    }

    bench.begin("sums of paths")?;
    // Sums of paths, and two lamps of very different radiance.
    let count = if bench.quick { 10_000 } else { 1_000_000 };
    let paths = Paths::trace(&subject.problem, lamps(&subject, &reflects), count);
    for (quantity, sum) in [
        (
            "one sum in 32 bits",
            Paths::in_f32 as fn(&Paths, usize) -> f64,
        ),
        ("32 bits a path, 64 in the sum", Paths::in_f64),
    ] {
        let counts = powers(1, paths.count().ilog10() as i32);
        lines.push(Line {
            axis: "paths summed",
            quantity,
            tolerable: TOLERABLE,
            points: (counts.into_iter())
                .map(|n| (n, paths.error(n as usize, sum)))
                .collect(),
        });
    }
    let ratios = powers(0, 12).into_iter();
    lines.push(Line {
        axis: "ratio of two lamps",
        quantity: "light of the dimmer one beside the other",
        tolerable: TOLERABLE,
        points: ratios
            .map(|ratio| (ratio, paths.dim_lamp_error(ratio)))
            .collect(),
    });
    Ok(findings(&words, noise, &lines))
}

/// Longest side of a room's bounding box.
fn size(room: &Room) -> f64 {
    let (low, high) = room.mesh.bounds();
    (high - low).max_element()
}

/// The room scaled by `factor`.
fn scaled(room: &Room, factor: f64) -> (Room, f64) {
    let mut room = room.clone();
    room.mesh.positions.iter_mut().for_each(|p| *p *= factor);
    (room.views.iter_mut()).for_each(|view| view.pose.center *= factor);
    let size = size(&room);
    (room, size)
}

/// The room with a small triangle at `distance` times its size, like a stray triangle of a scan.
fn with_outlier(room: &Room, distance: f64) -> (Room, f64) {
    let mut room = room.clone();
    let size = size(&room);
    let (low, high) = room.mesh.bounds();
    let first = room.mesh.positions.len() as u32;
    let middle = (low + high) * 0.5;
    let far = middle + DVec3::new(0.6, 0.48, 0.64) * (size * distance);
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| far + p * (0.1 * size));
    room.mesh.positions.extend(corners);
    room.mesh.triangles.push([first, first + 1, first + 2]);
    room.mesh.object_of.push(room.mesh.objects.len() as u32);
    room.mesh.objects.push("speck".to_owned());
    if !room.mesh.corner_uvs.is_empty() {
        room.mesh.corner_uvs.push([Vec2::ZERO; 3]);
    }
    room.materials
        .push(Material::diffuse(Vec3::splat(0.5), Vec3::ZERO));
    (room, size)
}

/// Whether the central ray of each pixel of each camera hits a surface.
fn meets(scene: &Scene) -> Vec<bool> {
    let pixels = scene.ids().triangles.iter().flatten();
    pixels.map(|&triangle| triangle != NOTHING).collect()
}

/// Error of the hit points of the pixels' central rays in units of `size` (99 % quantile), compared in f64 with the
/// intersection of ray and triangle plane. `met` are the pixels with a hit in the original room; one that hits
/// nothing now has error 1.
fn hit_error(room: &Room, scene: &Scene, met: &[bool], size: f64) -> f64 {
    let lens = scene.cameras.first().map(|camera| camera.intrinsics);
    let [width, height] = lens.map_or([0; 2], |lens| [lens.width, lens.height]);
    let exact = cameras(&room.views, [width, height]);
    let mut errors = Vec::new();
    let mut met = met.iter();
    for (camera, (lens, pose)) in scene.cameras.iter().zip(&exact) {
        for pixel in 0..camera.pixels() {
            if met.next() != Some(&true) {
                continue;
            }
            let at = camera.corner(pixel) + 0.5;
            let Some(hit) = scene.intersect(&camera.ray(at)) else {
                errors.push(1.0);
                continue;
            };
            let corners = room.mesh.triangles[hit.triangle as usize];
            let [a, b, c] = corners.map(|i| room.mesh.positions[i as usize]);
            let normal = (b - a).cross(c - a);
            let on_plane = lens.normalized(at.as_dvec2());
            let direction = pose.rotation * DVec3::new(on_plane.x, -on_plane.y, -1.0);
            let t = (a - pose.center).dot(normal) / direction.dot(normal);
            let found = scene.point(&hit).as_dvec3() + scene.origin;
            errors.push((pose.center + direction * t - found).length() / size);
        }
    }
    quantile(&mut errors, QUANTILE).unwrap_or(f64::NAN)
}

/// The reflectors' albedos by channel, from a quick fit.
fn fitted(bench: &Bench, subject: &Subject, reflects: &[bool], seed: u64) -> Result<Vec<f64>> {
    let settings = Settings {
        preset: Preset::Preview,
        ..cache_settings(seed, bench.quick)
    };
    let objects = solved(bench, subject, &settings)?.estimate.objects;
    let both = objects.iter().zip(reflects);
    let reflectors = both.filter(|(_, reflects)| **reflects);
    let albedos = reflectors.flat_map(|(object, _)| object.albedo.to_array());
    Ok(albedos.map(f64::from).collect())
}

/// Mean relative difference over positive reference values.
fn difference(found: &[f64], wanted: &[f64]) -> f64 {
    let both = found.iter().zip(wanted);
    let both = both.filter(|(_, wanted)| **wanted > 0.0);
    let differences: Vec<f64> = both.map(|(a, b)| (a - b).abs() / b).collect();
    differences.iter().sum::<f64>() / differences.len().max(1) as f64
}

/// Two objects to be treated as lamps: the last visible reflector, and the last lamp.
fn lamps(subject: &Subject, reflects: &[bool]) -> [usize; 2] {
    let ids = subject.problem.scene.ids();
    let last = |reflector: bool| {
        let mut objects = (0..reflects.len()).rev();
        objects.find(|&i| reflects[i] == reflector && (ids.seen_pixels(i) > 0 || !reflector))
    };
    [last(true).unwrap_or(0), last(false).unwrap_or(0)]
}

fn findings(words: &str, noise: f64, lines: &[Line]) -> Findings {
    let mut table = Table::new("axis,quantity,value,relative_error");
    for line in lines {
        for &(value, error) in &line.points {
            table.row((line.axis, line.quantity, value, error));
        }
    }
    let row = |line: &Line| {
        let errors = line.points.iter().map(|p| p.1);
        vec![
            line.axis.to_owned(),
            line.quantity.to_owned(),
            brief(errors.clone().fold(f64::INFINITY, f64::min)),
            brief(errors.fold(0.0, f64::max)),
            brief(line.tolerable),
            reach(line),
        ]
    };
    Findings {
        how: format!(
            "{words}. Hit points of the photographs' central rays, against planes and cameras as given in 64 bits; albedos fitted \
             by preset `preview` with the same seed to the same \
             photographs, against those fitted to the room as it is or with the outlier one room away, in 32 bits too (two seeds differ by {}, and what moves the mesh's middle moves the cells in which light \
             is gathered too, so that less than twice that is none); radiance of paths as the fit evaluates them, against the same \
             products in 64 bits. Every number is the same on every machine.",
            brief(noise),
        ),
        tables: vec![("", table)],
        plots: vec![("", plot(lines))],
        summary: Summary {
            columns: "axis | quantity | least error | largest error | tolerable | reach",
            rows: lines.iter().map(row).collect(),
        },
        seen: (lines.iter())
            .map(|line| format!("{}, {}: {}.", line.axis, line.quantity, sentence(line)))
            .collect(),
        ..Findings::default()
    }
}

fn plot(lines: &[Line]) -> Plot {
    let series = |line: &Line| {
        let name = format!("{}: {}", line.axis, line.quantity);
        Series::line(name, line.points.iter().map(|&(x, y)| [x, y]))
    };
    Plot {
        title: "Relative errors of 32 bits".to_owned(),
        x: Axis::logarithmic("value on the axis named"),
        y: Axis::logarithmic("relative error"),
        series: lines.iter().map(series).collect(),
        ..Plot::default()
    }
}

/// The range of parameter values with a tolerable error.
fn reach(line: &Line) -> String {
    let is_tolerable = |p: &&(f64, f64)| p.1 <= line.tolerable;
    let tolerable = || line.points.iter().filter(is_tolerable).map(|p| p.0);
    match (tolerable().reduce(f64::min), tolerable().reduce(f64::max)) {
        (Some(low), Some(high)) => format!("{low:.0e} to {high:.0e}"),
        _ => "nowhere".to_owned(),
    }
}

fn sentence(line: &Line) -> String {
    let (Some(first), Some(last)) = (line.points.first(), line.points.last()) else {
        return "not measured".to_owned();
    };
    let too_large = |p: &(f64, f64)| p.1.is_nan() || p.1 > line.tolerable;
    match line.points.iter().position(too_large) {
        None => format!(
            "below {} at all {} values tried from {:.0e} to {:.0e}, at most {}",
            brief(line.tolerable),
            line.points.len(),
            first.0,
            last.0,
            brief(line.points.iter().map(|p| p.1).fold(0.0, f64::max)),
        ),
        Some(place) => {
            let worse = line.points[place];
            let count = line.points.iter().filter(|p| too_large(p)).count();
            let goes_on = count == line.points.len() - place;
            format!(
                "{} at {:.0e}, and above {} first at {:.0e} ({}), {}",
                brief(first.1),
                first.0,
                brief(line.tolerable),
                worse.0,
                brief(worse.1),
                match goes_on {
                    true => "and at all values tried beyond".to_owned(),
                    false => format!("in all at {count} of {} values tried", line.points.len()),
                },
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_that_is_too_large_once_is_not_said_to_be_so_beyond() {
        let text = |errors: [f64; 4]| {
            let points = (0..4).map(|i| 10f64.powi(i)).zip(errors).collect();
            sentence(&Line {
                axis: "size",
                quantity: "hit points",
                tolerable: 0.1,
                points,
            })
        };
        assert!(text([0.0, 0.01, 0.0, 0.05]).starts_with("below 0.100 at all 4 values"));
        assert!(text([0.0, 0.2, 0.0, 0.0]).ends_with("in all at 1 of 4 values tried"));
        assert!(text([0.0, 0.0, 0.2, f64::NAN]).ends_with("at all values tried beyond"));
    }
}
