//! Bundle adjustment: poses and depths of points by robust Gauss-Newton steps; depths are eliminated (Schur complement).

use crate::capture::camera::Pose;
use crate::capture::poses::matches::Match;
use crate::capture::poses::points::Point;
use crate::capture::scan::Lens;
use crate::math::stats::quantile;
use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use std::collections::BTreeMap;

const STEPS: usize = 10;
/// Standard deviation of a depth image's distance, as a part of it: twice the noise of a structured-light camera at 3 m (Nguyen,
/// Izadi and Lovell 2012), since errors of neighbouring pixels are alike.
const DEPTH_DEVIATION: f64 = 0.01;
/// Median of the length of a two-dimensional normal vector of variance 1.
const RAYLEIGH_MEDIAN: f64 = 1.177_410_022_515_475;
/// Unknowns of a pose: shift and turn.
const POSE: usize = 6;

/// Rows of derivatives of a match's two coordinates by a pose.
type Rows = SMatrix<f64, 2, POSE>;

/// Points that are seen by two photographs and more, and what is known of them.
pub struct Adjustment<'a> {
    tracks: Vec<(&'a Point, &'a [Match])>,
    lenses: &'a [Lens],
}

/// A match's difference from what poses and depth say.
struct Residual {
    /// Expected minus seen position in pixels.
    error: DVec2,
    information: DMat2,
    /// Derivatives by the pose of the point's own photograph, of the other one, and by the logarithm of inverse depth.
    own: Rows,
    other: Rows,
    depth: SVector<f64, 2>,
}

impl<'a> Adjustment<'a> {
    /// The points with matches whose index `takes` accepts.
    pub fn new(
        points: &'a [Point],
        matches: &'a [Vec<Match>],
        lenses: &'a [Lens],
        takes: impl Fn(usize) -> bool,
    ) -> Self {
        let tracks = (points.iter().zip(matches).enumerate())
            .filter(|(index, (_, seen))| takes(*index) && !seen.is_empty())
            .map(|(_, (point, seen))| (point, seen.as_slice()))
            .collect();
        Self { tracks, lenses }
    }

    /// Number of matches.
    pub fn matches(&self) -> usize {
        self.tracks.iter().map(|(_, seen)| seen.len()).sum()
    }

    /// Poses that fit the matches best, beginning with `poses`; `given` are the scan's, with standard deviations in metres along
    /// each axis and in radians about each.
    pub fn adjust(&self, given: &[Pose], mut poses: Vec<Pose>, deviations: [f64; 2]) -> Vec<Pose> {
        let mut depths = vec![0.0; self.tracks.len()];
        for _ in 0..STEPS {
            let Some(scale) = self.scale(&poses, &depths) else {
                return poses;
            };
            let Some(step) = self.step(given, deviations, &mut poses, &mut depths, scale) else {
                return poses;
            };
            if step < 1e-7 {
                break;
            }
        }
        poses
    }

    /// The largest standard deviations that the given poses can have, in metres along each axis and in radians about each: what
    /// moves points by the median error of matches, which two poses share. `None` without matches.
    pub fn deviations(&self, given: &[Pose]) -> Option<[f64; 2]> {
        let error = self.median_error(given, 1)?;
        let mut depths: Vec<f64> = self
            .tracks
            .iter()
            .map(|(p, _)| 1.0 / p.inverse_depth.x)
            .collect();
        let mut focal: Vec<f64> = self.lenses.iter().map(|lens| lens.pinhole.fx).collect();
        let angle =
            error / (RAYLEIGH_MEDIAN * std::f64::consts::SQRT_2 * quantile(&mut focal, 0.5)?);
        Some([angle * quantile(&mut depths, 0.5)?, angle])
    }

    /// Median distance in pixels between expected and seen positions, with the best depths; `None` with fewer than `least` matches.
    pub fn median_error(&self, poses: &[Pose], least: usize) -> Option<f64> {
        let mut depths = vec![0.0; self.tracks.len()];
        for _ in 0..STEPS {
            let scale = self.scale(poses, &depths)?;
            for (track, depth) in depths.iter_mut().enumerate() {
                let residuals: Vec<_> = self.residuals(track, poses, *depth).collect();
                let (gradient, curvature) = depth_equation(&residuals, *depth, scale);
                *depth -= gradient / curvature;
            }
        }
        let mut errors: Vec<f64> = (0..self.tracks.len())
            .flat_map(|track| self.residuals(track, poses, depths[track]))
            .map(|residual| residual.1.error.length())
            .collect();
        (errors.len() >= least).then(|| quantile(&mut errors, 0.5))?
    }

    /// What one of the whitened coordinates deviates by, from the median; `None` without matches.
    fn scale(&self, poses: &[Pose], depths: &[f64]) -> Option<f64> {
        let mut lengths: Vec<f64> = (0..self.tracks.len())
            .flat_map(|track| self.residuals(track, poses, depths[track]))
            .map(|(_, residual)| residual.length())
            .collect();
        let median = quantile(&mut lengths, 0.5)?;
        (median > 0.0).then(|| median / RAYLEIGH_MEDIAN)
    }

