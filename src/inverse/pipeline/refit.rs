//! After textures were found: all colours and lamps once more, in the light as the textures send it on.

use crate::inverse::fit::path_noise::distribute_paths;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::pipeline::textures::Detail;
use crate::inverse::solver::Termination;
use crate::math::stats::Moments;

/// Held-out loss may rise by so many standard errors of the rise before what was found is taken back.
const SIGNIFICANT: f64 = 2.0;

impl Pipeline<'_, '_> {
    /// Fits all rounds again to the photographs less what the textures change in them, which one set of paths tells; the
    /// textures are shown scaled with their objects.
    ///
    /// The light that a printed poster sends to a wall, and what its border adds to the pixels of its frame, are otherwise
    /// those of one mean colour.
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
        distribute_paths(
            &mut self.clusters,
            self.roles.len(),
            self.budget.round_paths,
        );
        // What textures change is told against the single colours that they were found with.
        let mut flat = self.unknowns.clone();
        for (k, albedo) in detail.albedo.iter().enumerate() {
            if texels.textured.get(k) == Some(&true) {
                flat.albedo[k] = *albedo;
            }
        }
        let offsets = self.texture_offsets(&lights, 4, &texels, &flat)?;
        self.detail = Some(Detail {
            offsets,
            ..detail.clone()
        });
        let mut clusters = summed.clusters;
        self.leave_textures_out(&mut clusters);
        self.descend(clusters, &summed.about);
        self.describe();

        let after = self.held_out_each();
        let mut rise = Moments::default();
        for (before, after) in before.2.iter().zip(&after) {
            rise.push(after - before);
        }
        let kept = after.is_empty() || rise.mean <= SIGNIFICANT * rise.standard_error();
        if !kept {
            (self.unknowns, self.errors, self.detail) = (before.0.clone(), before.1, Some(detail));
            self.describe();
        }
        let moved = (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k].reflects())
            .map(|k| {
                (self.unknowns.albedo[k] - before.0.albedo[k])
                    .abs()
                    .max_element()
            })
            .fold(0.0, f32::max);
        let why = match kept {
            true => {
                format!("with the light that textures send on, albedos move by {moved:.3} at most")
            }
            false => format!(
                "held-out pixels get worse by {:.1} standard errors, so what was found before stays",
                rise.mean / rise.standard_error()
            ),
        };
        self.record("refit", started, kept, why)?;
        Ok(())
    }

    /// The loss of each held-out pixel.
    fn held_out_each(&mut self) -> Vec<f64> {
        let (each, cast) = self.losses.held_out_each(self.problem, &self.estimate);
        self.monitor.cast(cast);
        each
    }
}
