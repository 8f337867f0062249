//! Handles on inserted objects: the foot moves one over the surfaces, the knob beside it turns it.

use crate::app::insertion::Insertions;
use crate::app::insertion::models::draw_box;
use crate::app::theme::Tokens;
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use egui::{Color32, Painter, Pos2, Stroke};
use glam::{DVec3, Quat, Vec3};

/// What can be dragged, by the object's index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handle {
    /// Where the object stands.
    Foot(usize),
    /// The knob that turns it.
    Turn(usize),
}

impl Handle {
    fn index(self) -> usize {
        match self {
            Self::Foot(index) | Self::Turn(index) => index,
        }
    }
}

/// How near to a handle a press takes it, in points.
const REACH: f32 = 10.0;

impl Insertions {
    /// Where handles are on the screen.
    fn handles(
        &self,
        scene: &Scene,
        project: impl Fn(Vec3) -> Option<Pos2>,
    ) -> Vec<(Handle, Pos2)> {
        let mut handles = Vec::new();
        for (index, object) in self.objects.iter().enumerate().filter(|(_, o)| o.visible) {
            let knob = self
                .knob(index, scene)
                .filter(|_| self.chosen == Some(index));
            if let Some(at) = knob.and_then(&project) {
                handles.push((Handle::Turn(index), at));
            }
            let foot = object.placement.at.map(|at| (at - scene.origin).as_vec3());
            if let Some(at) = foot.and_then(&project) {
                handles.push((Handle::Foot(index), at));
            }
        }
        handles
    }

    /// Where the knob of a placed object is, in scene coordinates: beside its file's +x side, on the ground.
    fn knob(&self, index: usize, scene: &Scene) -> Option<Vec3> {
        let placement = &self.objects.get(index)?.placement;
        let foot = (placement.at? - scene.origin).as_vec3();
        let corners = self.models.corners(placement, scene)?;
        let side = (corners[1] + corners[5]) * 0.5;
        Some(foot + (side - foot) * 1.3)
    }

    /// Takes the handle at `pointer`, if there is one.
    pub fn take_handle(
        &mut self,
        scene: &Scene,
        pointer: Pos2,
        project: impl Fn(Vec3) -> Option<Pos2>,
    ) {
        self.dragged = self
            .handles(scene, project)
            .into_iter()
            .find(|(_, at)| at.distance(pointer) < REACH)
            .map(|(handle, _)| handle);
    }

    /// Follows the pointer's `ray`, which meets the scene at `surface`, with the handle that is held; false where none is.
    pub fn drag_handle(&mut self, scene: &Scene, ray: &Ray, surface: Option<DVec3>) -> bool {
        let Some(handle) = self.dragged else {
            return false;
        };
        self.chosen = Some(handle.index());
        match (handle, surface) {
            (Handle::Foot(_), Some(point)) => {
                self.place(point);
            }
            (Handle::Foot(_), None) => {}
            (Handle::Turn(index), _) => self.turn(index, scene, ray),
        }
        true
    }

    /// Turns an object so that its knob lies where the ray meets the ground plane that it stands on.
    fn turn(&mut self, index: usize, scene: &Scene, ray: &Ray) {
        let knob = self.knob(index, scene);
        let Some((object, knob)) = self.objects.get_mut(index).zip(knob) else {
            return;
        };
        let Some(at) = object.placement.at else {
            return;
        };
        let foot = (at - scene.origin).as_vec3();
        let distance = (foot - ray.origin).dot(scene.up) / ray.direction.dot(scene.up);
        if !(distance.is_finite() && distance > 0.0) {
            return;
        }
        let aim = ray.origin + ray.direction * distance - foot;
        let unturned =
            Quat::from_axis_angle(scene.up, -object.placement.rotate.to_radians() as f32)
                * (knob - foot);
        let angle = unturned.cross(aim).dot(scene.up).atan2(unturned.dot(aim));
        if angle.is_finite() {
            object.placement.rotate = f64::from(angle.to_degrees()).round();
        }
    }

    /// Draws the handles, and a box around the chosen object where `boxed`.
    pub fn draw_handles(
        &self,
        painter: &Painter,
        scene: &Scene,
        tokens: &Tokens,
        boxed: bool,
        project: impl Fn(Vec3) -> Option<Pos2>,
    ) {
        if boxed
            && let Some(object) = self.chosen.and_then(|index| self.objects.get(index))
            && object.visible
            && let Some(corners) = self.models.corners(&object.placement, scene)
        {
            draw_box(painter, &corners, &project, tokens.inserted, 1.5);
        }
        let handles = self.handles(scene, project);
        for (handle, at) in &handles {
            let outline = Stroke::new(1.0, Color32::BLACK);
            match handle {
                Handle::Foot(index) => {
                    let radius = if self.chosen == Some(*index) {
                        5.0
                    } else {
                        3.5
                    };
                    painter.circle(*at, radius, tokens.inserted, outline);
                }
                Handle::Turn(index) => {
                    let foot = handles
                        .iter()
                        .find(|(other, _)| *other == Handle::Foot(*index));
                    if let Some((_, foot)) = foot {
                        painter.line_segment([*foot, *at], Stroke::new(1.5, tokens.inserted));
                    }
                    painter.circle(*at, 4.5, Color32::BLACK, Stroke::new(2.0, tokens.inserted));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::app::insertion::Insertions;
    use crate::app::model::tests::scene;
    use crate::scene::geometry::Ray;
    use glam::{DVec3, Vec3};

    #[test]
    fn the_knob_turns_the_object_towards_the_pointer_counter_clockwise_from_above() {
        let scene = scene();
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("cube.obj");
        std::fs::write(&file, "v 0 0 0\nv 0.2 0 0.2\nv 0 0.2 0\nf 1 2 3\n").expect("written");
        let mut insertions = Insertions::default();
        insertions.add(file, Some(DVec3::ZERO));
        let ctx = egui::Context::default();
        for _ in 0..500 {
            if !insertions
                .models
                .update(&ctx, &insertions.objects)
                .is_empty()
            {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let foot = (DVec3::ZERO - scene.origin).as_vec3();
        // Straight down onto the ground, north of the object (−z): a quarter turn from +x.
        for (aim, degrees) in [(Vec3::NEG_Z, 90.0), (Vec3::Z, -90.0), (Vec3::X, 0.0)] {
            let above = foot + aim * 0.7 + Vec3::Y * 3.0;
            insertions.turn(0, &scene, &Ray::new(above, Vec3::NEG_Y));
            let turned = insertions.objects[0].placement.rotate;
            assert!(
                (turned - degrees).abs() < 1e-3,
                "{turned} instead of {degrees}"
            );
        }
    }
}
