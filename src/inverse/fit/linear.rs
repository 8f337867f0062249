//! The fit to clusters that are linearised once, as sums over rounds of paths are.

use crate::inverse::fit::equations::NormalEquations;
use crate::inverse::fit::gauss_newton::{
    MIN_DAMPING, STEP_TOLERANCE, is_stalled, propose, relative_gradient,
};
use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::prior_terms::PriorTerms;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::unknowns::Unknowns;
use glam::DVec3;
use rayon::prelude::*;

const MAX_STEPS: u32 = 12;

/// The solution of a linearised fit.
#[derive(Debug)]
pub struct Descended {
    /// The unknowns.
    pub unknowns: Unknowns,
    /// The robust weights at the solution.
    pub robust: RobustWeights,
    /// The normal equations at the solution.
    pub equations: NormalEquations,
    /// The prior's terms in these.
    pub terms: PriorTerms,
    /// The clusters with their residuals at the solution.
    pub clusters: Vec<Linearised>,
}

/// Fits the parameters in `free` (indices into albedos, then emissions) to clusters linearised about `about`, starting at `start`.
///
/// One step does not suffice: the Hessian is kept semidefinite and so contains the squared noise of the derivatives, which
/// shortens the steps of parameters that few paths meet. Robust weights are updated at each step.
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
        let terms = PriorTerms::new(&equations, free, &unknowns);
        let (next, length) = propose(&equations, &terms, free, &unknowns, MIN_DAMPING);
        let gradient = relative_gradient(&equations, &terms, free, &unknowns);
        if length.remaining < STEP_TOLERANCE || is_stalled(before, gradient) || steps == MAX_STEPS {
            return Descended {
                unknowns,
                robust,
                equations,
                terms,
                clusters,
            };
        }
        let step: Vec<DVec3> = (free.iter())
            .map(|&i| (next.value(i) - unknowns.value(i)).as_dvec3())
            .collect();
        clusters.par_iter_mut().for_each(|c| c.step(&step));
        (unknowns, before) = (next, gradient);
        steps += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use glam::Vec3;

    /// 1000 clusters depend on one albedo through derivatives with a relative noise of one. One step goes half the way; the fit
    /// finds the albedo. The tolerance is four of its standard errors.
    #[test]
    fn noise_of_derivatives_does_not_keep_an_albedo_where_it_began() {
        let (begun, truth) = (0.2, 0.6);
        let mut stream = Stream::new(77, 0, 0, 0);
        let mut noise = move || DVec3::splat(f64::from(stream.uniform() - 0.5) * 12f64.sqrt());
        let clusters: Vec<Linearised> = (0..1000)
            .map(|_| {
                let [a, b] = [(); 2].map(|()| DVec3::ONE + noise());
                Linearised {
                    residuals: [a, b].map(|j| DVec3::splat(truth) - j * begun),
                    own: (a + b) * 0.5,
                    rows: vec![(0, a, b)],
                    ..Linearised::unit(0, DVec3::ZERO)
                }
            })
            .collect();
        let about = Unknowns::grey([begun as f32], [0.0]);
        let prior = Prior::new(1, 1, Vec3::ONE);
        let (one, _) = {
            let robust = RobustWeights::even(1);
            let equations = NormalEquations::new(&clusters, 1, &robust, &prior);
            let terms = PriorTerms::new(&equations, &[0], &about);
            propose(&equations, &terms, &[0], &about, MIN_DAMPING)
        };
        assert!(one.albedo[0].x < 0.5, "{}", one.albedo[0]);
        let found = descend(clusters, &about, &about, &[0], &prior);
        let albedo = f64::from(found.unknowns.albedo[0].x);
        assert!((albedo - truth).abs() < 0.08, "{albedo}");
    }
}
