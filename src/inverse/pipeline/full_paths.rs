//! The second stage: full paths to the lamps found, with all roles settled on them.

use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::solver::Termination;

/// Searches for lamps out of sight at most.
const MAX_SEARCHES: usize = 3;

impl Pipeline<'_, '_> {
    /// Second stage: full paths to the lamps found. Lights that the first stage missed or imagined are tested here,
    /// where nothing but the model enters.
    pub(super) fn full_paths(&mut self) -> Result<(), Termination> {
        let started = self.monitor.seconds();
        self.search_anew()?;
        let (mut cache, mut limit) = self.fit_full_paths()?;
        for _ in 1..MAX_SEARCHES {
            // Albedos that a lamp put right may show another.
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
        self.record("objects", started, true, why + &limit)?;
        Ok(())
    }

    /// Paths to the lamps as they are known, stored, with all roles settled on them; and what is to be said of their number.
    pub(super) fn fit_full_paths(&mut self) -> Result<(PathCache, String), Termination> {
        self.monitor.phase("tracing paths to the lamps");
        let lights = self.lights();
        let (cache, limit) = self.stored(&lights, None, 1, self.budget.round_paths)?;
        self.monitor.phase("fitting albedo and emission");
        // Tests of roles weigh all alike: whatever the residuals of a wrong role say is no measure of trust.
        self.robust = RobustWeights::even(self.roles.len());
        let fitted = self.fit(&cache)?;
        self.settle_roles(&cache, fitted)?;
        Ok((cache, limit))
    }
}
