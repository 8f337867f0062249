//! Handles that move, rotate and scale an inserted object: at its base, beside it and above it.

use crate::app::insertion::Insertions;
use crate::app::insertion::models::draw_box;
use crate::app::theme::Tokens;
use crate::compose::placement::Placement;
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use egui::{Color32, Modifiers, Painter, Pos2, Rect, Stroke, StrokeKind, vec2};
use glam::{DVec3, Quat, Vec3};

/// What the pointer does to an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Moves it; its handle is at its base.
    Move,
    /// Rotates it; its handle is beside it.
    Rotate,
    /// Scales it; its handle is above it.
    Scale,
}

/// What can be dragged: the object's index, and what the handle does to it.
pub type Handle = (usize, Kind);

/// Least and greatest scale of an object.
pub const SCALES: (f64, f64) = (1e-6, 1e6);

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
        let shown = self.objects.iter().enumerate().filter(|(_, o)| !o.hidden);
        for (index, object) in shown {
            for kind in [Kind::Rotate, Kind::Scale, Kind::Move] {
                if (kind == Kind::Move || self.chosen == Some(index))
                    && let Some(at) = self.place(kind, object, scene).and_then(&project)
                {
                    handles.push(((index, kind), at));
                }
            }
        }
        handles
    }

    /// Where a handle of a placed object is, in scene coordinates; that which rotates it is on the ground by its file's +x side.
    fn place(&self, kind: Kind, object: &Placement, scene: &Scene) -> Option<Vec3> {
        let foot = foot(object, scene)?;
        if kind == Kind::Move {
            return Some(foot);
        }
        let corners = self.models.corners(object, scene)?;
        if kind == Kind::Rotate {
            let side = (corners[1] + corners[5]) * 0.5;
            return Some(foot + (side - foot) * 1.3);
        }
        let height = (corners[2] - corners[0]).length();
        let width = (corners[1] - corners[0]).length();
        Some(foot + scene.up * (height + 0.2 * height.max(width)))
    }

    /// The handle at `pointer`.
    pub fn handle_at(
        &self,
        scene: &Scene,
        pointer: Pos2,
        project: impl Fn(Vec3) -> Option<Pos2>,
    ) -> Option<Handle> {
        let handles = self.handles(scene, project);
        let near = |(_, at): &(Handle, Pos2)| at.distance(pointer) < REACH;
        handles.into_iter().find(near).map(|(handle, _)| handle)
    }

    /// An object's index and placement after `handle` is dragged to the pointer's `ray`, which hits `surface`. It moves over
    /// surfaces, up and down with Shift, and on its level through whatever is there with Ctrl.
    pub fn dragged(
        &self,
        handle: Handle,
        scene: &Scene,
        ray: &Ray,
        surface: Option<DVec3>,
        modifiers: Modifiers,
    ) -> Option<(usize, Placement)> {
        let (index, kind) = handle;
        let mut object = self.objects.get(index)?.clone();
        match kind {
            Kind::Move => {
                let to = match (modifiers.shift, modifiers.command) {
                    (true, _) => raised(&object, scene, ray),
                    (false, true) => levelled(&object, scene, ray),
                    (false, false) => surface,
                };
                object.at = to.or(object.at);
            }
            Kind::Rotate => object.rotate = self.turned(&object, scene, ray)?,
            Kind::Scale => object.scale = self.resized(&object, scene, ray)?,
        }
        Some((index, object))
    }

    /// The scale that brings the handle above an object to where the ray passes the axis through its foot.
    fn resized(&self, object: &Placement, scene: &Scene, ray: &Ray) -> Option<f64> {
        let foot = foot(object, scene)?;
        let top = self.place(Kind::Scale, object, scene)?;
        let wanted = height_of(foot, scene.up, ray)?;
        let factor = f64::from(wanted / top.distance(foot));
        let scale = (object.scale * factor).clamp(SCALES.0, SCALES.1);
        (factor.is_finite() && factor > 0.0).then(|| three_digits(scale))
    }

    /// The angle that turns an object's handle to where the ray meets the ground plane that it stands on, degrees.
    fn turned(&self, object: &Placement, scene: &Scene, ray: &Ray) -> Option<f64> {
        let foot = foot(object, scene)?;
        let handle = self.place(Kind::Rotate, object, scene)?;
        let aim = on_plane(foot, scene.up, ray)? - foot;
        let back = Quat::from_axis_angle(scene.up, -object.rotate.to_radians() as f32);
        let unturned = back * (handle - foot);
        let angle = unturned.cross(aim).dot(scene.up).atan2(unturned.dot(aim));
        let degrees = f64::from(angle.to_degrees()).round();
        angle.is_finite().then_some(degrees)
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
            && let Some((_, object)) = self.chosen().filter(|(_, object)| !object.hidden)
            && let Some(corners) = self.models.corners(object, scene)
        {
            draw_box(painter, &corners, &project, tokens.inserted, 1.5);
        }
        let handles = self.handles(scene, project);
        for ((index, kind), at) in &handles {
            match kind {
                Kind::Move => {
                    let chosen = self.chosen == Some(*index);
                    let radius = if chosen { 5.0 } else { 3.5 };
                    let outline = Stroke::new(1.0, Color32::BLACK);
                    painter.circle(*at, radius, tokens.inserted, outline);
                }
                Kind::Rotate => {
                    let foot = |(other, _): &&(Handle, Pos2)| *other == (*index, Kind::Move);
                    if let Some((_, foot)) = handles.iter().find(foot) {
                        painter.line_segment([*foot, *at], Stroke::new(1.5, tokens.inserted));
                    }
                    painter.circle(*at, 4.5, Color32::BLACK, Stroke::new(2.0, tokens.inserted));
                }
                Kind::Scale => {
                    let square = Rect::from_center_size(*at, vec2(9.0, 9.0));
                    let (stroke, inside) = (Stroke::new(2.0, tokens.inserted), StrokeKind::Inside);
                    painter.rect(square, 0.0, Color32::BLACK, stroke, inside);
                }
            }
        }
    }
}

