//! The loss curve on a logarithmic axis, with the held-out loss and the ends of stages.

use crate::app::panels::plot::{at, decades, hovered, legend};
use crate::app::theme;
use crate::inverse::solver::{LossPoint, Progress, Stage};
use egui::Ui;
use egui_plot::{Line, LineStyle, Plot, PlotPoints, Points, VLine};

/// Points drawn of a curve at most.
const POINTS: usize = 2000;

pub fn pane(ui: &mut Ui, progress: &Progress) {
    let tokens = theme::tokens(ui);
    if progress.losses.is_empty() && progress.fits.is_empty() {
        ui.weak("No loss has been measured yet");
        return;
    }
    let train = curve(&progress.losses, |point| point.train);
    let held_out = curve(&progress.losses, |point| point.held_out);
    let fits = progress.fits.iter();
    let fits = logarithmic(fits.map(|point| [point.seconds, point.residual]));
    let textures = progress.textures.iter();
    let textures = logarithmic(textures.map(|point| [point.seconds, point.residual]));
    Plot::new("loss")
        .legend(legend())
        .y_axis_formatter(|mark, _| at(mark.value))
        .x_axis_formatter(|mark, _| format!("{} s", mark.value))
        .label_formatter(|position| {
            hovered(position, |name, p| {
                let value = format!("{name}\n{:.1} s: {}", p.x, at(p.y));
                match stage_at(&progress.stages, p.x) {
                    Some(stage) if name.is_empty() => format!("{stage} ends at {:.1} s", p.x),
                    Some(stage) => format!("{value}\n{stage}"),
                    None => value,
                }
            })
        })
        .y_grid_spacer(decades)
        .y_axis_min_width(36.0)
        .show(ui, |plot| {
            for stage in &progress.stages {
                // Without a name it stays out of the legend.
                let line = VLine::new("", stage.ended).color(tokens.outline);
                plot.vline(line.style(LineStyle::dashed_loose()));
            }
            // A single point has no line.
            for (name, points, color) in [
                ("Loss", train, tokens.train),
                ("Held out", held_out, tokens.held_out),
                ("Residual of the fit, relative", fits, tokens.text),
            ] {
                if points.len() == 1 {
                    plot.points(Points::new(name, points).color(color).radius(3.0));
                } else {
                    let line = Line::new(name, PlotPoints::from(points));
                    plot.line(line.color(color).width(1.8));
                }
            }
            if !textures.is_empty() {
                let points = Points::new("Textures, relative", textures);
                plot.points(points.color(tokens.weak).radius(1.5));
            }
        });
}

/// The stage at a time since the start; `None` after the last that has ended.
fn stage_at(stages: &[Stage], seconds: f64) -> Option<&str> {
    let stage = stages.iter().find(|stage| seconds <= stage.ended)?;
    Some(&stage.name)
}

/// Seconds and logarithm of a loss.
fn curve(losses: &[LossPoint], value: impl Fn(&LossPoint) -> Option<f64>) -> Vec<[f64; 2]> {
    logarithmic((losses.iter()).filter_map(|point| Some([point.seconds, value(point)?])))
}

/// Points with the logarithm of their second value, thinned out evenly, without values that are not positive.
fn logarithmic(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 2]> = points
        .filter(|[_, value]| *value > 0.0)
        .map(|[seconds, value]| [seconds, value.log10()])
        .collect();
    let stride = points.len().div_ceil(POINTS).max(1);
    let last = points.last().copied();
    let mut thinned: Vec<[f64; 2]> = points.into_iter().step_by(stride).collect();
    if let Some(last) = last.filter(|last| thinned.last() != Some(last)) {
        thinned.push(last);
    }
    thinned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_in_the_first_stage_that_ends_no_earlier() {
        let stages = [("light field", 2.0), ("refine", 5.0)].map(|(name, ended)| Stage {
            name: name.to_owned(),
            ended,
            ..Stage::default()
        });
        let at = |seconds| stage_at(&stages, seconds);
        assert_eq!(at(2.0), Some("light field"));
        assert_eq!(at(4.9), Some("refine"));
        assert_eq!(at(5.1), None);
    }

    #[test]
    fn curves_are_logarithmic_keep_their_end_and_leave_out_what_was_not_measured() {
        let losses: Vec<LossPoint> = (0..5001)
            .map(|i| LossPoint {
                seconds: f64::from(i),
                iteration: i as u64,
                train: Some(0.01),
                held_out: (i % 2 == 0).then_some(f64::from(i)),
            })
            .collect();
        let train = curve(&losses, |p| p.train);
        assert!(train.len() <= POINTS + 1 && train.last() == Some(&[5000.0, -2.0]));
        let held_out = curve(&losses, |p| p.held_out);
        assert!(held_out.len() > POINTS / 4);
        assert!(held_out.iter().all(|p| p[0] > 0.0 && p[0] % 2.0 == 0.0));
    }
}
