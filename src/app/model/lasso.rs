//! A closed line drawn over the 3D view, and the faces that it encloses.

use crate::scene::Scene;
use crate::scene::geometry::Hit;
use egui::Pos2;
use glam::Vec3;

/// Least distance between points of the line, in points of the screen.
const STEP: f32 = 3.0;
/// A face is seen if the surface drawn at its middle lies within this distance, a fraction of the scene's diameter.
const NEAR: f32 = 2e-3;

/// A line while it is drawn.
#[derive(Debug, Clone, Default)]
pub struct Lasso {
    /// Its points, on the screen.
    pub line: Vec<Pos2>,
}

impl Lasso {
    /// Goes on to a point.
    pub fn draw(&mut self, to: Pos2) {
        let last = self.line.last();
        if last.is_none_or(|last| last.distance(to) >= STEP) {
            self.line.push(to);
        }
    }

    /// The faces whose middle is seen inside the line; `project` maps to the screen, `under` finds the surface there.
    pub fn enclosed(
        &self,
        scene: &Scene,
        faces: impl Iterator<Item = u32>,
        project: impl Fn(Vec3) -> Option<Pos2>,
        under: impl Fn(Pos2) -> Option<Hit>,
    ) -> Vec<u32> {
        faces
            .filter(|&face| {
                let middle = scene.corners(face).iter().sum::<Vec3>() / 3.0;
                let Some(at) = project(middle).filter(|&at| self.encloses(at)) else {
                    return false;
                };
                under(at).is_some_and(|hit| {
                    let off = scene.point(&hit).distance(middle);
                    hit.triangle == face || off <= NEAR * scene.diameter
                })
            })
            .collect()
    }

    /// Whether a ray from a point to the right crosses the closed line an odd number of times.
    fn encloses(&self, at: Pos2) -> bool {
        let ends = self.line.iter().zip(self.line.iter().cycle().skip(1));
        let crossed = ends.filter(|(a, b)| {
            let crosses = (a.y > at.y) != (b.y > at.y);
            crosses && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x)
        });
        crossed.count() % 2 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    #[test]
    fn a_line_encloses_what_lies_inside_it_however_it_is_bent() {
        let mut lasso = Lasso::default();
        assert!(!lasso.encloses(pos2(0.0, 0.0)));
        // A horseshoe that is open to the right.
        let [xs, ys] = [
            [0, 40, 40, 10, 10, 40, 40, 0],
            [0, 0, 10, 10, 30, 30, 40, 40],
        ];
        for (x, y) in xs.into_iter().zip(ys) {
            lasso.draw(pos2(x as f32, y as f32));
        }
        for (x, y, inside) in [
            (5.0, 20.0, true),
            (30.0, 5.0, true),
            (30.0, 35.0, true),
            (30.0, 20.0, false),
            (50.0, 5.0, false),
            (-5.0, 20.0, false),
            (20.0, -5.0, false),
        ] {
            assert_eq!(lasso.encloses(pos2(x, y)), inside, "{x} {y}");
        }
        // Points next to each other are one.
        let points = lasso.line.len();
        lasso.draw(pos2(0.5, 40.5));
        assert_eq!(lasso.line.len(), points);
    }
}
