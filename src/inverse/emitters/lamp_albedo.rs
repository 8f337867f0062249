//! Albedos of lamps, as nuisance parameters: they are fitted together with the other unknowns and then set to zero.
//!
//! In pixels of a lamp, emitted and reflected light cannot be separated. The unknowns are therefore the lamp's mean exitant
//! radiance, as its pixels show it, and its albedo at fixed exitance. The albedo then only changes how the exitance is
//! distributed over the lamp, and so over the room: a shade below a white ceiling is brighter on its upper side than its lower
//! side shows. The photographs need not determine the albedo; its uncertainty enters the other unknowns' standard errors.

use crate::inverse::fit::prior::Prior;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use glam::{DVec3, Vec3};

/// The prior without terms for the albedos of lamps.
pub fn without_lamps(prior: &Prior, roles: &[Role]) -> Prior {
    let mut prior = prior.clone();
    lamps(roles).for_each(|k| prior.forget_albedo(k));
    prior
}

/// Changes the derivatives with respect to lamps' albedos from fixed emission to fixed mean exitant radiance in their pixels.
/// `places` maps parameters to rows.
pub fn hold_exitance(clusters: &mut [Linearised], roles: &[Role], places: &[usize]) {
    for lamp in lamps(roles) {
        let rows = [lamp, roles.len() + lamp].map(|parameter| places[parameter]);
        let reflected = reflected(clusters, lamp, rows);
        for cluster in &mut *clusters {
            shift(cluster, rows, reflected);
        }
    }
}

/// Sets the albedos of lamps to zero, so that their emission is their whole exitant radiance.
pub fn leave_out(unknowns: &mut Unknowns, roles: &[Role]) {
    lamps(roles).for_each(|k| unknowns.albedo[k] = Vec3::ZERO);
}

fn lamps(roles: &[Role]) -> impl Iterator<Item = usize> + '_ {
    (0..roles.len()).filter(|&k| roles[k] == Role::Emitter)
}

/// A cluster's derivatives with respect to two parameters, mean of both sets.
fn derivatives(cluster: &Linearised, rows: [usize; 2]) -> [DVec3; 2] {
    rows.map(|row| {
        let derivative = cluster.rows.iter().find(|r| r.0 == row);
        derivative.map_or(DVec3::ZERO, |&(_, a, b)| (a + b) * 0.5)
    })
}

/// Mean radiance that a lamp would reflect in its pixels with an albedo of one: the regression of its clusters' derivatives with
/// respect to albedo on those with respect to emission.
fn reflected(clusters: &[Linearised], lamp: usize, rows: [usize; 2]) -> DVec3 {
    let own = clusters.iter().filter(|c| c.object as usize == lamp);
    let (numerator, denominator) = own.fold((DVec3::ZERO, DVec3::ZERO), |(n, d), cluster| {
        let [albedo, emission] = derivatives(cluster, rows);
        let weighted = cluster.weight * emission;
        (n + weighted * albedo, d + weighted * emission)
    });
    let is_determined = denominator.cmpgt(DVec3::ZERO);
    DVec3::select(is_determined, numerator / denominator, DVec3::ZERO)
}

