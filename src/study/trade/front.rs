//! The Pareto front: points that no other point beats in both seconds and error.

use crate::study::trade::curve::Curve;

/// Marks the (seconds, error) points that no other point dominates: none is as early and as accurate, and better in
/// one of the two. Of equal points only the first is marked.
pub fn front(points: &[[f64; 2]]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        let [p, q] = [points[a], points[b]];
        p[0].total_cmp(&q[0])
            .then(p[1].total_cmp(&q[1]))
            .then(a.cmp(&b))
    });
    let mut on_front = vec![false; points.len()];
    let mut best = f64::INFINITY;
    for index in order {
        if points[index][1] < best {
            best = points[index][1];
            on_front[index] = true;
        }
    }
    on_front
}

/// Marks the points of all curves that lie on their common front.
pub fn mark(curves: &mut [Curve]) {
    let all: Vec<[f64; 2]> = (curves.iter().flat_map(|curve| &curve.points))
        .map(|point| [point.seconds, point.error])
        .collect();
    let marked = front(&all);
    let points = curves.iter_mut().flat_map(|curve| &mut curve.points);
    for (point, pareto) in points.zip(marked) {
        point.pareto = pareto;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    #[test]
    fn a_point_is_on_the_front_exactly_if_no_other_beats_it() {
        let mut stream = Stream::new(1, 0, 0, 0);
        for count in 0..60 {
            // Few distinct values, so that many are equal.
            let points: Vec<[f64; 2]> = (0..count)
                .map(|_| [0, 1].map(|_| stream.below(9) as f64))
                .collect();
            let marked = front(&points);
            for (i, p) in points.iter().enumerate() {
                let beaten = points.iter().enumerate().any(|(j, q)| {
                    let as_good = q[0] <= p[0] && q[1] <= p[1];
                    as_good && (q != p || j < i)
                });
                assert_eq!(marked[i], !beaten, "{i} of {points:?}");
            }
        }
    }
}
