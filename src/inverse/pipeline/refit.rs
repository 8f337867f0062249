//! Refits all albedos and lamps with the effect of the textures.

use crate::inverse::pipeline::Pipeline;
use crate::inverse::pipeline::textures::Detail;
use crate::inverse::solver::Termination;
use crate::math::stats::Moments;

/// Increase of the held-out loss, in standard errors, above which the refit is undone.
const SIGNIFICANT: f64 = 2.0;

/// Mean increase of the loss of held-out pixels, in standard errors; zero if there are none.
pub(super) fn increase(before: &[f64], after: &[f64]) -> f64 {
    let mut increase = Moments::default();
    for (before, after) in before.iter().zip(after) {
        increase.push(after - before);
    }
    let errors = increase.mean / increase.standard_error();
    if errors.is_nan() { 0.0 } else { errors }
}

impl Pipeline<'_, '_> {
    /// Fits the sum of all rounds again to the photographs minus the change by the textures, which is traced once. Textures are
    /// scaled with the mean albedo of their objects.
    ///
    /// Without this, the light from a textured object, and mixed pixels at its edges, would be those of its mean colour.
    pub(super) fn refit(&mut self) -> Result<(), Termination> {
        let detail = self.detail.clone();
        let texels = detail.as_ref().and_then(|d| d.refined.texels.clone());
        let (Some(detail), Some(texels), Some(summed)) = (detail, texels, self.summed.take())
        else {
            return Ok(());
        };
        let started = self.monitor.seconds();
        self.monitor.phase("fitting again with textures");
        let before = (
            self.unknowns.clone(),
            self.errors.clone(),
            self.held_out_each(),
        );
        let lights = self.lights();
        self.distribute(self.budget.round_paths);
        // The change by textures is relative to the mean albedos that they were fitted with.
        let mut flat = self.unknowns.clone();
        for (k, albedo) in detail.albedo.iter().enumerate() {
            if texels.textured.get(k) == Some(&true) {
                flat.albedo[k] = *albedo;
            }
        }
        let colors = &texels.colors.colors;
        let offsets = self.traced(&lights, None, 4, 0, |slice| {
            slice.texture_offsets(&flat, colors)
        })?;
        self.detail = Some(Detail {
            offsets,
            ..detail.clone()
        });
        let mut clusters = summed.clusters;
        self.leave_textures_out(&mut clusters);
        self.descend(clusters, &summed.about);
        self.describe();

        let after = self.held_out_each();
        let increase = increase(&before.2, &after);
        let kept = increase <= SIGNIFICANT;
        if !kept {
            (self.unknowns, self.errors, self.detail) = (before.0.clone(), before.1, Some(detail));
            self.describe();
        }
        let change = (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k].reflects())
            .map(|k| {
                (self.unknowns.albedo[k] - before.0.albedo[k])
                    .abs()
                    .max_element()
            })
            .fold(0.0, f32::max);
        let why = match kept {
            true => {
                format!(
                    "with the light that textures reflect, albedos change by {change:.3} at most"
                )
            }
            false => format!(
                "held-out pixels get worse by {increase:.1} standard errors, so the refit is undone"
            ),
        };
        self.record("refit", started, kept, why)
    }

    pub(super) fn held_out_each(&mut self) -> Vec<f64> {
        let (each, cast) = self.losses.held_out_each(self.problem, &self.estimate);
        self.monitor.cast(cast);
        each
    }
}
