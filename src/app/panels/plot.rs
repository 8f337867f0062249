//! What plots with logarithmic axes share.

use crate::app::number::number;
use egui_plot::{Corner, GridInput, GridMark, HoverPosition, Legend, PlotPoint, log_grid_spacer};

/// Axes of fewer or more decades than these have evenly spaced lines.
const NARROW: f64 = 0.5;
const WIDE: f64 = 12.0;

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

/// The number that a place on such an axis stands for, in words.
pub fn at(logarithm: f64) -> String {
    number(10f64.powf(logarithm) as f32)
}

/// A legend in the corner that falling curves leave free.
pub fn legend() -> Legend {
    let legend = Legend::default().position(Corner::LeftBottom);
    legend.background_alpha(0.6).follow_insertion_order(true)
}

/// The label of the curve's point under the pointer, made from the curve's name and the place.
pub fn hovered(
    position: &HoverPosition<'_>,
    say: impl Fn(&str, PlotPoint) -> String,
) -> Option<String> {
    match position {
        HoverPosition::NearDataPoint {
            plot_name,
            position,
            ..
        } => Some(say(plot_name, *position)),
        HoverPosition::Elsewhere { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithmic_axes_have_lines_at_round_values() {
        let input = GridInput {
            bounds: (-2.1, 0.4),
            base_step_size: 0.01,
        };
        let labelled = decades(input).into_iter().filter(|m| m.step_size > 0.1);
        let values: Vec<String> = labelled.map(|mark| at(mark.value)).collect();
        let expected = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0].map(number);
        assert_eq!(values, expected);
    }
}