/// Subtracts `reflected` times the derivative with respect to emission from the derivative with respect to albedo.
fn shift(cluster: &mut Linearised, [albedo, emission]: [usize; 2], reflected: DVec3) {
    let Some(&(_, a, b)) = cluster.rows.iter().find(|r| r.0 == emission) else {
        return;
    };
    let (a, b) = (a * reflected, b * reflected);
    match cluster.rows.binary_search_by_key(&albedo, |r| r.0) {
        Ok(at) => {
            cluster.rows[at].1 -= a;
            cluster.rows[at].2 -= b;
        }
        Err(at) => cluster.rows.insert(at, (albedo, -a, -b)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::fit::linear::descend;
    use crate::inverse::roles;

    /// A lamp (0) of emission 10 that reflects `albedo` × 1 below and `albedo` × 3 above, seen from below. A floor (1) is lit by
    /// its lower side and a ceiling (2) by its upper side; both are photographed, with noise that cancels.
    fn room(albedo: f64, seen: bool) -> Vec<Linearised> {
        // The emission of the lamp, the albedos of floor and ceiling.
        let own = |object: u32, rows: &[(usize, f64)]| {
            let row = if object == 0 { 3 } else { object as usize };
            rows.iter().find(|r| r.0 == row).map_or(0.0, |r| r.1)
        };
        let below = 10.0 + albedo;
        let cluster = |object: u32, measured: f64, model: f64, rows: &[(usize, f64)]| Linearised {
            own: DVec3::splat(own(object, rows)),
            rows: (rows.iter())
                .map(|&(row, d)| (row, DVec3::splat(d), DVec3::splat(d)))
                .collect(),
            ..Linearised::unit(object, DVec3::splat(measured - model))
        };
        // Rows: albedos of lamp, floor, ceiling, and the lamp's emission; about emission 10, albedos 0 and 0.5.
        let lamp = cluster(0, below, 10.0, &[(0, 1.0), (3, 1.0)]);
        let floor = cluster(1, 0.5 * below, 5.0, &[(0, 0.5), (1, 10.0), (3, 0.5)]);
        let above = 0.5 * (10.0 + 3.0 * albedo);
        let ceiling = cluster(2, above, 5.0, &[(0, 1.5), (2, 10.0), (3, 0.5)]);
        let mut all: Vec<Linearised> = std::iter::repeat_n([lamp, floor, ceiling], 40)
            .flatten()
            .collect();
        for (index, cluster) in all.iter_mut().enumerate() {
            let noise = [0.002, -0.002][index / 3 % 2];
            cluster.residuals = cluster.residuals.map(|r| r + noise);
        }
        if seen {
            // A pixel of the upper side.
            all.push(cluster(0, 10.0 + 3.0 * albedo, 10.0, &[(0, 3.0), (3, 1.0)]));
        }
        all
    }

    fn solved(albedo: f64, seen: bool) -> (Unknowns, Unknowns) {
        let roles = [Role::Emitter, Role::Reflector, Role::Reflector];
        let about = Unknowns::grey([0.0, 0.5, 0.5], [10.0, 0.0, 0.0]);
        let prior = Prior::new(3, 3, Vec3::ONE);
        let mut clusters = room(albedo, seen);
        for cluster in &mut clusters {
            cluster.rows.retain(|r| r.0 != 0);
            cluster.rows.iter_mut().for_each(|r| r.0 -= 1);
        }
        let free = roles::free(&roles, |k| roles[k] != Role::Emitter);
        let plain = descend(clusters, &about, &about, &free, &prior).unknowns;
        let free = roles::free(&roles, |_| true);
        let mut clusters = room(albedo, seen);
        hold_exitance(&mut clusters, &roles, &roles::places(&free, 3));
        let prior = without_lamps(&prior, &roles);
        let mut found = descend(clusters, &about, &about, &free, &prior).unknowns;
        leave_out(&mut found, &roles);
        (plain, found)
    }

    /// The ceiling receives more light than the lamp's lower side shows, by an albedo that no photograph determines. A marginal
    /// albedo of one half errs by less than zero. The exitance is that of the lamp's pixels either way.
    #[test]
    fn a_lamp_that_reflects_is_no_brighter_and_lights_the_ceiling_more() {
        for albedo in [0.3, 0.7, 0.9] {
            let (plain, found) = solved(albedo, false);
            let exitance = Vec3::splat((10.0 + albedo) as f32);
            assert!(found.emission[0].abs_diff_eq(exitance, 0.02), "{found:?}");
            assert_eq!(found.albedo[0], Vec3::ZERO);
            let half = Vec3::splat(0.5);
            assert!(found.albedo[1].abs_diff_eq(half, 1e-3), "{found:?}");
            let errors = [&plain, &found].map(|u| (u.albedo[2].x - 0.5).abs());
            assert!(errors[1] < 0.75 * errors[0], "{albedo}: {errors:?}");
        }
    }

    #[test]
    fn where_more_of_a_lamp_is_seen_its_albedo_is_known() {
        for albedo in [0.0, 0.8] {
            let (_, found) = solved(albedo, true);
            let close = found.albedo[2].abs_diff_eq(Vec3::splat(0.5), 2e-3);
            assert!(close, "{albedo}: {found:?}");
        }
    }
}
