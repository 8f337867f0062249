//! The trade of the open capture: error over seconds, where the running solve is on it, and where to stop.

use crate::app::action::Action;
use crate::app::controls::labelled;
use crate::app::panels::plot::{at, decades, hovered, legend};
use crate::app::request::{Request, Requests};
use crate::app::theme::{self, Tokens};
use crate::app::trade::{Measured, Stop, TradeView, Vertical, offers, stop_at};
use crate::app::view::Parts;
use crate::inverse::settings::{Preset, Settings};
use crate::session::snapshot::Snapshot;
use crate::study::trade::{Curve, Point, Trade};
use egui::{Button, Color32, DragValue, Pos2, Ui};
use egui_plot::{Line, LineStyle, MarkerShape, Plot, PlotPoint, PlotPoints, Points, VLine};

/// How near to a point a click must be, in points of the screen.
const REACH: f32 = 14.0;
/// Least height of a plot with a legend, in points of the screen.
const LEGEND: f32 = 160.0;

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>, measured: &Measured) {
    let (document, requests) = (parts.document, &mut *parts.requests);
    let view = &mut parts.view.panels.trade;
    measuring(ui, measured, &mut view.limit, requests);
    stops(ui, &document.settings, requests);
    let Some(trade) = &measured.trade else {
        ui.weak("The trade of this capture was not measured yet");
        return;
    };
    ui.horizontal_wrapped(|ui| {
        for (stop, curve, expected) in offers(trade) {
            let button = ui.small_button(stop.words());
            if button.on_hover_text(expected).clicked() {
                requests.ask(Request::Stop(curve, stop));
            }
        }
    });
    ui.horizontal(|ui| {
        let vertical = &mut view.vertical;
        ui.selectable_value(vertical, Vertical::Claimed, "Claimed error")
            .on_hover_text("The relative error of albedo that estimates claim of themselves");
        ui.selectable_value(vertical, Vertical::Measured, "Measured error")
            .on_hover_text(trade.measure.label());
    })
    .response
    .on_hover_text(trade.machine.words());
    let now = live(&document.snapshot);
    let chosen = plot(ui, now, view, trade);
    requests.ask_all(chosen.map(|(curve, stop)| Request::Stop(curve, stop)));
}

/// The button that measures, and what it is at.
fn measuring(ui: &mut Ui, measured: &Measured, limit: &mut f64, requests: &mut Requests) {
    ui.horizontal(|ui| {
        let doing = measured.doing();
        let text = if doing.is_some() { "Cancel" } else { "Measure" };
        requests
            .button(ui, Action::MeasureTrade, Button::new(text))
            .on_disabled_hover_text("Measured only while no solve runs: pause it or let it end");
        match doing {
            Some(doing) => {
                ui.spinner();
                ui.label(doing);
            }
            None => {
                let seconds = DragValue::new(limit).range(5.0..=3600.0);
                labelled(ui, "in", seconds.suffix(" s"))
                    .on_hover_text("Time for all presets together");
                if measured.unsaved && ui.button("Keep").on_hover_text(KEEP).clicked() {
                    requests.ask(Request::KeepTrade);
                }
            }
        }
    });
}

const KEEP: &str = "Writes trade.csv, trade.json and trade.png into the folder where this capture's results are looked for when it is opened";

/// The two stops as numbers.
fn stops(ui: &mut Ui, before: &Settings, requests: &mut Requests) {
    let mut settings = before.clone();
    ui.horizontal(|ui| {
        let error = DragValue::new(&mut settings.target_error).range(0.0..=100.0);
        let error = error.speed(0.01).max_decimals(3).suffix(" %");
        labelled(ui, "Stop at error", error)
            .on_hover_text("Relative error of albedo that the estimate claims of itself; 0 leaves it to the preset");
        let time = DragValue::new(&mut settings.time).range(0.0..=1e9);
        labelled(ui, "Stop at time", time.speed(0.1).suffix(" s"))
            .on_hover_text("Seconds of solving; 0 sets no limit");
    });
    if settings != *before {
        requests.ask(Request::Set(Box::new(settings)));
    }
}

