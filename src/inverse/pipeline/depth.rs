//! How many bounces of light the photographs hold, by what was found.

use crate::inverse::loss::Rest;
use crate::inverse::pipeline::{MAX_DEPTH, Pipeline};
use crate::inverse::solver::Stage;

/// Bounces that a fixed depth is commonly set to.
const COMMON_DEPTH: u32 = 10;

impl Pipeline<'_, '_> {
    /// Says how deep paths go, now that albedos are known, and what would be missing, or is, after fewer bounces.
    pub(super) fn tell_depth(&mut self) {
        let started = self.monitor.seconds();
        let limit = match self.monitor.settings.bounces {
            0 => None,
            _ => Some(self.max_bounces),
        };
        // Where the solve itself is limited, what it leaves out is told by deeper paths.
        let deep = self.losses.deepened(MAX_DEPTH);
        let bounces = limit.unwrap_or(COMMON_DEPTH);
        let rest = deep.beyond(self.problem, &self.estimate, bounces);
        if let Some(rest) = &rest {
            self.monitor.cast(rest.cast);
        }
        let stage = Stage {
            name: "depth".to_owned(),
            seconds: self.monitor.seconds() - started,
            iterations: self.monitor.progress.iterations,
            train_loss: None,
            held_out_loss: None,
            kept: true,
            why: words(limit, rest.as_ref()),
        };
        self.monitor.stage(stage);
    }
}

fn words(limit: Option<u32>, rest: Option<&Rest>) -> String {
    let fraction = rest.map(|rest| {
        format!(
            "{:.2} ± {:.2} % of the light in the photographs",
            rest.fraction * 100.0,
            rest.stderr * 100.0
        )
    });
    match (limit, fraction) {
        (None, Some(fraction)) => format!(
            "paths end by chance alone and leave nothing out; {fraction} comes after {COMMON_DEPTH} bounces, by the albedos found"
        ),
        (None, None) => "paths end by chance alone and leave nothing out".to_owned(),
        (Some(limit), Some(fraction)) => format!(
            "paths end after {limit} bounces, as asked for, and leave out {fraction}, by the albedos found"
        ),
        (Some(limit), None) => format!("paths end after {limit} bounces, as asked for"),
    }
}
