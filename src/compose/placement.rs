//! Placement of an inserted object, and its triangles in scene coordinates.

use crate::compose::object::ObjectModel;
use crate::compose::object::surface::MaterialOverride;
use crate::error::{Error, Result};
use crate::gpu::{Inserted, Tracer};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::scene::bvh::Bvh;
use crate::scene::geometry::Ray;
use crate::transport::lit::LitScene;
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An object inserted into the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// OBJ or GLB file.
    pub file: PathBuf,
    /// Centre of the object's base in the capture's coordinates; `None` if the file's coordinates are the capture's.
    pub at: Option<DVec3>,
    /// Factor on the file's size.
    pub scale: f64,
    /// Rotation about the up axis in degrees, counter-clockwise seen from above.
    pub rotate: f64,
    /// Rotation about the file's x and z axes in degrees, z first, before `rotate`.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tilt: DVec2,
    /// The material of the whole object in place of those of its file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<MaterialOverride>,
    /// Whether the object is left out of all pictures.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub hidden: bool,
}

fn is_zero(tilt: &DVec2) -> bool {
    *tilt == DVec2::ZERO
}

impl Placement {
    /// An object as its file has it, with its base at `at`, or by the file's own coordinates.
    pub fn new(file: impl AsRef<Path>, at: Option<DVec3>) -> Self {
        Self {
            file: file.as_ref().to_owned(),
            at,
            scale: 1.0,
            rotate: 0.0,
            tilt: DVec2::ZERO,
            material: None,
            hidden: false,
        }
    }

    /// The rotation that comes before all others.
    pub fn tilt_rotation(&self) -> DQuat {
        let about_z = DQuat::from_rotation_z(self.tilt.y.to_radians());
        DQuat::from_rotation_x(self.tilt.x.to_radians()) * about_z
    }

    /// Transform from the file's to the capture's coordinates; `base` is the tilted [`ObjectModel::base`], `up` the unit up vector.
    ///
    /// With `at`, the tilted object's base is put there after the file's +y axis was rotated to `up` along the shortest
    /// arc. Without it, only `scale`, `tilt` and `rotate` apply, about the file's origin.
    ///
    /// # Errors
    /// The scale is not positive, or a number is not finite.
    pub fn transform(&self, base: DVec3, up: DVec3) -> Result<DAffine3> {
        if !(self.scale.is_finite() && self.scale > 0.0) {
            let problem = format!("{} is no size", self.scale);
            return Err(Error::usage("--scale", problem, "give a number above 0"));
        }
        let turned = self.rotate.is_finite() && self.tilt.is_finite();
        if !turned || !self.at.is_none_or(DVec3::is_finite) {
            let problem = "a number is not finite";
            let remedy = "give finite numbers";
            return Err(Error::usage("--at, --rotate, --tilt", problem, remedy));
        }
        let turn = DQuat::from_axis_angle(up, self.rotate.to_radians());
        let tilt = self.tilt_rotation();
        let linear = |rotation: DQuat| DMat3::from_quat(rotation) * self.scale;
        Ok(match self.at {
            None => DAffine3::from_mat3(linear(turn * tilt)),
            Some(at) => {
                let upright = DQuat::from_rotation_arc(DVec3::Y, up);
                let offset = at - linear(turn * upright) * base;
                DAffine3::from_mat3_translation(linear(turn * upright * tilt), offset)
            }
        })
    }
}

/// An object's triangles in scene coordinates, with their BVH.
#[derive(Debug)]
pub struct PlacedObject {
    /// The object.
    pub model: Arc<ObjectModel>,
    /// Corners of each triangle.
    pub corners: Vec<[Vec3; 3]>,
    /// Unit geometric normal of each triangle, on its front side.
    pub normals: Vec<Vec3>,
    /// Unit shading normals at the corners; empty where the object has none.
    pub corner_normals: Vec<[Vec3; 3]>,
    /// Middle of the bounding box.
    pub center: Vec3,
    /// Half the bounding box's diagonal.
    pub radius: f32,
    /// BVH over the triangles.
    pub bvh: Bvh,
}

impl PlacedObject {
    /// Places an object in a scene.
    ///
    /// # Errors
    /// The scale is not positive, a number is not finite, or a coordinate is too large for f32.
    pub fn new(model: Arc<ObjectModel>, placement: &Placement, scene: &Scene) -> Result<Self> {
        let up = scene.up.as_dvec3().normalize_or(DVec3::Y);
        let transform = placement.transform(model.base(placement.tilt_rotation()), up)?;
        let rotation = transform.matrix3 * placement.scale.recip();
        let model = match &placement.material {
            Some(material) => Arc::new(model.as_ref().clone().with_material(material)),
            None => model,
        };
        let placed = |p: DVec3| (transform.transform_point3(p) - scene.origin).as_vec3();
        let corners: Vec<[Vec3; 3]> = model.corners.iter().map(|c| c.map(placed)).collect();
        if !corners.iter().flatten().all(|p| p.is_finite()) {
            let problem = "is placed outside the range of coordinates";
            let remedy = "check --at and --scale";
            return Err(Error::file(&placement.file, problem, remedy));
        }
        let turned = |n: DVec3| (rotation * n).normalize_or_zero().as_vec3();
        let normal = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a).normalize_or_zero();
        let normals = model.corners.iter().map(|c| turned(normal(c))).collect();
        let own = model.corner_normals.iter();
        let corner_normals = own.map(|n| n.map(|n| turned(n.as_dvec3()))).collect();
        let positions: Vec<Vec3> = corners.iter().flatten().copied().collect();
        let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = (positions.iter().copied()).fold(Vec3::NEG_INFINITY, Vec3::max);
        let triangles = 0..corners.len() as u32;
        let indices: Vec<_> = triangles.map(|i| [0, 1, 2].map(|k| 3 * i + k)).collect();
        Ok(Self {
            bvh: Bvh::new(&positions, &indices),
            model,
            corners,
            normals,
            corner_normals,
            center: (low + high) * 0.5,
            radius: (high - low).length() * 0.5,
        })
    }

    /// The object's arrays for a graphics card.
    pub fn for_card(&self) -> Inserted<'_> {
        Inserted {
            corners: &self.corners,
            normals: &self.normals,
            corner_normals: &self.corner_normals,
            corner_colors: &self.model.corner_colors,
            material_of: &self.model.material_of,
            materials: &self.model.materials,
        }
    }

    /// Whether a cone around a ray, with a half-angle in radians, may meet the object's bounding sphere.
    pub fn is_near(&self, ray: &Ray, angle: f32) -> bool {
        let to_center = self.center - ray.origin;
        let distance = to_center.cross(ray.direction.normalize_or_zero()).length();
        let behind = to_center.dot(ray.direction) < 0.0 && to_center.length() > self.radius;
        distance <= self.radius + angle * to_center.length() && !behind
    }
}

/// A scene with objects on the renderer's graphics card; `None` if there is none that takes them.
pub fn tracer(
    renderer: &Renderer,
    lit: &LitScene,
    objects: &[Arc<PlacedObject>],
) -> Option<Tracer> {
    let inserted: Vec<Inserted<'_>> = objects.iter().map(|object| object.for_card()).collect();
    renderer.tracer(lit, &inserted)
}
