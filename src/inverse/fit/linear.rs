//! The fit to clusters that were linearised once: what a sum over rounds of paths is fitted by.

use crate::inverse::fit::equations::NormalEquations;
use crate::inverse::fit::gauss_newton::{MIN_DAMPING, STEP_TOLERANCE, is_stalled, propose, pull};
use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::unknowns::Unknowns;
use glam::DVec3;
use rayon::prelude::*;

/// Steps at most.
const MAX_STEPS: u32 = 12;

/// Where the direction of descent vanishes.
#[derive(Debug)]
pub struct Descended {
    /// The unknowns.
    pub unknowns: Unknowns,
    /// The weights there.
    pub robust: RobustWeights,
    /// The normal equations there.
    pub equations: NormalEquations,
    /// The clusters, their residuals those that are left.
    pub clusters: Vec<Linearised>,
}

/// Fits the parameters in `free` (indices into albedos, then emissions) to clusters that were linearised about `about`, beginning
/// at `start`.
///
/// One step would not do: the Hessian, which must not be indefinite, holds the square of the derivatives' noise besides
/// their product across sets, so that what few paths meet would stay near where it began. Weights are found anew at each.
pub fn descend(
    mut clusters: Vec<Linearised>,
    about: &Unknowns,
    start: &Unknowns,
    free: &[usize],
    prior: &Prior,
) -> Descended {
    let from_about: Vec<DVec3> = (free.iter())
        .map(|&i| (start.value(i) - about.value(i)).as_dvec3())
        .collect();
    clusters.par_iter_mut().for_each(|c| c.step(&from_about));
    let mut unknowns = start.clone();
    let mut steps = 0;
    let mut before = f64::INFINITY;
    loop {
        let robust = RobustWeights::from_residuals(&clusters, about.surfaces());
        let equations = NormalEquations::new(&clusters, free.len(), &robust, prior);
        let (next, length) = propose(&equations, free, &unknowns, MIN_DAMPING);
        let pull = pull(&equations, free, &unknowns);
        if length.left < STEP_TOLERANCE || is_stalled(before, pull) || steps == MAX_STEPS {
            return Descended {
                unknowns,
                robust,
                equations,
                clusters,
            };
        }
        let moved: Vec<DVec3> = (free.iter())
            .map(|&i| (next.value(i) - unknowns.value(i)).as_dvec3())
            .collect();
        clusters.par_iter_mut().for_each(|c| c.step(&moved));
        (unknowns, before) = (next, pull);
        steps += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use glam::{BVec3, Vec3};

    /// A thousand clusters that know one albedo through derivatives whose noise is as large as they are: it is found, where
    /// one step would go half the way. The tolerance is four standard errors of its own.
    #[test]
    fn noise_of_derivatives_does_not_keep_an_albedo_where_it_began() {
        let (begun, truth) = (0.2, 0.6);
        let mut stream = Stream::new(77, 0, 0, 0);
        let mut noise = move || DVec3::splat(f64::from(stream.uniform() - 0.5) * 12f64.sqrt());
        let clusters: Vec<Linearised> = (0..1000)
            .map(|_| {
                let [a, b] = [(); 2].map(|()| DVec3::ONE + noise());
                Linearised {
                    object: 0,
                    weight: DVec3::ONE,
                    pixels: 1.0,
                    residuals: [a, b].map(|j| DVec3::splat(truth) - j * begun),
                    censored: BVec3::FALSE,
                    own: (a + b) * 0.5,
                    rows: vec![(0, a, b)],
                }
            })
            .collect();
        let mut about = Unknowns::new(1);
        about.albedo[0] = Vec3::splat(begun as f32);
        let prior = Prior::new(1, 1, Vec3::ONE);
        let (one, _) = {
            let robust = RobustWeights::even(1);
            let equations = NormalEquations::new(&clusters, 1, &robust, &prior);
            propose(&equations, &[0], &about, MIN_DAMPING)
        };
        assert!(one.albedo[0].x < 0.5, "{}", one.albedo[0]);
        let found = descend(clusters, &about, &about, &[0], &prior);
        let albedo = f64::from(found.unknowns.albedo[0].x);
        assert!((albedo - truth).abs() < 0.08, "{albedo}");
    }
}
