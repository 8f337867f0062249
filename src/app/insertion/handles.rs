//! Handles on inserted objects: the foot moves one, the knob beside it turns it, the one above it scales it. The crates
//! that draw such things are made for another egui.

use crate::app::insertion::Insertions;
use crate::app::insertion::models::draw_box;
use crate::app::theme::Tokens;
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use egui::{Color32, Modifiers, Painter, Pos2, Rect, Stroke, vec2};
use glam::{DVec3, Quat, Vec3};

/// What can be dragged, by the object's index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handle {
    /// Where the object stands.
    Foot(usize),
    /// The knob that turns it.
    Turn(usize),
    /// The square above it that scales it.
    Size(usize),
}

/// What a foot is moved along.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Along {
    /// The surfaces under the pointer.
    #[default]
    Surfaces,
    /// The up axis.
    Up,
    /// The plane that it stands on, through whatever is there.
    Level,
}

impl Along {
    /// With Shift up and down, with Ctrl on one level.
    pub fn of(modifiers: Modifiers) -> Self {
        match (modifiers.shift, modifiers.command) {
            (true, _) => Self::Up,
            (false, true) => Self::Level,
            _ => Self::Surfaces,
        }
    }
}

impl Handle {
    fn index(self) -> usize {
        match self {
            Self::Foot(index) | Self::Turn(index) | Self::Size(index) => index,
        }
    }
}

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
        for (index, object) in self
            .objects
            .iter()
            .enumerate()
            .filter(|(_, o)| !o.placement.hidden)
        {
            if self.chosen == Some(index) {
                let knob = self.knob(index, scene).and_then(&project);
                let top = self.top(index, scene).and_then(&project);
                handles.extend(knob.map(|at| (Handle::Turn(index), at)));
                handles.extend(top.map(|at| (Handle::Size(index), at)));
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

    /// Where the handle above a placed object is, in scene coordinates.
    fn top(&self, index: usize, scene: &Scene) -> Option<Vec3> {
        let placement = &self.objects.get(index)?.placement;
        let foot = (placement.at? - scene.origin).as_vec3();
        let corners = self.models.corners(placement, scene)?;
        let height = (corners[2] - corners[0]).length();
        let width = (corners[1] - corners[0]).length();
        Some(foot + scene.up * (height + 0.2 * height.max(width)))
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
    pub fn drag_handle(
        &mut self,
        scene: &Scene,
        ray: &Ray,
        surface: Option<DVec3>,
        along: Along,
    ) -> bool {
        let Some(handle) = self.dragged else {
            return false;
        };
        self.chosen = Some(handle.index());
        match handle {
            Handle::Foot(index) => {
                let to = match along {
                    Along::Surfaces => surface,
                    Along::Up => self.raised(index, scene, ray),
                    Along::Level => self.levelled(index, scene, ray),
                };
                if let Some(point) = to {
                    self.place(point);
                }
            }
            Handle::Turn(index) => self.turn(index, scene, ray),
            Handle::Size(index) => self.resize(index, scene, ray),
        }
        true
    }

    fn foot(&self, index: usize, scene: &Scene) -> Option<Vec3> {
        let at = self.objects.get(index)?.placement.at?;
        Some((at - scene.origin).as_vec3())
    }

    /// Where the foot is at the ray's height above or below where it is now.
    fn raised(&self, index: usize, scene: &Scene, ray: &Ray) -> Option<DVec3> {
        let height = height_of(self.foot(index, scene)?, scene.up, ray)?;
        let at = self.objects.get(index)?.placement.at?;
        Some(at + scene.up.as_dvec3() * f64::from(height))
    }

    /// Where the ray meets the plane that the foot stands on.
    fn levelled(&self, index: usize, scene: &Scene, ray: &Ray) -> Option<DVec3> {
        let point = on_plane(self.foot(index, scene)?, scene.up, ray)?;
        Some(point.as_dvec3() + scene.origin)
    }

    /// Scales an object so that the handle above it comes to where the ray passes the axis through its foot.
    fn resize(&mut self, index: usize, scene: &Scene, ray: &Ray) {
        let foot = self.foot(index, scene);
        let Some((foot, top)) = foot.zip(self.top(index, scene)) else {
            return;
        };
        let wanted = height_of(foot, scene.up, ray);
        let factor = wanted.map(|height| f64::from(height / top.distance(foot)));
        if let Some(factor) = factor.filter(|f| f.is_finite() && *f > 0.0)
            && let Some(object) = self.objects.get_mut(index)
        {
            let scale = (object.placement.scale * factor).clamp(SCALES.0, SCALES.1);
            object.placement.scale = three_digits(scale);
        }
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
        let Some(point) = on_plane(foot, scene.up, ray) else {
            return;
        };
        let aim = point - foot;
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
            && !object.placement.hidden
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
                Handle::Size(_) => {
                    let square = Rect::from_center_size(*at, vec2(9.0, 9.0));
                    painter.rect(
                        square,
                        0.0,
                        Color32::BLACK,
                        Stroke::new(2.0, tokens.inserted),
                        egui::StrokeKind::Inside,
                    );
                }
            }
        }
    }
}

