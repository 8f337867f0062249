//! Moving, rotating and scaling the chosen object by the pointer alone, as Blender's G, R and S do: X, Y and Z hold an
//! axis, a click or Enter keeps the result, Escape takes it back.

use crate::app::insertion::Insertions;
use crate::app::insertion::handles::{Kind, SCALES, foot, height_of, three_digits};
use crate::compose::placement::Placement;
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use egui::{Context, Key, Modifiers, Pos2};
use glam::{DQuat, DVec2, DVec3, EulerRot, Vec3};

/// A transform under way. It moves over surfaces or along the axis, and rotates about the up axis or about the axis, by the angle
/// that the pointer goes around the object's foot.
#[derive(Debug, Clone, PartialEq)]
pub struct Transform {
    kind: Kind,
    /// The axis of the capture's coordinates: x, y or z.
    axis: Option<usize>,
    /// The object's index and placement at the start.
    index: usize,
    before: Placement,
    /// Where the pointer was when a view first saw it.
    start: Option<Pos2>,
}

impl Transform {
    /// Begins, changes or ends a transform by the keys that were pressed, and takes those out of the input. Returns the object's
    /// index and its placement at the start if it is to be taken back.
    pub fn follow_keys(
        transform: &mut Option<Self>,
        insertions: &Insertions,
        ctx: &Context,
    ) -> Option<(usize, Placement)> {
        let pressed = |key| ctx.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        for (key, kind) in [
            (Key::G, Kind::Move),
            (Key::R, Kind::Rotate),
            (Key::S, Kind::Scale),
        ] {
            let placed = insertions.chosen().filter(|(_, o)| o.at.is_some());
            if let Some((index, object)) = placed.filter(|_| pressed(key)) {
                let under_way = transform.take();
                let before = under_way.map_or_else(|| object.clone(), |known| known.before);
                *transform = Some(Self {
                    kind,
                    axis: None,
                    index,
                    before,
                    start: None,
                });
            }
        }
        let under_way = transform.as_mut()?;
        for (axis, key) in [Key::X, Key::Y, Key::Z].into_iter().enumerate() {
            if pressed(key) {
                under_way.axis = (under_way.axis != Some(axis)).then_some(axis);
            }
        }
        if pressed(Key::Enter) {
            *transform = None;
        }
        let cancelled = transform.take_if(|_| pressed(Key::Escape))?;
        Some((cancelled.index, cancelled.before))
    }

    /// The object's index and placement for the pointer at `pointer` of a view, whose `ray` hits `surface`; `project` gives
    /// where a scene point is on the screen.
    pub fn placed(
        &mut self,
        scene: &Scene,
        pointer: Pos2,
        ray: &Ray,
        surface: Option<DVec3>,
        project: impl Fn(Vec3) -> Option<Pos2>,
    ) -> Option<(usize, Placement)> {
        let start = *self.start.get_or_insert(pointer);
        let mut object = self.before.clone();
        let foot = foot(&object, scene)?;
        match (self.kind, self.axis) {
            (Kind::Move, None) => object.at = surface.or(object.at),
            (Kind::Move, Some(axis)) => {
                let along = Vec3::AXES[axis];
                let far = height_of(foot, along, ray)?;
                object.at = object.at.map(|at| at + (along * far).as_dvec3());
            }
            (Kind::Rotate, axis) => {
                let middle = project(foot)?;
                let (from, to) = (start - middle, pointer - middle);
                // The screen's y points down, so that this angle is clockwise as seen.
                let clockwise = to.angle() - from.angle();
                let axis = axis.map_or(scene.up, |axis| Vec3::AXES[axis]).as_dvec3();
                let towards_eye = axis.dot(ray.direction.as_dvec3()) < 0.0;
                let degrees = f64::from(clockwise.to_degrees()).round();
                let degrees = if towards_eye { -degrees } else { degrees };
                rotate(&mut object, scene, axis, degrees);
            }
            (Kind::Scale, _) => {
                let middle = project(foot)?;
                let factor = f64::from(pointer.distance(middle) / start.distance(middle).max(1.0));
                let scale = (object.scale * factor).clamp(SCALES.0, SCALES.1);
                object.scale = three_digits(scale);
            }
        }
        Some((self.index, object))
    }

