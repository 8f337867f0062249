//! What lamps reflect of the room's light, behind their own: an unknown that is fitted to be left out again.
//!
//! Where a lamp is seen, its own light and what it reflects are one. Its unknowns are therefore taken to be all that
//! leaves it, as its pixels show it in the mean, and its albedo at that. What the albedo then changes is from where on
//! the lamp, and so to where in the room, how much light goes: a shade that is bright on its side towards a white
//! ceiling sends more there than its lower side tells. No photograph need determine it; the other unknowns, and their
//! standard errors, then hold what it may be.

use crate::inverse::fit::prior::Prior;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use glam::{DVec3, Vec3};

/// The same beliefs with nothing expected of the albedos of lamps.
pub fn beliefs(prior: &Prior, roles: &[Role]) -> Prior {
    let mut prior = prior.clone();
    lamps(roles).for_each(|k| prior.forget_albedo(k));
    prior
}

/// Turns the derivatives by a lamp's albedo from those at a fixed emission into those at a fixed mean of all that leaves
/// it where it is seen. `places` tells the row of each parameter.
pub fn hold_exitance(clusters: &mut [Linearised], roles: &[Role], places: &[usize]) {
    for lamp in lamps(roles) {
        let rows = [lamp, roles.len() + lamp].map(|parameter| places[parameter]);
        let reflected = reflected(clusters, lamp, rows);
        for cluster in &mut *clusters {
            shift(cluster, rows, reflected);
        }
    }
}

/// Sets the albedos of lamps to zero, so that their emission is all that leaves them.
pub fn leave_out(unknowns: &mut Unknowns, roles: &[Role]) {
    lamps(roles).for_each(|k| unknowns.albedo[k] = Vec3::ZERO);
}

fn lamps(roles: &[Role]) -> impl Iterator<Item = usize> + '_ {
    (0..roles.len()).filter(|&k| roles[k] == Role::Emitter)
}

/// Mean derivatives of a cluster by two parameters.
fn derivatives(cluster: &Linearised, rows: [usize; 2]) -> [DVec3; 2] {
    rows.map(|row| {
        let found = cluster.rows.iter().find(|r| r.0 == row);
        found.map_or(DVec3::ZERO, |&(_, a, b)| (a + b) * 0.5)
    })
}

/// Radiance that a lamp of albedo one would reflect where it is seen: the regression of what its clusters would reflect on
/// the fraction of the lamp in them.
fn reflected(clusters: &[Linearised], lamp: usize, rows: [usize; 2]) -> DVec3 {
    let own = clusters.iter().filter(|c| c.object as usize == lamp);
    let (top, bottom) = own.fold((DVec3::ZERO, DVec3::ZERO), |(top, bottom), cluster| {
        let [albedo, emission] = derivatives(cluster, rows);
        let weighted = cluster.weight * emission;
        (top + weighted * albedo, bottom + weighted * emission)
    });
    DVec3::select(bottom.cmpgt(DVec3::ZERO), top / bottom, DVec3::ZERO)
}

