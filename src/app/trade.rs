//! The trade of speed for exactness of the open capture, read from its results or measured here, and where on it to stop.

use crate::app::task::Task;
use crate::inverse::settings::{PARAMETERS, Settings};
use crate::session::snapshot::OpenCapture;
use crate::study::trade::{Curve, Point, Trade};
use egui::Pos2;
use std::path::Path;
use std::sync::Arc;

/// What is plotted over seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Vertical {
    /// The relative error that estimates claim of themselves; the paper's descent claims none.
    Claimed,
    /// The error as it was measured.
    Measured,
}

/// How the pane is shown.
#[derive(Debug)]
pub struct TradeView {
    /// What is plotted over seconds.
    pub vertical: Vertical,
    /// Seconds that a measurement may take.
    pub limit: f64,
    /// Where the points were drawn last: place on the screen, curve and point.
    pub places: Vec<(Pos2, usize, usize)>,
}

/// A measurement, which shows all curves so far.
pub type Measuring = Task<Arc<Trade>, ()>;

/// The trade of the open capture, as far as it is measured.
#[derive(Default)]
pub struct Measured {
    /// The curves of the open capture, as far as they are known.
    pub trade: Option<Arc<Trade>>,
    /// Whether the curves were measured here and are in no file yet.
    pub unsaved: bool,
    /// What is being measured, and the measurement under way.
    pub measuring: Option<(Arc<OpenCapture>, Measuring)>,
}

impl Default for TradeView {
    fn default() -> Self {
        Self {
            vertical: Vertical::Claimed,
            limit: 120.0,
            places: Vec::new(),
        }
    }
}

impl Measured {
    /// Reads the trade in a folder, if there is one and it is this capture's.
    ///
    /// # Errors
    /// The file is broken, or belongs to another capture.
    pub fn load(&mut self, folder: &Path, capture: &OpenCapture) -> Result<(), String> {
        let Some(trade) = Trade::read(folder).map_err(|error| error.to_string())? else {
            return Ok(());
        };
        if trade.hash.as_deref() != Some(capture.hash.as_str()) {
            return Err(format!(
                "{}: trade.json belongs to another capture; measure again",
                folder.display()
            ));
        }
        self.trade = Some(Arc::new(trade));
        self.unsaved = false;
        Ok(())
    }

    /// What is being measured now, in words.
    pub fn doing(&self) -> Option<String> {
        self.measuring.as_ref().map(|(_, task)| task.doing())
    }
}

/// Claimed errors in percent that are offered.
const ERRORS: [f64; 7] = [10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1];
/// Seconds that are offered.
const SECONDS: [f64; 8] = [1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0];

/// When a solve is to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// At a relative error in percent that the estimate claims of itself.
    Error(f64),
    /// After some seconds.
    Seconds(f64),
}

impl Stop {
    /// "Stop at 1 %" or "Stop at 10 s".
    pub fn words(self) -> String {
        match self {
            Self::Error(percent) => format!("Stop at {percent} %"),
            Self::Seconds(seconds) => format!("Stop at {seconds} s"),
        }
    }
}

/// Round errors, each with the preset that reaches it first, and round seconds, each with the most exact preset by then.
///
/// Each is a stop, the index of the curve whose parameters to take, and what to expect in words.
pub fn offers(trade: &Trade) -> Vec<(Stop, usize, String)> {
    let ends = trade.curves.iter().filter_map(|curve| curve.points.last());
    let last = ends.map(|point| point.seconds).fold(0.0, f64::max);
    let seconds = SECONDS.into_iter().filter(|&seconds| seconds <= last);
    let stops = ERRORS.map(Stop::Error).into_iter();
    let stops = stops.chain(seconds.map(Stop::Seconds));
    stops.filter_map(|stop| offer(trade, stop)).collect()
}

/// The preset that is best at a stop.
fn offer(trade: &Trade, stop: Stop) -> Option<(Stop, usize, String)> {
    // Seconds until a curve claims the error, or its error by then.
    let value = |curve: &Curve| match stop {
        Stop::Error(percent) => {
            let claims = |point: &&Point| point.reported.is_some_and(|e| e * 100.0 <= percent);
            curve.points.iter().find(claims).map(|point| point.seconds)
        }
        Stop::Seconds(seconds) => {
            let before = curve.points.iter().rev().find(|p| p.seconds <= seconds);
            before.map(|point| point.error)
        }
    };
    let presets = trade.curves.iter().enumerate().filter(|(_, c)| c.is_preset);
    let values = presets.filter_map(|(i, curve)| Some((i, value(curve)?)));
    let (curve, best) = values.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let name = &trade.curves[curve].name;
    let expected = match stop {
        Stop::Error(_) => format!("{name}: after {best:.1} s"),
        Stop::Seconds(_) => format!("{name}: {} {best:.4}", trade.measure.label()),
    };
    Some((stop, curve, expected))
}

/// The stop at a point of a curve, rounded up to two digits so that a solve reaches it.
pub fn stop_at(point: &Point, vertical: Vertical) -> Option<Stop> {
    match vertical {
        Vertical::Claimed => point.reported.map(|e| Stop::Error(round_up(e * 100.0))),
        Vertical::Measured => Some(Stop::Seconds(round_up(point.seconds))),
    }
}

/// The next number of two digits that is no smaller; zero stays.
fn round_up(value: f64) -> f64 {
    if value.is_nan() || value <= 0.0 {
        return 0.0;
    }
    let decimals = 1 - value.log10().floor() as i32;
    let unit = 10f64.powi(decimals.abs());
    // Products such as 0.7 · 10 are a hair above the whole number that they stand for.
    match decimals >= 0 {
        true => (value * unit - 1e-9).ceil() / unit,
        false => (value / unit - 1e-9).ceil() * unit,
    }
}

/// `settings` with the preset of `other` and every parameter in which it differs from the defaults; the seed stays.
pub fn taken_over(settings: &Settings, other: &Settings) -> Settings {
    let defaults = Settings::default();
    let mut taken = Settings {
        preset: other.preset,
        ..settings.clone()
    };
    for parameter in PARAMETERS.iter().filter(|p| p.name != "seed") {
        let value = parameter.get(other);
        if value != parameter.get(&defaults) {
            // A value that was read from settings is allowed in settings.
            let set = parameter.set(&mut taken, &value);
            debug_assert_eq!(set, Ok(()));
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_are_rounded_up_to_two_digits() {
        for (value, expected) in [
            (0.7, 0.7),
            (0.701, 0.71),
            (1.0, 1.0),
            (1.23, 1.3),
            (14.2, 15.0),
            (9.96, 10.0),
            (123.0, 130.0),
            (0.0123, 0.013),
            (0.0, 0.0),
            (f64::NAN, 0.0),
        ] {
            assert!((round_up(value) - expected).abs() < 1e-9, "{value}");
        }
    }

    #[test]
    fn a_curves_own_parameters_are_taken_over_and_the_persons_others_stay() {
        let own = Settings {
            seed: 5,
            held_out: 0.2,
            bounces: 3,
            ..Settings::default()
        };
        let curve = Settings {
            seed: 9,
            bounces: 8,
            preset: crate::inverse::settings::Preset::Preview,
            ..Settings::default()
        };
        let expected = Settings {
            preset: curve.preset,
            bounces: 8,
            ..own.clone()
        };
        assert_eq!(taken_over(&own, &curve), expected);
    }
}
