//! The second stage: full paths to the lamps, and roles settled on them.

use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::{Pipeline, Result};

const MAX_SEARCHES: usize = 3;

impl Pipeline<'_, '_> {
    /// Second stage: full paths to the lamps. Lamps that the light field missed or imagined are found here, since full paths
    /// depend on the model alone.
    pub(super) fn full_paths(&mut self) -> Result {
        let started = self.monitor.seconds();
        self.search_anew()?;
        let (mut cache, mut limit) = self.fit_full_paths()?;
        for _ in 1..MAX_SEARCHES {
            // With albedos corrected by a new lamp, another one may become significant.
            if !self.search_unseen(false)? {
                break;
            }
            (cache, limit) = self.fit_full_paths()?;
        }
        let added = self.test_glow(&cache)?;
        self.weigh(&cache)?;
        let why = match added.as_slice() {
            [] => "one albedo or one emission an object; no further light is called for".to_owned(),
            names => format!(
                "light added to {} where the photographs called for it",
                names.join(", ")
            ),
        };
        self.record("objects", started, true, why + &limit)
    }

    /// Stores full paths to the present lamps, fits all that is free to them, and settles the roles. Also returns the remark of
    /// [`Self::stored`] on their number.
    fn fit_full_paths(&mut self) -> Result<(PathCache, String)> {
        self.monitor.phase("tracing paths to the lamps");
        let lights = self.lights();
        let (cache, limit) = self.stored(&lights, None, 1, self.budget.round_paths)?;
        self.monitor.phase("fitting albedo and emission");
        // Roles are tested with even weights, since residuals under a wrong role are no measure of noise.
        self.robust = RobustWeights::even(self.roles.len());
        self.free_saturated();
        let fitted = self.fit(&cache)?;
        self.settle_roles(&cache, fitted)?;
        self.hold_saturated(&cache)?;
        Ok((cache, limit))
    }
}
