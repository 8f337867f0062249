//! A plot axis with round ticks, linear or logarithmic.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// Maps values to pixels along one axis.
#[derive(Debug, Clone)]
pub struct Scale {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Scale {
    /// A scale that holds all values with a margin, and is never empty. A logarithmic scale needs values > 0.
    pub fn around(values: impl Iterator<Item = f64>, logarithmic: bool) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for position in values.map(|value| Self::position(value, logarithmic)) {
            (low, high) = (low.min(position), high.max(position));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let room = match (high - low) * 0.04 {
            room if room > 0.0 => room,
            _ if logarithmic => 0.5,
            _ => (low.abs() * 0.5).max(f64::MIN_POSITIVE),
        };
        Self {
            low: low - room,
            high: high + room,
            logarithmic,
        }
    }

    /// Smallest value shown.
    pub fn low(&self) -> f64 {
        self.value(self.low)
    }

    /// Largest value shown.
    pub fn high(&self) -> f64 {
        self.value(self.high)
    }

    fn value(&self, position: f64) -> f64 {
        match self.logarithmic {
            true => 10f64.powf(position),
            false => position,
        }
    }

    fn position(value: f64, logarithmic: bool) -> f64 {
        if logarithmic { value.log10() } else { value }
    }
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let position = Self::position(*value, self.logarithmic);
        let fraction = ((position - self.low) / (self.high - self.low)).clamp(-1.0, 2.0);
        limit.0 + (fraction * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let wanted = hint.max_num_points().clamp(2, 10) as f64;
        let span = self.high - self.low;
        let decades = if self.logarithmic { span.ceil() } else { 0.0 };

        // Logarithmic: ticks at 1, 2 and 5 of each decade, or only at decades if there are many.
        if self.logarithmic && decades > 1.0 {
            let step = (span / wanted).ceil().max(1.0);
            let digits: &[f64] = if span < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
            let first = (self.low / step).floor() as i32;
            let last = (self.high / step).ceil() as i32;
            let decade = |i: i32| 10f64.powf(f64::from(i) * step);
            let ticks = (first..=last).flat_map(|i| digits.iter().map(move |d| d * decade(i)));
            return (ticks.filter(|v| (self.low..=self.high).contains(&v.log10()))).collect();
        }

        // Linear: the smallest step of 1, 2 or 5 × 10ⁿ that gives at most the wanted number of ticks.
        let (low, high) = (self.low(), self.high());
        let min_step = (high - low) / wanted;
        let power = 10f64.powf(min_step.log10().floor());
        let mut steps = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter();
        let step = steps.find(|&step| step >= min_step).unwrap_or(min_step);
        let first = (low / step).ceil();
        let ticks = (0..=wanted as usize).map(|i| (first + i as f64) * step);
        ticks.filter(|v| (low..=high).contains(v)).collect()
    }

    fn range(&self) -> Range<f64> {
        self.low()..self.high()
    }
}

impl ValueFormatter<f64> for Scale {
    fn format(value: &f64) -> String {
        let magnitude = value.abs();
        // Twelve digits hide the rounding of i · step.
        let rounded: f64 = format!("{value:.12e}").parse().unwrap_or(*value);
        if magnitude != 0.0 && !(1e-3..1e5).contains(&magnitude) {
            format!("{rounded:e}")
        } else {
            rounded.to_string()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters::coord::ranged1d::BoldPoints;

    #[test]
    fn ticks_are_round_and_inside() {
        let labels = |ends: [f64; 2], logarithmic, count| -> Vec<String> {
            let scale = Scale::around(ends.into_iter(), logarithmic);
            let ticks = scale.key_points(BoldPoints(count));
            ticks.iter().map(Scale::format).collect()
        };
        let linear = labels([0.0, 0.93], false, 6);
        assert_eq!(linear, ["0", "0.2", "0.4", "0.6", "0.8"]);
        let labels = labels([1e-7, 1e2], true, 10);
        assert!(labels.contains(&"1e-7".to_owned()) && labels.contains(&"100".to_owned()));
    }

    #[test]
    fn logarithmic_scales_give_equal_room_to_equal_factors() {
        let scale = Scale::around([1.0, 100.0].into_iter(), true);
        let [a, b, c] = [1.0, 10.0, 100.0].map(|v| scale.map(&v, (0, 1000)));
        assert!((2 * b - a - c).abs() <= 1 && a < b);
    }

    #[test]
    fn a_single_value_or_none_still_makes_a_scale() {
        for values in [vec![], vec![0.0], vec![5.0], vec![-1e-30]] {
            let scale = Scale::around(values.into_iter(), false);
            assert!(scale.low() < scale.high());
            assert!(scale.key_points(BoldPoints(5)).len() < 20);
        }
    }
}