/// Where a ray meets the plane through `point` with unit normal `up`, in front of its origin.
fn on_plane(point: Vec3, up: Vec3, ray: &Ray) -> Option<Vec3> {
    let distance = (point - ray.origin).dot(up) / ray.direction.dot(up);
    (distance.is_finite() && distance > 0.0).then(|| ray.origin + ray.direction * distance)
}

/// Height above `point`, along the unit vector `up`, of that axis's point that is nearest to a ray.
fn height_of(point: Vec3, up: Vec3, ray: &Ray) -> Option<f32> {
    let (to, direction) = (point - ray.origin, ray.direction);
    let (slope, square) = (up.dot(direction), direction.length_squared());
    let height = (slope * to.dot(direction) - square * to.dot(up)) / (square - slope * slope);
    height.is_finite().then_some(height)
}

/// A number rounded to three digits.
fn three_digits(value: f64) -> f64 {
    let unit = 10f64.powf(value.abs().log10().floor() - 2.0);
    (value / unit).round() * unit
}

#[cfg(test)]
mod tests {
    use super::{Along, Handle};
    use crate::app::insertion::Insertions;
    use crate::app::model::tests::scene;
    use crate::scene::geometry::Ray;
    use glam::{DVec3, Vec3};

    /// An object whose box is 0.4 wide and 0.2 high about the origin, chosen, in a scene.
    fn inserted(scene: &crate::scene::Scene) -> Insertions {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("cube.obj");
        let text = "v -0.2 0 -0.2\nv 0.2 0 0.2\nv 0.2 0.2 0.2\nf 1 2 3\n";
        std::fs::write(&file, text).expect("written");
        let mut insertions = Insertions::default();
        insertions.add(file, Some(DVec3::ZERO));
        let ctx = egui::Context::default();
        for _ in 0..500 {
            let read = insertions.models.update(&ctx, &insertions.objects);
            if !read.is_empty() {
                assert!(insertions.top(0, scene).is_some());
                return insertions;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        panic!("the object was not read");
    }

    #[test]
    fn the_knob_turns_the_object_towards_the_pointer_counter_clockwise_from_above() {
        let scene = scene();
        let mut insertions = inserted(&scene);
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
    #[test]
    fn the_handle_above_scales_and_the_foot_moves_over_surfaces_up_or_on_one_level() {
        let scene = scene();
        let mut insertions = inserted(&scene);
        let local = |point: DVec3| (point - scene.origin).as_vec3();
        let ray = |from: DVec3, to: DVec3| Ray::new(local(from), (to - from).as_vec3());

        // The handle stands at 0.2 + 0.08; at twice that height the object is twice as large.
        insertions.dragged = Some(Handle::Size(0));
        let aim = ray(DVec3::new(0.3, 0.5, 3.0), DVec3::new(0.0, 0.56, 0.0));
        assert!(insertions.drag_handle(&scene, &aim, None, Along::Surfaces));
        let scale = insertions.objects[0].placement.scale;
        assert!((scale - 2.0).abs() < 1e-9, "{scale}");
        // Below the foot there is no size.
        let below = ray(DVec3::new(0.3, 0.5, 3.0), DVec3::new(0.0, -0.4, 0.0));
        insertions.drag_handle(&scene, &below, None, Along::Surfaces);
        assert_eq!(insertions.objects[0].placement.scale, scale);

        insertions.dragged = Some(Handle::Foot(0));
        let near = |a: Option<DVec3>, b: DVec3| a.is_some_and(|a| a.distance(b) < 1e-5);
        let aim = ray(DVec3::new(0.0, 1.0, 3.0), DVec3::new(0.0, 0.7, 0.0));
        insertions.drag_handle(&scene, &aim, Some(DVec3::X), Along::Up);
        assert!(near(insertions.objects[0].placement.at, DVec3::Y * 0.7));
        let aim = ray(DVec3::new(0.0, 2.0, 3.0), DVec3::new(0.4, 0.7, 0.1));
        insertions.drag_handle(&scene, &aim, Some(DVec3::X), Along::Level);
        let level = DVec3::new(0.4, 0.7, 0.1);
        assert!(near(insertions.objects[0].placement.at, level));
        insertions.drag_handle(&scene, &aim, Some(DVec3::X), Along::Surfaces);
        assert!(near(insertions.objects[0].placement.at, DVec3::X));
    }
}