    /// One step of all poses and depths. Returns the largest change of a pose; `None` if the equations have no solution.
    fn step(
        &self,
        given: &[Pose],
        deviations: [f64; 2],
        poses: &mut [Pose],
        depths: &mut [f64],
        scale: f64,
    ) -> Option<f64> {
        let size = POSE * poses.len();
        let mut matrix = DMatrix::<f64>::zeros(size, size);
        let mut gradient = DVector::<f64>::zeros(size);

        // The given poses hold where photographs say nothing.
        for (index, (given, pose)) in given.iter().zip(poses.iter()).enumerate() {
            let shift = pose.center - given.center;
            let turn = turn_between(&given.rotation, &pose.rotation);
            for (part, (value, deviation)) in [shift, turn].into_iter().zip(deviations).enumerate()
            {
                for axis in 0..3 {
                    let row = POSE * index + 3 * part + axis;
                    matrix[(row, row)] += 1.0 / (deviation * deviation);
                    gradient[row] += value[axis] / (deviation * deviation);
                }
            }
        }

        // Each point's equations, its depth eliminated.
        let mut eliminated = Vec::with_capacity(self.tracks.len());
        for (track, depth) in depths.iter().enumerate() {
            let residuals: Vec<_> = self.residuals(track, poses, *depth).collect();
            let (own_gradient, curvature) = depth_equation(&residuals, *depth, scale);
            let mut mixed: BTreeMap<usize, SVector<f64, POSE>> = BTreeMap::new();
            let own = self.tracks[track].0.frame;
            for (other, residual) in &residuals {
                let weighted = residual.weighted(scale);
                let error = vector(residual.error);
                let sides = [(own, residual.own), (*other, residual.other)];
                for (i, rows) in sides {
                    let weighted_rows = rows.transpose() * weighted;
                    let mut part = gradient.fixed_rows_mut::<POSE>(POSE * i);
                    part += weighted_rows * error;
                    *mixed.entry(i).or_insert_with(SVector::zeros) +=
                        weighted_rows * residual.depth;
                    for (j, columns) in sides {
                        let mut block = matrix.fixed_view_mut::<POSE, POSE>(POSE * i, POSE * j);
                        block += weighted_rows * columns;
                    }
                }
            }
            for (&i, a) in &mixed {
                let mut part = gradient.fixed_rows_mut::<POSE>(POSE * i);
                part -= a * (own_gradient / curvature);
                for (&j, b) in &mixed {
                    let mut block = matrix.fixed_view_mut::<POSE, POSE>(POSE * i, POSE * j);
                    block -= a * b.transpose() / curvature;
                }
            }
            eliminated.push((own_gradient, curvature, mixed));
        }

        // Poses, then depths by back-substitution.
        let step = -matrix.cholesky()?.solve(&gradient);
        for (index, pose) in poses.iter_mut().enumerate() {
            let part = step.fixed_rows::<POSE>(POSE * index);
            pose.center += DVec3::new(part[0], part[1], part[2]);
            let turn = DVec3::new(part[3], part[4], part[5]);
            pose.rotation = rotation(turn) * pose.rotation;
        }
        for (depth, (own_gradient, curvature, mixed)) in depths.iter_mut().zip(&eliminated) {
            let moved: f64 = (mixed.iter())
                .map(|(&i, a)| a.dot(&step.fixed_rows::<POSE>(POSE * i)))
                .sum();
            *depth -= (own_gradient + moved) / curvature;
        }
        Some(step.amax())
    }

    /// The differences of a point's matches, with their photographs.
    fn residuals(
        &self,
        track: usize,
        poses: &[Pose],
        depth: f64,
    ) -> impl Iterator<Item = (usize, Residual)> {
        let (point, matches) = self.tracks[track];
        let own = poses[point.frame];
        let in_camera = point.ray.extend(1.0) / (point.inverse_depth.x * depth.exp());
        let world = own.to_world(in_camera);
        matches.iter().filter_map(move |seen| {
            let pose = poses[seen.frame];
            let there = pose.to_camera(world);
            let lens = &self.lenses[seen.frame];
            let expected = lens.project(there)?;
            // Derivatives of the pixel by the point in the world; a millionth of the distance is far above rounding.
            let small = 1e-6 * there.length();
            let mut by_point = [DVec2::ZERO; 3];
            for (axis, by) in DVec3::AXES.into_iter().zip(&mut by_point) {
                let moved = lens.project(there + axis * small)?;
                *by = (moved - expected) / small;
            }
            let [x, y, z] = by_point;
            let to_world = pose.rotation * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
            let gradients =
                [DVec3::new(x.x, y.x, z.x), DVec3::new(x.y, y.y, z.y)].map(|row| to_world * row);
            let (from_own, from_other) = (world - own.center, world - pose.center);
            let rows = |sign: f64, arm: DVec3| {
                let mut rows = Rows::zeros();
                for (i, g) in gradients.iter().enumerate() {
                    // Turning by ω moves the point by ω × arm, and g · (ω × arm) = ω · (arm × g).
                    let turned = arm.cross(*g) * sign;
                    let shifted = *g * sign;
                    let row = shifted.to_array().into_iter().chain(turned.to_array());
                    row.enumerate().for_each(|(j, v)| rows[(i, j)] = v);
                }
                rows
            };
            Some((
                seen.frame,
                Residual {
                    error: expected - seen.pixel,
                    information: seen.information,
                    own: rows(1.0, from_own),
                    other: rows(-1.0, from_other),
                    depth: SVector::from(gradients.map(|g| -g.dot(from_own))),
                },
            ))
        })
    }
}