/// Takes from the derivative by a lamp's albedo what its emission gives way by.
fn shift(cluster: &mut Linearised, [albedo, emission]: [usize; 2], reflected: DVec3) {
    let Some(&(_, a, b)) = cluster.rows.iter().find(|r| r.0 == emission) else {
        return;
    };
    let (a, b) = (a * reflected, b * reflected);
    match cluster.rows.iter_mut().find(|r| r.0 == albedo) {
        Some(row) => {
            row.1 -= a;
            row.2 -= b;
        }
        None => cluster.rows.push((albedo, -a, -b)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::fit::linear::descend;
    use crate::inverse::roles;
    use glam::BVec3;

    /// A lamp (0) of emission 10 that reflects `albedo` of the light on it, 1 below and 3 above, seen from below; a floor (1)
    /// under it and a ceiling (2) over it, each photographed, with noise that cancels, and lit by its side of the lamp.
    fn room(albedo: f64, seen: bool) -> Vec<Linearised> {
        let below = 10.0 + albedo;
        let cluster = |object: u32, measured: f64, model: f64, rows: &[(usize, f64)]| Linearised {
            object,
            weight: DVec3::ONE,
            pixels: 1.0,
            residuals: [DVec3::splat(measured - model); 2],
            censored: BVec3::FALSE,
            own: DVec3::splat(rows[0].1),
            rows: (rows.iter())
                .map(|&(row, d)| (row, DVec3::splat(d), DVec3::splat(d)))
                .collect(),
        };
        // Rows: albedos of lamp, floor, ceiling, and the lamp's emission; about emission 10, albedos 0 and 0.5.
        let lamp = cluster(0, below, 10.0, &[(3, 1.0), (0, 1.0)]);
        let floor = cluster(1, 0.5 * below, 5.0, &[(1, 10.0), (3, 0.5), (0, 0.5)]);
        let above = 0.5 * (10.0 + 3.0 * albedo);
        let ceiling = cluster(2, above, 5.0, &[(2, 10.0), (3, 0.5), (0, 1.5)]);
        let mut all: Vec<Linearised> = std::iter::repeat_n([lamp, floor, ceiling], 40)
            .flatten()
            .collect();
        for (index, cluster) in all.iter_mut().enumerate() {
            let noise = [0.002, -0.002][index / 3 % 2];
            cluster.residuals = cluster.residuals.map(|r| r + noise);
        }
        if seen {
            // The upper side is seen too.
            all.push(cluster(0, 10.0 + 3.0 * albedo, 10.0, &[(3, 1.0), (0, 3.0)]));
        }
        all
    }

    fn solved(albedo: f64, seen: bool) -> (Unknowns, Unknowns) {
        let roles = [Role::Emitter, Role::Reflector, Role::Reflector];
        let mut about = Unknowns::new(3);
        about.albedo = [0.0, 0.5, 0.5].map(Vec3::splat).to_vec();
        about.emission[0] = Vec3::splat(10.0);
        let prior = Prior::new(3, 3, Vec3::ONE);
        let plain = {
            let clusters = room(albedo, seen).into_iter().map(|mut c| {
                c.rows.retain(|r| r.0 != 0);
                c.rows.iter_mut().for_each(|r| r.0 -= 1);
                c
            });
            descend(
                clusters.collect(),
                &about,
                &about,
                &roles::free(&roles, |k| roles[k] != Role::Emitter),
                &prior,
            )
            .unknowns
        };
        let free = roles::free(&roles, |_| true);
        let mut clusters = room(albedo, seen);
        hold_exitance(&mut clusters, &roles, &roles::places(&free, 3));
        let mut found = descend(clusters, &about, &about, &free, &beliefs(&prior, &roles)).unknowns;
        leave_out(&mut found, &roles);
        (plain, found)
    }

    /// The ceiling has more light than the lamp's lower side tells, by an albedo that no photograph shows: it is then taken
    /// for one half, which errs by less than none at all; what leaves the lamp is what is seen of it either way.
    #[test]
    fn a_lamp_that_reflects_is_no_brighter_and_lights_the_ceiling_more() {
        for albedo in [0.3, 0.7, 0.9] {
            let (plain, found) = solved(albedo, false);
            let exitance = (10.0 + albedo) as f32;
            assert!(
                (found.emission[0] - exitance).abs().max_element() < 0.02,
                "{found:?}"
            );
            assert_eq!(found.albedo[0], Vec3::ZERO);
            assert!(
                (found.albedo[1] - 0.5).abs().max_element() < 1e-3,
                "{found:?}"
            );
            let errors = [&plain, &found].map(|u| (u.albedo[2].x - 0.5).abs());
            assert!(errors[1] < 0.75 * errors[0], "{albedo}: {errors:?}");
        }
    }

    #[test]
    fn where_more_of_a_lamp_is_seen_its_albedo_is_known() {
        for albedo in [0.0, 0.8] {
            let (_, found) = solved(albedo, true);
            assert!(
                (found.albedo[2] - 0.5).abs().max_element() < 2e-3,
                "{albedo}: {found:?}"
            );
        }
    }
}
