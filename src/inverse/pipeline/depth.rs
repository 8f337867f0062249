//! Reports the path depth of the solve, and the light that a limited depth leaves out.

use crate::inverse::loss::LateLight;
use crate::inverse::pipeline::{MAX_DEPTH, Pipeline};

/// A common fixed depth, in bounces.
const COMMON_DEPTH: u32 = 10;

impl Pipeline<'_, '_> {
    /// Records the path depth, and the fraction of the photographed light beyond it, or beyond [`COMMON_DEPTH`] if it is unlimited.
    pub(super) fn tell_depth(&mut self) {
        let started = self.monitor.seconds();
        let limit = match self.monitor.settings.bounces {
            0 => None,
            _ => Some(self.max_bounces),
        };
        // Deeper paths than those of a limited solve measure what it leaves out.
        let deep = self.losses.deepened(MAX_DEPTH);
        let bounces = limit.unwrap_or(COMMON_DEPTH);
        let late = deep.beyond(self.problem, &self.estimate, bounces);
        if let Some(late) = &late {
            self.monitor.cast(late.cast);
        }
        self.record_unmeasured("depth", started, true, describe(limit, late.as_ref()));
    }
}

/// The outcome of the stage in one sentence.
fn describe(limit: Option<u32>, late: Option<&LateLight>) -> String {
    let fraction = late.map(|late| {
        format!(
            "{:.2} ± {:.2} % of the light in the photographs",
            late.fraction * 100.0,
            late.stderr * 100.0
        )
    });
    match (limit, fraction) {
        (None, Some(fraction)) => format!(
            "paths end by Russian roulette alone and leave nothing out; with the albedos found, {fraction} comes after {COMMON_DEPTH} bounces"
        ),
        (None, None) => "paths end by Russian roulette alone and leave nothing out".to_owned(),
        (Some(limit), Some(fraction)) => format!(
            "paths end after {limit} bounces, as set, and with the albedos found leave out {fraction}"
        ),
        (Some(limit), None) => format!("paths end after {limit} bounces, as set"),
    }
}