/// Draws the curves; gives the curve and the stop of a point that was clicked.
fn plot(
    ui: &mut Ui,
    now: Option<(f64, Option<f64>)>,
    view: &mut TradeView,
    trade: &Trade,
) -> Option<(usize, Stop)> {
    let tokens = theme::tokens(ui);
    let vertical = view.vertical;
    let height = move |point: &Point| height(point, vertical);
    let percent = vertical == Vertical::Claimed;
    let value = move |log: f64| match percent {
        true => format!("{} %", at(log)),
        false => at(log),
    };
    let mut drawn = Plot::new("trade");
    // A legend would cover a small plot.
    if ui.available_height() > LEGEND {
        drawn = drawn.legend(legend());
    }
    let response = drawn
        .x_axis_formatter(|mark, _| format!("{} s", at(mark.value)))
        .y_axis_formatter(move |mark, _| value(mark.value))
        .label_formatter(move |position| {
            hovered(position, |name, p| {
                format!("{name}\n{} s: {}", at(p.x), value(p.y))
            })
        })
        .x_grid_spacer(decades)
        .y_grid_spacer(decades)
        .y_axis_min_width(44.0)
        .show(ui, |plot| {
            let mut places = Vec::new();
            for (index, curve) in trade.curves.iter().enumerate() {
                let color = color(curve, tokens);
                let mut line = Vec::new();
                for (number, point) in curve.points.iter().enumerate() {
                    if let Some(y) = height(point) {
                        line.push([point.seconds.log10(), y]);
                        places.push(([point.seconds.log10(), y], index, number));
                    }
                }
                if curve.is_preset {
                    let line = Line::new(&curve.name, PlotPoints::from(line.clone()));
                    plot.line(line.color(color).width(1.6));
                }
                plot.points(Points::new(&curve.name, line).color(color).radius(2.2));
            }
            let front: Vec<[f64; 2]> = (trade.curves.iter().flat_map(|curve| &curve.points))
                .filter(|point| point.pareto)
                .filter_map(|point| Some([point.seconds.log10(), height(point)?]))
                .collect();
            if !percent {
                let front = Points::new("Pareto front", front).shape(MarkerShape::Circle);
                plot.points(front.filled(false).color(tokens.strong).radius(4.0));
            }
            if let Some((seconds, claim)) = now {
                let x = seconds.log10();
                let line = VLine::new("running solve", x).color(tokens.accent);
                plot.vline(line.style(LineStyle::dashed_loose()));
                if let Some(claim) = claim.filter(|_| percent) {
                    let here = vec![[x, (claim * 100.0).log10()]];
                    let here = Points::new("running solve", here).shape(MarkerShape::Diamond);
                    plot.points(here.color(tokens.accent).radius(6.0));
                }
            }
            places
        });
    let on_screen = |at: [f64; 2]| {
        let place = PlotPoint::new(at[0], at[1]);
        response.transform.position_from_point(&place)
    };
    view.places = (response.inner.iter())
        .map(|&(at, curve, point)| (on_screen(at), curve, point))
        .collect();
    if !response.response.clicked() {
        return None;
    }
    let at = response.response.interact_pointer_pos()?;
    let (curve, point) = nearest(&view.places, at)?;
    let stop = stop_at(trade.curves.get(curve)?.points.get(point)?, vertical)?;
    Some((curve, stop))
}

/// The logarithm of a point's error; `None` where it has no such error.
fn height(point: &Point, vertical: Vertical) -> Option<f64> {
    let value = match vertical {
        Vertical::Claimed => point.reported? * 100.0,
        Vertical::Measured => point.error,
    };
    (value > 0.0 && point.seconds > 0.0).then(|| value.log10())
}

/// Seconds of the solve that is under way or has ended, and the relative error that it claims.
fn live(snapshot: &Snapshot) -> Option<(f64, Option<f64>)> {
    let progress = &snapshot.progress;
    progress.seconds_to_first_estimate?;
    let claim = snapshot.estimate.relative_error().filter(|e| *e > 0.0);
    (progress.seconds > 0.0).then_some((progress.seconds, claim))
}

/// The point nearest to a place on the screen, if it is near.
fn nearest(places: &[(Pos2, usize, usize)], at: Pos2) -> Option<(usize, usize)> {
    let near = places.iter().map(|&(p, c, i)| (p.distance(at), c, i));
    let (distance, curve, point) = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (distance <= REACH).then_some((curve, point))
}

fn color(curve: &Curve, tokens: &Tokens) -> Color32 {
    if !curve.is_preset {
        return tokens.outline;
    }
    match curve.settings.preset {
        Preset::Preview => tokens.good,
        Preset::Balanced => tokens.train,
        Preset::Reference => tokens.held_out,
        Preset::Paper => tokens.weak,
    }
}