    /// What is under way, in words.
    pub fn words(&self) -> String {
        let (kind, way) = match self.kind {
            Kind::Move => ("Move", "along"),
            Kind::Rotate => ("Rotate", "about"),
            Kind::Scale => ("Scale", "along"),
        };
        let held = |axis| format!(" {way} {}", ["X", "Y", "Z"][axis]);
        let axis = self.axis.map_or_else(String::new, held);
        format!("{kind}{axis}: click or Enter keeps it, Esc takes it back")
    }
}

/// Rotates a placement about an axis through its foot, by degrees counter-clockwise as seen from the axis's tip.
fn rotate(object: &mut Placement, scene: &Scene, axis: DVec3, degrees: f64) {
    let upright = DQuat::from_rotation_arc(DVec3::Y, scene.up.as_dvec3());
    let before =
        upright * DQuat::from_rotation_y(object.rotate.to_radians()) * object.tilt_rotation();
    let after = DQuat::from_axis_angle(axis, degrees.to_radians()) * before;
    let (y, x, z) = (upright.inverse() * after).to_euler(EulerRot::YXZ);
    let rounded = |angle: f64| (angle.to_degrees() * 1e3).round() * 1e-3;
    object.rotate = rounded(y);
    object.tilt = DVec2::new(rounded(x), rounded(z));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::model::tests::scene;

    fn begun(kind: Kind, axis: Option<usize>) -> Transform {
        Transform {
            kind,
            axis,
            index: 0,
            before: Placement::new("chair.glb", Some(DVec3::new(0.5, 0.0, 0.5))),
            start: Some(Pos2::new(10.0, 0.0)),
        }
    }

    /// Looks straight down; the foot is at the screen's origin, x to the right and z down.
    fn placed(transform: &mut Transform, pointer: Pos2) -> Placement {
        let scene = scene();
        let foot = foot(&transform.before, &scene).expect("it stands");
        let over = foot + Vec3::new(pointer.x * 0.01, 0.0, pointer.y * 0.01);
        let ray = Ray::new(over + scene.up, -scene.up);
        let surface = Some(over.as_dvec3() + scene.origin);
        let project = |_| Some(Pos2::ZERO);
        let placed = transform.placed(&scene, pointer, &ray, surface, project);
        placed.expect("it moves").1
    }

    #[test]
    fn an_object_follows_the_pointer_over_surfaces_or_along_an_axis() {
        for (axis, z) in [(None, 0.7), (Some(0), 0.5)] {
            let moved = placed(&mut begun(Kind::Move, axis), Pos2::new(30.0, 20.0));
            let at = moved.at.expect("a place");
            assert!(at.distance(DVec3::new(0.8, 0.0, z)) < 1e-5, "{at}");
        }
    }

    #[test]
    fn the_angle_around_the_foot_rotates_and_the_distance_from_it_scales() {
        // From the right to the bottom of the screen is clockwise seen from above.
        let turned = placed(&mut begun(Kind::Rotate, None), Pos2::new(0.0, 10.0));
        assert_eq!((turned.rotate, turned.tilt), (-90.0, DVec2::ZERO));
        let scaled = placed(&mut begun(Kind::Scale, None), Pos2::new(0.0, 25.0));
        assert_eq!(scaled.scale, 2.5);
    }

    #[test]
    fn rotations_about_any_axis_add_up() {
        let scene = scene();
        let mut object = Placement::new("chair.glb", Some(DVec3::ZERO));
        object.rotate = 30.0;
        object.tilt = DVec2::new(20.0, -40.0);
        let orientation = |object: &Placement| {
            let transform = object.transform(DVec3::ZERO, scene.up.as_dvec3());
            DQuat::from_mat3(&transform.expect("sound").matrix3)
        };
        let mut expected = orientation(&object);
        for (axis, degrees) in [(DVec3::X, 50.0), (DVec3::Z, -70.0), (DVec3::Y, 110.0)] {
            rotate(&mut object, &scene, axis, degrees);
            expected = DQuat::from_axis_angle(axis, degrees.to_radians()) * expected;
            let off = expected.angle_between(orientation(&object));
            assert!(off < 1e-4, "{off} after a rotation about {axis}");
        }
    }
}