impl Residual {
    /// Length in standard deviations of a match.
    fn length(&self) -> f64 {
        self.error
            .dot(self.information * self.error)
            .max(0.0)
            .sqrt()
    }

    /// Information times the weight of a robust (Cauchy) cost, in units of what matches deviate by.
    fn weighted(&self, scale: f64) -> SMatrix<f64, 2, 2> {
        let relative = self.length() / scale;
        let weight = 1.0 / (1.0 + 0.25 * relative * relative) / (scale * scale);
        let m = self.information * weight;
        SMatrix::<f64, 2, 2>::new(m.x_axis.x, m.y_axis.x, m.x_axis.y, m.y_axis.y)
    }
}

/// Gradient and curvature of a point's robust cost by the logarithm of its inverse depth, whose deviation from the depth image is
/// `depth`.
fn depth_equation(residuals: &[(usize, Residual)], depth: f64, scale: f64) -> (f64, f64) {
    let precision = 1.0 / (DEPTH_DEVIATION * DEPTH_DEVIATION);
    let mut sums = (depth * precision, precision);
    for (_, residual) in residuals {
        let towards = residual.weighted(scale) * residual.depth;
        sums.0 += towards.dot(&vector(residual.error));
        sums.1 += towards.dot(&residual.depth);
    }
    sums
}

fn vector(v: DVec2) -> SVector<f64, 2> {
    SVector::from(v.to_array())
}

/// The rotation by a vector: its length is the angle in radians.
fn rotation(turn: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_scaled_axis(turn))
}

/// The vector of the rotation, in the world, that takes one rotation to another.
pub fn turn_between(from: &DMat3, to: &DMat3) -> DVec3 {
    DQuat::from_mat3(&(*to * from.transpose())).to_scaled_axis()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_equal_differences() {
        let lens = Lens::plain([320, 240], [250.0, 255.0], [158.0, 121.0]);
        let lenses = [lens; 2];
        let turned = |turn: [f64; 3], center: [f64; 3]| Pose {
            rotation: rotation(DVec3::from(turn)),
            center: DVec3::from(center),
        };
        let poses = [
            turned([0.1, 0.2, -0.1], [0.0; 3]),
            turned([0.0, 0.4, 0.05], [0.3, -0.1, 0.2]),
        ];
        let point = Point {
            frame: 0,
            pixel: [100, 90],
            ray: DVec2::new(-0.23, -0.12),
            inverse_depth: DVec3::new(0.4, 0.0, 0.0),
        };
        let seen = vec![vec![Match {
            frame: 1,
            pixel: DVec2::new(100.0, 80.0),
            information: DMat2::IDENTITY,
        }]];
        let points = [point];
        let adjustment = Adjustment::new(&points, &seen, &lenses, |_| true);
        let at = |poses: &[Pose], depth: f64| {
            let mut residuals = adjustment.residuals(0, poses, depth);
            residuals.next().expect("in front of the camera").1
        };
        let here = at(&poses, 0.0);
        let step = 1e-6;
        for (frame, rows) in [(0, here.own), (1, here.other)] {
            for column in 0..POSE {
                let mut moved = poses;
                let axis = DVec3::AXES[column % 3] * step;
                match column / 3 {
                    0 => moved[frame].center += axis,
                    _ => moved[frame].rotation = rotation(axis) * moved[frame].rotation,
                }
                let difference = (at(&moved, 0.0).error - here.error) / step;
                let found = DVec2::new(rows[(0, column)], rows[(1, column)]);
                let close = difference.distance(found) < 1e-3 * (1.0 + difference.length());
                assert!(close, "{frame} {column}: {found} not {difference}");
            }
        }
        let difference = (at(&poses, step).error - here.error) / step;
        let found = DVec2::new(here.depth[0], here.depth[1]);
        let off = difference.distance(found);
        assert!(off < 1e-2, "{found} not {difference}");
    }
}
