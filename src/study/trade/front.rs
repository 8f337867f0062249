//! The Pareto front: points that no other point beats in both seconds and error.

use crate::study::trade::curve::{Curve, Point};

/// Marks the points of all curves that no other point dominates: none is as early and as accurate, and better in one of the two. Of
/// equal points only the first is marked.
pub fn mark(curves: &mut [Curve]) {
    let points = curves.iter_mut().flat_map(|curve| &mut curve.points);
    let mut points: Vec<&mut Point> = points.collect();
    // The sort is stable: equal points stay in order.
    points.sort_by(|p, q| {
        let earlier = p.seconds.total_cmp(&q.seconds);
        earlier.then(p.error.total_cmp(&q.error))
    });
    let mut best = f64::INFINITY;
    for point in points {
        point.pareto = point.error < best;
        if point.pareto {
            best = point.error;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::settings::Preset;
    use crate::math::rng::Stream;

    #[test]
    fn a_point_is_on_the_front_exactly_if_no_other_beats_it() {
        let mut stream = Stream::new(1, 0, 0, 0);
        for count in 0..60 {
            // Few distinct values, so that many are equal.
            let points: Vec<[f64; 2]> = (0..count)
                .map(|_| [0, 1].map(|_| stream.below(9) as f64))
                .collect();
            let mut curves = [Curve::through(Preset::Balanced, &points)];
            mark(&mut curves);
            for (i, p) in points.iter().enumerate() {
                let beaten = points.iter().enumerate().any(|(j, q)| {
                    let as_good = q[0] <= p[0] && q[1] <= p[1];
                    as_good && (q != p || j < i)
                });
                assert_eq!(curves[0].points[i].pareto, !beaten, "{i} of {points:?}");
            }
        }
    }
}
