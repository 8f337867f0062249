//! Plots of studies in a pane, as their files show them.

use crate::app::picture::inspect::number;
use crate::app::theme;
use crate::export::plot::{Axis, Draw, Plot, Series};
use egui::{Align2, Ui};
use egui_plot::{
    Corner, FilledArea, GridInput, GridMark, HoverPosition, Legend, Line, LineStyle, PlotPoint,
    PlotPoints, Points, Text, VLine, log_grid_spacer,
};

/// Opacity of bands.
const BAND: f32 = 0.18;
/// Decades of an axis below and above which its lines are spaced evenly.
const NARROW: f64 = 0.5;
const WIDE: f64 = 12.0;

/// Draws a plot of a height in points.
pub fn show(ui: &mut Ui, id: &str, plot: &Plot, height: f32) {
    let tokens = theme::tokens(ui);
    ui.weak(format!("{} over {}", plot.y.label, plot.x.label));
    let (x, y) = (plot.x.clone(), plot.y.clone());
    let named = (plot.x.clone(), plot.y.clone());
    let mut pane = egui_plot::Plot::new(id);
    if plot.x.logarithmic {
        pane = pane.x_grid_spacer(decades);
    }
    if plot.y.logarithmic {
        pane = pane.y_grid_spacer(decades);
    }
    pane.height(height)
        .legend(
            Legend::default()
                .position(Corner::RightTop)
                .background_alpha(0.6),
        )
        .x_axis_formatter(move |mark, _| words(&x, mark.value))
        .y_axis_formatter(move |mark, _| words(&y, mark.value))
        .label_formatter(move |position| match position {
            HoverPosition::NearDataPoint {
                plot_name,
                position,
                ..
            } => Some(format!(
                "{plot_name}\n{}: {}",
                words(&named.0, position.x),
                words(&named.1, position.y)
            )),
            HoverPosition::Elsewhere { .. } => None,
        })
        .y_axis_min_width(44.0)
        .allow_scroll(false)
        .show(ui, |drawn| {
            for (at, name) in &plot.marks {
                if let Some(at) = place(&plot.x, *at) {
                    let line = VLine::new(name, at).color(tokens.outline);
                    drawn.vline(line.style(LineStyle::dashed_loose()));
                }
            }
            for (index, series) in plot.series.iter().enumerate() {
                let color = tokens.series[index % tokens.series.len()];
                let points: Vec<[f64; 2]> = places(plot, series).map(|(point, _)| point).collect();
                let [xs, low, high] = band(plot, series);
                // Without a name, so that the legend shows the curve's colour alone.
                if xs.len() > 1 {
                    let area = FilledArea::new("", &xs, &low, &high);
                    drawn.add(area.fill_color(color.gamma_multiply(BAND)));
                }
                let dots = Points::new(&series.name, points.clone()).color(color);
                match series.draw {
                    Draw::Dots => drawn.points(dots.radius(4.0)),
                    Draw::Line | Draw::Steps => {
                        let line = Line::new(&series.name, PlotPoints::from(points)).color(color);
                        let line = line.width(1.6);
                        drawn.line(match series.draw {
                            Draw::Steps => line.style(LineStyle::dashed_loose()),
                            _ => line,
                        });
                        drawn.points(dots.radius(2.2));
                    }
                }
            }
            for (at, name) in plot.labels.iter().filter(|(_, name)| !name.is_empty()) {
                if let Some(at) = both(plot, *at) {
                    let text = Text::new("", PlotPoint::from(at), name).color(tokens.text);
                    drawn.text(text.anchor(Align2::LEFT_BOTTOM));
                }
            }
        });
}

/// Lines at 1, 2, 5 and between of every decade of an axis that shows logarithms to base 10.
pub fn decades(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    if high - low < NARROW || high - low > WIDE {
        return log_grid_spacer(10)(input);
    }
    let digit = |exponent: f64, digit: u32| GridMark {
        value: exponent + f64::from(digit).log10(),
        step_size: match digit {
            1 => 1.0,
            2 | 5 => 0.3,
            _ => 0.05,
        },
    };
    (low.floor() as i32..=high.ceil() as i32)
        .flat_map(|exponent| (1..=9).map(move |d| digit(f64::from(exponent), d)))
        .filter(|mark| (low..=high).contains(&mark.value))
        .collect()
}

/// Where a value lies on an axis; `None` where it has no place.
fn place(axis: &Axis, value: f64) -> Option<f64> {
    let at = match axis.logarithmic {
        true if value <= 0.0 => return None,
        true => value.log10(),
        false => value,
    };
    at.is_finite().then_some(at)
}

fn both(plot: &Plot, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    Some([place(&plot.x, x)?, place(&plot.y, y)?])
}

/// The points of a series that have a place, with their index.
fn places<'a>(plot: &'a Plot, series: &'a Series) -> impl Iterator<Item = ([f64; 2], usize)> + 'a {
    let points = series.points.iter().enumerate();
    points.filter_map(|(index, point)| Some((both(plot, *point)?, index)))
}

/// Places along x, and of the lower and upper ends of a series' band.
fn band(plot: &Plot, series: &Series) -> [Vec<f64>; 3] {
    let mut band = [const { Vec::new() }; 3];
    for (at, index) in places(plot, series) {
        let ends = (series.band.get(index)).map(|ends| ends.map(|end| place(&plot.y, end)));
        if let Some([Some(low), Some(high)]) = ends {
            band[0].push(at[0]);
            band[1].push(low);
            band[2].push(high);
        }
    }
    band
}

fn words(axis: &Axis, at: f64) -> String {
    number(match axis.logarithmic {
        true => 10f64.powf(at) as f32,
        false => at as f32,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_place_on_a_logarithmic_axis_is_left_out_with_its_band() {
        let plot = Plot {
            x: Axis::logarithmic("x"),
            y: Axis::logarithmic("y"),
            ..Plot::default()
        };
        let series = Series {
            points: vec![[1.0, 10.0], [10.0, 0.0], [100.0, 1000.0], [0.0, 1.0]],
            band: vec![[1.0, 100.0], [0.0, 1.0], [f64::NAN, 1e4], [1.0, 1.0]],
            ..Series::default()
        };
        let points: Vec<[f64; 2]> = places(&plot, &series).map(|(point, _)| point).collect();
        assert_eq!(points, [[0.0, 1.0], [2.0, 3.0]]);
        let [xs, low, high] = band(&plot, &series);
        assert_eq!((xs, low, high), (vec![0.0], vec![0.0], vec![2.0]));
        assert_eq!(words(&plot.y, 2.0), "100");
    }

    #[test]
    fn logarithmic_axes_have_lines_at_round_values() {
        let input = GridInput {
            bounds: (-2.1, 0.4),
            base_step_size: 0.01,
        };
        let labelled = decades(input).into_iter().filter(|m| m.step_size > 0.1);
        let values: Vec<String> = labelled
            .map(|m| number(10f64.powf(m.value) as f32))
            .collect();
        let expected = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0].map(number);
        assert_eq!(values, expected);
    }
}