/// Where an object stands, in scene coordinates.
pub(super) fn foot(object: &Placement, scene: &Scene) -> Option<Vec3> {
    Some((object.at? - scene.origin).as_vec3())
}

/// Where an object's foot is at the ray's height above or below where it is now.
fn raised(object: &Placement, scene: &Scene, ray: &Ray) -> Option<DVec3> {
    let height = height_of(foot(object, scene)?, scene.up, ray)?;
    Some(object.at? + scene.up.as_dvec3() * f64::from(height))
}

/// Where the ray meets the plane that an object stands on.
fn levelled(object: &Placement, scene: &Scene, ray: &Ray) -> Option<DVec3> {
    let point = on_plane(foot(object, scene)?, scene.up, ray)?;
    Some(point.as_dvec3() + scene.origin)
}

/// Where a ray meets the plane through `point` with unit normal `up`, in front of its origin.
fn on_plane(point: Vec3, up: Vec3, ray: &Ray) -> Option<Vec3> {
    let distance = (point - ray.origin).dot(up) / ray.direction.dot(up);
    (distance.is_finite() && distance > 0.0).then(|| ray.origin + ray.direction * distance)
}

/// Height above `point`, along the unit vector `up`, of that axis's point that is nearest to a ray.
pub(super) fn height_of(point: Vec3, up: Vec3, ray: &Ray) -> Option<f32> {
    let (to, direction) = (point - ray.origin, ray.direction);
    let (slope, square) = (up.dot(direction), direction.length_squared());
    let height = (slope * to.dot(direction) - square * to.dot(up)) / (square - slope * slope);
    height.is_finite().then_some(height)
}

pub(super) fn three_digits(value: f64) -> f64 {
    let unit = 10f64.powf(value.abs().log10().floor() - 2.0);
    (value / unit).round() * unit
}

#[cfg(test)]
mod tests {
    use super::Kind;
    use crate::app::insertion::Insertions;
    use crate::app::insertion::models::tests::models;
    use crate::app::model::tests::scene;
    use crate::scene::geometry::Ray;
    use egui::Modifiers;
    use glam::{DVec3, Vec3};

    /// An object whose box is 0.4 wide and 0.2 high about the origin, chosen.
    fn inserted() -> Insertions {
        let mut insertions = Insertions::default();
        insertions.add("cube.obj".into(), Some(DVec3::ZERO), 1.0);
        insertions.models = models([[-0.2, 0.0, -0.2], [0.2, 0.0, 0.2], [0.2, 0.2, 0.2]]);
        insertions
    }

    #[test]
    fn the_handle_beside_turns_the_object_towards_the_pointer_counter_clockwise_from_above() {
        let scene = scene();
        let mut insertions = inserted();
        let foot = (DVec3::ZERO - scene.origin).as_vec3();
        // Straight down onto the ground, north of the object (−z): a quarter turn from +x.
        for (aim, degrees) in [(Vec3::NEG_Z, 90.0), (Vec3::Z, -90.0), (Vec3::X, 0.0)] {
            let above = Ray::new(foot + aim * 0.7 + Vec3::Y * 3.0, Vec3::NEG_Y);
            let turned = insertions.turned(&insertions.objects[0], &scene, &above);
            let turned = turned.expect("an angle");
            assert!((turned - degrees).abs() < 1e-3, "{turned} for {degrees}");
            insertions.objects[0].rotate = turned;
        }
    }

    #[test]
    fn the_handle_above_scales_and_the_foot_moves_over_surfaces_up_or_on_one_level() {
        let scene = scene();
        let mut insertions = inserted();
        let local = |point: DVec3| (point - scene.origin).as_vec3();
        let ray = |from: DVec3, to: DVec3| Ray::new(local(from), (to - from).as_vec3());

        // The handle stands at 0.2 + 0.08; at twice that height the object is twice as large.
        let size = (0, Kind::Scale);
        let aim = ray(DVec3::new(0.3, 0.5, 3.0), DVec3::new(0.0, 0.56, 0.0));
        let dragged = insertions.dragged(size, &scene, &aim, None, Modifiers::NONE);
        insertions.objects[0] = dragged.expect("a size").1;
        let scale = insertions.objects[0].scale;
        assert!((scale - 2.0).abs() < 1e-9, "{scale}");
        // Below the foot there is no size.
        let below = ray(DVec3::new(0.3, 0.5, 3.0), DVec3::new(0.0, -0.4, 0.0));
        let dragged = insertions.dragged(size, &scene, &below, None, Modifiers::NONE);
        assert!(dragged.is_none());

        let level = DVec3::new(0.4, 0.7, 0.1);
        let raised = DVec3::Y * 0.7;
        for (height, to, modifiers, expected) in [
            (1.0, raised, Modifiers::SHIFT, raised),
            (2.0, level, Modifiers::COMMAND, level),
            (2.0, level, Modifiers::NONE, DVec3::X),
        ] {
            let aim = ray(DVec3::new(0.0, height, 3.0), to);
            let foot = (0, Kind::Move);
            let dragged = insertions.dragged(foot, &scene, &aim, Some(DVec3::X), modifiers);
            insertions.objects[0] = dragged.expect("a place").1;
            let at = insertions.objects[0].at.expect("a place");
            assert!(at.distance(expected) < 1e-5, "{modifiers:?}: {at}");
        }
    }
}
