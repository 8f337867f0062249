//! The shapes of inserted objects, read on threads of their own, for boxes in the views.

use crate::app::task::{Progress, Task};
use crate::compose::object::surface::MaterialOverride;
use crate::compose::object::{ObjectModel, base};
use crate::compose::placement::Placement;
use crate::scene::Scene;
use egui::{Color32, Painter, Pos2, Stroke};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

enum Shape {
    Reading(Task<(), Outline>),
    Read(Outline),
}

/// Shapes by file.
#[derive(Default)]
pub struct Models(HashMap<PathBuf, Shape>);

impl Models {
    /// Starts reading what is not known yet; gives the files that have been read since the last call, or why they cannot be.
    pub fn update(
        &mut self,
        ctx: &egui::Context,
        objects: &[Placement],
    ) -> Vec<(PathBuf, Result<(), String>)> {
        for object in objects {
            self.ask(ctx, &object.file);
        }
        let mut read = Vec::new();
        // What cannot be read is tried again when it is asked for again.
        self.0.retain(|file, shape| {
            let end = match shape {
                Shape::Reading(task) => task.end(),
                Shape::Read(_) => None,
            };
            let Some(end) = end else {
                return true;
            };
            let end = end.map(|model| *shape = Shape::Read(model));
            read.push((file.clone(), end.clone()));
            end.is_ok()
        });
        read
    }

    /// Starts reading a file unless it is known; true where it is read already.
    pub fn ask(&mut self, ctx: &egui::Context, file: &Path) -> bool {
        if let Some(known) = self.0.get(file) {
            return matches!(known, Shape::Read(_));
        }
        let path = file.to_owned();
        let read = move |_: &Progress<()>| Ok(Outline::new(&ObjectModel::read(&path)?));
        // Without a thread the object has no box.
        if let Ok(task) = Task::begin("object", ctx, read) {
            self.0.insert(file.to_owned(), Shape::Reading(task));
        }
        false
    }

    /// Width, height and depth of an object as modelled.
    pub fn size(&self, file: &Path) -> Option<DVec3> {
        let (low, high) = self.shape(file)?.bounds;
        Some(high - low)
    }

    /// An object's material with the largest area.
    pub fn material(&self, file: &Path) -> Option<MaterialOverride> {
        Some(self.shape(file)?.material)
    }

    fn shape(&self, file: &Path) -> Option<&Outline> {
        match self.0.get(file)? {
            Shape::Read(model) => Some(model),
            Shape::Reading(_) => None,
        }
    }

    /// A power of ten that makes an object at most a third of the scene, where it is larger than that as modelled.
    pub fn fitting_scale(&self, file: &Path, scene: &Scene) -> Option<f64> {
        let size = self.size(file)?.max_element();
        let diameter = f64::from(scene.diameter);
        if size <= diameter || !size.is_finite() {
            return None;
        }
        Some(10f64.powf((diameter / (3.0 * size)).log10().floor()))
    }

    /// The corners of the box around a placed object, in scene coordinates; bit 0 of the index is x, 1 is y, 2 is z.
    pub fn corners(&self, placement: &Placement, scene: &Scene) -> Option<[Vec3; 8]> {
        let shape = self.shape(&placement.file)?;
        let (low, high) = shape.bounds;
        let tilt = placement.tilt_rotation();
        let base = base(shape.points.iter().map(|&point| tilt * point));
        let transform = placement.transform(base, scene.up.as_dvec3()).ok()?;
        Some(std::array::from_fn(|index| {
            let high_along = glam::BVec3::new(index & 1 != 0, index & 2 != 0, index & 4 != 0);
            let corner = DVec3::select(high_along, high, low);
            (transform.transform_point3(corner) - scene.origin).as_vec3()
        }))
    }
}

/// What the window keeps of an object's file.
struct Outline {
    /// Lowest and highest coordinates.
    bounds: (DVec3, DVec3),
    /// The outermost points along [`DIRECTIONS`] directions: bounds of a large model that is tilted take long to compute.
    points: Vec<DVec3>,
    material: MaterialOverride,
}

const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Number of directions that outermost points are found for; they are about 14° apart.
const DIRECTIONS: u32 = 200;

impl Outline {
    fn new(model: &ObjectModel) -> Self {
        let bounds = model.bounds();
        let spread = (0..DIRECTIONS).map(|index| {
            // A spiral of points with equal areas around them.
            let height = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(DIRECTIONS);
            let (sin, cos) = (f64::from(index) * GOLDEN_ANGLE).sin_cos();
            let radius = (1.0 - height * height).sqrt();
            DVec3::new(radius * cos, height, radius * sin)
        });
        let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
        let outermost = |direction: DVec3| {
            let points = model.corners.iter().flatten().copied();
            points.max_by(|a, b| direction.dot(*a).total_cmp(&direction.dot(*b)))
        };
        Self {
            bounds,
            points: axes.chain(spread).filter_map(outermost).collect(),
            material: model.main_material(),
        }
    }
}

/// Draws the edges of a box.
pub fn draw_box(
    painter: &Painter,
    corners: &[Vec3; 8],
    project: impl Fn(Vec3) -> Option<Pos2>,
    color: Color32,
    width: f32,
) {
    let points = corners.map(project);
    for (from, bit) in (0..8usize).flat_map(|from| [1, 2, 4].map(|bit| (from, bit))) {
        let end = points[from | bit].filter(|_| from & bit == 0);
        if let Some((a, b)) = points[from].zip(end) {
            let shadow = Color32::from_black_alpha(120);
            painter.line_segment([a, b], Stroke::new(width + 1.5, shadow));
            painter.line_segment([a, b], Stroke::new(width, color));
        }
    }
}

/// What tests of inserted objects share.
#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::app::model::tests::scene;

    /// A model of one triangle in `cube.obj`.
    pub fn models(corners: [[f64; 3]; 3]) -> Models {
        let material = MaterialOverride::default().surface().material(None);
        let corners = vec![corners.map(DVec3::from)];
        let model = ObjectModel::from_corners("cube", corners, material).expect("a model");
        let shape = Shape::Read(Outline::new(&model));
        Models([("cube.obj".into(), shape)].into())
    }

    fn cube(size: f64) -> Models {
        models([[0.0; 3], [size, 0.0, size], [0.0, size, 0.0]])
    }

    #[test]
    fn boxes_stand_where_the_object_was_placed() {
        let scene = scene();
        let placement = Placement {
            scale: 2.0,
            ..Placement::new("cube.obj", Some(DVec3::new(0.5, 0.0, -0.2)))
        };
        let corners = cube(0.1).corners(&placement, &scene).expect("known");
        let points = corners.map(|p| p.as_dvec3() + scene.origin);
        let low = points.into_iter().fold(DVec3::INFINITY, DVec3::min);
        let high = points.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max);
        assert!(low.distance(DVec3::new(0.4, 0.0, -0.3)) < 1e-5, "{low}");
        assert!(high.distance(DVec3::new(0.6, 0.2, -0.1)) < 1e-5, "{high}");
    }

    #[test]
    fn only_what_is_larger_than_the_scene_is_scaled() {
        let scene = scene();
        let file = Path::new("cube.obj");
        assert_eq!(cube(1.0).fitting_scale(file, &scene), None);
        let scale = cube(90.0).fitting_scale(file, &scene).expect("too large");
        assert!((scale - 0.01).abs() < 1e-9, "{scale}");
    }
}
